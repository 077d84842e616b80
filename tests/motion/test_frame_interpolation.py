"""Linear and cubic interpolation at fractional frames."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from choreograph.core.numerics import interpolate_frames
from choreograph.motion.motion import _spline_frames


def test_values_are_linear_between_frames_and_repeat_the_ends_outside():
    np.testing.assert_allclose(interpolate_frames(np.array([1.0, 3.0]), [-1, 0.25, 5]), [1, 1.5, 3])


def test_one_frame_is_repeated():
    np.testing.assert_allclose(interpolate_frames(np.array([2.0]), [0, 1]), [2, 2])


def test_trailing_axes_are_kept():
    values = np.arange(24.0).reshape(4, 3, 2)
    np.testing.assert_allclose(interpolate_frames(values, [0.5, 3.0]), [values[:2].mean(axis=0), values[3]])


@pytest.mark.parametrize("n_frames", [4, 5, 6, 300])
def test_splines_are_those_of_scipy_to_the_last_bit(n_frames):
    rng = np.random.default_rng(n_frames)
    values = rng.normal(size=(n_frames, 3, 4))
    frames = np.sort(np.concatenate([rng.uniform(0, n_frames - 1, 50), np.arange(n_frames)]))
    expected = CubicSpline(np.arange(n_frames), values)(frames)
    np.testing.assert_array_equal(_spline_frames(values, frames), expected)
