"""A take's music in step with it: beats on counts, bars on bars, however the pair was recorded."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic_rollouts import synthetic_motion

from choreograph.core.counts import NO_COUNTS, make_counts, numbers_in_bar
from choreograph.library.songs import AnalysedSong, beats_ahead, music_of_take
from choreograph.motion.motion import Credits, Take
from choreograph.music.frame_rhythm import FRAME_RHYTHM_FPS, FRAME_RHYTHM_NAMES
from choreograph.music.mel import log_mel
from choreograph.music.song import load_song
from choreograph.music.synthesis.song import render_song, write_song

BEAT, SONG_BPM = FRAME_RHYTHM_NAMES.index("beat"), 120.0


@pytest.fixture(scope="module")
def analysed(tmp_path_factory):
    """A song of 120 beats a minute and its true counts."""
    truth = render_song("house", seed=5, duration_s=30.0, bpm=SONG_BPM)
    path = tmp_path_factory.mktemp("song") / "song.wav"
    write_song(path, truth)
    song = load_song(path)
    counts = make_counts(truth.beat_times_s, numbers_in_bar(len(truth.beat_times_s), 4), 4)
    return AnalysedSong(song.duration_s, log_mel(song.samples), counts, song)


def take_of(first_s, period_s, *, n=20, first_number=1, song_start_s=0.0):
    times_s = first_s + period_s * np.arange(n)
    numbers = (np.arange(n) + first_number - 1) % 4 + 1
    motion = synthetic_motion(np.zeros(30, int))  # 15 s
    counts = make_counts(times_s[times_s < 15], numbers[times_s < 15], 4)
    return Take("take", motion, Credits(), song_start_s=song_start_s, counts=counts)


@pytest.mark.parametrize(("first_s", "period_s"), [(0.2, 0.55), (0.4, 0.47), (0.75, 0.5)])
def test_beats_are_on_counts(analysed, first_s, period_s):
    take = take_of(first_s, period_s)
    music = music_of_take(take, analysed, take.counts.times_s)
    beats = np.flatnonzero(music.rhythm[:, BEAT]) / FRAME_RHYTHM_FPS
    assert beats == pytest.approx(take.counts.times_s, abs=0.5 / FRAME_RHYTHM_FPS + 1e-6)
    assert len(music.spectral) == len(take.counts) - 1
    # What sounds is on the counts as well: onsets are strong there, and weak between.
    times_s = np.arange(len(music.rhythm)) / FRAME_RHYTHM_FPS
    phase = (times_s - first_s) / period_s % 1.0
    inside = (times_s > first_s) & (times_s < take.counts.times_s[-1])
    on, between = (np.abs(phase - at) < 0.1 for at in (np.round(phase), 0.3))
    onsets = music.rhythm[:, 1]
    assert onsets[inside & on].mean() > 2 * onsets[inside & between].mean()


def test_count_1_is_on_a_downbeat(analysed):
    for first_number in (1, 2, 3, 4):
        take = take_of(0.3, 0.5, first_number=first_number, song_start_s=2.0)
        ahead = beats_ahead(take.counts.times_s, take.counts, analysed.counts, take.song_start_s)
        assert analysed.counts.numbers[ahead] == first_number
        recorded = (2.0 + 0.3 - analysed.counts.times_s[0]) / 0.5
        assert abs(ahead - recorded) <= 2  # and the pair is moved no further than that needs


def test_a_pair_in_step_stays_as_it_was_recorded(analysed):
    beats_s = analysed.counts.times_s
    start_s = round((float(beats_s[4]) - 0.2) * FRAME_RHYTHM_FPS) / FRAME_RHYTHM_FPS  # rhythm is in frames
    inside = (beats_s >= start_s) & (beats_s < start_s + 15)
    counts = make_counts(beats_s[inside] - start_s, analysed.counts.numbers[inside], 4)
    take = replace(take_of(0.2, 0.5), counts=counts, song_start_s=start_s)
    bounds_s = counts.times_s
    in_step = music_of_take(take, analysed, bounds_s)
    recorded = music_of_take(replace(take, counts=NO_COUNTS), analysed, bounds_s)
    frames = slice(0, 14 * FRAME_RHYTHM_FPS)
    assert np.corrcoef(in_step.rhythm[frames, 1], recorded.rhythm[frames, 1])[0, 1] > 0.9
    assert np.allclose(in_step.spectral, recorded.spectral, rtol=0.2, atol=0.5)


def test_without_counts_the_music_is_as_recorded_and_has_no_phase(analysed):
    take = replace(take_of(0.2, 0.5), counts=NO_COUNTS)
    music = music_of_take(take, analysed, np.arange(0.0, 14.0, 0.5))
    assert not music.count_phase.any()
    beats = np.flatnonzero(music.rhythm[:, BEAT]) / FRAME_RHYTHM_FPS
    assert beats[:5] == pytest.approx(analysed.counts.times_s[:5], abs=0.5 / FRAME_RHYTHM_FPS + 1e-6)
