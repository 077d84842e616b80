"""Banded linear equations as scipy's, to the bit. A dance then does not import `scipy.linalg`.

That import takes 0.1 s, longer than all equations of a dance.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba.core import types
from numba.extending import intrinsic

from choreograph.core.kernel_cache import njit
from choreograph.core.numerics import Floats


def solve_symmetric(bands: Floats, right: Floats) -> Floats:
    """The solution (N, ...) of equations with a positive definite matrix and the right side (N, ...).

    Row i of `bands` (K, N) is the i-th diagonal below the main one, from its first column on. This is
    `scipy.linalg.solveh_banded(bands, right, lower=True)`.
    """
    solution = right.reshape(len(right), -1).astype(np.float64)
    _solve_symmetric(np.array(bands, np.float64, order="C"), solution)
    return solution.reshape(right.shape)


def solve_tridiagonal(bands: Floats, right: Floats) -> Floats:
    """The solution (N, ...) of equations with a matrix of three diagonals and the right side (N, ...).

    The rows of `bands` (3, N) are the diagonal above the main one, from its second column on, the main one,
    and the one below it. This is `scipy.linalg.solve_banded((1, 1), bands, right)`.
    """
    solution = right.reshape(len(right), -1).astype(np.float64)
    above, middle, below = (np.array(band, np.float64) for band in bands)
    _solve_tridiagonal(np.append(above[1:], 0.0), middle, below, solution)
    return solution.reshape(right.shape)


def _fused(_context: Any, _a: Any, _b: Any, _c: Any) -> Any:
    """The type and the code of `_fma`."""

    def code(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.fma(*arguments)

    return types.float64(types.float64, types.float64, types.float64), code


_fma: Any = intrinsic(_fused)  # a b + c, rounded once, as by the library that scipy uses


@njit("void(float64[:,::1], float64[:,::1])", nogil=True)
def _solve_symmetric(factor: Floats, x: Floats) -> None:  # pragma: no cover - compiled
    """Change the right side `x` (N, C) to the solution, and bands (K, N) to their Cholesky factor."""
    n_bands, n = factor.shape
    n_columns = x.shape[1]
    for j in range(n):
        n_below = min(n_bands, n - j)
        factor[0, j] = math.sqrt(factor[0, j])
        for i in range(1, n_below):
            factor[i, j] *= 1.0 / factor[0, j]
        for column in range(1, n_below):
            for row in range(column, n_below):
                entry = factor[row - column, j + column]
                factor[row - column, j + column] = _fma(factor[row, j], -factor[column, j], entry)
    for j in range(n):
        for c in range(n_columns):
            x[j, c] /= factor[0, j]
        for i in range(1, min(n_bands, n - j)):
            for c in range(n_columns):
                x[j + i, c] = _fma(factor[i, j], -x[j, c], x[j + i, c])
    for j in range(n - 1, -1, -1):
        for c in range(n_columns):
            known = 0.0
            for i in range(1, min(n_bands, n - j)):
                known = _fma(factor[i, j], x[j + i, c], known)
            x[j, c] = (x[j, c] - known) / factor[0, j]


@njit("void(float64[::1], float64[::1], float64[::1], float64[:,::1])", nogil=True)
def _solve_tridiagonal(
    above: Floats, middle: Floats, below: Floats, x: Floats
) -> None:  # pragma: no cover - compiled
    """Change the right side `x` (N, C) to the solution by elimination with exchanged rows. Bands (N,) change.

    `below` becomes the second diagonal above the main one, which an exchange of rows fills.
    """
    n, n_columns = x.shape
    for i in range(n - 1):
        if abs(middle[i]) >= abs(below[i]):
            factor = below[i] / middle[i]
            middle[i + 1] -= factor * above[i]
            for c in range(n_columns):
                x[i + 1, c] -= factor * x[i, c]
            below[i] = 0.0
            continue
        factor = middle[i] / below[i]
        middle[i], above[i], middle[i + 1] = below[i], middle[i + 1], above[i] - factor * middle[i + 1]
        below[i] = above[i + 1]
        above[i + 1] = -factor * below[i]
        for c in range(n_columns):
            x[i, c], x[i + 1, c] = x[i + 1, c], x[i, c] - factor * x[i + 1, c]
    for i in range(n - 1, -1, -1):
        for c in range(n_columns):
            if i < n - 1:
                x[i, c] -= above[i] * x[i + 1, c]
            if i < n - 2:
                x[i, c] -= below[i] * x[i + 2, c]
            x[i, c] /= middle[i]
