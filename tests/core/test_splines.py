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


@pytest.mark.parametrize("shape", [(), (3,)])
def test_a_smooth_spline_goes_on_at_the_rates_of_its_ends(shape):
    knots = np.linspace(0.2, 1.2, 21)
    values = np.multiply.outer(np.sin(knots), np.ones(shape))
    spline, at = CubicSpline(knots, values), np.array([-0.3, 0.2, 0.7, 1.2, 1.5])
    wanted = np.sin([0.2, 0.2, 0.7, 1.2, 1.2]) + np.cos([0.2, 0.2, 0.7, 1.2, 1.2]) * [-0.5, 0, 0, 0, 0.3]
    found = spline.continued(at)
    assert found.shape == (5, *shape)
    np.testing.assert_allclose(found, np.multiply.outer(wanted, np.ones(shape)), atol=1e-4)
    assert np.array_equal(found[1:4], spline(at[1:4]))
    assert float(spline.continued(1.5).flat[0]) == found[4].flat[0]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_spline_goes_on_in_the_direction_of_its_end(sign):
    """Beside a corner, its rate at the end has the other sign, or is a multiple of the slope there."""
    steps = np.array([0.5, 2.0, 2.0, 2.0, 1.0, 1.0, 0.1])
    values = sign * np.concatenate([[0.0], np.cumsum(steps)])
    spline = CubicSpline(np.arange(8.0), values)
    assert sign * spline.rate(0.0) < 0.0 and sign * spline.rate(7.0) < 0.0
    np.testing.assert_allclose(sign * spline.continued([-1.0, 8.0]), [-0.25, 8.6 + 0.05])
    fast = CubicSpline(np.arange(5.0), sign * np.array([0.0, 2.0, 2.5, 3.0, 3.5]))
    assert -4.0 < sign * fast.continued(-1.0) == pytest.approx(-sign * fast.rate(0.0))
    swings = CubicSpline(np.arange(5.0), sign * np.array([0.0, 1.0, 1.0, 4.0, 7.0]))
    assert sign * swings.rate(0.0) > 2.0
    assert sign * swings.continued(-1.0) == -2.0
    held = CubicSpline(np.arange(4.0), np.array([1.0, 1.0, 2.0, 3.0]))
    assert held.continued(-1.0) == 1.0


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
