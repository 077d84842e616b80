"""Selection: the smallest style losses, best first, for any block size; ties go to the earlier clip."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from choreograph.choreography.selection import select_clips
from choreograph.core.errors import ParameterError


def by_hand(music, music_count, clips, clip_count, k, weight):
    loss = np.linalg.norm(music[:, None] - clips[None], axis=2) + weight * np.abs(
        music_count[:, None] - clip_count
    )
    return np.argsort(loss, axis=1, kind="stable")[:, :k]


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 30), st.integers(1, 40), st.sampled_from([0.0, 0.3]))
def test_the_nearest_best_first(seed, n_clips, k, weight):
    rng = np.random.default_rng(seed)
    given_ = (
        rng.normal(size=(5, 8)),
        rng.uniform(0, 9, 5),
        rng.normal(size=(n_clips, 8)),
        rng.uniform(0, 9, n_clips),
    )
    chosen = select_clips(*given_, candidates=k, beat_weight=weight)
    assert np.array_equal(chosen, by_hand(*given_, min(k, n_clips), weight))


def test_seconds_of_a_large_repertoire_are_those_alone():
    """Losses of 40,000 clips are computed for 200 seconds at a time."""
    rng = np.random.default_rng(0)
    music, clips = rng.normal(size=(250, 8)), rng.normal(size=(40_000, 8))
    counts = np.zeros(250), np.zeros(40_000)
    chosen = select_clips(music, counts[0], clips, counts[1], candidates=6, beat_weight=0.0)
    for second in (0, 199, 200, 249):
        alone = select_clips(music[[second]], counts[0][:1], clips, counts[1], candidates=6, beat_weight=0.0)
        assert np.array_equal(chosen[[second]], alone)


def test_ties_go_to_the_earlier_clip():
    chosen = select_clips(
        np.zeros((2, 4), np.float32), np.zeros(2), np.zeros((50, 4), np.float32), np.zeros(50), candidates=7,
        beat_weight=1.0,
    )  # fmt: skip
    assert chosen.tolist() == [list(range(7))] * 2


def test_beat_counts_decide_between_equal_styles():
    chosen = select_clips(
        np.zeros((1, 4)),
        np.array([8.0]),
        np.zeros((3, 4)),
        np.array([4.0, 8.0, 7.0]),
        candidates=3,
        beat_weight=0.1,
    )
    assert chosen.tolist() == [[1, 2, 0]]


@pytest.mark.parametrize(("n_clips", "k"), [(0, 3), (3, 0), (3, -1)])
def test_no_clips_or_no_candidates_are_refused(n_clips, k):
    with pytest.raises(ParameterError):
        select_clips(
            np.zeros((1, 4)),
            np.zeros(1),
            np.zeros((n_clips, 4)),
            np.zeros(n_clips),
            candidates=k,
            beat_weight=0.0,
        )


def test_penalised_clips_come_last():
    chosen = select_clips(
        np.zeros((2, 4)), np.zeros(2), np.zeros((6, 4)), np.zeros(6), candidates=2, beat_weight=0.0,
        penalty=lambda second: (np.arange(6) < 4 + second).astype(float),
    )  # fmt: skip
    assert chosen.tolist() == [[4, 5], [5, 0]]
