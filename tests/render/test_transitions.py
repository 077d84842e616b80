"""Crossfades and decaying offsets: ends, derivatives, and the identity where both sides are equal."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from choreograph.motion import rotations as rot
from choreograph.motion.skeleton import Skeleton
from choreograph.plan.joins import SampledRun
from choreograph.render.assembly import (
    apply_offset,
    blend_transition,
    crossfade,
    decay_offset,
    decay_rate,
    inertial_offsets,
)


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


FPS = 1000.0  # so that steps from frame to frame are velocities
JOIN, LENGTH = 1000, 2000  # frames: the second run takes over in the middle of 2 s
SINCE_S = (np.arange(LENGTH) - JOIN) / FPS
HINGE = np.array([1.0, 0.0, 0.0])


def sampled(root, quat, start: int, stop: int, *, locked: bool = False) -> SampledRun:
    """A run with a row for every frame of the dance."""
    skeleton = Skeleton(("hips", "knee"), np.array([-1, 0]), np.array([[0.0, 1, 0], [0, -0.5, 0]]))
    return SampledRun(skeleton, FPS, 0, start, stop, root, quat, locked, 0.4)


def joined(a, b, *, locked=(False, False)) -> tuple[np.ndarray, np.ndarray]:
    """Roots and rotations of the dance of two motions, each a root (T, 3) and rotations (T, J, 4)."""
    root, quat = (np.concatenate([one[:JOIN], other[JOIN:]]) for one, other in zip(a, b, strict=True))
    runs = sampled(*a, 0, JOIN, locked=locked[0]), sampled(*b, JOIN, LENGTH, locked=locked[1])
    blend_transition(*runs, "inertial", FPS, root, quat)
    return root, quat


def bent(angle_rad) -> tuple[np.ndarray, np.ndarray]:
    """A body at rest but for its knee, bent by (T,) radians."""
    quat = np.zeros((LENGTH, 2, 4))
    quat[:, 0, 0] = 1.0
    quat[:, 1] = rot.from_rotvec(np.asarray(angle_rad)[:, None] * HINGE)
    return np.zeros((LENGTH, 3)), quat


def smooth_motion(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A motion that turns and moves fast about any axes."""
    rng = np.random.default_rng(seed)
    powers = np.stack([np.ones(LENGTH), SINCE_S, SINCE_S**2], axis=1)
    root = powers @ (rng.normal(size=(3, 3)) * [[1.0], [2.0], [5.0]])
    turn = np.einsum(
        "tp,pjx->tjx", powers, rng.normal(size=(3, 2, 3)) * np.array([1.0, 3.0, 5.0])[:, None, None]
    )
    return root, rot.from_rotvec(turn)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("locked", [(False, False), (True, False), (False, True), (True, True)])
def test_position_and_velocity_go_through_a_transition(seed, locked):
    a, b = smooth_motion(seed), smooth_motion(seed + 100)

    def jumps(root, quat):
        """Of position and velocity: a line through two frames on either side, met half a frame away."""
        turned = rot.to_rotvec(rot.multiply(quat, rot.invert(quat[JOIN])))
        path = np.concatenate([root, turned.reshape(LENGTH, -1)], axis=1)[JOIN - 2 : JOIN + 2]
        met = (3 * path[1] - path[0]) / 2 - (3 * path[2] - path[3]) / 2
        return np.abs(met).max(), np.abs((path[3] - path[2]) - (path[1] - path[0])).max() * FPS

    position, velocity = jumps(*joined(a, b, locked=locked))
    assert position < 1e-3 and velocity < 0.5
    cut = jumps(*(np.concatenate([one[:JOIN], other[JOIN:]]) for one, other in zip(a, b, strict=True)))
    assert cut[0] > 0.5 and cut[1] > 2.0


