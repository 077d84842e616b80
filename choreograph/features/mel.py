"""Log-mel spectrogram at exactly 60 fps.

At 22.05 kHz a frame is 367.5 samples, so there is no whole hop: frame i is centred on the sample
nearest to i / 60 s, at most half a sample (23 µs) off throughout the song. A hop of 367 or 368 would
drift by a frame every 12 s.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from choreograph.errors import ParameterError
from choreograph.progress import StepReport
from choreograph.timebase import MUSIC_FPS, SAMPLE_RATE_HZ, seconds_to_frames

MEL_BANDS = 96
MEL_WINDOW = 2048  # samples, 93 ms
_POWER_FLOOR = 1e-6  # about 99 dB below a full-scale sine: quieter than 16-bit dither
_BLOCK_FRAMES = 2048


def log_mel(samples: NDArray[np.floating], *, report: StepReport | None = None) -> NDArray[np.float32]:
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
    padded = np.pad(samples, (MEL_WINDOW // 2, MEL_WINDOW // 2 + SAMPLE_RATE_HZ // MUSIC_FPS))
    windows = np.lib.stride_tricks.sliding_window_view(padded, MEL_WINDOW)
    out = np.empty((n_frames, MEL_BANDS), np.float32)
    for start in range(0, n_frames, _BLOCK_FRAMES):
        block = slice(start, start + _BLOCK_FRAMES)
        out[block] = log_mel_of_windows(windows[centres[block]])
        if report is not None:
            report(min(block.stop, n_frames), n_frames)
    return out


def log_mel_of_windows(windows: NDArray[np.float32]) -> NDArray[np.float32]:
    """`log_mel` (T, 96) of the `MEL_WINDOW` samples around each frame, (T, W)."""
    spectrum = fft.rfft(windows * _hann(), axis=1)  # (T, F)
    power = spectrum.real**2 + spectrum.imag**2
    return np.log(np.maximum(power @ mel_filterbank().T, _POWER_FLOOR))


@lru_cache(maxsize=1)
def _hann() -> NDArray[np.float32]:
    return np.hanning(MEL_WINDOW + 1)[:-1].astype(np.float32)


@lru_cache(maxsize=1)
def mel_filterbank() -> NDArray[np.float32]:
    """Triangular filters (96, 1025) from 0 Hz to half the sample rate, each of unit area per Hz."""
    from choreograph.cached_librosa import librosa  # a second to import

    # Rounded to float32 once, at the end: librosa's default rounds before it normalises the area, too.
    filters = librosa.filters.mel(
        sr=SAMPLE_RATE_HZ, n_fft=MEL_WINDOW, n_mels=MEL_BANDS, norm="slaney", dtype=np.float64
    )
    return filters.astype(np.float32)


@lru_cache(maxsize=1)
def mel_band_hz() -> NDArray[np.float64]:
    """Centre frequencies of the bands in Hz, (96,)."""
    from choreograph.cached_librosa import librosa

    return librosa.mel_frequencies(MEL_BANDS + 2, fmin=0.0, fmax=SAMPLE_RATE_HZ / 2)[1:-1]
