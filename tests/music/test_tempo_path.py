"""The tempo path on synthetic drum loops with known beats, and against librosa where the tempo is steady."""

from __future__ import annotations

import numpy as np
import pytest
import soxr
from hypothesis import given, settings
from hypothesis import strategies as st

from choreograph.core.errors import ParameterError
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.evaluation.metrics.beat import f_score
from choreograph.music.beats import best_beat_sequence, librosa_beats, onset_strength, tempo_path_beats
from choreograph.music.mel import log_mel
from content.songs.known_songs import BENCHMARK_SONGS

pytestmark = pytest.mark.slow


def drum_loop(beat_times_s: np.ndarray, *, swing: float = 0.0, off_beat_hat: float = 0.5) -> np.ndarray:
    """Kick and snare on the beats, a hat on every eighth; `swing` 1 puts the off-beats on the triplet."""
    rng = np.random.default_rng(0)
    n = np.arange(4000) / SAMPLE_RATE_HZ
    kick = np.sin(2 * np.pi * 55 * n) * np.exp(-12 * n)
    snare = 0.4 * rng.normal(size=4000) * np.exp(-30 * n)
    hat = 0.3 * np.diff(rng.normal(size=4001)) * np.exp(-80 * n)
    samples = np.zeros(round((beat_times_s[-1] + 1.0) * SAMPLE_RATE_HZ))
    for i, time_s in enumerate(beat_times_s):
        period_s = np.diff(beat_times_s)[min(i, len(beat_times_s) - 2)]
        sounds = [(time_s, snare if i % 2 else kick), (time_s, 0.5 * hat)]
        sounds.append((time_s + period_s * (0.5 + swing / 6), off_beat_hat * hat))
        for at_s, sound in sounds:
            start = round(at_s * SAMPLE_RATE_HZ)
            room = samples[start : start + 4000]
            room += sound[: len(room)]
    return (0.8 * samples / np.abs(samples).max()).astype(np.float32)


def ramp(first_bpm: float, last_bpm: float, duration_s: float = 50.0) -> np.ndarray:
    times = [0.3]
    while times[-1] < duration_s:
        times.append(times[-1] + 60 / (first_bpm + (last_bpm - first_bpm) * times[-1] / duration_s))
    return np.array(times)


@pytest.mark.parametrize("swing", [0.0, 1.0])
@pytest.mark.parametrize(("first", "last"), [(90, 140), (140, 90)])
def test_a_ramp_is_followed(first, last, swing):
    times_s = ramp(first, last)
    mel = log_mel(drum_loop(times_s, swing=swing))
    assert f_score(tempo_path_beats(mel), times_s) > 0.95
    assert f_score(librosa_beats(mel, len(mel) / 60), times_s) < 0.92  # a tracker with one tempo loses it


@pytest.mark.parametrize(("first", "second"), [(84, 124), (124, 84), (90, 175), (132, 100)])
def test_where_another_tempo_begins_it_is_found_at_once(first, second):
    """Two loops end to end: neither is played at two thirds or four thirds of its tempo for the other's."""
    half_s = 18.0
    starts = np.arange(0.3, half_s, 60 / first)
    times_s = np.r_[starts, np.arange(starts[-1] + 60 / first, 2 * half_s, 60 / second)]
    beats = tempo_path_beats(log_mel(drum_loop(times_s)))
    for bpm, part in ((first, beats[beats < half_s - 1]), (second, beats[beats > half_s + 1])):
        octaves = np.log2(60 / np.median(np.diff(part)) / bpm)  # half or double tempo is settled elsewhere
        assert abs(octaves - round(octaves)) < 0.03
    off_s = np.abs(times_s[:, None] - beats).min(axis=1)
    heard = np.abs(times_s - half_s) > 1.0
    at_half_tempo = np.sum(heard & (times_s > half_s)) / np.sum(heard) / 2 if second > 150 else 0.0
    assert np.mean(off_s[heard] < 0.05) > 0.95 - at_half_tempo


@pytest.mark.parametrize("bpm", [80, 96, 120, 138])
def test_steady_beats_agree_with_librosa_and_the_truth(bpm):
    times_s = 0.3 + np.arange(0, 40, 60 / bpm)
    mel = log_mel(drum_loop(times_s))
    beats = tempo_path_beats(mel)
    assert f_score(beats, times_s) > 0.95
    assert f_score(beats, librosa_beats(mel, len(mel) / 60)) > 0.9
    nearest = times_s[np.abs(beats[:, None] - times_s).argmin(axis=1)]
    assert abs(np.median(beats - nearest)) < 0.02


@pytest.mark.parametrize("song", [BENCHMARK_SONGS[i] for i in (0, 4, 5, 8, 10)], ids=lambda song: song.name)
def test_beats_of_mixed_songs_are_on_time(song):
    """In a mix onsets are found later than alone, and 70 ms would be a tolerance for dancers."""
    rendered = song.render()
    mono = soxr.resample(rendered.samples.mean(axis=1), 44100, SAMPLE_RATE_HZ)
    beats, true = tempo_path_beats(log_mel(mono)), rendered.beat_times_s
    assert f_score(beats[(beats > true[0] - 0.07) & (beats < true[-1] + 0.07)], true) > 0.95
    nearest = np.abs(beats - true[:, None]).argmin(axis=1)
    assert abs(np.median(beats[nearest] - true)) < 0.008


def test_the_kick_decides_against_a_loud_off_beat():
    times_s = 0.3 + np.arange(0, 40, 0.5)
    kicks_only = drum_loop(np.repeat(times_s, 1), off_beat_hat=1.2)
    assert f_score(tempo_path_beats(log_mel(kicks_only)), times_s) > 0.95


@given(st.integers(20, 60), st.integers(0, 19), st.integers(300, 900))
@settings(deadline=None, max_examples=25)
def test_a_pulse_train_is_found_completely(period, phase, n_frames):
    strength = np.zeros(n_frames)
    strength[phase::period] = 1.0
    gain = np.zeros((1, 66))
    gain[0, period - 15] = 0.5
    beats = best_beat_sequence(strength, gain, n_frames, 15, 200.0, 100.0)
    inner = beats[(beats > 0) & (beats < n_frames - period)]
    assert set(inner) <= set(range(phase, n_frames, period))
    assert (np.diff(beats) > 0).all()


def test_onset_strength_does_not_depend_on_loudness():
    mel = log_mel(drum_loop(0.3 + np.arange(0, 20, 0.5)))
    quieter = mel - 3.0
    np.testing.assert_allclose(onset_strength(mel), onset_strength(quieter), rtol=1e-3, atol=1e-3)


def test_another_shape_is_refused():
    with pytest.raises(ParameterError, match="log-mel"):
        tempo_path_beats(np.zeros((10, 4)))


def test_a_new_tempo_has_to_be_worth_its_penalty():
    """A pulse every 30 frames, then one every 41, each scored 0.5 a frame more at its own period."""
    strength = np.zeros(1200)
    strength[np.r_[0:600:30, 600:1200:41]] = 1.0
    gain = np.zeros((2, 66))
    gain[0, 15], gain[1, 26] = 0.5, 0.5
    for penalty, found in ((100.0, True), (1e6, False)):
        beats = best_beat_sequence(strength, gain, 600, 15, 1000.0, penalty)
        late = beats[(beats > 650) & (beats < 1150)]
        assert np.isin(late, np.arange(600, 1200, 41)).all() == found
