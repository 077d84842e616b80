"""Banded equations against those of scipy, which they replace."""

from __future__ import annotations

import numpy as np
import pytest
import scipy

from choreograph.core.banded import solve_symmetric, solve_tridiagonal

SIDES = [(), (1,), (3,), (2, 5)]


@pytest.mark.parametrize("columns", SIDES)
@pytest.mark.parametrize(("n_bands", "n"), [(1, 1), (1, 9), (2, 7), (4, 4), (4, 5), (4, 400)])
def test_a_symmetric_system_has_the_solution_of_scipy(n_bands, n, columns):
    rng = np.random.default_rng(n)
    bands, right = rng.normal(size=(n_bands, n)), rng.normal(size=(n, *columns))
    bands[0] = 4.0 * n_bands + rng.uniform(size=n)
    known = bands.copy(), right.copy()
    theirs = scipy.linalg.solveh_banded(bands, right.reshape(n, -1), lower=True).reshape(right.shape)
    np.testing.assert_allclose(solve_symmetric(bands, right), theirs, rtol=1e-13, atol=1e-15)
    assert (bands == known[0]).all() and (right == known[1]).all()


@pytest.mark.parametrize("columns", SIDES)
@pytest.mark.parametrize("n", [2, 3, 4, 9, 400])
@pytest.mark.parametrize("kind", ["dominant", "any"])
def test_a_system_of_three_diagonals_has_the_bits_of_scipy(n, columns, kind):
    rng = np.random.default_rng(n)
    bands, right = rng.normal(size=(3, n)), rng.normal(size=(n, *columns))
    if kind == "dominant":
        bands[1] += 4.0
    known = bands.copy(), right.copy()
    theirs = scipy.linalg.solve_banded((1, 1), bands, right.reshape(n, -1)).reshape(right.shape)
    np.testing.assert_array_equal(solve_tridiagonal(bands, right), theirs)
    assert (bands == known[0]).all() and (right == known[1]).all()
