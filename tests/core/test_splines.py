"""Cubic interpolation against scipy's, to the bit."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline as ScipySpline
from scipy.interpolate import PchipInterpolator

from choreograph.core.splines import CubicSpline, monotone_cubic


def _points(rng, n_knots, shape):
    knots = np.cumsum(rng.uniform(0.01, 2.0, n_knots)) - 1.0
    values = rng.normal(size=(n_knots, *shape))
    inside = rng.uniform(knots[0], knots[-1], 50)
    return knots, values, np.concatenate([knots, inside, [knots[0] - 0.7, knots[-1] + 0.4]])


@pytest.mark.parametrize("n_knots", [2, 3, 4, 5, 21, 200])
@pytest.mark.parametrize("shape", [(), (3,)])
def test_a_spline_has_the_bits_of_scipys(n_knots, shape):
    rng = np.random.default_rng(n_knots)
    for _ in range(20):
        knots, values, at = _points(rng, n_knots, shape)
        ours, theirs = CubicSpline(knots, values), ScipySpline(knots, values)
        np.testing.assert_array_equal(ours(at), theirs(at))
        np.testing.assert_array_equal(ours.rate(at), theirs(at, 1))
        assert float(ours(at[0]).flat[0]) == float(theirs(at[0]).flat[0])


@pytest.mark.parametrize("n_knots", [2, 3, 4, 21, 200])
@pytest.mark.parametrize("shape", [(), (3,)])
@pytest.mark.parametrize("kind", ["random", "rising", "with plateaus"])
def test_a_monotone_curve_has_the_bits_of_scipys(n_knots, shape, kind):
    rng = np.random.default_rng(n_knots)
    for _ in range(20):
        knots, values, at = _points(rng, n_knots, shape)
        if kind != "random":
            values = np.cumsum(np.abs(values), axis=0)
        if kind == "with plateaus":
            values = np.floor(values)
        np.testing.assert_array_equal(monotone_cubic(knots, values, at), PchipInterpolator(knots, values)(at))


def test_a_monotone_curve_of_rising_values_rises():
    knots = np.arange(6.0)
    curve = monotone_cubic(knots, [0.0, 0.1, 0.1, 5.0, 5.1, 9.0], np.linspace(0.0, 5.0, 501))
    assert (np.diff(curve) >= 0).all()
    assert (curve[100:201] == 0.1).all()
