"""Pitch of music: its tuning, the constant-Q transform, and chroma.

Definitions are librosa's. librosa itself takes longer to import than a song takes to analyse, because it
imports scikit-learn and compiles kernels.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import scipy
from numpy.typing import NDArray

from choreograph.core.numerics import Floats, frame_blocks
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.music.mel import silent_outside
from choreograph.music.song import at_half_rate

_C1_HZ = 440.0 * 2.0 ** (-45 / 12)
_A0_HZ = 27.5
BINS_PER_OCTAVE, N_OCTAVES = 36, 7
N_BINS = BINS_PER_OCTAVE * N_OCTAVES
_KEPT_MAGNITUDE = 0.99  # of a filter's spectrum. The smallest values are left out
_BLOCK_FRAMES = 4096


# Tuning.


_PITCHES_HZ = (150.0, 4000.0)  # range of spectral peaks
_PEAK_SHARE = 0.1  # of the loudest bin that a peak has at least
_TUNING_STEP = 0.01  # semitones


def spectral_peaks(magnitude: NDArray[np.float32], window: int) -> tuple[Floats, Floats]:
    """Frequencies in Hz and magnitudes (P,) of the peaks of spectra (T, F), interpolated by parabolas."""
    loud = np.where(magnitude > _PEAK_SHARE * magnitude.max(axis=1, keepdims=True), magnitude, 0)
    hz = np.arange(1, magnitude.shape[1] - 1) * SAMPLE_RATE_HZ / window
    is_peak = (loud[:, 1:-1] > loud[:, :-2]) & (loud[:, 1:-1] >= loud[:, 2:])
    is_peak &= (hz >= _PITCHES_HZ[0]) & (hz < _PITCHES_HZ[1])
    frames, bins = np.nonzero(is_peak)
    left, middle, right = (magnitude[frames, bins + i].astype(np.float64) for i in range(3))
    slope, curvature = 0.5 * (right - left), right + left - 2 * middle
    shift = np.where(np.abs(slope) < np.abs(curvature), -slope / np.where(curvature == 0, 1, curvature), 0.0)
    return (bins + 1 + shift) * SAMPLE_RATE_HZ / window, middle + 0.5 * slope * shift


def tuning_of(frequencies_hz: Floats) -> float:
    """Deviation of the A from 440 Hz in semitones, -0.5 to 0.5, on which most frequencies (P,) agree."""
    semitones = np.mod(12 * np.log2(frequencies_hz / _A0_HZ), 1.0)
    semitones[semitones >= 0.5] -= 1.0
    bounds = np.linspace(-0.5, 0.5, round(1 / _TUNING_STEP) + 1)
    votes, _ = np.histogram(semitones, bounds)
    return float(bounds[np.argmax(votes)])


# The constant-Q transform: the windows of filters are shorter, the higher their frequency.
#
# Relative to the rate, the filters of all octaves are the same. So one bank is applied to the song, then to
# the song at half the rate, and so on. librosa makes a bank for each octave, which differs by rounding.


def constant_q(samples: NDArray[np.float32], hop: int, tuning: float) -> NDArray[np.float32]:
    """Magnitudes (N_BINS, 1 + S // hop) of the transform of samples (S,), from C1 up.

    `tuning` is in semitones. The hop can be halved six times.
    """
    bank, lengths = _filters(round(tuning / _TUNING_STEP))
    used = np.flatnonzero(np.any(bank != 0, axis=0))
    band = slice(int(used[0]), int(used[-1]) + 1)
    size = 2 * (bank.shape[1] - 1)
    n_frames = 1 + len(samples) // hop
    out = np.empty((N_BINS, n_frames), np.float32, order="F")
    scale = 1 / np.sqrt(lengths)[:, None]
    for octave in range(N_OCTAVES):
        rows = slice(N_BINS - (octave + 1) * BINS_PER_OCTAVE, N_BINS - octave * BINS_PER_OCTAVE)
        for block in frame_blocks(n_frames, _BLOCK_FRAMES):
            span = silent_outside(
                samples, block.start * hop - size // 2, (block.stop - 1) * hop - size // 2 + size
            )
            windows = np.lib.stride_tricks.sliding_window_view(span, size)[::hop]
            spectrum = scipy.fft.rfft(windows, axis=1)[:, band]  # (T_b, F)
            out[rows, block] = np.abs(spectrum @ bank[:, band].T).T * scale
        if octave < N_OCTAVES - 1:
            samples, hop = at_half_rate(samples), hop // 2
            samples *= np.float32(2**0.5)
    return out


@lru_cache(maxsize=4)
def _filters(tuning_steps: int) -> tuple[NDArray[np.complex64], Floats]:
    """Spectra (36, F) of the filters of the highest octave, and their lengths in samples, (36,)."""
    numbers = np.arange(N_BINS - BINS_PER_OCTAVE, N_BINS) + tuning_steps * _TUNING_STEP * BINS_PER_OCTAVE / 12
    hz = _C1_HZ * 2.0 ** (numbers / BINS_PER_OCTAVE)
    two_bins = 2.0 ** (2 / BINS_PER_OCTAVE)
    lengths = (two_bins + 1) / (two_bins - 1) * SAMPLE_RATE_HZ / hz  # Q periods
    size = int(2 ** np.ceil(np.log2(lengths.max())))
    bank = np.zeros((BINS_PER_OCTAVE, size), np.complex64)
    for row, length, frequency_hz in zip(bank, lengths, hz, strict=True):
        at = np.arange(-length // 2, length // 2)  # samples
        n_samples = len(at)
        window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(n_samples) / n_samples)
        wave = window * np.exp(2j * np.pi * frequency_hz / SAMPLE_RATE_HZ * at)
        first = (size - n_samples) // 2
        row[first : first + n_samples] = wave / np.abs(wave).sum()
    bank *= (lengths / size)[:, None]
    spectra = scipy.fft.fft(bank, axis=1)[:, : size // 2 + 1]
    return _without_small(spectra), lengths


def _without_small(spectra: NDArray[np.complex64]) -> NDArray[np.complex64]:
    """Spectra (N, F) with the smallest values of each set to 0."""
    magnitude = np.abs(spectra)
    ordered = np.sort(magnitude, axis=1)
    share = np.cumsum(ordered / magnitude.sum(axis=1, keepdims=True), axis=1)
    first = np.argmin(share < 1 - _KEPT_MAGNITUDE, axis=1)
    least = np.take_along_axis(ordered, first[:, None], axis=1)
    return np.where(magnitude < least, 0, spectra)


# Chroma: the shares of the twelve pitch classes from C to B.


@lru_cache
def chroma_filterbank(window: int, tuning: float = 0.0, octaves: tuple[float, float] | None = None) -> Floats:
    """Filters (12, window // 2 + 1) from the bins of a spectrum to pitch classes.

    Each bin is spread over neighbouring classes as wide as it is, with a squared sum of 1. `octaves` are
    the mean and the standard deviation of a Gaussian weight over octaves above A0.
    """
    hz = np.arange(1, window) * SAMPLE_RATE_HZ / window
    semitones = 12 * np.log2(hz / (_A0_HZ * 2.0 ** (tuning / 12)))
    semitones = np.concatenate([[semitones[0] - 18.0], semitones])  # bin 0 lies far below bin 1
    width = np.append(np.maximum(np.diff(semitones), 1.0), 1.0)
    away = np.mod(semitones - np.arange(12)[:, None] + 126.0, 12.0) - 6.0  # (12, F)
    bank = np.exp(-0.5 * (2 * away / width) ** 2)
    bank /= np.linalg.norm(bank, axis=0)
    if octaves is not None:
        bank *= np.exp(-0.5 * ((semitones / 12 - octaves[0]) / octaves[1]) ** 2)
    from_c: Floats = np.roll(bank, -3, axis=0)[:, : window // 2 + 1]
    return from_c


def chroma_of(tones: NDArray[np.float32]) -> NDArray[np.float32]:
    """Sums (12, T) of the bins of a constant-Q transform (N_BINS, T) in each pitch class."""
    per_class = BINS_PER_OCTAVE // 12
    folded = tones.reshape(N_OCTAVES, BINS_PER_OCTAVE, -1).sum(axis=0)
    nearest = np.roll(folded, per_class // 2, axis=0)  # the bins around a pitch belong to it
    summed: NDArray[np.float32] = nearest.reshape(12, per_class, -1).sum(axis=1)
    return summed


_CENS_STEPS = (0.4, 0.2, 0.1, 0.05)  # shares of a pitch class, each above which adds a quarter
_CENS_FRAMES = 41  # of the smoothing


def energy_normalised(chroma: NDArray[np.float32]) -> NDArray[np.floating]:
    """Chroma energy normalised statistics (12, T): quantised shares, smoothed over a second.

    References
    ----------
    Müller and Ewert, *Chroma Toolbox*, ISMIR 2011.
    """
    shares = normalised(chroma, 1)
    levels = sum(0.25 * (shares > step) for step in _CENS_STEPS)
    window = np.hanning(_CENS_FRAMES + 2)
    return normalised(scipy.ndimage.convolve1d(levels, window / window.sum(), axis=1, mode="constant"), 2)


def tonal_centroids(chroma: NDArray[np.floating]) -> Floats:
    """Positions (6, T) of chroma (12, T) on the circles of fifths, of minor and of major thirds."""
    angles = np.pi * np.outer([7 / 6, 7 / 6, 3 / 2, 3 / 2, 2 / 3, 2 / 3], np.arange(12))
    angles[::2] -= np.pi / 2  # sines in the even rows, cosines in the odd ones
    radii = np.array([1.0, 1.0, 1.0, 1.0, 0.5, 0.5])[:, None]
    centroids: Floats = (radii * np.cos(angles)) @ normalised(chroma, 1)
    return centroids


def normalised(rows: NDArray[np.floating], order: float) -> NDArray[np.floating]:
    """Columns of (D, T) with a norm of 1 of this order, or 0 throughout."""
    length = np.linalg.norm(rows, order, axis=0)
    tiny = np.finfo(rows.dtype if rows.dtype.kind == "f" else np.float32).tiny
    return rows / np.where(length < tiny, 1, length).astype(rows.dtype)
