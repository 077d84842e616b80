"""Filters in time and a function as scipy's, to the bit. A dance then does not import `scipy.ndimage`.

That import takes 0.2 s, longer than all filters of a dance.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.core.kernel_cache import njit
from choreograph.core.numerics import Floats, frame_blocks

_LARGEST_EXPONENT = 709.0  # of a finite power of e
_COLUMNS = 12  # that are copied at once, in the order of the filter
_TRUNCATE = 4.0  # standard deviations on either side
_PADDING = {"nearest": "edge", "reflect": "symmetric"}  # of scipy: of NumPy


def gaussian_filter(values: Floats, sigma: float, mode: str = "nearest") -> Floats:
    """Values (T, ...) averaged along the first axis, as by `scipy.ndimage.gaussian_filter1d`.

    `sigma` is in rows. Beyond the ends are the first and last row (`nearest`), or the rows there, mirrored
    (`reflect`).
    """
    reach = reach_of(sigma)
    at = np.arange(-reach, reach + 1)
    weights = np.exp(-0.5 / (sigma * sigma) * at**2)
    weights /= weights.sum()
    rows = np.asarray(values, np.float64).reshape(len(values), -1)  # (T, C)
    filtered = np.empty(rows.shape)
    for part in frame_blocks(rows.shape[1], _COLUMNS):
        columns = rows[:, part].T
        padded = np.pad(columns, ((0, 0), (reach, reach)), _PADDING[mode])  # type: ignore[call-overload]
        of_part = np.empty(columns.shape)
        _filter_columns(np.ascontiguousarray(padded), weights, of_part)
        filtered[:, part] = of_part.T
    return filtered.reshape(values.shape)


def reach_of(sigma: float) -> int:
    """The number of rows to each side that a filtered row depends on."""
    return int(_TRUNCATE * sigma + 0.5)


@njit("void(float64[:,::1], float64[::1], float64[:,::1])", nogil=True)
def _filter_columns(padded: Floats, weights: Floats, filtered: Floats) -> None:  # pragma: no cover - compiled
    """Set all values of `filtered` (C, T), with sums in the order of those of scipy."""
    reach, n = len(weights) // 2, filtered.shape[1]
    for column in range(len(filtered)):
        for begin in range(0, n, 512):  # which remain in the fastest memory
            end = min(n, begin + 512)
            total, middle = filtered[column, begin:end], padded[column, begin + reach : end + reach]
            for t in range(len(total)):
                total[t] = middle[t] * weights[reach]
            for k in range(reach):
                left = padded[column, begin + k : end + k]
                right = padded[column, begin + 2 * reach - k : end + 2 * reach - k]
                for t in range(len(total)):
                    total[t] += (left[t] + right[t]) * weights[k]


def maximum_filter(values: Floats, size: int) -> Floats:
    """The values (T,) of which each is the largest of `size`, an odd number, around it.

    It is `scipy.ndimage.maximum_filter1d`. Beyond the ends are the values there, mirrored.
    """
    padded = np.pad(values, size // 2, "symmetric")
    largest: Floats = np.lib.stride_tricks.sliding_window_view(padded, size).max(axis=1)
    return largest


def logistic(values: Floats | float) -> Floats:
    """1 / (1 + exp(-x)) of values of any shape, as by `scipy.special.expit`."""
    below = np.minimum(-np.asarray(values, np.float64), _LARGEST_EXPONENT)
    powers = np.fromiter(map(math.exp, below.ravel().tolist()), np.float64, below.size)
    return 1.0 / (1.0 + powers.reshape(below.shape))


def median_filter(values: Floats, size: int) -> NDArray[Any]:
    """The values (T,) of which each is the middle one of `size`, as by `scipy.ndimage.median_filter`.

    Beyond the ends are the first and the last value.
    """
    before = size // 2
    padded = np.pad(values, (before, size - 1 - before), "edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, size)
    middle: NDArray[Any] = np.partition(windows, before, axis=1)[:, before]
    return middle
