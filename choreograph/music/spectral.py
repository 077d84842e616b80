"""Timbre and harmony of music: 87 spectral features per beat interval, by librosa.

The paper's Table 2, row by row (a1 to a4 are the rhythmic features, `music.frame_rhythm`):

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

from itertools import accumulate
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.core.numerics import frame_blocks
from choreograph.core.progress import StepReport, part
from choreograph.core.timebase import SAMPLE_RATE_HZ, times_to_frames
from choreograph.music.beats import checked_beat_times_s
from choreograph.music.mel import at_unit_loudness

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
_CQT_BINS_PER_OCTAVE, _CQT_BINS = 36, 252  # seven octaves from C1
_CQT_MIN_SAMPLES = 1 << 16  # samples. The lowest octave's filters are this long
_CQT_BLOCK_FRAMES = 1 << 15  # 13 minutes, which take 0.3 GB. The last bit may differ at a border of blocks
_TUNING_HOP = 8 * _HOP
_TUNING_BLOCK_FRAMES = 512
# White noise at unit loudness has 768 in every bin of a power spectrum, and 16-bit dither about 1e-4. Below
# this floor a bin is inaudible and must not determine the timbre of a pause.
_POWER_FLOOR = 1e-3
_MEL_POWER_FLOOR = 1e-5
_CQT_FLOOR = 1e-3  # of the song's strongest bin
_CROSSING_FLOOR = 1e-3  # amplitude of a sample


def spectral_features(
    samples: NDArray[np.floating],
    beat_times_s: NDArray[np.floating],
    *,
    report: StepReport | None = None,
) -> NDArray[np.float32]:
    """The 87 spectral features of every interval between two consecutive beats.

    Parameters
    ----------
    samples : float array (S,)        mono at 22.05 kHz, at any gain
    beat_times_s : float array (Q,)   increasing times inside the song: the bounds of the intervals

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
    samples = at_unit_loudness(samples)
    beats = checked_beat_times_s(beat_times_s, len(samples) / SAMPLE_RATE_HZ)
    if len(beats) < 2:
        return np.zeros((0, SPECTRAL_DIM), np.float32)
    tuning = _tuning(samples)
    tonal = _tonal_frames(samples, tuning, part(report, 0, 50, _STEPS))
    frames = np.empty((len(tonal["tonnetz"]), SPECTRAL_DIM))  # (T, 87), frame i centred at i * 512 samples
    for name, rows in tonal.items():
        frames[:, SPECTRAL_COLUMNS[name]] = rows
    timbre_report = part(report, 50, _STEPS, _STEPS)
    for block in frame_blocks(len(frames)):
        first = block.start * _HOP - _WINDOW // 2
        span = _span(samples, first, (block.stop - 1) * _HOP + _WINDOW // 2)
        for name, rows in _timbre_frames(span, tuning).items():
            frames[block, SPECTRAL_COLUMNS[name]] = rows
        if timbre_report is not None:
            timbre_report(block.stop, len(frames))
    return _interval_means(frames, beats).astype(np.float32)


def _tonal_frames(
    samples: NDArray[np.float32], tuning: float, report: StepReport | None
) -> dict[str, NDArray[np.floating]]:
    """Features of the constant-Q transform, each (T, n) with T = 1 + S // 512."""
    from choreograph.music.cached_librosa import librosa

    n_frames = 1 + len(samples) // _HOP
    tones = np.empty((_CQT_BINS, n_frames), np.float32, order="F")  # (252, T)
    for block in frame_blocks(n_frames, _CQT_BLOCK_FRAMES):
        tones[:, block] = _tones(samples, block, tuning)
        if report is not None:
            report(block.stop, n_frames)
    quietest = _CQT_FLOOR * tones.max()
    for block in frame_blocks(n_frames):
        tones[:, block][tones[:, block] < quietest] = 0.0
    chroma = librosa.feature.chroma_cqt(C=tones, bins_per_octave=_CQT_BINS_PER_OCTAVE)  # (12, T)
    cens = librosa.feature.chroma_cens(C=tones, bins_per_octave=_CQT_BINS_PER_OCTAVE)
    rows = {"chroma_cqt": chroma, "chroma_cens": cens, "tonnetz": librosa.feature.tonnetz(chroma=chroma)}
    return {name: row[:, :n_frames].T for name, row in rows.items()}


def _tones(samples: NDArray[np.float32], block: slice, tuning: float) -> NDArray[np.float32]:
    """Magnitudes of the constant-Q transform of a block of frames, (252, T_b), as in the whole song's.

    The samples around the block that the filters of the lowest octave reach are transformed with it.
    """
    from choreograph.music.cached_librosa import librosa

    first = max(0, block.start * _HOP - _CQT_MIN_SAMPLES)
    span = samples[first : block.stop * _HOP + _CQT_MIN_SAMPLES]
    long_enough = np.pad(span, (0, max(0, _CQT_MIN_SAMPLES - len(span))))
    tones = librosa.cqt(
        long_enough, sr=SAMPLE_RATE_HZ, hop_length=_HOP, n_bins=_CQT_BINS,
        bins_per_octave=_CQT_BINS_PER_OCTAVE, tuning=tuning * _CQT_BINS_PER_OCTAVE / 12,
    )  # fmt: skip
    amplitude: NDArray[np.float32] = np.abs(
        tones[:, block.start - first // _HOP : block.stop - first // _HOP]
    )
    return amplitude


def _span(samples: NDArray[np.float32], first: int, stop: int) -> NDArray[np.float32]:
    """Samples `first` … `stop` - 1 of a song, with silence before its first and after its last."""
    inside = samples[max(0, first) : max(0, stop)]
    return np.pad(inside, (max(0, -first), stop - max(0, first) - len(inside)))


def _timbre_frames(block: NDArray[np.float32], tuning: float) -> dict[str, NDArray[np.floating]]:
    """Features of the short-time spectrum, each (T_b, n), of samples that begin half a window early."""
    from choreograph.music.cached_librosa import librosa

    rate: dict[str, Any] = {"sr": SAMPLE_RATE_HZ}
    spectrum = librosa.stft(block, n_fft=_WINDOW, hop_length=_HOP, center=False)  # (F, T_b)
    power = spectrum.real**2 + spectrum.imag**2
    gated = np.where(power < _POWER_FLOOR, np.float32(0.0), power)
    amplitude = np.sqrt(gated)
    at_floor = np.sqrt(np.maximum(power, _POWER_FLOOR))  # decibels of zero are undefined

    def mel_db(n_mels: int) -> NDArray[np.floating]:
        mel = librosa.feature.melspectrogram(S=gated, n_mels=n_mels, **rate)
        decibels: NDArray[np.floating] = librosa.power_to_db(mel, amin=_MEL_POWER_FLOOR, top_db=None)
        return decibels

    centroid = librosa.feature.spectral_centroid(S=amplitude, **rate)
    rows = {
        "chroma": librosa.feature.chroma_stft(S=gated, tuning=tuning, **rate),
        "mel_db": mel_db(_COLUMNS["mel_db"]),
        "mfcc": librosa.feature.mfcc(S=mel_db(128), n_mfcc=_COLUMNS["mfcc"], **rate),
        "centroid_hz": centroid,
        "bandwidth_hz": librosa.feature.spectral_bandwidth(S=amplitude, centroid=centroid, **rate),
        "contrast_db": librosa.feature.spectral_contrast(S=at_floor, **rate).mean(axis=0, keepdims=True),
        "flatness": librosa.feature.spectral_flatness(S=amplitude, amin=_POWER_FLOOR),
        "rolloff_hz": librosa.feature.spectral_rolloff(S=amplitude, **rate),
        "zero_crossing_rate": librosa.feature.zero_crossing_rate(
            block, frame_length=_WINDOW, hop_length=_HOP, center=False, threshold=_CROSSING_FLOOR
        ),
    }
    return {name: row.T for name, row in rows.items()}


def _tuning(samples: NDArray[np.float32]) -> float:
    """Deviation of the song's A from 440 Hz in semitones, -0.5 to 0.5, or 0 if no pitch is found."""
    from choreograph.music.cached_librosa import librosa

    n_frames = 1 + max(0, len(samples) - _WINDOW) // _TUNING_HOP
    pitches, strengths = [], []  # of all frames, where there is a pitch
    for block in frame_blocks(n_frames, _TUNING_BLOCK_FRAMES):
        span = _span(samples, block.start * _TUNING_HOP, (block.stop - 1) * _TUNING_HOP + _WINDOW)
        pitch, strength = librosa.piptrack(
            y=span, sr=SAMPLE_RATE_HZ, n_fft=_WINDOW, hop_length=_TUNING_HOP, center=False
        )  # (F, T_b)
        pitches.append(pitch[pitch > 0])
        strengths.append(strength[pitch > 0])
    pitched, strong = np.concatenate(pitches), np.concatenate(strengths)
    if len(pitched) == 0:
        return 0.0
    return float(librosa.pitch_tuning(pitched[strong >= np.median(strong)]))


def _interval_means(frames: NDArray[np.floating], beats: NDArray[np.float64]) -> NDArray[np.floating]:
    """Mean of the frames (T, D) centred in each interval [beat, next beat), (Q - 1, D)."""
    bounds = np.ceil(times_to_frames(beats, SAMPLE_RATE_HZ / _HOP) - 1e-6).astype(np.int64)
    starts = np.minimum(bounds[:-1], len(frames) - 1)
    stop = max(min(bounds[-1], len(frames)), starts[-1] + 1)
    sums = np.add.reduceat(frames[:stop], starts, axis=0)  # reduceat gives an empty interval its first frame
    return sums / np.maximum(1, np.diff(np.append(starts, stop)))[:, None]