@pytest.mark.parametrize("speed_rad_s", [2.0, 5.0])
@pytest.mark.parametrize("who", ["before", "after"])
def test_a_fast_knee_is_not_thrown_beyond_straight(speed_rad_s, who):
    """One of two passes at full speed where the other stands, almost straight."""
    straight = 0.1
    sign = 1.0 if who == "before" else -1.0
    pair = bent(straight - sign * speed_rad_s * SINCE_S), bent(np.full(LENGTH, straight))
    _, quat = joined(*(pair if who == "before" else pair[::-1]))
    near = np.abs(SINCE_S) < 0.45
    angle = (rot.to_rotvec(quat[:, 1]) @ HINGE)[near]
    cut = straight + speed_rad_s * np.maximum(-sign * SINCE_S, 0.0)[near]
    scale = speed_rad_s * 0.4
    assert angle.min() > straight - 0.031 * scale  # 0.1 if both sides were held at the other's pose
    assert np.abs(angle - cut).max() < 0.085 * scale
    assert np.abs(np.diff(angle, n=2)).max() * FPS**2 < 1.4 * speed_rad_s / 0.4


@given(st.integers(0, 2**32 - 1), st.floats(0.1, 1.0))
def test_what_is_shared_swings_little_and_what_is_not_starts_at_zero(seed, length_s):
    rate = np.random.default_rng(seed).normal(size=(4, 3))
    times_s = np.linspace(0.0, length_s, 101)
    shared, alone = (
        decay_rate(rate, np.zeros_like(rate), times_s, length_s, shared=share) for share in (True, False)
    )
    along = rate / np.linalg.norm(rate, axis=-1, keepdims=True) ** 2
    swings = [(path * along).sum(-1).max() / length_s for path in (shared, alone)]
    assert swings == pytest.approx([0.0604 * min(1.0, 0.4 / length_s), 0.1975], abs=1e-3)
    assert np.array_equal(alone[0], np.zeros_like(rate))
    assert np.allclose(shared[-1], 0, atol=1e-12) and np.allclose(alone[-1], 0, atol=1e-12)
    for path in (shared, alone):
        assert np.allclose((path[1] - path[0]) / times_s[1], rate, atol=0.1 * np.abs(rate).max())


def test_an_acceleration_swings_a_joint_by_a_tenth_of_a_radian_at_most():
    times_s, zero = np.linspace(0.0, 0.6, 301), np.zeros((2, 3))
    for shared in (True, False):
        bends = decay_rate(zero, np.array([[900.0, 0, 0], [0, 5.0, 0]]), times_s, 0.6, shared=shared)
        assert np.linalg.norm(bends, axis=-1).max(axis=0) == pytest.approx(
            [0.1, 0.01728 * 5 * 0.36], rel=1e-3
        )


def test_two_that_face_away_from_one_another_turn_at_the_rate_they_do():
    """The turn between them passes π, where its rotation vector changes sign."""
    angle = np.array([-0.05, 0.0, 0.05]) + np.pi
    a_quat = rot.from_rotvec(angle[:, None, None] * HINGE)
    still = np.broadcast_to([1.0, 0, 0, 0], (3, 1, 4))
    _, turn = inertial_offsets(np.zeros((3, 3)), a_quat, np.zeros((3, 3)), still, fps=FPS)
    assert np.linalg.norm(turn[0]) == pytest.approx(np.pi)
    assert turn[1, 0] == pytest.approx(0.05 * FPS * HINGE)
    assert turn[2, 0] == pytest.approx(np.zeros(3), abs=1e-6)


@pytest.mark.parametrize("apart_m", [0.1, 0.4])
def test_a_dance_does_not_come_to_rest_at_a_transition(apart_m):
    """Of two bodies that walk at the same speed, one ahead: the dance catches up, and slows down nowhere."""
    speed_m_s = 0.5
    ahead = np.stack([speed_m_s * SINCE_S, np.zeros(LENGTH), np.zeros(LENGTH)], axis=1)
    still = bent(np.zeros(LENGTH))[1]
    root, _ = joined((ahead, still), (ahead + np.array([apart_m, 0.0, 0.0]), still))
    danced_m_s = np.diff(root[:, 0]) * FPS
    assert danced_m_s.min() > 0.99 * speed_m_s
    assert danced_m_s.argmax() == pytest.approx(JOIN, abs=2)
    assert danced_m_s.max() == pytest.approx(speed_m_s + 1.875 * apart_m / 0.8, rel=0.01)
