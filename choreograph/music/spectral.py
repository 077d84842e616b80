"""Timbre and harmony of music: 87 spectral features per beat interval, as librosa defines them.

The paper's Table 2, row by row (a1 to a4 are the rhythmic features, `music.rhythm`):

| a | feature | numbers | column |
| --- | --- | --- | --- |
| 5–16 | chromagram of the short-time Fourier transform, C to B | 12 | chroma |
| 17–28 | constant-Q chromagram | 12 | chroma_cqt |
| 29–40 | chroma energy normalised (CENS) | 12 | chroma_cens |
| 41–66 | mel-scaled spectrogram, in decibels | 26 | mel_db |
| 67–79 | mel-frequency cepstral coefficients | 13 | mfcc |
| 80 | spectral centroid | 1 | centroid_hz |
| 81 | spectral bandwidth | 1 | bandwidth_hz |
| 82 | spectral contrast, mean of librosa's seven bands | 1 | contrast_db |
| 83 | spectral flatness | 1 | flatness |
| 84 | roll-off frequency | 1 | rolloff_hz |
| 85–90 | tonal centroid features | 6 | tonnetz |
| 91 | zero-crossing rate, of a sample | 1 | zero_crossing_rate |

12 + 12 + 12 + 26 + 13 + 5 + 6 + 1 = 87. The table leaves some details open. Contrast has one number there and
seven in librosa, so we use their mean. The mel spectrogram is in decibels, since power spans six orders of
magnitude. The row of an interval is the mean of the frames centred in it. Windows and bands are
librosa's defaults (2,048 samples, hop 512, 128 mel bands for the MFCC). Loudness is normalised first.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import lru_cache
from itertools import accumulate, pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from choreograph.core.numerics import Floats, frame_blocks
from choreograph.core.progress import StepReport, part
from choreograph.core.timebase import SAMPLE_RATE_HZ, times_to_frames
from choreograph.music.beats import checked_beat_times_s
from choreograph.music.mel import hann_window, loudness, mel_filterbank, scaled, silent_outside
from choreograph.music.song import at_half_rate

_COLUMNS = {
    "chroma": 12, "chroma_cqt": 12, "chroma_cens": 12, "mel_db": 26, "mfcc": 13, "centroid_hz": 1,
    "bandwidth_hz": 1, "contrast_db": 1, "flatness": 1, "rolloff_hz": 1, "tonnetz": 6,
    "zero_crossing_rate": 1,
}  # fmt: skip
SPECTRAL_COLUMNS = {
    name: slice(stop - size, stop)
    for (name, size), stop in zip(_COLUMNS.items(), accumulate(_COLUMNS.values()), strict=True)
}
SPECTRAL_DIM = sum(_COLUMNS.values())

_STEPS = 100  # of its progress
_WINDOW, _HOP = 2048, 512  # samples
_CQT_REACH = 1 << 16  # samples. The lowest octave's filters are this long
_CQT_WHOLE_FRAMES = 1 << 15  # 13 minutes, which are transformed at once
_CQT_BLOCKS = 4  # as many blocks as those frames have. The last bit may differ at a border of blocks
_TUNING_HOP = 8 * _HOP
_TIMBRE_BLOCK_FRAMES = 1024
_TUNING_BLOCK_FRAMES = 512
# White noise at unit loudness has 768 in every bin of a power spectrum, and 16-bit dither about 1e-4. Below
# this floor a bin is inaudible and must not determine the timbre of a pause.
_POWER_FLOOR = 1e-3
_MEL_POWER_FLOOR = 1e-5
_CQT_FLOOR = 1e-3  # of the song's strongest bin
_CROSSING_FLOOR = 1e-3  # amplitude of a sample
_CHROMA_OCTAVES = (5.0, 2.0)  # mean and standard deviation, above A0, of the weights of bins
_MFCC_BANDS = 128
_ROLLOFF = 0.85  # of the amplitude
_N_CONTRASTS, _CONTRAST_HZ = 7, 200.0  # bands of an octave each, and the upper end of the lowest one
_CONTRAST_SHARE = 0.02  # of the bins of a band that are its loudest, or quietest


def spectral_features(
    samples: NDArray[np.floating],
    beat_times_s: NDArray[np.floating],
    *,
    cqt_frames: int = _CQT_WHOLE_FRAMES,
    report: StepReport | None = None,
) -> NDArray[np.float32]:
    """The 87 spectral features of every interval between two consecutive beats.

    Parameters
    ----------
    samples : float array (S,)        mono at 22.05 kHz, at any gain
    beat_times_s : float array (Q,)   increasing times inside the song: the bounds of the intervals
    cqt_frames : int                  frames of a song whose constant-Q transform is made at once. That of a
                                      longer song is made in blocks of a quarter of them

    Returns
    -------
    float32 array (Q - 1, 87)   columns as in `SPECTRAL_COLUMNS`. No row if there are fewer than two beats.
    An interval too short to hold a frame (23 ms) gets those of the next frame. In silence the mel bands
    are at their floor of -50 dB, flatness is 1 (a spectrum without a peak), and all others except mfcc are 0.

    Raises
    ------
    ParameterError   if samples are empty, not mono or not finite, or beats not increasing in the song

    References
    ----------
    Rhythm is a Dancer, section 3.1.2 and Table 2 (a5 to a91).
    """
    samples = np.asarray(samples, np.float32)
    level = loudness(samples)
    beats = checked_beat_times_s(beat_times_s, len(samples) / SAMPLE_RATE_HZ)
    if len(beats) < 2:
        return np.zeros((0, SPECTRAL_DIM), np.float32)
    tuning = _tuning(samples, level)
    tonal = _tonal_frames(samples, level, tuning, cqt_frames, part(report, 0, 50, _STEPS))
    timbre_report, n_frames = part(report, 50, _STEPS, _STEPS), len(tonal["tonnetz"])

    def frame_rows() -> Iterator[NDArray[np.floating]]:
        """Blocks of frames (T_b, 87). Frame i is centred at i * 512 samples."""
        for block in frame_blocks(n_frames, _TIMBRE_BLOCK_FRAMES):
            first = block.start * _HOP - _WINDOW // 2
            span = _span(samples, level, first, (block.stop - 1) * _HOP + _WINDOW // 2)
            of_block = {name: rows[block] for name, rows in tonal.items()} | _timbre_frames(span, tuning)
            frames = np.empty((len(of_block["tonnetz"]), SPECTRAL_DIM))
            for name, rows in of_block.items():
                frames[:, SPECTRAL_COLUMNS[name]] = rows
            yield frames
            if timbre_report is not None:
                timbre_report(block.stop, n_frames)

    return _interval_means(frame_rows(), n_frames, beats).astype(np.float32)


def _tonal_frames(
    samples: NDArray[np.floating], level: float, tuning: float, whole_frames: int, report: StepReport | None
) -> dict[str, NDArray[np.floating]]:
    """Features of the constant-Q transform, each (T, n) with T = 1 + S // 512."""
    n_frames = 1 + len(samples) // _HOP
    sums = np.empty((12, n_frames), np.float32, order="F")
    size = n_frames if n_frames <= whole_frames else whole_frames // _CQT_BLOCKS
    loudest, floors = np.float32(0.0), dict[int, np.float32]()
    # The floor follows from the loudest bin of the song. Blocks before it are transformed again, since the
    # transform of an hour of song is large.
    for block in 2 * list(frame_blocks(n_frames, size)):
        if floors.get(block.start) == _CQT_FLOOR * loudest:
            continue
        tones = _tones(samples, level, block, tuning)  # (252, T_b)
        loudest = max(loudest, tones.max())
        floors[block.start] = _CQT_FLOOR * loudest
        tones[tones < floors[block.start]] = 0.0
        sums[:, block] = chroma_of(tones)
        if report is not None:
            report(block.stop, n_frames)
    chroma = normalised(sums, np.inf)
    rows = {"chroma_cqt": chroma, "chroma_cens": energy_normalised(sums), "tonnetz": tonal_centroids(chroma)}
    return {name: row.T for name, row in rows.items()}


