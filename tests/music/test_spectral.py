"""The 87 spectral features per beat interval: synthetic tones, librosa as oracle, laws, unusual songs."""

from __future__ import annotations

import warnings
from itertools import pairwise

import librosa
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import frame_blocks
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.music.mel import loudness, scaled
from choreograph.music.spectral import SPECTRAL_COLUMNS, SPECTRAL_DIM, spectral_features

pytestmark = pytest.mark.slow

HOP_S = 512 / SAMPLE_RATE_HZ
A4_HZ = 440.0
C_MAJOR, D_MAJOR = (0, 4, 7), (2, 6, 9)  # pitch classes
CHROMAS = ("chroma", "chroma_cqt", "chroma_cens")


def tone(semitones_over_c4: float, duration_s: float) -> np.ndarray:
    hz = A4_HZ * 2 ** ((semitones_over_c4 - 9) / 12)
    n = np.arange(round(duration_s * SAMPLE_RATE_HZ)) / SAMPLE_RATE_HZ
    return np.sin(2 * np.pi * hz * n)


def chord(semitones: tuple[float, ...], duration_s: float) -> np.ndarray:
    return sum(tone(s, duration_s) for s in semitones) / len(semitones)


def noise(duration_s: float, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(0, 0.2, round(duration_s * SAMPLE_RATE_HZ))


def piece(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Four seconds of chords under soft noise, with beats about twice a second."""
    rng = np.random.default_rng(seed)
    chords = [chord(tuple(rng.choice(24, 3, replace=False)), 1.0) for _ in range(4)]
    return np.concatenate(chords) + 0.05 * noise(4.0, seed), np.cumsum(rng.uniform(0.4, 0.6, 6))


def column(rows: np.ndarray, name: str) -> np.ndarray:
    return rows[:, SPECTRAL_COLUMNS[name]]


def test_there_are_87_features_in_the_papers_order():
    assert SPECTRAL_DIM == 87
    first = {"chroma": 5, "chroma_cqt": 17, "chroma_cens": 29, "mel_db": 41, "mfcc": 67, "centroid_hz": 80}
    first |= {"bandwidth_hz": 81, "contrast_db": 82, "flatness": 83, "rolloff_hz": 84, "tonnetz": 85}
    first |= {"zero_crossing_rate": 91}
    assert {name: columns.start + 5 for name, columns in SPECTRAL_COLUMNS.items()} == first


@pytest.mark.parametrize(("name", "pitch"), [("A", 9), ("C", 0), ("F sharp", 6)])
def test_a_tone_appears_at_its_pitch(name, pitch):
    rows = spectral_features(0.3 * tone(pitch, 4.0), np.array([1.0, 1.5, 2.2, 3.0]))
    assert rows.shape == (3, 87)
    hz = A4_HZ * 2 ** ((pitch - 9) / 12)
    for chroma in CHROMAS:
        assert (column(rows, chroma).argmax(axis=1) == pitch).all(), chroma
    np.testing.assert_allclose(column(rows, "centroid_hz"), hz, rtol=0.03)
    np.testing.assert_allclose(column(rows, "rolloff_hz"), hz, atol=22)
    np.testing.assert_allclose(column(rows, "zero_crossing_rate"), 2 * hz / SAMPLE_RATE_HZ, rtol=0.02)
    assert (column(rows, "bandwidth_hz") < 150).all()
    assert (column(rows, "flatness") < 0.01).all()
    bands_hz = librosa.mel_frequencies(28, fmin=0, fmax=SAMPLE_RATE_HZ / 2)
    loudest = column(rows, "mel_db").argmax(axis=1)
    assert (bands_hz[loudest] < hz).all() and (hz < bands_hz[loudest + 2]).all()


def test_noise_is_flat_and_wide():
    rows = spectral_features(noise(4.0), np.array([1.0, 2.0, 3.0]))
    np.testing.assert_allclose(column(rows, "centroid_hz"), SAMPLE_RATE_HZ / 4, rtol=0.05)
    np.testing.assert_allclose(column(rows, "flatness"), np.exp(-np.euler_gamma), atol=0.02)
    np.testing.assert_allclose(column(rows, "rolloff_hz"), 0.85 * SAMPLE_RATE_HZ / 2, rtol=0.05)
    np.testing.assert_allclose(column(rows, "zero_crossing_rate"), 0.5, atol=0.02)
    partials = tuple(12 * np.log2(n) for n in range(1, 40))
    rich = spectral_features(chord(partials, 4.0), np.array([1.0, 2.0, 3.0]))
    assert (column(rich, "contrast_db") > column(rows, "contrast_db") + 3.0).all()


def test_a_melody_is_read_interval_by_interval():
    melody = [0, 7, 4, 9, 2, 11]
    samples = np.concatenate([tone(s, 0.8) for s in melody])
    rows = spectral_features(samples, np.arange(len(melody) + 1) * 0.8)
    for chroma in ("chroma", "chroma_cqt"):
        np.testing.assert_array_equal(column(rows, chroma).argmax(axis=1), melody)


def test_tonal_centroid_is_hartes_of_the_chord():
    """Harte, Sandler, Gasser (2006): a chord's mean on the circles of fifths, minor and major thirds."""
    rows = spectral_features(
        np.concatenate([chord(C_MAJOR, 2.0), chord(D_MAJOR, 2.0)]), np.array([0.5, 1.5, 2.5, 3.5])
    )
    for row, pitches in ((rows[0], C_MAJOR), (rows[2], D_MAJOR)):
        angles = np.outer([7 * np.pi / 6, 3 * np.pi / 2, 2 * np.pi / 3], pitches)  # (3, 3)
        radii = np.array([1.0, 1.0, 0.5])[:, None]
        expected = np.stack([radii * np.sin(angles), radii * np.cos(angles)], axis=1).mean(axis=-1).ravel()
        np.testing.assert_allclose(row[SPECTRAL_COLUMNS["tonnetz"]], expected, atol=0.12)


def test_rows_are_means_of_librosas_features(monkeypatch):
    """On noise over chords nothing is below our floors; the block size does not matter."""
    samples, beats = piece()
    samples = samples + noise(4.0) * 0.2
    monkeypatch.setattr(
        "choreograph.music.spectral.frame_blocks", lambda n, size=37: frame_blocks(n, min(size, 37))
    )
    rows = spectral_features(samples, beats)
    y = np.pad(scaled(samples, loudness(samples)), 1024)
    flat = {"sr": SAMPLE_RATE_HZ, "n_fft": 2048, "hop_length": 512, "center": False}
    no_rate = {"n_fft": 2048, "hop_length": 512, "center": False}
    mel_db = librosa.power_to_db(librosa.feature.melspectrogram(y=y, n_mels=26, **flat), top_db=None)
    theirs = {
        "mel_db": mel_db,
        "mfcc": librosa.feature.mfcc(y=y, n_mfcc=13, **flat),
        "centroid_hz": librosa.feature.spectral_centroid(y=y, **flat),
        "bandwidth_hz": librosa.feature.spectral_bandwidth(y=y, **flat),
        "contrast_db": librosa.feature.spectral_contrast(y=y, **flat).mean(axis=0, keepdims=True),
        "flatness": librosa.feature.spectral_flatness(y=y, **no_rate),
        "rolloff_hz": librosa.feature.spectral_rolloff(y=y, **flat),
        "chroma_cqt": librosa.feature.chroma_cqt(y=y[1024:-1024], sr=SAMPLE_RATE_HZ, tuning=0.0),
        "chroma_cens": librosa.feature.chroma_cens(y=y[1024:-1024], sr=SAMPLE_RATE_HZ, tuning=0.0),
        "tonnetz": librosa.feature.tonnetz(y=y[1024:-1024], sr=SAMPLE_RATE_HZ, tuning=0.0),
    }
    for name, frames in theirs.items():
        times_s = np.arange(frames.shape[1]) * HOP_S
        for k, (start, stop) in enumerate(pairwise(beats)):
            expected = frames[:, (times_s >= start) & (times_s < stop)].mean(axis=1)
            scale = np.abs(frames).max()
            np.testing.assert_allclose(
                rows[k, SPECTRAL_COLUMNS[name]], expected, atol=0.02 * scale, err_msg=name
            )


@given(st.floats(5e-3, 50.0), st.integers(0, 4))
@settings(max_examples=8, deadline=None)
def test_gain_changes_nothing(gain, seed):
    samples, beats = piece(seed)
    scaled, original = spectral_features(samples * gain, beats), spectral_features(samples, beats)
    np.testing.assert_allclose(scaled, original, rtol=1e-3, atol=1e-2)


@given(st.integers(1, 60), st.integers(0, 4))
@settings(max_examples=8, deadline=None)
def test_a_delayed_song_has_the_same_rows(n_hops, seed):
    samples, beats = piece(seed)
    later = np.concatenate([np.zeros(n_hops * 512), samples])
    shifted, rows = spectral_features(later, beats + n_hops * HOP_S), spectral_features(samples, beats)
    for name in SPECTRAL_COLUMNS:
        scale = np.abs(column(rows, name)).max()
        np.testing.assert_allclose(
            column(shifted, name), column(rows, name), atol=0.02 * scale, rtol=0, err_msg=name
        )


@given(st.integers(1, 4), st.integers(0, 4))
@settings(max_examples=8, deadline=None)
def test_leaving_out_a_beat_merges_two_intervals(left_out, seed):
    """The row of the merged interval is the mean of the two, weighted by their frames."""
    samples, beats = piece(seed)
    rows, merged = spectral_features(samples, beats), spectral_features(samples, np.delete(beats, left_out))
    n_frames = np.diff(np.ceil(beats / HOP_S))
    pair = slice(left_out - 1, left_out + 1)
    expected = np.average(rows[pair], axis=0, weights=n_frames[pair])
    np.testing.assert_allclose(merged[left_out - 1], expected, rtol=1e-4, atol=1e-3)
    np.testing.assert_array_equal(
        np.delete(merged, left_out - 1, axis=0), np.delete(rows, [left_out - 1, left_out], axis=0)
    )


@pytest.mark.parametrize("beats", [[], [1.0]])
def test_without_two_beats_there_is_no_interval(beats):
    rows = spectral_features(piece()[0], np.array(beats))
    assert rows.shape == (0, 87)
    assert rows.dtype == np.float32


@pytest.mark.parametrize("sound", ["silence", "noise", "a click", "an offset"])
@pytest.mark.parametrize("n_samples", [1, 100, 735, 2048, 30_000])
def test_songs_shorter_than_a_window_give_rows_without_warnings(n_samples, sound):
    samples = np.zeros(n_samples)
    if sound == "noise":
        samples = np.random.default_rng(0).normal(0, 0.1, n_samples)
    elif sound == "an offset":
        samples += 0.5
    elif sound == "a click":
        samples[n_samples // 2] = 0.9
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        rows = spectral_features(samples, np.array([0.0, 0.4, 1.0]) * n_samples / SAMPLE_RATE_HZ)
    assert rows.shape == (2, 87)
    assert np.isfinite(rows).all()


def test_silence_and_hiss_in_a_pause_have_the_same_timbre():
    """16-bit dither 70 dB below the music is inaudible: a pause is not bright noise."""
    samples = np.concatenate([chord(C_MAJOR, 2.0), np.zeros(2 * SAMPLE_RATE_HZ), chord(C_MAJOR, 2.0)])
    beats = np.array([0.5, 1.5, 2.5, 3.5, 4.5, 5.5])
    hiss = np.random.default_rng(0).normal(0, 1e-4, len(samples))
    rows = spectral_features(samples + hiss, beats)
    pause = rows[2]
    for name in ("centroid_hz", "bandwidth_hz", "rolloff_hz", "zero_crossing_rate", "chroma", "contrast_db"):
        np.testing.assert_allclose(pause[SPECTRAL_COLUMNS[name]], 0.0, atol=1e-3, err_msg=name)
    np.testing.assert_allclose(pause[SPECTRAL_COLUMNS["mel_db"]], -50.0, atol=1e-3)
    np.testing.assert_allclose(pause, spectral_features(samples, beats)[2], atol=0.05)
    silent = spectral_features(np.zeros(len(samples)), beats)
    timbre = slice(SPECTRAL_COLUMNS["mel_db"].start, SPECTRAL_COLUMNS["tonnetz"].start)
    np.testing.assert_allclose(silent[2, timbre], pause[timbre], atol=1e-3)


def test_intervals_between_two_frames_get_the_next_frame():
    samples, _ = piece()
    rows = spectral_features(samples, np.array([1.0, 1.001, 1.002, 1.0 + HOP_S]))
    np.testing.assert_array_equal(rows[0], rows[1])
    assert np.isfinite(rows).all() and column(rows, "chroma").max() > 0.5


@pytest.mark.parametrize("cents", [-40, -20, 15, 35])
@pytest.mark.parametrize("chroma", ["chroma", "chroma_cqt"])
def test_a_song_out_of_tune_keeps_its_notes(chroma, cents):
    beats = np.array([1.2, 1.5, 1.9])
    detuned_pitches = tuple(pitch + cents / 100 for pitch in C_MAJOR)
    in_tune, detuned = (
        column(spectral_features(chord(pitches, 4.0), beats), chroma)
        for pitches in (C_MAJOR, detuned_pitches)
    )
    np.testing.assert_allclose(detuned, in_tune, atol=0.1)


@pytest.mark.parametrize("beats", [[0.5, 0.5], [0.5, np.inf], [0.5, 9.0], [-1.0, 0.5]])
def test_beats_of_another_song_are_refused(beats):
    with pytest.raises(ParameterError):
        spectral_features(piece()[0], np.array(beats))


def test_blocks_of_the_constant_q_transform_are_those_of_the_whole_song():
    song = (chord(C_MAJOR, 12.0) + noise(12.0)) * np.geomspace(0.01, 1.0, 12 * SAMPLE_RATE_HZ)
    beats = np.arange(0.0, 12.0, 0.5)
    whole = spectral_features(song, beats)
    in_blocks = spectral_features(song, beats, cqt_frames=500)  # of 517
    assert np.allclose(in_blocks, whole, rtol=1e-3, atol=1e-3)


def test_a_song_of_minutes_is_tuned_as_a_short_one():
    """The tuning is found in blocks of 95 s."""
    beats, pitches = np.array([1.2, 1.5, 1.9]), tuple(pitch + 0.35 for pitch in C_MAJOR)
    short, long = (spectral_features(chord(pitches, duration_s), beats) for duration_s in (4.0, 100.0))
    np.testing.assert_allclose(column(long, "chroma"), column(short, "chroma"), atol=0.1)
