"""Log-mel spectrogram at exactly 60 fps, loudness normalisation, and onset envelopes."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import AnyFloats, AnyInts, Floats, frame_blocks
from choreograph.core.progress import StepReport
from choreograph.core.timebase import MUSIC_FPS, SAMPLE_RATE_HZ, SEGMENT_S, seconds_to_frames
from choreograph.music.song import SILENCE_PEAK, peak_of

# Log-mel spectrogram at exactly 60 fps.
#
# At 22.05 kHz a frame is 367.5 samples, so the hop is not a whole number. Frame i is centred on the sample
# nearest to i / 60 s, with an error of at most half a sample (23 µs). A hop of 367 or 368 would drift by a
# frame every 12 s.


MEL_BANDS = 96
MEL_WINDOW = 2048  # samples, 93 ms
_POWER_FLOOR = 1e-6  # about 99 dB below a full-scale sine, quieter than 16-bit dither
_BLOCK_FRAMES = 2048
_SPECTRA_AT_ONCE = 256  # which stay in the processor's cache


def log_mel(
    samples: NDArray[np.floating], *, level: float = 1.0, report: StepReport | None = None
) -> NDArray[np.float32]:
    """Natural logarithm of mel power, Slaney's scale and area normalisation, Hann window.

    Parameters
    ----------
    samples : float array (S,)   mono at 22.05 kHz
    level : that samples are relative to, see `scaled`

    Returns
    -------
    float32 array (T, 96)   T = round(S / 22050 * 60), at least 1. Frame i is centred at i / 60 s

    Raises
    ------
    ParameterError   if `samples` is empty or not one-dimensional

    References
    ----------
    ChoreoGraph, section 3.1 (music features at 60 fps).
    """
    samples = _checked_samples(samples)
    n_frames = max(1, seconds_to_frames(len(samples) / SAMPLE_RATE_HZ, MUSIC_FPS))
    centres = np.rint(np.arange(n_frames) * (SAMPLE_RATE_HZ / MUSIC_FPS)).astype(np.int64)  # (T,)
    out = np.empty((n_frames, MEL_BANDS), np.float32)
    for block in frame_blocks(n_frames, _BLOCK_FRAMES):
        out[block] = log_mel_of_windows(windows_around(samples, centres[block], MEL_WINDOW, level))
        if report is not None:
            report(min(block.stop, n_frames), n_frames)
    return out


def windows_around(
    samples: NDArray[np.floating], centres: NDArray[np.int64], size: int, level: float = 1.0
) -> NDArray[np.float32]:
    """The `size` samples (T, W) around each of the increasing `centres` (T,), with silence outside the song.

    They are relative to a level. Only the part of the song that the windows reach is copied.
    """
    first = int(centres[0]) - size // 2
    span = silent_outside(samples, first, int(centres[-1]) - size // 2 + size)
    if level != 1.0:
        span = scaled(span, level)
    windows: NDArray[np.float32] = np.lib.stride_tricks.sliding_window_view(span, size)[centres - centres[0]]
    return windows


def silent_outside(samples: NDArray[np.floating], first: int, stop: int) -> NDArray[np.float32]:
    """Samples `first` … `stop` - 1 of a song, with silence before its first and after its last."""
    span = np.zeros(stop - first, np.float32)
    low, high = max(first, 0), min(stop, len(samples))
    if low < high:
        span[low - first : high - first] = samples[low:high]
    return span


def log_mel_of_windows(windows: NDArray[np.float32]) -> NDArray[np.float32]:
    """`log_mel` (T, 96) of the `MEL_WINDOW` samples around each frame, (T, W)."""
    power = np.empty((len(windows), MEL_WINDOW // 2 + 1), np.float32)  # (T, F)
    for part in frame_blocks(len(windows), _SPECTRA_AT_ONCE):
        spectrum = scipy.fft.rfft(windows[part] * hann_window(), axis=1)
        power[part] = spectrum.real**2 + spectrum.imag**2
    log_mel: NDArray[np.float32] = np.log(np.maximum(power @ mel_filterbank().T, _POWER_FLOOR))
    return log_mel


@lru_cache(maxsize=1)
def hann_window() -> NDArray[np.float32]:
    """The window of `MEL_WINDOW` samples."""
    return np.hanning(MEL_WINDOW + 1)[:-1].astype(np.float32)


@lru_cache
def mel_filterbank(n_bands: int = MEL_BANDS) -> NDArray[np.float32]:
    """Triangular filters (n_bands, 1025) from 0 Hz to half the sample rate, each of unit area per Hz."""
    bounds_hz = _mel_bounds_hz(n_bands)
    away_hz = bounds_hz[:, None] - scipy.fft.rfftfreq(MEL_WINDOW, 1 / SAMPLE_RATE_HZ)  # (B + 2, F)
    width_hz = np.diff(bounds_hz)[:, None]
    rising, falling = -away_hz[:-2] / width_hz[:-1], away_hz[2:] / width_hz[1:]
    area_hz = (bounds_hz[2:] - bounds_hz[:-2])[:, None] / 2
    filters: NDArray[np.float64] = np.maximum(0.0, np.minimum(rising, falling)) / area_hz
    return filters.astype(np.float32)


@lru_cache
def mel_band_hz(n_bands: int = MEL_BANDS) -> NDArray[np.float64]:
    """Centre frequencies of the bands in Hz, (n_bands,)."""
    return _mel_bounds_hz(n_bands)[1:-1]


def _mel_bounds_hz(n_bands: int) -> NDArray[np.float64]:
    """Frequencies (n_bands + 2,) at equal distances on Slaney's mel scale: linear below 1 kHz, then log."""
    linear_hz, border_hz, per_octave = 200.0 / 3.0, 1000.0, 27.0 / np.log(6.4)
    border = border_hz / linear_hz
    top = border + np.log(0.5 * SAMPLE_RATE_HZ / border_hz) * per_octave
    mel = np.linspace(0.0, top, n_bands + 2)
    return np.where(mel < border, mel * linear_hz, border_hz * np.exp((mel - border) / per_octave))