def _tones(samples: NDArray[np.floating], level: float, block: slice, tuning: float) -> NDArray[np.float32]:
    """Magnitudes of the constant-Q transform of a block of frames, (252, T_b), as in the whole song's.

    The samples around the block that the filters of the lowest octave reach are transformed with it.
    """
    first = max(0, block.start * _HOP - _CQT_REACH)
    tones = constant_q(scaled(samples[first : block.stop * _HOP + _CQT_REACH], level), _HOP, tuning)
    return tones[:, block.start - first // _HOP : block.stop - first // _HOP]


def _span(samples: NDArray[np.floating], level: float, first: int, stop: int) -> NDArray[np.float32]:
    """Samples `first` … `stop` - 1 relative to a level, with silence before and after the song."""
    return scaled(silent_outside(samples, first, stop), level)


def _timbre_frames(block: NDArray[np.float32], tuning: float) -> dict[str, NDArray[np.floating]]:
    """Features of the short-time spectrum, each (T_b, n), of samples that begin half a window early."""
    spectrum = _spectra(block, _HOP)
    power = spectrum.real**2 + spectrum.imag**2  # (T_b, F)
    gated = np.where(power < _POWER_FLOOR, np.float32(0.0), power)
    amplitude = np.sqrt(gated)
    total = np.maximum(amplitude.sum(axis=1, keepdims=True), np.finfo(np.float32).tiny)
    share, hz = amplitude / total, _bin_hz()
    centroid_hz = share @ hz  # (T_b,)
    bandwidth_hz = np.sqrt((share * np.square(hz - centroid_hz[:, None])).sum(axis=1))
    # Decibels and geometric means of zero are undefined.
    floored = np.maximum(power, _POWER_FLOOR)
    reached = np.cumsum(amplitude, axis=1)
    rows = {
        "chroma": normalised(chroma_filterbank(_WINDOW, tuning, _CHROMA_OCTAVES) @ gated.T, np.inf),
        "mel_db": _mel_db(gated, _COLUMNS["mel_db"]).T,
        "mfcc": scipy.fft.dct(_mel_db(gated, _MFCC_BANDS), axis=1, norm="ortho")[:, : _COLUMNS["mfcc"]].T,
        "centroid_hz": centroid_hz,
        "bandwidth_hz": bandwidth_hz,
        "contrast_db": _contrast_db(np.sqrt(floored)),
        "flatness": np.exp(np.log(floored).mean(axis=1)) / floored.mean(axis=1),
        "rolloff_hz": hz[np.argmax(reached >= _ROLLOFF * reached[:, -1:], axis=1)],
        "zero_crossing_rate": _zero_crossings(block),
    }
    return {name: row.T.reshape(len(power), -1) for name, row in rows.items()}


def _spectra(samples: NDArray[np.float32], hop: int) -> NDArray[np.complex64]:
    """Spectra (T, F) of the whole windows of samples (S,), one every `hop` samples."""
    windows = np.lib.stride_tricks.sliding_window_view(samples, _WINDOW)[::hop]
    spectra: NDArray[np.complex64] = scipy.fft.rfft(windows * hann_window(), axis=1)
    return spectra


@lru_cache(maxsize=1)
def _bin_hz() -> NDArray[np.float64]:
    hz: NDArray[np.float64] = scipy.fft.rfftfreq(_WINDOW, 1 / SAMPLE_RATE_HZ)
    return hz


def _mel_db(power: NDArray[np.float32], n_bands: int) -> NDArray[np.floating]:
    """Power (T, F) in mel bands in decibels, (T, n_bands)."""
    decibels: NDArray[np.floating] = 10 * np.log10(
        np.maximum(power @ mel_filterbank(n_bands).T, _MEL_POWER_FLOOR)
    )
    return decibels


def _contrast_db(amplitude: NDArray[np.float32]) -> NDArray[np.floating]:
    """Difference (T,) in decibels of the loudest and quietest fiftieth of the bins, mean over bands."""
    hz = _bin_hz()
    contrast = np.zeros(len(amplitude))
    bounds_hz = (0.0, *(_CONTRAST_HZ * 2.0**octave for octave in range(_N_CONTRASTS)))
    for band, (low_hz, high_hz) in enumerate(pairwise(bounds_hz)):
        first = max(0, int(np.searchsorted(hz, low_hz)) - 1)
        stop = int(np.searchsorted(hz, high_hz, "right"))
        n_bins = max(1, round(_CONTRAST_SHARE * (stop - first)))
        last = stop if band == _N_CONTRASTS - 1 else stop - 1  # which the next band begins with
        ordered = np.sort(amplitude[:, first:last], axis=1)
        contrast += 10 * np.log10(ordered[:, -n_bins:].mean(axis=1) / ordered[:, :n_bins].mean(axis=1))
    return contrast / _N_CONTRASTS


def _zero_crossings(block: NDArray[np.float32]) -> NDArray[np.floating]:
    """Share of samples at which the sign changes, of each window of samples (S,), (T,)."""
    is_negative = np.signbit(np.where(np.abs(block) <= _CROSSING_FLOOR, 0, block))
    changes = np.concatenate([[0], np.cumsum(is_negative[1:] != is_negative[:-1])])
    starts = np.arange(0, len(block) - _WINDOW + 1, _HOP)
    share: NDArray[np.floating] = (changes[starts + _WINDOW - 1] - changes[starts]) / _WINDOW
    return share


def _tuning(samples: NDArray[np.floating], level: float) -> float:
    """Deviation of the song's A from 440 Hz in semitones, -0.5 to 0.5, or 0 if no pitch is found."""
    n_frames = 1 + max(0, len(samples) - _WINDOW) // _TUNING_HOP
    parts = []  # frequencies and magnitudes of all peaks
    for block in frame_blocks(n_frames, _TUNING_BLOCK_FRAMES):
        span = _span(samples, level, block.start * _TUNING_HOP, (block.stop - 1) * _TUNING_HOP + _WINDOW)
        parts.append(spectral_peaks(np.abs(_spectra(span, _TUNING_HOP)), _WINDOW))
    pitches_hz, magnitudes = (np.concatenate(part) for part in zip(*parts, strict=True))
    if len(pitches_hz) == 0:
        return 0.0
    return tuning_of(pitches_hz[magnitudes >= np.median(magnitudes)])


def _interval_means(
    blocks: Iterable[NDArray[np.floating]], n_frames: int, beats: NDArray[np.float64]
) -> NDArray[np.floating]:
    """Mean of the frames (T, D) centred in each interval [beat, next beat), (Q - 1, D), from blocks of them.

    An empty interval has its first frame.
    """
    bounds = np.ceil(times_to_frames(beats, SAMPLE_RATE_HZ / _HOP) - 1e-6).astype(np.int64)
    starts = np.minimum(bounds[:-1], n_frames - 1)
    stop = max(min(bounds[-1], n_frames), starts[-1] + 1)
    ends = np.maximum(np.append(starts[1:], stop), starts + 1)
    sums, first, done = [], 0, 0  # first frame of `rows`, and number of intervals that are complete
    rows: NDArray[np.floating] = np.zeros((0, 0))
    for block in blocks:
        rows = np.concatenate([rows, block]) if len(rows) else block
        complete = int(np.searchsorted(ends, first + len(rows), "right"))
        if complete > done:
            of_intervals = rows[: ends[complete - 1] - first]
            sums.append(np.add.reduceat(of_intervals, starts[done:complete] - first, axis=0))
            done = complete
        begin = starts[done] if done < len(starts) else stop
        rows, first = rows[max(0, begin - first) :].copy(), max(first, min(begin, first + len(rows)))
    return np.concatenate(sums) / np.maximum(1, np.diff(np.append(starts, stop)))[:, None]


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
