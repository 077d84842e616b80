"""Linear interpolation at fractional frames."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating]
Indices = NDArray[np.int64]


def frame_weights(frames: Floats, n_frames: int) -> tuple[Indices, Indices, NDArray[np.float64]]:
    """Indices of the frames before and after fractional `frames` (...), and the weight of the latter.

    Each has the shape of `frames`, which is clamped to 0 … `n_frames` - 1.
    """
    inside: NDArray[np.float64] = np.clip(np.asarray(frames, np.float64), 0.0, n_frames - 1)
    low: Indices = np.minimum(inside.astype(np.int64), max(n_frames - 2, 0))
    high: Indices = np.minimum(low + 1, n_frames - 1)
    return low, high, inside - low


def interpolate_frames(values: Floats, frames: Floats) -> NDArray[np.float64]:
    """`values` (T, ...) at fractional `frames` (F...), clamped to the first and last: (F..., ...)."""
    low, high, weight = frame_weights(frames, len(values))
    weight = weight.reshape((*weight.shape, *[1] * (values.ndim - 1)))
    return values[low] * (1 - weight) + values[high] * weight
