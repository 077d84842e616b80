"""Beats of synthetic songs whose tempo is known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from choreograph.core.errors import ParameterError
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.music.beats import fill_missing_beats, get_beat_tracker
from choreograph.music.mel import log_mel
from choreograph.music.song import Song

pytestmark = pytest.mark.slow


def clicks(bpm: float, duration_s: float = 30.0, loud_every: int = 1) -> tuple[np.ndarray, np.ndarray]:
    times_s = np.arange(0.5, duration_s - 0.1, 60 / bpm)
    samples = np.random.default_rng(0).normal(0, 1e-3, round(duration_s * SAMPLE_RATE_HZ)).astype(np.float32)
    n = np.arange(2000) / SAMPLE_RATE_HZ
    click = np.exp(-60 * n) * np.sin(2 * np.pi * 1000 * n)
    for i, time_s in enumerate(times_s):
        start = round(time_s * SAMPLE_RATE_HZ)
        samples[start : start + 2000] += (1.0 if i % loud_every == 0 else 0.03) * click[
            : len(samples) - start
        ]
    return samples, times_s


def tracked(samples: np.ndarray, tracker: str) -> np.ndarray:
    return get_beat_tracker(tracker).beats(Song(samples, "song"), log_mel(samples))


@pytest.mark.parametrize("tracker", ["tempo-path", "librosa"])
@pytest.mark.parametrize("bpm", [60, 72, 84, 100, 120, 128, 140])
def test_beats_of_clicks_are_found(bpm, tracker):
    samples, times_s = clicks(bpm, 40.0)
    beats = tracked(samples, tracker)
    off_s = np.abs(beats[:, None] - times_s).min(axis=0)
    assert np.mean(off_s < 0.05) > 0.9
    assert len(beats) == pytest.approx(len(times_s), abs=3)


@pytest.mark.parametrize("tracker", ["tempo-path", "librosa"])
def test_beats_go_on_through_a_pause(tracker):
    samples, _times_s = clicks(100, 40.0)
    samples[15 * SAMPLE_RATE_HZ : 22 * SAMPLE_RATE_HZ] *= 1e-3
    beats = tracked(samples, tracker)
    assert np.diff(beats).max() < 0.9
    assert beats[0] < 0.7
    assert beats[-1] > 39.0


@pytest.mark.parametrize("tracker", ["tempo-path", "librosa"])
@pytest.mark.parametrize("duration_s", [0.2, 3.0, 20.0])
def test_silence_has_no_beats(duration_s, tracker):
    samples = np.zeros(round(duration_s * SAMPLE_RATE_HZ), np.float32)
    assert tracked(samples, tracker).shape == (0,)


@given(st.floats(0.3, 1.2), st.sets(st.integers(4, 25), max_size=3))
@settings(deadline=None)
def test_missing_beats_are_filled_in(period_s, missing):
    beats = 0.2 + period_s * np.arange(30)
    kept = np.array([b for i, b in enumerate(beats) if i not in missing])
    whole = fill_missing_beats(kept, beats[-1] + period_s / 2)
    assert (np.diff(whole) > 0).all()
    if not any({i, i + 1} <= missing for i in missing):
        np.testing.assert_allclose(whole, beats, atol=1e-6)


@given(st.floats(0.3, 1.2), st.integers(0, 40))
@settings(deadline=None)
def test_no_beat_is_filled_in_before_the_song(period_s, first):
    """Not even by the rounding error of a first beat that lies a whole number of periods into it."""
    beats = period_s * (first + np.arange(10.0))
    whole = fill_missing_beats(beats, beats[-1] + period_s / 2)
    assert whole[0] >= 0 and (np.diff(whole) > 0).all()


def test_unknown_and_absent_trackers_are_refused():
    with pytest.raises(ParameterError, match="librosa"):
        get_beat_tracker("madmom")
    try:
        import beat_this  # noqa: F401
    except ImportError:
        with pytest.raises(ParameterError, match="extra"):
            get_beat_tracker("beat-this")
