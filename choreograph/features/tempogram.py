"""Onset envelopes, tempogram over log lag and its scale transform: rhythm features twice a second.

The tempogram is the autocorrelation of the onset envelopes in the 12 s around a time. Its lag axis is
logarithmic, so a change of tempo shifts it. The scale transform (magnitude of the Fourier transform
along log lag) is invariant to that shift and keeps the metre: groups of three or four, swung or
straight. Together they tell a waltz from a cha-cha whatever the instruments. (Ours: ChoreoGraph's
music input is the log-mel alone.)
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from choreograph.errors import ParameterError
from choreograph.features.mel import MEL_BANDS, mel_band_hz
from choreograph.motion.interpolation import frame_weights
from choreograph.timebase import MUSIC_FPS, seconds_to_frames

RHYTHM_FPS = 2
CONTEXT_S = 12.0  # length of music, centred on a row, that the row is computed from
_BAND_EDGES_HZ = (0.0, 250.0, 2000.0, 11025.0)  # bass, melody, percussion
N_BANDS = len(_BAND_EDGES_HZ) - 1
LAGS_S = np.geomspace(0.2, 4.0, 70)  # about 16 an octave
N_SCALES = 17  # lowest coefficients of the scale transform, the mean included
RHYTHM_DIM = N_BANDS * (len(LAGS_S) + N_SCALES)


def onset_envelopes(log_mel: NDArray[np.floating]) -> NDArray[np.float32]:
    """Half-wave rectified rise of log power per band: bass, melody, percussion, (T, 3) at 60 fps.

    `log_mel` (T, 96) as `features.mel.log_mel` returns it. The rise is taken over two frames (33 ms)
    and within 60 dB of the song's maximum, so noise in a pause is not an onset.
    """
    log_mel = _checked(log_mel)
    floor = log_mel.max() - 60.0 / (10.0 / np.log(10.0))  # 60 dB in natural log of power
    level = np.maximum(log_mel, floor)
    rise = np.zeros_like(level)
    rise[2:] = np.maximum(0.0, level[2:] - level[:-2])
    hz = mel_band_hz()
    bands = [(hz >= low) & (hz < high) for low, high in pairwise(_BAND_EDGES_HZ)]
    return np.stack([rise[:, band].mean(axis=1) for band in bands], axis=1)  # (T, 3)


def tempogram(onsets: NDArray[np.floating], times_s: NDArray[np.floating]) -> NDArray[np.float32]:
    """Autocorrelation of onsets (T, C) at 60 fps in the 12 s around each of `times_s` (N,): (N, C, lags).

    Normalised to 1 at lag 0 (not stored) and sampled at `LAGS_S`; 0 where a band is silent. Outside
    the song there is silence.
    """
    starts = np.clip(np.rint(np.asarray(times_s) * MUSIC_FPS).astype(np.int64), 0, len(onsets))  # (N,)
    correlation = autocorrelations(onsets, starts, CONTEXT_S)  # (N, C, W)
    low, high, weight = frame_weights(LAGS_S * MUSIC_FPS, correlation.shape[-1])
    weight = weight.astype(np.float32)  # stays in single precision, as everything here
    out = correlation[..., low] * (1 - weight) + correlation[..., high] * weight
    return np.clip(out, -1.0, 1.5).astype(np.float32)


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


def scale_transform(columns: NDArray[np.floating]) -> NDArray[np.float32]:
    """Tempo-invariant rhythm: magnitudes of the Fourier transform along log lag, (..., lags) -> (..., 17)."""
    taper = np.hanning(columns.shape[-1] + 2)[1:-1]
    magnitudes = np.abs(np.fft.rfft(columns * taper, axis=-1))[..., :N_SCALES]
    return (magnitudes / np.sqrt(columns.shape[-1])).astype(np.float32)


def rhythm_features(log_mel: NDArray[np.floating], *, start_s: float = 0.0) -> NDArray[np.float32]:
    """Tempogram and scale transform of three bands, float32 (N, RHYTHM_DIM) at 2 per second.

    Parameters
    ----------
    log_mel : float array (T, 96)   at 60 fps, the whole song: a row depends on the 12 s around it
    start_s : time of the first row, for a take whose motion begins there

    Returns
    -------
    row i is computed from the 12 s around start_s + i / 2 s, up to the song's end (at least one row): per
    band the tempogram (70), then the scale transform (17). A silent band's tempogram is zero.

    Raises
    ------
    ParameterError   if `log_mel` is not (T, 96) with T of at least 1
    """
    onsets = onset_envelopes(log_mel)
    n_rows = 1 + max(0, int((len(onsets) / MUSIC_FPS - start_s) * RHYTHM_FPS))
    columns = tempogram(onsets, start_s + np.arange(n_rows) / RHYTHM_FPS)  # (N, 3, lags)
    return np.concatenate([columns, scale_transform(columns)], axis=2).reshape(n_rows, RHYTHM_DIM)


def _autocorrelation(rows: NDArray[np.floating], size: int) -> NDArray[np.floating]:
    """Linear autocorrelation of rows (C, W) at lags 0 … W - 1."""
    spectrum = fft.rfft(rows, size, axis=1)
    return fft.irfft(spectrum.real**2 + spectrum.imag**2, size, axis=1)[:, : rows.shape[1]]


def _checked(log_mel: NDArray[np.floating]) -> NDArray[np.float32]:
    log_mel = np.asarray(log_mel, np.float32)
    if log_mel.ndim != 2 or log_mel.shape[1] != MEL_BANDS or len(log_mel) == 0:
        raise ParameterError(f"expected log-mel (T, {MEL_BANDS}), got an array of shape {log_mel.shape}")
    return log_mel