# Loudness normalisation, so that features do not depend on the level of the file.


_BLOCK = 735  # samples, 1/30 s, which are gated together as sound or pause
PAUSE_GATE = 1e-6  # of the loudest block's power (-60 dB). Quieter blocks are pauses and do not count


def scaled(samples: NDArray[np.float32], level: float) -> NDArray[np.float32]:
    """Samples (S,) relative to a level. An infinite one makes them silent."""
    if np.isinf(level):
        return np.zeros_like(samples)
    out = np.empty_like(samples)
    np.divide(samples, np.float64(level), out=out, casting="same_kind")  # in double precision, without a copy
    return out


def loudness(samples: NDArray[np.floating]) -> float:
    """Root mean square of samples (S,) outside pauses, or infinity for a silent song (peak below -80 dB).

    Silence before or after a song changes nothing. Raises `ParameterError` if `samples` is empty, not
    one-dimensional or not finite. (Rhythm is a Dancer, section 5: RMS normalisation. There, pauses count
    too.)
    """
    peak = peak_of(_checked_samples(samples))
    if not np.isfinite(peak):
        raise ParameterError("expected finite samples, got NaN or infinity: a decoder or an effect failed")
    if peak < SILENCE_PEAK:
        return float(np.inf)
    starts = np.arange(0, len(samples), _BLOCK)
    energy = np.empty(len(starts))  # (B,)
    for part in frame_blocks(len(starts)):
        sound = samples[starts[part.start] : part.stop * _BLOCK]
        energy[part] = np.add.reduceat(
            np.square(sound / peak, dtype=np.float64), starts[part] - starts[part.start]
        )
    size = np.diff(starts, append=len(samples))
    is_sound = energy > PAUSE_GATE * size * (energy / size).max()
    return float(peak * np.sqrt(energy[is_sound].sum() / size[is_sound].sum()))


def _checked_samples(samples: NDArray[np.floating]) -> NDArray[np.float32]:
    samples = np.asarray(samples, np.float32)
    if len(samples.shape) != 1 or len(samples) == 0:
        raise ParameterError(f"expected mono samples (S,), got an array of shape {samples.shape}")
    return samples


