"""Onset envelopes of three bands, and their autocorrelation: what beats, tempo and rhythm are read from."""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from choreograph.errors import ParameterError
from choreograph.features.mel import MEL_BANDS, mel_band_hz
from choreograph.frame_blocks import frame_blocks
from choreograph.timebase import MUSIC_FPS, SEGMENT_S, seconds_to_frames

_BAND_EDGES_HZ = (0.0, 250.0, 2000.0, 11025.0)  # bass, melody, percussion
N_BANDS = len(_BAND_EDGES_HZ) - 1
ONSET_RANGE = 60.0 / (10.0 / np.log(10.0))  # 60 dB in natural log of power


def onset_envelopes(log_mel: NDArray[np.floating]) -> NDArray[np.float64]:
    """Half-wave rectified rise of log power per band: bass, melody, percussion, (T, 3) at 60 fps.

    `log_mel` (T, 96) as `features.mel.log_mel` returns it. The rise is taken over two frames (33 ms)
    and within 60 dB of the song's maximum, so noise in a pause is not an onset.
    """
    log_mel = _checked(log_mel)
    floor = log_mel.max() - ONSET_RANGE
    onsets = np.empty((len(log_mel), N_BANDS))
    for block in frame_blocks(len(log_mel)):
        onsets[block] = band_means(level_rise(log_mel, floor, block))
    return onsets


def level_rise(log_mel: NDArray[np.floating], floor: float, block: slice) -> NDArray[np.float64]:
    """Rise over two frames of the frames `block` of log power (T, 96), no lower than `floor`: (T_b, 96)."""
    first = max(0, block.start - 2)
    level = np.maximum(log_mel[first : block.stop], floor).astype(np.float64, copy=False)
    rise = np.zeros((block.stop - block.start, level.shape[1]))
    n_known = len(level) - 2
    if n_known > 0:
        rise[len(rise) - n_known :] = np.maximum(0.0, level[2:] - level[:-2])
    return rise


def band_means(rise: NDArray[np.floating]) -> NDArray[np.floating]:
    """Means (T, 3) of the rise of log power (T, 96) over bass, melody and percussion."""
    return np.stack([rise[:, band].mean(axis=1) for band in _bands()], axis=1)


@lru_cache(maxsize=1)
def _bands() -> tuple[NDArray[np.bool_], ...]:
    hz = mel_band_hz()
    return tuple((hz >= low) & (hz < high) for low, high in pairwise(_BAND_EDGES_HZ))


def onset_density(log_mel: NDArray[np.floating], n_seconds: int) -> NDArray[np.float32]:
    """How densely the music sounds in the 4 s from each second, (S,), as a rank among its seconds, 0 to 1.

    The mean of the three envelopes; equal seconds have the mean rank. Raises as `onset_envelopes`.
    """
    from scipy.stats import rankdata

    strength = np.concatenate([[0.0], np.cumsum(onset_envelopes(log_mel).mean(axis=1, dtype=np.float64))])
    last = len(strength) - 1
    first = np.minimum(np.arange(n_seconds) * MUSIC_FPS, last - 1)
    end = np.minimum(first + SEGMENT_S * MUSIC_FPS, last)
    mean = (strength[end] - strength[first]) / (end - first)
    return ((rankdata(np.round(mean, 6)) - 0.5) / n_seconds).astype(np.float32)


def autocorrelations(
    onsets: NDArray[np.floating], centres: NDArray[np.integer], context_s: float
) -> NDArray[np.float32]:
    """Autocorrelation of onsets (T, C) at 60 fps around each frame of `centres` (N,): (N, C, W).

    W lags of a frame, as many as `context_s` holds. Normalised to 1 at lag 0, corrected for the window's
    taper; 0 where a channel is silent. Outside the song there is silence.
    """
    window = seconds_to_frames(context_s, MUSIC_FPS)
    taper = np.hanning(window + 2)[1:-1].astype(np.float32)
    size = fft.next_fast_len(2 * window, real=True)
    padded = np.pad(np.asarray(onsets, np.float32), ((window // 2, window), (0, 0)))
    inside = np.zeros(len(padded), np.float32)
    inside[window // 2 : window // 2 + len(onsets)] = 1.0
    taper_correlation = _autocorrelation(taper[None], size)[0]
    taper_bias = np.maximum(taper_correlation / taper_correlation[0], 1e-3)
    out = np.empty((len(centres), padded.shape[1], window), np.float32)
    for i, start in enumerate(centres):
        segment = padded[start : start + window]  # (W, C)
        weight = taper * inside[start : start + window]
        mean = (segment * weight[:, None]).sum(axis=0) / max(weight.sum(), 1e-6)
        correlation = _autocorrelation(((segment - mean) * weight[:, None]).T, size)  # (C, W)
        out[i] = correlation / np.maximum(correlation[:, :1], 1e-9) / taper_bias
    return out


def _autocorrelation(rows: NDArray[np.floating], size: int) -> NDArray[np.floating]:
    """Linear autocorrelation of rows (C, W) at lags 0 … W - 1."""
    spectrum = fft.rfft(rows, size, axis=1)
    return fft.irfft(spectrum.real**2 + spectrum.imag**2, size, axis=1)[:, : rows.shape[1]]


def _checked(log_mel: NDArray[np.floating]) -> NDArray[np.float32]:
    log_mel = np.asarray(log_mel, np.float32)
    if log_mel.ndim != 2 or log_mel.shape[1] != MEL_BANDS or len(log_mel) == 0:
        raise ParameterError(f"expected log-mel (T, {MEL_BANDS}), got an array of shape {log_mel.shape}")
    return log_mel
