"""Log-mel spectrogram at exactly 60 fps.

At 22.05 kHz a frame is 367.5 samples, so no whole hop exists: frame i is centred on the sample
nearest to i / 60 s, which is within half a sample (23 µs) for ever, where a hop of 367 or 368 would
drift by a frame every 12 s.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from choreograph.errors import ParameterError
from choreograph.timebase import MUSIC_FPS, SAMPLE_RATE_HZ, seconds_to_frames

MEL_BANDS = 96
_WINDOW = 2048  # samples, 93 ms
_POWER_FLOOR = 1e-6  # about 99 dB below a full-scale sine: quieter than 16-bit dither
_BLOCK_FRAMES = 2048


def log_mel(samples: NDArray[np.floating]) -> NDArray[np.float32]:
    """Natural logarithm of mel power, Slaney's scale and area normalisation, Hann window.

    Parameters
    ----------
    samples : float array (S,)   mono at 22.05 kHz

    Returns
    -------
    float32 array (T, 96)   T = round(S / 22050 * 60), at least 1; frame i is centred at i / 60 s

    Raises
    ------
    ParameterError   if `samples` is empty or not one-dimensional

    References
    ----------
    ChoreoGraph, section 3.1 (music features at 60 fps).
    """
    samples = np.asarray(samples, np.float32)
    if samples.ndim != 1 or len(samples) == 0:
        raise ParameterError(f"expected mono samples (S,), got an array of shape {samples.shape}")
    n_frames = max(1, seconds_to_frames(len(samples) / SAMPLE_RATE_HZ, MUSIC_FPS))
    centres = np.rint(np.arange(n_frames) * (SAMPLE_RATE_HZ / MUSIC_FPS)).astype(np.int64)  # (T,)
    padded = np.pad(samples, (_WINDOW // 2, _WINDOW // 2 + SAMPLE_RATE_HZ // MUSIC_FPS))
    windows = np.lib.stride_tricks.sliding_window_view(padded, _WINDOW)
    hann = np.hanning(_WINDOW + 1)[:-1].astype(np.float32)
    bank = mel_filterbank().T  # (F, 96)
    out = np.empty((n_frames, MEL_BANDS), np.float32)
    for start in range(0, n_frames, _BLOCK_FRAMES):
        block = slice(start, start + _BLOCK_FRAMES)
        spectrum = fft.rfft(windows[centres[block]] * hann, axis=1)  # (T_b, F)
        power = spectrum.real**2 + spectrum.imag**2
        out[block] = np.log(np.maximum(power @ bank, _POWER_FLOOR))
    return out


@lru_cache(maxsize=1)
def mel_filterbank() -> NDArray[np.float32]:
    """Triangular filters (96, 1025) from 0 Hz to half the sample rate, each of unit area per Hz."""
    top_mel = _hz_to_mel(np.array(SAMPLE_RATE_HZ / 2))
    edges_hz = _mel_to_hz(np.linspace(0.0, top_mel, MEL_BANDS + 2))  # (98,)
    bins_hz = np.fft.rfftfreq(_WINDOW, 1 / SAMPLE_RATE_HZ)  # (F,)
    low, centre, high = (edges_hz[i : i + MEL_BANDS, None] for i in range(3))
    rising = (bins_hz - low) / (centre - low)
    falling = (high - bins_hz) / (high - centre)
    triangles = np.maximum(0.0, np.minimum(rising, falling))  # (96, F)
    return (triangles * 2.0 / (high - low)).astype(np.float32)


def mel_band_hz() -> NDArray[np.float64]:
    """Centre frequencies of the bands in Hz, (96,)."""
    top_mel = _hz_to_mel(np.array(SAMPLE_RATE_HZ / 2))
    return _mel_to_hz(np.linspace(0.0, top_mel, MEL_BANDS + 2))[1:-1]


def _hz_to_mel(hz: NDArray[np.float64]) -> NDArray[np.float64]:
    """Slaney's scale: linear below 1 kHz (15 mel), 27 mel per factor of 6.4 above."""
    return np.where(hz < 1000, hz * 3 / 200, 15 + np.log(np.maximum(hz, 1000) / 1000) * 27 / np.log(6.4))


def _mel_to_hz(mel: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(mel < 15, mel * 200 / 3, 1000 * np.exp((mel - 15) * np.log(6.4) / 27))
