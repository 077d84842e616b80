"""Log-mel against an independent reference, and the times of its frames."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from choreograph.core.errors import ParameterError
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.music.mel import MEL_BANDS, log_mel, mel_band_hz, mel_filterbank, windows_around


def slaney_edges_hz() -> np.ndarray:
    """Band edges (98,), equally spaced on Slaney's scale: linear below 1 kHz, logarithmic above."""
    top_mel = 15 + np.log(SAMPLE_RATE_HZ / 2 / 1000) * 27 / np.log(6.4)
    mel = np.linspace(0.0, top_mel, MEL_BANDS + 2)
    return np.where(mel < 15, mel * 200 / 3, 1000 * np.exp((mel - 15) * np.log(6.4) / 27))


def slaney_filters() -> np.ndarray:
    """Triangles (96, 1025) between the edges, each of unit area per Hz."""
    edges_hz = slaney_edges_hz()
    bins_hz = np.fft.rfftfreq(2048, 1 / SAMPLE_RATE_HZ)
    triangles = [np.interp(bins_hz, edges_hz[i : i + 3], [0.0, 1.0, 0.0]) for i in range(MEL_BANDS)]
    return np.stack(triangles) * 2 / (edges_hz[2:] - edges_hz[:-2])[:, None]


def test_filters_and_centres_are_slaneys():
    np.testing.assert_allclose(mel_filterbank(), slaney_filters(), atol=1e-8)
    np.testing.assert_allclose(mel_band_hz(), slaney_edges_hz()[1:-1], rtol=1e-12)


def test_log_mel_in_double_precision():
    rng = np.random.default_rng(0)
    time_s = np.arange(2 * SAMPLE_RATE_HZ) / SAMPLE_RATE_HZ
    samples = (rng.normal(0, 0.1, len(time_s)) + np.sin(2 * np.pi * 440 * time_s)).astype(np.float32)
    hann = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(2048) / 2048)
    padded = np.pad(samples, 2048).astype(np.float64)
    centres = np.rint(np.arange(120) * 367.5).astype(int) + 2048
    frames = np.stack([padded[c - 1024 : c + 1024] for c in centres]) * hann
    expected = np.log(np.maximum(np.abs(np.fft.rfft(frames)) ** 2 @ slaney_filters().T, 1e-6))
    np.testing.assert_allclose(log_mel(samples), expected, atol=2e-5)


def test_log_mel_is_the_same_with_the_reference_filters(monkeypatch):
    samples = np.random.default_rng(1).normal(0, 0.1, 3 * SAMPLE_RATE_HZ).astype(np.float32)
    ours = log_mel(samples)
    monkeypatch.setattr("choreograph.music.mel.mel_filterbank", lambda: slaney_filters().astype(np.float32))
    np.testing.assert_allclose(ours, log_mel(samples), atol=1e-6)


def test_a_click_late_in_a_long_song_is_in_its_frame():
    samples = np.zeros(120 * SAMPLE_RATE_HZ, np.float32)
    samples[round(117.25 * SAMPLE_RATE_HZ)] = 1.0
    mel = log_mel(samples)
    assert mel.shape == (7200, MEL_BANDS)
    loudness = np.exp(mel).sum(axis=1)
    assert np.average(np.arange(7200), weights=loudness - loudness.min()) == pytest.approx(
        117.25 * 60, abs=0.1
    )


@given(st.integers(1, 60_000))
@settings(max_examples=20, deadline=None)
def test_every_length_has_its_frames(n_samples):
    mel = log_mel(np.zeros(n_samples, np.float32))
    assert mel.shape == (max(1, round(n_samples / SAMPLE_RATE_HZ * 60)), MEL_BANDS)
    assert np.isfinite(mel).all()


def test_mel_refuses_stereo():
    with pytest.raises(ParameterError):
        log_mel(np.zeros((100, 2)))


@given(st.integers(1, 50), st.lists(st.integers(-20, 70), min_size=1, max_size=8), st.integers(1, 9))
def test_windows_of_a_song_are_silent_outside_it(n_samples, centres, half):
    samples, at = np.arange(1, n_samples + 1, dtype=np.float32), np.sort(np.array(centres))
    windows = windows_around(samples, at, 2 * half)
    index = at[:, None] + np.arange(-half, half)
    expected = np.where((index >= 0) & (index < n_samples), index + 1, 0)
    np.testing.assert_array_equal(windows, expected)


def test_log_mel_makes_no_copy_of_the_song():
    """A copy of these ten minutes would take 53 MB, and a block of windows takes 40 MB."""
    samples = np.random.default_rng(0).normal(0, 0.1, 600 * SAMPLE_RATE_HZ).astype(np.float32)
    tracemalloc.start()
    try:
        mel = log_mel(samples)
        _, peak = tracemalloc.get_traced_memory()
        assert peak < mel.nbytes + 45e6
    finally:
        tracemalloc.stop()
