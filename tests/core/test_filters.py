"""Filters against those of scipy, which they replace."""

from __future__ import annotations

import numpy as np
import pytest
import scipy

from choreograph.core.filters import gaussian_filter, logistic, maximum_filter, median_filter

SHAPES = ((1, 2), (7,), (40, 3), (1500, 5, 4))


@pytest.mark.parametrize("mode", ["nearest", "reflect"])
@pytest.mark.parametrize("sigma", [0.4, 3.0, 21.0])
@pytest.mark.parametrize("shape", SHAPES)
def test_means_in_time_are_those_of_scipy(shape, sigma, mode):
    values = np.random.default_rng(0).normal(size=shape)
    theirs = scipy.ndimage.gaussian_filter1d(values, sigma, axis=0, mode=mode)
    np.testing.assert_allclose(gaussian_filter(values, sigma, mode), theirs, rtol=0, atol=1e-15)


@pytest.mark.parametrize("n", [1, 2, 5, 60])
def test_medians_and_maxima_are_those_of_scipy(n):
    values = np.random.default_rng(n).normal(size=n)
    for size in range(1, 10):
        theirs = scipy.ndimage.median_filter(values, size, mode="nearest")
        assert (median_filter(values, size) == theirs).all()
    for size in (1, 3, 9, 31):
        assert (maximum_filter(values, size) == scipy.ndimage.maximum_filter1d(values, size)).all()


def test_the_logistic_function_is_that_of_scipy_and_does_not_overflow():
    values = np.random.default_rng(0).normal(size=(200, 4)) * 20
    np.testing.assert_allclose(logistic(values), scipy.special.expit(values), rtol=1e-15)
    assert logistic(np.array([-1e9, 1e9])) == pytest.approx([0.0, 1.0]) and logistic(0.0) == 0.5
