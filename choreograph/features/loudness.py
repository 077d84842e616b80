"""Loudness normalisation, so that features do not depend on how loud a song was saved."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.audio.song import SILENCE_PEAK
from choreograph.errors import ParameterError
from choreograph.frame_blocks import frame_blocks

_BLOCK = 735  # samples, 1/30 s: the unit that is gated as sound or pause
_AT_ONCE = 1 << 20  # samples scaled in double precision
PAUSE_GATE = 1e-6  # of the loudest block's power (-60 dB): quieter blocks are pauses and do not count


def at_unit_loudness(samples: NDArray[np.floating]) -> NDArray[np.float32]:
    """Samples (S,) scaled to a root mean square of 1 outside pauses (0 dB, like the paper's songs).

    Silence before or after a song changes nothing. A silent song (peak below
    -80 dB) becomes zeros. Raises `ParameterError` if `samples` is empty, not one-dimensional or not
    finite. (Rhythm is a Dancer, section 5: RMS normalisation; there pauses count too.)
    """
    samples = np.asarray(samples, np.float32)
    if samples.ndim != 1 or len(samples) == 0:
        raise ParameterError(f"expected mono samples (S,), got an array of shape {samples.shape}")
    peak = float(np.abs(samples).max())
    if not np.isfinite(peak):
        raise ParameterError("expected finite samples, got NaN or infinity: a decoder or an effect failed")
    if peak < SILENCE_PEAK:
        return np.zeros_like(samples)
    starts = np.arange(0, len(samples), _BLOCK)
    energy = np.empty(len(starts))  # (B,)
    for part in frame_blocks(len(starts)):
        sound = samples[starts[part.start] : part.stop * _BLOCK]
        energy[part] = np.add.reduceat(
            np.square(sound / peak, dtype=np.float64), starts[part] - starts[part.start]
        )
    size = np.diff(starts, append=len(samples))
    is_sound = energy > PAUSE_GATE * size * (energy / size).max()
    level = peak * np.sqrt(energy[is_sound].sum() / size[is_sound].sum())
    out = np.empty_like(samples)
    for part in frame_blocks(len(samples), _AT_ONCE):
        out[part] = samples[part] / level
    return out
