"""A song brought to one loudness, so that what is heard in it does not depend on how loud it was saved."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import ParameterError

_BLOCK = 735  # samples, 1/30 s: what is judged to sound or to be a pause
_GATE = 1e-6  # of the loudest block's power (-60 dB): quieter is a pause, and no part of the loudness
_SILENCE = 1e-4  # peak amplitude (-80 dB) under which there is nothing to make louder


def at_unit_loudness(samples: NDArray[np.floating]) -> NDArray[np.float32]:
    """Samples (S,) scaled to a root mean square of 1 where the song sounds (0 dB, as the paper's songs).

    Pauses do not count, so silence before or after a song changes nothing. A silent song (peak below
    -80 dB) becomes zeros. Raises `ParameterError` if `samples` is empty, not one-dimensional or not
    finite. (Rhythm is a Dancer, section 5: RMS normalisation; it counts the pauses in.)
    """
    samples = np.asarray(samples, np.float32)
    if samples.ndim != 1 or len(samples) == 0:
        raise ParameterError(f"expected mono samples (S,), got an array of shape {samples.shape}")
    peak = float(np.abs(samples).max())
    if not np.isfinite(peak):
        raise ParameterError("expected finite samples, got NaN or infinity: a decoder or an effect failed")
    if peak < _SILENCE:
        return np.zeros_like(samples)
    starts = np.arange(0, len(samples), _BLOCK)
    energy = np.add.reduceat(np.square(samples / peak, dtype=np.float64), starts)  # (B,)
    size = np.diff(starts, append=len(samples))
    sounds = energy > _GATE * size * (energy / size).max()
    level = peak * np.sqrt(energy[sounds].sum() / size[sounds].sum())
    return (samples / level).astype(np.float32)
