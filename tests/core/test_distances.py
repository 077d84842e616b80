"""Pairwise distances by a matrix product, against scipy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from choreograph.core.numerics import squared_distances


@pytest.mark.parametrize(("dtype", "tolerance"), [(np.float32, 1e-5), (np.float64, 1e-13)])
def test_distances_are_scipys(dtype, tolerance):
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(7, 32)).astype(dtype), rng.normal(size=(11, 32)).astype(dtype)
    found = squared_distances(a, b)
    assert found.dtype == dtype
    np.testing.assert_allclose(found, cdist(a, b, "sqeuclidean"), rtol=tolerance)
    np.testing.assert_array_equal(squared_distances(a[:0], b), np.zeros((0, 11)))


def test_distances_are_never_below_zero():
    a = 1e3 + np.random.default_rng(1).normal(size=(50, 8)).astype(np.float32)
    found = squared_distances(a, a)
    assert found.min() >= 0
    assert np.diagonal(found).max() < 1e-6 * np.sum(a**2, axis=1).max()
