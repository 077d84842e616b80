"""The analytic tempo-density of takes and songs: bumps on beats."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from choreograph.music.song_features import BUMP_S, bumps, motion_density, music_density

beat_lists = st.lists(st.floats(0.0, 30.0), max_size=20).map(lambda b: np.unique(np.array(b)))


@settings(max_examples=60, deadline=None)
@given(beat_lists)
def test_there_is_a_bump_on_every_beat_and_nowhere_else(beats):
    times = np.arange(0, 30, 0.05)
    curve = bumps(times, beats)
    assert curve.dtype == np.float32
    if len(beats) == 0:
        assert not curve.any()
        return
    gap = np.abs(times[:, None] - beats).min(axis=1)
    assert np.allclose(curve, np.exp(-0.5 * (gap / BUMP_S) ** 2), atol=1e-6)
    assert np.allclose(bumps(beats, beats), 1.0)


@settings(max_examples=30, deadline=None)
@given(beat_lists, st.integers(1, 8))
def test_the_density_of_a_second_is_part_of_the_songs(beats, n_seconds):
    curves = music_density(n_seconds, beats)
    whole = motion_density(20 * (n_seconds + 3), beats)
    assert curves.shape == (n_seconds, 80)
    for second in range(n_seconds):
        assert np.allclose(curves[second], whole[20 * second : 20 * second + 80], atol=1e-6)


def test_a_shift_of_beats_shifts_the_curve():
    beats = np.array([1.0, 1.5, 2.25])
    assert np.allclose(motion_density(100, beats + 1.0)[20:], motion_density(80, beats), atol=1e-6)
    assert motion_density(60, beats)[20] == pytest.approx(1.0)