# Onset envelopes of three bands, and their autocorrelation, for beats, tempo and rhythm.


_BAND_EDGES_HZ = (0.0, 250.0, 2000.0, 11025.0)  # bass, melody, percussion
N_BANDS = len(_BAND_EDGES_HZ) - 1
ONSET_RANGE = 60.0 / (10.0 / np.log(10.0))  # 60 dB in natural log of power


def onset_envelopes(log_mel: NDArray[np.floating]) -> NDArray[np.float64]:
    """Half-wave rectified rise of log power per band: bass, melody, percussion, (T, 3) at 60 fps.

    `log_mel` (T, 96) is the result of `music.mel.log_mel`. The rise is taken over two frames (33 ms) and
    within 60 dB of the song's maximum, so that noise in a pause is not an onset.
    """
    log_mel = checked_log_mel(log_mel)
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
    """Onset density of the 4 s from each second of a song, (S,), as a rank among its seconds, 0 to 1.

    The mean of the three envelopes is ranked, and equal seconds have the mean rank. Raises as
    `onset_envelopes`.
    """
    strength = np.concatenate([[0.0], np.cumsum(onset_envelopes(log_mel).mean(axis=1, dtype=np.float64))])
    last = len(strength) - 1
    first = np.minimum(np.arange(n_seconds) * MUSIC_FPS, last - 1)
    end = np.minimum(first + SEGMENT_S * MUSIC_FPS, last)
    mean = (strength[end] - strength[first]) / (end - first)
    # The ranks of scipy.stats.rankdata. Importing scipy.stats takes longer than the spectra of a song.
    _, which, n_equal = np.unique(np.round(mean, 6), return_inverse=True, return_counts=True)
    ranks = (np.cumsum(n_equal) - 0.5 * (n_equal - 1))[which]
    density: NDArray[np.float32] = ((ranks - 0.5) / n_seconds).astype(np.float32)
    return density


def autocorrelations(
    onsets: NDArray[np.floating], centres: NDArray[np.integer], context_s: float
) -> NDArray[np.float32]:
    """Autocorrelation of onsets (T, C) at 60 fps around each frame of `centres` (N,): (N, C, W).

    There are as many lags W, in frames, as `context_s` holds. Values are normalised to 1 at lag 0 and
    corrected for the taper of the window. They are 0 where a channel is silent. Outside the song there is
    silence.
    """
    window = seconds_to_frames(context_s, MUSIC_FPS)
    taper = np.hanning(window + 2)[1:-1].astype(np.float32)
    size = scipy.fft.next_fast_len(2 * window, real=True)
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
    spectrum = scipy.fft.rfft(rows, size, axis=1)
    correlation: NDArray[np.floating] = scipy.fft.irfft(spectrum.real**2 + spectrum.imag**2, size, axis=1)[
        :, : rows.shape[1]
    ]
    return correlation


def checked_log_mel(log_mel: NDArray[np.floating]) -> NDArray[np.float32]:
    """Log-mel (T, 96) as float32. Raises `ParameterError` for another shape."""
    log_mel = np.asarray(log_mel, np.float32)
    if log_mel.ndim != 2 or log_mel.shape[1] != MEL_BANDS or len(log_mel) == 0:
        raise ParameterError(f"expected log-mel (T, {MEL_BANDS}), got an array of shape {log_mel.shape}")
    return log_mel


def sums_before(blocks: Iterable[AnyFloats], frames: AnyInts) -> Floats:
    """Sums (..., D) of all rows before each of `frames` (...), 0 to T, of rows (T, D) in blocks.

    Rows are added one after another, so that the result does not depend on the sizes of the blocks.
    """
    sums = np.zeros((*np.shape(frames), 0))
    before, position = np.zeros(0), 0
    for block in blocks:  # (T_b, D)
        if position == 0:
            before = np.zeros(block.shape[1])
            sums = np.zeros((*np.shape(frames), block.shape[1]))
        running = np.cumsum(np.concatenate([before[None], block]), axis=0)  # (T_b + 1, D)
        inside = (frames > position) & (frames <= position + len(block))
        sums[inside] = running[frames[inside] - position]
        before, position = running[-1], position + len(block)
    return sums
