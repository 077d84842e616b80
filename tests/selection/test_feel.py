"""Energy and density of steps of clips against those of a song."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from choreograph.selection import energy_mismatch, steps_mismatch

RANKS = np.linspace(0.0, 1.0, 11)


def test_loud_parts_ask_for_large_clips_and_soft_parts_for_small_ones():
    energy = np.repeat([1.0, 0.0], 8)
    loud, soft = (energy_mismatch(energy, RANKS, second) for second in (0, 12))
    assert (np.diff(loud) < 0).all() and loud[-1] == 0.0
    assert (np.diff(soft) > 0).all() and soft[0] == 0.0
    np.testing.assert_allclose(loud, soft[::-1])
    assert not energy_mismatch(np.full(8, 0.7), RANKS, 2).any()  # a song of one loudness


@given(st.floats(0, 1))
def test_the_clip_of_the_same_rank_is_nearest_in_steps(density):
    away = steps_mismatch(np.array([density]), RANKS, 0)
    assert abs(RANKS[np.argmin(away)] - density) <= 0.05 + 1e-9
