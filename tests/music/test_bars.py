"""Bars of click tracks with planted accents, of synthetic songs, of a splice, and of what has none."""

from __future__ import annotations

import librosa
import numpy as np
import pytest
import soxr
from hypothesis import given, settings
from hypothesis import strategies as st

from choreograph.core.errors import ParameterError
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.evaluation.metrics.beat import f_score
from choreograph.music import bars
from choreograph.music.bars import ACCENT_NAMES, REPEAT_NAMES, beat_evidence, best_bars, track_bars
from choreograph.music.beats import tempo_path_beats
from choreograph.music.mel import log_mel
from content.songs.known_songs import BENCHMARK_SONGS
from content.songs.synthesis.song import render_song

N = np.arange(5000) / SAMPLE_RATE_HZ
KICK = np.sin(2 * np.pi * 55 * N) * np.exp(-10 * N)
CLICK = 0.3 * np.sin(2 * np.pi * 2500 * N) * np.exp(-60 * N)


def bars_of_clicks(
    metre: int, *, first: int = 1, n_beats: int = 48, bpm: float = 110.0, second: float = 0.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Samples, beats and their numbers: a kick and a new chord on every 1, clicks on all beats.

    There is a kick of strength `second` in the middle of the bar.
    """
    beats_s = 0.4 + np.arange(n_beats) * 60 / bpm
    numbers = (np.arange(n_beats) + first - 1) % metre + 1
    samples = np.zeros(round((beats_s[-1] + 1) * SAMPLE_RATE_HZ))
    bar = np.cumsum(numbers == 1)
    for time_s, number, index in zip(beats_s, numbers, bar, strict=True):
        start = round(time_s * SAMPLE_RATE_HZ)
        pitch_hz = 220 * 2 ** ((0, 5, 7, 3)[index % 4] / 12)
        tone = 0.2 * np.sin(
            2 * np.pi * pitch_hz * np.arange(round(60 / bpm * SAMPLE_RATE_HZ)) / SAMPLE_RATE_HZ
        )
        strength = {1: 1.0, metre // 2 + 1: second}.get(number, 0.0)
        for sound in (tone, CLICK, strength * KICK):
            room = samples[start : start + len(sound)]
            room += sound[: len(room)]
    return samples.astype(np.float32), beats_s, numbers


def tracked(samples: np.ndarray, beats_s: np.ndarray):
    return track_bars(samples, log_mel(samples), beats_s)


@pytest.mark.slow
@given(st.sampled_from([3, 4, 5, 7]), st.integers(0, 6), st.floats(80, 160))
@settings(max_examples=16)
def test_planted_bars_are_found(metre, first, bpm):
    samples, beats_s, numbers = bars_of_clicks(metre, first=first % metre + 1, bpm=bpm)
    counts = tracked(samples, beats_s)
    assert counts.metre == metre and counts.source == "music"
    assert counts.numbers.tolist() == numbers.tolist()
    assert counts.times_s.tolist() == beats_s.tolist()
    assert counts.confidence > 0.8


@given(st.floats(-30, 0), st.floats(0.05, 3.0))
@settings(max_examples=8)
def test_bars_depend_neither_on_gain_nor_on_silence_before(gain_db, silence_s):
    samples, beats_s, numbers = bars_of_clicks(3, first=2)
    silence = np.zeros(round(silence_s * SAMPLE_RATE_HZ))
    later = np.concatenate([silence, 10 ** (gain_db / 20) * samples])
    counts = tracked(later, beats_s + len(silence) / SAMPLE_RATE_HZ)
    assert counts.metre == 3 and counts.numbers.tolist() == numbers.tolist()


def test_a_dropped_beat_makes_one_irregular_bar():
    samples, beats_s, numbers = bars_of_clicks(4, n_beats=64)
    kept = np.arange(64) != 30
    counts = tracked(samples, beats_s[kept])
    assert (counts.numbers == numbers[kept]).mean() > 0.95
    steps = (np.diff(counts.numbers) % 4 != 1).sum()
    assert steps == 1


def test_six_fast_beats_are_a_bar_and_six_slow_ones_are_two():
    """As in 6/8, where beats are eighths, and in a waltz whose chords last two bars."""
    for bpm, metre, downbeats in ((180.0, 6, slice(None, None, 6)), (100.0, 3, slice(None, None, 3))):
        samples, beats_s, _ = bars_of_clicks(6, bpm=bpm, second=0.4)
        counts = tracked(samples, beats_s)
        assert counts.metre == metre
        assert counts.downbeat_times_s.tolist() == beats_s[downbeats].tolist()


def test_bars_begin_where_they_may():
    samples, beats_s, numbers = bars_of_clicks(4, n_beats=64)
    counts = track_bars(samples, log_mel(samples), beats_s, metres=(4,), may_be_one=numbers == 3)
    assert (counts.numbers == (numbers + 1) % 4 + 1).all()


def test_without_bars():
    samples, beats_s, _ = bars_of_clicks(4)
    for few in (beats_s[:0], beats_s[:3]):
        counts = tracked(samples, few)
        assert not counts.has_bars and counts.numbers.tolist() == [0] * len(few) and counts.confidence == 0
    silent = tracked(np.zeros_like(samples), beats_s)
    assert not silent.has_bars and len(silent) == len(beats_s)


@pytest.mark.parametrize("loudness", [0.0, 1.0], ids=["noise", "equal clicks in noise"])
def test_what_has_no_bars_is_not_trusted(loudness):
    beats_s = np.arange(0.3, 19, 0.5)
    confidence = []
    for seed in range(9):
        samples = 0.01 * np.random.default_rng(seed).normal(size=20 * SAMPLE_RATE_HZ)
        for time_s in beats_s:
            start = round(time_s * SAMPLE_RATE_HZ)
            samples[start : start + len(CLICK)] += loudness * CLICK
        confidence.append(tracked(samples, beats_s).confidence)
    assert np.median(confidence) < 0.5


def test_evidence_has_its_names_and_is_finite():
    samples, beats_s, numbers = bars_of_clicks(4)
    accents, repeats = beat_evidence(samples, log_mel(samples), beats_s)
    assert accents.shape == (48, len(ACCENT_NAMES)) and repeats.shape == (48, len(REPEAT_NAMES))
    assert np.isfinite(accents).all() and np.isfinite(repeats).all()
    for name in ("kick on the beat", "harmony change"):
        column = accents[:, ACCENT_NAMES.index(name)]
        assert column[numbers == 1][1:].min() > column[numbers != 1].max()
    assert repeats[:, REPEAT_NAMES.index("low accents, 4 beats")].mean() > 0.4
    assert repeats[:, REPEAT_NAMES.index("low accents, 3 beats")].mean() < 0


def test_the_path_may_change_metre_at_a_bar():
    evidence = np.zeros((40, 25))
    evidence[np.arange(20), np.arange(20) % 4 + 3] = 2.0
    evidence[np.arange(20, 40), np.arange(20) % 3] = 2.0
    states, margin = best_bars(evidence)
    assert states.tolist() == evidence.argmax(axis=1).tolist()
    assert margin > 10


@pytest.mark.parametrize("mel", [np.zeros((10, 4)), np.zeros((0, 96))])
def test_another_shape_is_refused(mel):
    with pytest.raises(ParameterError, match="log-mel"):
        track_bars(np.zeros(22050), mel, np.arange(4.0))


def test_beats_outside_the_song_are_refused():
    samples, _, _ = bars_of_clicks(4)
    with pytest.raises(ParameterError, match="within"):
        tracked(samples, np.arange(0, 200, 0.5))


def mono(song) -> np.ndarray:
    return soxr.resample(song.samples.mean(axis=1), 44100, SAMPLE_RATE_HZ)


@pytest.mark.slow
@pytest.mark.parametrize("song", [BENCHMARK_SONGS[i] for i in (0, 5, 8, 10, 17)], ids=lambda song: song.name)
def test_downbeats_of_songs_that_begin_anywhere(song):
    """By the tracker's beats, the first bar cut off, since a song that begins on 1 is told by that alone."""
    rendered = song.render()
    start_s = rendered.beat_times_s[3] - 0.1
    samples = mono(rendered)[round(start_s * SAMPLE_RATE_HZ) :]
    mel = log_mel(samples)
    beats_s = tempo_path_beats(mel)
    counts = track_bars(samples, mel, beats_s[beats_s < len(samples) / SAMPLE_RATE_HZ])
    downbeats_s = rendered.bar_times_s[1:] - start_s
    found = counts.downbeat_times_s
    found = found[(found > downbeats_s[0] - 0.07) & (found < downbeats_s[-1] + 0.07)]
    assert counts.metre == rendered.beats_per_bar
    assert f_score(found, downbeats_s) > 0.85
    assert counts.confidence > 0.8


@pytest.mark.slow
@pytest.mark.parametrize(
    "song", [s for s in BENCHMARK_SONGS if s.group in ("level", "metre")], ids=lambda s: s.name
)
def test_downbeats_of_songs_in_any_metre(song):
    """Nothing was fitted to these styles. The beats are the true ones, without those of the first bar."""
    rendered = song.render()
    samples, bars_s = mono(rendered), rendered.bar_times_s
    beats_s = rendered.beat_times_s[3:-2]
    counts = track_bars(samples, log_mel(samples), beats_s)
    assert counts.metre == rendered.beats_per_bar
    assert counts.downbeat_times_s.tolist() == bars_s[1 : 1 + len(counts.downbeat_times_s)].tolist()


@pytest.mark.slow
def test_metre_follows_a_splice():
    parts = [render_song(genre, duration_s=24.0, seed=6001 + i) for i, genre in enumerate(("house", "waltz"))]
    samples = np.concatenate([mono(part)[: 18 * SAMPLE_RATE_HZ] for part in parts])
    bars_s = [part.bar_times_s[part.bar_times_s < 18] + 18 * i for i, part in enumerate(parts)]
    mel = log_mel(samples)
    beats_s = tempo_path_beats(mel)
    counts = track_bars(samples, mel, beats_s[beats_s < 36])
    assert f_score(counts.downbeat_times_s, np.concatenate(bars_s)) > 0.85
    assert set(counts.numbers[counts.times_s < 17]) == {1, 2, 3, 4}
    assert set(counts.numbers[counts.times_s > 20]) == {1, 2, 3}


@pytest.mark.slow
def test_metre_of_real_ballroom_songs(shared_data):
    from choreograph.music.song import load_song

    names = ("C_2", "C_4", "R_2", "R_7", "T_5", "W_3", "W_7", "W_12", "W_22", "W_24", "W_31")
    right = 0
    for name in names:
        song = load_song(shared_data / "dance-with-melody" / f"DANCE_{name}" / "audio.mp3")
        mel = log_mel(song.samples)
        beats_s = tempo_path_beats(mel)
        counts = track_bars(song.samples, mel, beats_s[beats_s < song.duration_s])
        right += counts.metre == (3 if name[0] == "W" else 4)
    assert right >= len(names) - 1


def test_the_most_probable_path_is_librosas():
    observed = np.random.default_rng(5).random((200, 25))
    transition = bars._transition()
    states, score = bars._most_probable_path(observed, transition)
    theirs, probability = librosa.sequence.viterbi(observed.T.copy(), transition, return_logp=True)
    np.testing.assert_array_equal(states, theirs)
    assert score == pytest.approx(float(np.squeeze(probability)))
