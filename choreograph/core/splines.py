"""Cubic interpolation as scipy's, to the bit. A dance then does not import `scipy.interpolate`.

That module imports `scipy.optimize` and `scipy.sparse`, and takes longer than all splines of a dance.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from choreograph.core.banded import solve_tridiagonal
from choreograph.core.numerics import Floats


class CubicSpline:
    """A cubic spline through `values` (N, ...) at increasing `knots` (N,), N of 2 or more.

    It is scipy's `CubicSpline`: the first three knots have one cubic, and the last three have one. Three
    knots have a parabola, and two a line.
    """

    def __init__(self, knots: Floats | Sequence[float], values: Floats | Sequence[float]) -> None:
        x, y = np.asarray(knots, np.float64), np.asarray(values, np.float64)
        self._knots, self._coefficients = x, _hermite_coefficients(x, y, _spline_rates(x, y))
        self._end_slopes = (y[1] - y[0]) / (x[1] - x[0]), (y[-1] - y[-2]) / (x[-1] - x[-2])

    def __call__(self, at: Floats | float) -> Floats:
        """The values (M, ...) at points (M,)."""
        return _evaluated(self._knots, self._coefficients, at)

    def rate(self, at: Floats | float) -> Floats:
        """The derivatives (M, ...) at points (M,)."""
        return _evaluated(self._knots, self._coefficients[:-1], at, (1.0, 2.0, 3.0))

    def continued(self, at: Floats | float) -> Floats:
        """The values (M, ...) at points (M,). Beyond the ends, they go on at the rate of the end.

        That rate is between half and double the slope from an end to the next knot. After a corner beside the
        end, that of the spline may even have the other sign.
        """
        points, first, last = np.asarray(at, np.float64), self._knots[0], self._knots[-1]
        values = self(np.clip(points, first, last))
        beyond = np.minimum(points - first, 0.0), np.maximum(points - last, 0.0)
        for end, past, slope in zip((first, last), beyond, self._end_slopes, strict=True):
            least, most = np.sort([0.5 * slope, 2.0 * slope], axis=0)
            rate = np.clip(self.rate(end), least, most)
            values += np.reshape(past, (*points.shape, *[1] * rate.ndim)) * rate
        return values


def monotone_cubic(
    knots: Floats | Sequence[float], values: Floats | Sequence[float], at: Floats | float
) -> Floats:
    """Values (M, ...) at points (M,) of the curve through `values` (N, ...) at increasing `knots` (N,).

    Between two knots the curve does not leave the range of their values. It is scipy's `PchipInterpolator`,
    of Fritsch and Butland, A method for constructing local monotone piecewise cubic interpolants (1984).
    """
    x, y = np.asarray(knots, np.float64), np.asarray(values, np.float64)
    return _evaluated(x, _hermite_coefficients(x, y, _monotone_rates(x, y)), at)


def _spline_rates(x: Floats, y: Floats) -> Floats:
    """The derivatives (N, ...) at the knots, for which the second derivative is continuous."""
    step = np.diff(x)
    wide = step.reshape(-1, *[1] * (y.ndim - 1))
    slope = np.diff(y, axis=0) / wide
    if len(x) == 2:
        return np.concatenate([slope, slope])
    bands, right = np.zeros((3, len(x))), np.empty(y.shape)
    bands[1, 1:-1] = 2 * (step[:-1] + step[1:])
    bands[0, 2:], bands[2, :-2] = step[:-1], step[1:]
    right[1:-1] = 3 * (wide[1:] * slope[:-1] + wide[:-1] * slope[1:])
    if len(x) == 3:
        right[0], right[-1] = 2 * slope[0], 2 * slope[-1]
        equations = np.array([[1.0, 1.0, 0.0], [step[1], bands[1, 1], step[0]], [0.0, 1.0, 1.0]])
        solution: Floats = np.linalg.solve(equations, right.reshape(3, -1))
        return solution.reshape(right.shape)
    first, last = x[2] - x[0], x[-1] - x[-3]
    bands[1, 0], bands[0, 1] = step[1], first
    bands[1, -1], bands[2, -2] = step[-2], last
    right[0] = ((wide[0] + 2 * first) * wide[1] * slope[0] + wide[0] ** 2 * slope[1]) / first
    right[-1] = (wide[-1] ** 2 * slope[-2] + (2 * last + wide[-1]) * wide[-2] * slope[-1]) / last
    return solve_tridiagonal(bands, right)


def _monotone_rates(x: Floats, y: Floats) -> Floats:
    """The derivatives (N, ...) at the knots: 0 at local extremes, else weighted harmonic means of slopes."""
    step = np.diff(x).reshape(-1, *[1] * (y.ndim - 1))
    slope = np.diff(y, axis=0) / step
    rates = np.zeros(y.shape)
    if len(x) == 2:
        rates[:] = slope
        return rates
    sign = np.sign(slope)
    extreme = (sign[1:] != sign[:-1]) | (slope[1:] == 0) | (slope[:-1] == 0)
    after, before = 2 * step[1:] + step[:-1], step[1:] + 2 * step[:-1]
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = 1.0 / ((after / slope[:-1] + before / slope[1:]) / (after + before))
    rates[1:-1] = np.where(extreme, 0.0, mean)
    rates[0] = _monotone_end(step[0], step[1], slope[0], slope[1])
    rates[-1] = _monotone_end(step[-1], step[-2], slope[-1], slope[-2])
    return rates


def _monotone_end(step: Floats, next_step: Floats, slope: Floats, next_slope: Floats) -> Floats:
    """The derivative (...) at an end: that of three points, changed so that the curve stays monotone."""
    rate = ((2 * step + next_step) * slope - step * next_slope) / (step + next_step)
    too_steep = (np.sign(slope) != np.sign(next_slope)) & (np.abs(rate) > 3.0 * np.abs(slope))
    kept: Floats = np.where(np.sign(rate) != np.sign(slope), 0.0, np.where(too_steep, 3.0 * slope, rate))
    return kept


def _hermite_coefficients(x: Floats, y: Floats, rates: Floats) -> Floats:
    """Coefficients (4, N - 1, ...) of the cubics, the highest first, from values and derivatives."""
    step = np.diff(x).reshape(-1, *[1] * (y.ndim - 1))
    slope = np.diff(y, axis=0) / step
    bend = (rates[:-1] + rates[1:] - 2 * slope) / step
    return np.stack([bend / step, (slope - rates[:-1]) / step - bend, rates[:-1], y[:-1]])


def _evaluated(
    knots: Floats, coefficients: Floats, at: Floats | float, factors: Sequence[float] = (1.0,) * 4
) -> Floats:
    """Values (M, ...) of piecewise polynomials at points (M,). Beyond the ends, the last ones continue.

    The terms are multiplied by `factors`, the lowest power first.
    """
    points = np.asarray(at, np.float64)
    index = np.clip(np.searchsorted(knots, points, side="right") - 1, 0, len(knots) - 2)
    past = np.reshape(points - knots[index], (*points.shape, *[1] * (coefficients.ndim - 2)))
    total, power = 0.0 + coefficients[-1][index], past
    for of_power, factor in zip(coefficients[-2::-1], factors[1:], strict=True):
        total = total + of_power[index] * power * factor
        power = power * past
    values: Floats = total
    return values
