"""Beats are followed while a song plays: those of a planted song, after a while, and none in silence."""

from __future__ import annotations

import numpy as np
import pytest
import soxr

from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.live.online_beats import OnlineBeats
from choreograph.music.mel import log_mel
from choreograph.music.synthesis.song import render_song
from choreograph.music.synthesis.sounds import RATE_HZ


@pytest.fixture(scope="module")
def song():
    """A song of 18 s at 120 beats a minute, its samples and its beats."""
    made = render_song("house", bpm=120.0, duration_s=18.0, seed=77)
    return soxr.resample(made.samples.mean(axis=1), RATE_HZ, SAMPLE_RATE_HZ), made.beat_times_s


def blocks(samples, block_s=0.1):
    size = round(block_s * SAMPLE_RATE_HZ)
    return (samples[start : start + size] for start in range(0, len(samples), size))


def test_beats_and_count_1_of_a_song_are_predicted(song):
    samples, beats_s = song
    tracker, errors_s, ones = OnlineBeats(), [], []
    for block in blocks(samples):
        tracker.feed(block)
        if tracker.clock is not None and 8.0 < tracker.heard_s < 13.5:
            ahead_s = tracker.heard_s + 2.0
            beat = int(np.ceil(tracker.clock.beat_at(ahead_s)))
            time_s = float(tracker.clock.time_at(beat))
            nearest = int(np.abs(beats_s - time_s).argmin())
            errors_s.append(time_s - beats_s[nearest])
            ones.append((tracker.clock.number_of(beat) == 1) == (nearest % 4 == 0))
    assert len(errors_s) > 50 and np.abs(errors_s).max() < 0.05
    assert np.mean(ones) > 0.9
    assert tracker.clock.generation == 1  # found once, and then followed


def test_frames_are_those_of_the_whole_song(song):
    samples = song[0][: 6 * SAMPLE_RATE_HZ]
    tracker = OnlineBeats()
    for block in blocks(samples, 0.037):
        tracker.feed(block)
    whole = log_mel(samples)
    assert 3 <= len(whole) - len(tracker._mel) + 1 <= 5  # those whose window is complete
    np.testing.assert_allclose(tracker._mel, whole[: len(tracker._mel)], atol=1e-4)


def test_a_clock_begins_after_some_seconds_of_music_and_ends_in_silence(song):
    samples, _ = song
    tracker = OnlineBeats()
    for block in blocks(np.zeros(2 * SAMPLE_RATE_HZ, np.float32)):
        tracker.feed(block)
    assert tracker.clock is None
    for block in blocks(samples[: 7 * SAMPLE_RATE_HZ]):
        tracker.feed(block)
    assert tracker.clock is not None
    for block in blocks(np.zeros(4 * SAMPLE_RATE_HZ, np.float32)):
        tracker.feed(block)
    assert tracker.clock is None


def test_a_stream_is_forgotten_but_for_a_window():
    tracker = OnlineBeats(window_s=5.0)
    for block in blocks(np.zeros(12 * SAMPLE_RATE_HZ, np.float32), 1.0):
        tracker.feed(block)
    from_s, samples = tracker.recent
    assert len(samples) < 5.2 * SAMPLE_RATE_HZ
    assert from_s + len(samples) / SAMPLE_RATE_HZ == pytest.approx(12.0)


def test_noise_without_beats_raises_nothing():
    rng = np.random.default_rng(0)
    tracker = OnlineBeats()
    for block in blocks(0.1 * rng.standard_normal(8 * SAMPLE_RATE_HZ).astype(np.float32), 0.5):
        tracker.feed(block)
    assert tracker.heard_s == pytest.approx(8.0)
