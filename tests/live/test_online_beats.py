"""The beats of music that is still playing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import soxr

from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.live.online_beats import CORRECTION_BEATS, BeatClock, OnlineBeats
from choreograph.music.mel import log_mel
from content.songs.synthesis.song import render_song
from content.songs.synthesis.sounds import RATE_HZ

STEADY = replace(BeatClock.steady(10.0, 4.25, 0.5, 1), metre=4, first_number=2)


@pytest.mark.parametrize("error", [-0.3, 0.0, 0.3])
@pytest.mark.parametrize("period_s", [0.45, 0.5, 0.56])
def test_positions_are_continuous_and_times_are_their_inverse(error, period_s):
    clock = STEADY.followed(11.3, error, period_s)
    times_s = np.linspace(5.0, 30.0, 2501)
    beats = clock.beat_at(times_s)
    assert (np.diff(beats) > 0).all()
    assert np.diff(beats).max() < 1.3 * 0.01 / 0.45
    np.testing.assert_allclose(clock.time_at(beats), times_s, atol=1e-9)
    assert clock.beat_at(11.3) == pytest.approx(STEADY.beat_at(11.3))


def test_an_error_is_corrected_after_two_beats_and_the_tempo_is_the_new_one():
    clock = STEADY.followed(11.0, 0.2, 0.4)
    later_s = 11.0 + CORRECTION_BEATS * 0.4
    assert clock.beat_at(later_s) == pytest.approx(STEADY.beat_at(11.0) + CORRECTION_BEATS + 0.2)
    assert clock.beat_at(later_s + 4.0) - clock.beat_at(later_s) == pytest.approx(10.0)
    assert (clock.metre, clock.first_number, clock.generation) == (4, 2, 1)


def test_counts_are_the_beats_between_two_times_with_their_numbers():
    counts = STEADY.counts(10.1, 12.4)  # beats 5 to 9, from 10.375 s on
    np.testing.assert_allclose(counts.times_s, 0.275 + 0.5 * np.arange(5))
    assert counts.numbers.tolist() == [4, 1, 2, 3, 4] and counts.metre == 4
    assert len(STEADY.counts(10.4, 10.6)) == 0
    without = BeatClock.steady(0.0, 0.0, 0.5, 0).counts(0.0, 2.0)
    assert without.metre == 0 and not without.numbers.any()


def test_beats_before_the_stream_have_numbers_as_well():
    assert STEADY.number_of(np.array([-3, -2, -1, 0])).tolist() == [4, 1, 2, 3]


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
