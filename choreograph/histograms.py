"""Distance between normalised histograms."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def chi_square_distance(a: Floats, b: Floats) -> Floats:
    """Chi-square distance of histograms (..., K) that sum to 1, from 0 (equal) to 1 (disjoint); broadcasts.

    ½ Σ_k (a_k - b_k)² / (a_k + b_k), our reading of Rhythm is a Dancer, equation 11. Bins empty in both add
    nothing.
    """
    a, b = np.asarray(a, np.float64), np.asarray(b, np.float64)
    both = a + b
    return 0.5 * np.sum(np.square(a - b) / np.where(both > 0, both, 1.0), axis=-1)
