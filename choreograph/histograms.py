"""Shares of numbered things, and how far two such histograms are apart."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def chi_square_distance(a: Floats, b: Floats) -> Floats:
    """Distance of shares (..., K), broadcasting, from 0 (equal) to 1 (nothing shared).

    ½ Σ_k (a_k - b_k)² / (a_k + b_k), as Rhythm is a Dancer's equation 11 is read; what neither has counts 0.
    """
    a, b = np.asarray(a, np.float64), np.asarray(b, np.float64)
    both = a + b
    return 0.5 * np.sum(np.square(a - b) / np.where(both > 0, both, 1.0), axis=-1)
