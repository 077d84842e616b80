"""Laws of interpolation at fractional frames and of continued splines, and of smooth sampling of motions."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_motions import stepping, swaying

from choreograph.core.numerics import continued_spline, frame_weights, interpolate_frames

laws = settings(max_examples=60, deadline=None)
lengths = st.integers(1, 12)
trailing = st.sampled_from([(), (3,), (2, 4)])
seeds = st.integers(0, 2**32 - 1)


def curve(seed: int, n_frames: int, shape: tuple[int, ...] = ()) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(n_frames, *shape))


@laws
@given(seeds, lengths, trailing)
def test_at_whole_frames_the_values_come_back_exactly(seed, n_frames, shape):
    values = curve(seed, n_frames, shape)
    assert np.array_equal(interpolate_frames(values, np.arange(n_frames, dtype=float)), values)


@laws
@given(seeds, lengths, trailing, st.lists(st.floats(-20, 20), min_size=1, max_size=9))
def test_it_agrees_with_numpys_interp(seed, n_frames, shape, frames):
    values = curve(seed, n_frames, shape)
    ours = interpolate_frames(values, np.array(frames)).reshape(len(frames), -1)
    columns = values.reshape(n_frames, -1).T
    theirs = np.stack([np.interp(frames, np.arange(n_frames), column) for column in columns], axis=1)
    np.testing.assert_allclose(ours, theirs, atol=1e-12)


@laws
@given(seeds, lengths, st.sampled_from([(), (1,), (5,), (2, 3)]), trailing)
def test_any_leading_and_trailing_dimensions(seed, n_frames, leading, shape):
    values = curve(seed, n_frames, shape)
    frames = np.random.default_rng(seed).uniform(-2, n_frames + 2, leading)
    ours = interpolate_frames(values, frames)
    assert ours.shape == (*leading, *shape)
    one_by_one = [interpolate_frames(values, np.array([frame]))[0] for frame in frames.ravel()]
    assert np.array_equal(ours.reshape(-1, *shape), np.stack(one_by_one))


@laws
@given(lengths, st.floats(-20, 20), st.floats(-3, 3), st.floats(-3, 3))
def test_straight_lines_are_kept(n_frames, frame, slope, start):
    line = start + slope * np.arange(n_frames)
    inside = np.clip(frame, 0, n_frames - 1)
    assert interpolate_frames(line, np.array(frame)) == pytest.approx(start + slope * inside, abs=1e-9)


@laws
@given(st.integers(1, 10**6), st.floats(allow_nan=False))
def test_weights_lie_between_neighbours_inside_the_range(n_frames, frame):
    low, high, weight = frame_weights(np.array(frame), n_frames)
    assert 0 <= low <= high <= n_frames - 1
    assert high - low == (n_frames > 1)
    assert 0.0 <= weight <= 1.0
    assert low + weight == np.clip(frame, 0, n_frames - 1)


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.int64])
def test_the_result_is_double_precision(dtype):
    values = np.arange(5).astype(dtype)
    assert interpolate_frames(values, np.array([0.5, 3.25], np.float32)).dtype == np.float64


def test_a_smooth_spline_goes_on_at_the_rates_of_its_ends():
    knots = np.linspace(0.2, 1.2, 21)
    at = np.array([-0.3, 0.2, 0.7, 1.2, 1.5])
    wanted = np.sin([0.2, 0.2, 0.7, 1.2, 1.2]) + np.cos([0.2, 0.2, 0.7, 1.2, 1.2]) * [-0.5, 0, 0, 0, 0.3]
    found = continued_spline(knots, np.sin(knots), at)
    np.testing.assert_allclose(found, wanted, atol=1e-4)
    assert float(continued_spline(knots, np.sin(knots), 1.5)) == found[4]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_spline_goes_on_in_the_direction_of_its_end(sign):
    """Beside a corner, its rate at the end has the other sign, or is a multiple of the slope there."""
    steps = np.array([0.5, 2.0, 2.0, 2.0, 1.0, 1.0, 0.1])
    values = sign * np.concatenate([[0.0], np.cumsum(steps)])
    found = continued_spline(np.arange(8.0), values, np.array([-1.0, 8.0]))
    np.testing.assert_allclose(sign * found, [-0.25, 8.6 + 0.05])
    swings = sign * np.array([0.0, 1.0, 1.0, 4.0, 7.0])
    assert sign * continued_spline(np.arange(5.0), swings, -1.0) == -2.0
    held = np.array([1.0, 1.0, 2.0, 3.0])
    assert continued_spline(np.arange(4.0), held, -1.0) == 1.0


@pytest.mark.parametrize("n_knots", [2, 3])
def test_few_knots_have_a_line_or_a_parabola(n_knots):
    knots = np.arange(float(n_knots))
    np.testing.assert_allclose(
        continued_spline(knots, 2.0 * knots, np.array([-1.0, 0.5, 4.0])), [-2.0, 1.0, 8.0]
    )


def test_smooth_sampling_at_whole_frames_is_the_motion():
    motion = swaying(20)
    same = motion.sampled_smooth(np.arange(20.0))
    np.testing.assert_allclose(same.root_pos_m, motion.root_pos_m, atol=1e-12)
    np.testing.assert_allclose(same.local_quat, motion.local_quat, atol=1e-9)


def test_smooth_sampling_restores_missing_frames_better_than_slerp():
    fine, coarse = stepping(120, fps=60.0), stepping(60, fps=30.0)
    frames = np.arange(8, 100) / 2
    truth = fine.local_quat[8:100]
    smooth = np.abs(coarse.sampled_smooth(frames, fps=60.0).local_quat - truth).max()
    linear = np.abs(coarse.sampled(frames, fps=60.0).local_quat - truth).max()
    assert smooth < 0.1 * linear


@pytest.mark.parametrize("n_frames", [1, 2, 3, 10])
def test_outside_the_range_smooth_sampling_repeats_the_end_poses(n_frames):
    motion = swaying(n_frames)
    clamped = motion.sampled_smooth(np.array([-3.0, n_frames + 5.0]), fps=12.0)
    assert clamped.fps == 12.0
    np.testing.assert_allclose(clamped.root_pos_m, motion.root_pos_m[[0, -1]])
    np.testing.assert_allclose(np.linalg.norm(clamped.local_quat, axis=-1), 1.0)
