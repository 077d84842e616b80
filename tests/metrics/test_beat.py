"""Beat metrics: the perfect, the empty and the malformed; answers known by hand; shifts do not matter."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from choreograph.errors import ParameterError
from choreograph.metrics.beat import (
    aligned_share,
    beat_ratio,
    chance_f_score,
    evaluate,
    f_score,
    squared_distance,
    validate,
)

NONE = np.zeros(0)


def beat_lists(max_size: int = 15):
    gaps = st.lists(st.floats(0.02, 3.0), max_size=max_size)
    return gaps.map(lambda g: np.cumsum(np.array(g)))


def test_perfect():
    beats = np.arange(0.3, 20, 0.5)
    assert evaluate(beats, beats) == {
        "f_score": 1.0,
        "motion_to_music": 0.0,
        "music_to_motion": 0.0,
        "aligned_share": 1.0,
        "beat_ratio": 1.0,
    }


def test_empty():
    beats = np.array([1.0, 2.0])
    assert f_score(NONE, beats) == f_score(beats, NONE) == f_score(NONE, NONE) == 0.0
    assert all(np.isnan(squared_distance(a, b)) for a, b in ((NONE, beats), (beats, NONE)))
    assert np.isnan(aligned_share(NONE, beats)) and aligned_share(beats, NONE) == 0.0
    assert np.isnan(beat_ratio(beats, NONE)) and beat_ratio(NONE, beats) == 0.0


@pytest.mark.parametrize(
    "beats",
    [np.array([1.0, np.nan]), np.array([2.0, 1.0]), np.array([1.0, 1.0]), np.zeros((2, 2)), np.float64(1.0)],
)
def test_malformed(beats):
    good = np.array([0.5, 1.5])
    for pair in ((beats, good), (good, beats)):
        with pytest.raises(ParameterError) as said:
            evaluate(*pair)
        assert "\n" not in str(said.value)
    validate(good, NONE)


def test_known_by_hand():
    music = np.array([1.0, 2.0, 3.0, 4.0])
    # 0.05 s late, 0.1 s early, one extra beat halfway: 1 hit of 3 and 4.
    motion = np.array([1.05, 1.9, 2.5])
    assert f_score(motion, music) == pytest.approx(2 * 1 / 7)
    assert squared_distance(motion, music) == pytest.approx((3**2 + 6**2 + 30**2) / 3)
    assert squared_distance(music, motion) == pytest.approx((3**2 + 6**2 + 30**2 + 90**2) / 4)


def test_aligned_within_a_thirtieth_of_a_second():
    music = np.array([1.0, 2.0, 3.0, 4.0])
    motion = np.array([1.03, 1.9, 2.5, 2.97, 3.04])
    assert aligned_share(motion, music) == pytest.approx(2 / 5)
    assert beat_ratio(motion, music) == pytest.approx(5 / 4)


def test_each_beat_is_matched_once():
    assert f_score(np.array([0.97, 1.0, 1.03]), np.array([1.0])) == pytest.approx(2 / 4)


@settings(max_examples=100, deadline=None)
@given(beat_lists(), beat_lists(), st.floats(-5, 5))
def test_laws(motion, music, shift):
    score = f_score(motion, music)
    assert 0 <= score <= 1
    assert score == f_score(music, motion)
    wide = f_score(motion, music, window_s=0.3)
    assert wide >= score
    moved = evaluate(motion + shift, music + shift)
    assert moved["motion_to_music"] == pytest.approx(squared_distance(motion, music), nan_ok=True, abs=1e-6)


@settings(max_examples=60, deadline=None)
@given(beat_lists(6), beat_lists(6), st.floats(0.05, 1.0))
def test_the_matching_is_the_largest(motion, music, window_s):
    def largest(i: int, j: int) -> int:
        if i == len(motion) or j == len(music):
            return 0
        take = 1 + largest(i + 1, j + 1) if abs(motion[i] - music[j]) <= window_s else 0
        return max(take, largest(i + 1, j), largest(i, j + 1))

    total = len(motion) + len(music)
    expected = 2 * largest(0, 0) / total if total else 0.0
    assert f_score(motion, music, window_s=window_s) == pytest.approx(expected)


def test_chance_is_the_share_of_time_that_windows_cover():
    rng = np.random.default_rng(0)
    music = np.arange(0.25, 60, 0.5)
    motion = np.sort(rng.uniform(0, 60, 120))
    chance = chance_f_score(motion, music, duration_s=60.0, rng=np.random.default_rng(1))
    assert chance == pytest.approx(0.14 / 0.5, abs=0.06)
    assert chance == chance_f_score(motion, music, duration_s=60.0, rng=np.random.default_rng(1))
    assert chance < 0.5 * f_score(music, music)
