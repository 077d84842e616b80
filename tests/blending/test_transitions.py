"""Crossfades and decaying offsets: ends, derivatives, and the identity where both sides are equal."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from choreograph.blending.transitions import apply_offset, crossfade, decay_offset, inertial_offsets
from choreograph.motion import rotations as rot


def random_motion(seed: int, n: int, joints: int = 4):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(n, 3)), rot.normalize(rng.normal(size=(n, joints, 4)))


def test_a_crossfade_goes_from_a_to_b():
    a, b = random_motion(0, 100), random_motion(1, 100)
    root, quat = crossfade(*a, *b)
    assert np.allclose(root[0], a[0][0], atol=0.03)
    assert np.allclose(root[-1], b[0][-1], atol=0.03)
    assert np.abs(np.sum(quat[0] * a[1][0], axis=-1)).min() > 0.999
    assert np.abs(np.sum(quat[-1] * b[1][-1], axis=-1)).min() > 0.999
    middle = (root[49] + root[50]) / 2
    assert np.allclose(
        middle, (0.505 * a[0][49] + 0.495 * b[0][49] + 0.495 * a[0][50] + 0.505 * b[0][50]) / 2
    )


def test_a_crossfade_of_the_same_is_the_same():
    a = random_motion(2, 12)
    root, quat = crossfade(*a, *a)
    assert np.allclose(root, a[0])
    assert np.allclose(quat, a[1])


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.05, 2.0))
def test_an_offset_decays_from_itself_to_rest(seed, length_s):
    offset = np.random.default_rng(seed).normal(size=(3, 2))
    h = length_s * 1e-4
    start = decay_offset(offset, np.array([0.0, h, 2 * h]), length_s)
    end = decay_offset(offset, length_s - np.array([2 * h, h, 0.0]), length_s)
    scale = np.abs(offset).max() * max(1.0, length_s) ** 2 / length_s**2
    assert np.allclose(start[0], offset[0])
    slope = (-3 * start[0] + 4 * start[1] - start[2]) / (2 * h)
    assert np.allclose(slope, offset[1], atol=1e-3 * scale * max(1, 1 / length_s))
    bend = (start[2] - 2 * start[1] + start[0]) / h**2
    assert np.allclose(bend, offset[2], atol=5e-2 * scale * max(1, 1 / length_s))
    assert np.allclose(end[2], 0, atol=1e-9)
    assert np.allclose((end[2] - end[0]) / (2 * h), 0, atol=1e-3 * scale)
    assert np.allclose(decay_offset(offset, np.array([length_s * 1.5, length_s * 9]), length_s), 0, atol=1e-9)


def test_a_zero_offset_stays_zero():
    assert np.array_equal(decay_offset(np.zeros((3, 4, 3)), np.linspace(0, 1, 9), 0.5), np.zeros((9, 4, 3)))


def test_offsets_lead_from_b_to_a():
    fps, t = 50.0, np.array([-0.02, 0.0, 0.02])[:, None]
    a_root = 1.0 + 2.0 * t + 1.5 * t**2 + np.zeros((3, 3))
    b_root = -3.0 * t + np.zeros((3, 3))
    axis = np.array([0.0, 1.0, 0.0])
    a_quat = rot.from_rotvec((0.4 + 0.5 * t)[:, None] * axis)
    b_quat = rot.from_rotvec((0.1 - 1.0 * t)[:, None] * axis)
    root, turn = inertial_offsets(a_root, a_quat, b_root, b_quat, fps=fps)
    assert np.allclose(root, np.array([1.0, 5.0, 3.0])[:, None])
    assert np.allclose(turn[:, 0], np.array([0.3, 1.5, 0.0])[:, None] * axis, atol=1e-9)


def test_b_with_its_offset_is_a_at_the_transition():
    a, b = random_motion(5, 3), random_motion(6, 3)
    root, turn = inertial_offsets(*a, *b, fps=60.0)
    at = np.array([0.0])
    met = apply_offset(b[0][1:2], b[1][1:2], decay_offset(root, at, 0.3), decay_offset(turn, at, 0.3))
    assert np.allclose(met[0][0], a[0][1])
    assert np.abs(np.sum(met[1][0] * a[1][1], axis=-1)) == pytest.approx(1.0)
