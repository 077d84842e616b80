"""Linear interpolation at fractional frames."""

import numpy as np

from choreograph.core.numerics import interpolate_frames


def test_values_are_linear_between_frames_and_repeat_the_ends_outside():
    np.testing.assert_allclose(interpolate_frames(np.array([1.0, 3.0]), [-1, 0.25, 5]), [1, 1.5, 3])


def test_one_frame_is_repeated():
    np.testing.assert_allclose(interpolate_frames(np.array([2.0]), [0, 1]), [2, 2])


def test_trailing_axes_are_kept():
    values = np.arange(24.0).reshape(4, 3, 2)
    np.testing.assert_allclose(interpolate_frames(values, [0.5, 3.0]), [values[:2].mean(axis=0), values[3]])
