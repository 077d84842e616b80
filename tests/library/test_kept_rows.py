"""Blocks of rows that are kept: the rows of the array, with room for few blocks, none read twice in vain."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from choreograph.library import rows as rows_module
from choreograph.library.derived import root_frame_rows
from choreograph.library.rows import KeptBlocks
from choreograph.motion.body import BODY_JOINTS, to_root_frame


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 200), st.integers(1, 40), st.integers(1, 6), st.integers(0, 1000))
def test_rows_are_those_of_the_array_with_room_for_any_number_of_blocks(n, block_rows, n_slots, seed):
    rng = np.random.default_rng(seed)
    array = rng.normal(size=(n, 3)).astype(np.float32)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rows_module, "MOST_BYTES", n_slots * block_rows * 12)
        kept = KeptBlocks(array.shape, "f4", block_rows, None)
    reads: list[int] = []

    def read(blocks):
        reads.extend(blocks)
        return (array[b * block_rows : (b + 1) * block_rows] for b in blocks)

    for _ in range(4):
        wanted = rng.integers(0, n, rng.integers(0, 30)).reshape(-1, 1)
        np.testing.assert_array_equal(kept.rows(wanted, read), array[wanted])
    if n <= n_slots * block_rows:
        assert len(reads) == len(set(reads))


def test_a_block_that_cannot_be_read_is_not_kept():
    kept = KeptBlocks((10, 1), "f4", 5, None)

    def damaged(blocks):
        raise OSError("damaged")

    with pytest.raises(OSError, match="damaged"):
        kept.rows(np.array([7]), damaged)
    array = np.arange(10, dtype=np.float32)[:, None]
    assert kept.rows(np.array([7]), lambda blocks: [array[5 * b : 5 * b + 5] for b in blocks]) == 7.0


def test_velocities_end_with_their_take():
    """Two takes that move at 1 and at 2 m/s. No difference is taken across their border."""
    times_s = np.arange(8) / 20
    body = np.random.default_rng(0).normal(size=(len(BODY_JOINTS), 3))
    pos = np.concatenate([body + v * times_s[:, None, None] * np.array([0.0, 1.0, 0.0]) for v in (1.0, 2.0)])
    made = root_frame_rows(lambda rows: pos[rows], np.arange(16), np.array([[0, 8], [8, 16]]))
    np.testing.assert_allclose(made[:, 0], to_root_frame(pos), atol=1e-6)
    np.testing.assert_allclose(made[:8, 1, :, 1], 1.0, atol=1e-5)
    np.testing.assert_allclose(made[8:, 1, :, 1], 2.0, atol=1e-5)
