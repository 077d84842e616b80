"""Tuning, constant-Q transform and chroma: librosa as oracle."""

from __future__ import annotations

import librosa
import numpy as np
import pytest

from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.music import spectral
from choreograph.music.mel import mel_band_hz, mel_filterbank

RATE = {"sr": SAMPLE_RATE_HZ}
BINS = {"bins_per_octave": spectral.BINS_PER_OCTAVE}


def sounds(seed: int, duration_s: float = 5.0) -> np.ndarray:
    """Notes with partials, a little out of tune, in noise."""
    rng = np.random.default_rng(seed)
    times_s = np.arange(round(duration_s * SAMPLE_RATE_HZ)) / SAMPLE_RATE_HZ
    notes = rng.integers(-24, 24, 8)[(8 * times_s / duration_s).astype(int)]
    phase = np.cumsum(2 * np.pi * 440.0 * 2 ** ((notes + 0.2) / 12) / SAMPLE_RATE_HZ)
    partials = sum(np.sin(n * phase) / n for n in range(1, 6))
    return (partials + rng.normal(0, 0.1, len(times_s))).astype(np.float32)


@pytest.mark.parametrize("n_bands", [26, 96, 128])
def test_mel_filters_are_librosas(n_bands):
    expected = librosa.filters.mel(n_fft=2048, n_mels=n_bands, dtype=np.float64, **RATE)
    np.testing.assert_array_equal(mel_filterbank(n_bands), expected.astype(np.float32))
    bounds_hz = librosa.mel_frequencies(n_bands + 2, fmin=0.0, fmax=SAMPLE_RATE_HZ / 2)
    np.testing.assert_allclose(mel_band_hz(n_bands), bounds_hz[1:-1], rtol=1e-12)


@pytest.mark.parametrize(("window", "tuning", "width"), [(2048, 0.13, 2.0), (8192, 0.0, None)])
def test_chroma_filters_are_librosas(window, tuning, width):
    ours = spectral.chroma_filterbank(window, tuning, None if width is None else (5.0, width))
    theirs = librosa.filters.chroma(n_fft=window, tuning=tuning, octwidth=width, dtype=np.float64, **RATE)
    np.testing.assert_allclose(ours, theirs, atol=1e-12)


@pytest.mark.parametrize(("n_samples", "tuning"), [(110_250, 0.0), (99_999, -0.5), (65_536, 0.31)])
def test_the_transform_is_librosas(n_samples, tuning):
    samples = sounds(1)[:n_samples]
    theirs = np.abs(librosa.cqt(samples, hop_length=512, n_bins=252, tuning=3 * tuning, **RATE, **BINS))
    ours = spectral.constant_q(samples, 512, tuning)
    assert ours.shape == (spectral.N_BINS, 1 + n_samples // 512)
    np.testing.assert_allclose(ours[:, : theirs.shape[1]], theirs, atol=3e-6 * theirs.max())


def test_chroma_of_the_transform_is_librosas():
    tones = spectral.constant_q(sounds(2), 512, 0.0)
    tones[tones < 1e-3 * tones.max()] = 0.0
    tones[:, 50:90] = 0.0  # a pause
    sums = spectral.chroma_of(tones)
    chroma = spectral.normalised(sums, np.inf)
    np.testing.assert_allclose(chroma, librosa.feature.chroma_cqt(C=tones, **BINS), atol=1e-5)
    cens = librosa.feature.chroma_cens(C=tones, **BINS)
    np.testing.assert_allclose(spectral.energy_normalised(sums), cens, atol=1e-5)
    centroids = librosa.feature.tonnetz(chroma=chroma)
    np.testing.assert_allclose(spectral.tonal_centroids(chroma), centroids, atol=1e-5)


@pytest.mark.parametrize("seed", [3, 4])
def test_peaks_and_tuning_are_librosas(seed):
    magnitude = np.abs(librosa.stft(sounds(seed), hop_length=2048, center=False))
    pitch, strength = librosa.piptrack(S=magnitude, n_fft=2048, **RATE)
    hz, height = spectral.spectral_peaks(np.ascontiguousarray(magnitude.T), 2048)
    np.testing.assert_allclose(np.sort(hz), np.sort(pitch[pitch > 0]), rtol=1e-5)
    np.testing.assert_allclose(np.sort(height), np.sort(strength[pitch > 0]), rtol=1e-4)
    assert spectral.tuning_of(hz) == librosa.pitch_tuning(hz)
