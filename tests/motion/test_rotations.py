"""Laws of quaternions over batch shapes, with scipy's rotations as reference."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from choreograph.motion import rotations as rot

shapes = st.sampled_from([(), (1,), (5,), (3, 4), (2, 1, 3)])
seeds = st.integers(0, 2**32 - 1)
laws = settings(max_examples=40, deadline=None)


def quats(seed: int, shape: tuple[int, ...]):
    return rot.normalize(np.random.default_rng(seed).normal(size=(*shape, 4)))


def same(a, b, atol: float = 1e-9) -> bool:
    """Whether quaternions (..., 4) are the same rotations: q and -q are."""
    return bool(np.allclose(np.abs(np.sum(a * b, axis=-1)), 1.0, atol=atol))


@laws
@given(seeds, shapes)
def test_group_laws(seed, shape):
    a, b, c = (quats(seed + i, shape) for i in range(3))
    assert np.allclose(rot.multiply(a, rot.multiply(b, c)), rot.multiply(rot.multiply(a, b), c))
    assert np.allclose(rot.multiply(a, rot.invert(a)), rot.IDENTITY)
    assert np.allclose(rot.multiply(rot.IDENTITY, a), a)
    v = np.random.default_rng(seed).normal(size=(*shape, 3))
    assert np.allclose(rot.rotate(rot.multiply(a, b), v), rot.rotate(a, rot.rotate(b, v)))
    assert np.allclose(np.linalg.norm(rot.rotate(a, v), axis=-1), np.linalg.norm(v, axis=-1))


@laws
@given(seeds)
def test_rotate_agrees_with_scipy(seed):
    q = quats(seed, (6,))
    v = np.random.default_rng(seed).normal(size=(6, 3))
    assert np.allclose(rot.rotate(q, v), Rotation.from_quat(q, scalar_first=True).apply(v))


@laws
@given(seeds, shapes)
def test_round_trips(seed, shape):
    q = quats(seed, shape)
    assert same(rot.from_matrix(rot.to_matrix(q)), q)
    assert same(rot.from_rotvec(rot.to_rotvec(q)), q)
    assert np.linalg.norm(rot.to_rotvec(q), axis=-1).max() <= np.pi + 1e-9
    for order in ("XYZ", "ZXY", "yzx"):
        assert same(rot.from_euler(order, rot.to_euler(order, q)), q, atol=1e-7)


@pytest.mark.parametrize("n_rows", [8, 4000])  # not compiled, and compiled
def test_vectors_and_angles_are_those_of_scipy_to_rounding(n_rows):
    rng = np.random.default_rng(n_rows)
    q = rng.normal(size=(n_rows, 4))
    q[:6] = [[1, 0, 0, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, -2], [1, 1e-5, 0, 0], [-1, 0, 1e-4, 2e-4]]
    theirs = Rotation.from_quat(q, scalar_first=True)
    np.testing.assert_allclose(rot.to_rotvec(q), theirs.as_rotvec(), rtol=0, atol=1e-14)
    vectors = theirs.as_rotvec() * rng.random((n_rows, 1))
    of_vectors = Rotation.from_rotvec(vectors).as_quat(scalar_first=True)
    np.testing.assert_allclose(rot.from_rotvec(vectors), of_vectors, rtol=0, atol=1e-15)
    for order in ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"):
        angles = rng.uniform(-3.0, 3.0, (n_rows, 3))
        angles[::4, 1], angles[1::4, 1] = np.pi / 2, -np.pi / 2  # gimbal lock
        for of in (theirs, Rotation.from_euler(order, angles)):
            expected = of.as_euler(order, suppress_warnings=True)
            found = rot.to_euler(order, of.as_quat(scalar_first=True))
            away = (found - expected + np.pi) % (2 * np.pi) - np.pi  # -π and π are the same
            np.testing.assert_allclose(away, 0.0, rtol=0, atol=2e-13)


@pytest.mark.parametrize("order", ["XYX", "XXY", "ZYY"])
def test_orders_that_repeat_an_axis_are_refused(order):
    with pytest.raises(ValueError, match=order):
        rot.to_euler(order, rot.IDENTITY)


def test_a_quaternion_of_length_0_is_refused():
    with pytest.raises(ValueError, match="length 0"):
        rot.to_rotvec(np.zeros((3, 4)))


def test_euler_angles_are_intrinsic():
    angles = np.array([0.3, -0.4, 0.7])
    one_by_one = rot.from_rotvec(np.diag(angles)[[0, 1, 2]])
    expected = rot.multiply(one_by_one[0], rot.multiply(one_by_one[1], one_by_one[2]))
    assert same(rot.from_euler("XYZ", angles), expected)


@laws
@given(seeds, shapes, st.floats(0, 1))
def test_slerp_has_constant_speed_on_the_shorter_arc(seed, shape, weight):
    a, b = quats(seed, shape), quats(seed + 1, shape)
    between = rot.slerp(a, b, np.full(shape, weight))
    assert np.allclose(np.linalg.norm(between, axis=-1), 1.0)

    def angle(p, q):
        return 2 * np.arccos(np.clip(np.abs(np.sum(p * q, axis=-1)), 0, 1))

    assert np.allclose(angle(a, between), weight * angle(a, b), atol=1e-6)
    assert np.allclose(angle(between, b), (1 - weight) * angle(a, b), atol=1e-6)


def test_slerp_of_nearly_equal_and_of_opposite_signs():
    q = quats(0, (3,))
    assert same(rot.slerp(q, q, 0.3), q)
    assert same(rot.slerp(q, -q, 0.3), q)
    assert same(rot.slerp(q, rot.normalize(q + 1e-9), 0.5), q)


@laws
@given(seeds)
def test_continuity_flips_signs_only(seed):
    rng = np.random.default_rng(seed)
    steps = rot.from_rotvec(rng.normal(scale=0.2, size=(30, 4, 3)))
    path = [steps[0]]
    for step in steps[1:]:
        path.append(rot.multiply(step, path[-1]))
    smooth = np.stack(path)
    flipped = smooth * rng.choice([-1.0, 1.0], size=(30, 4, 1))
    continuous = rot.make_continuous(flipped)
    assert same(continuous, smooth)
    assert (np.sum(continuous[1:] * continuous[:-1], axis=-1) > 0).all()
    assert np.array_equal(continuous[0], flipped[0])


@laws
@given(seeds, shapes)
def test_between_takes_one_direction_to_the_other(seed, shape):
    rng = np.random.default_rng(seed)
    a, b = rng.normal(size=(2, *shape, 3))
    turned = rot.rotate(rot.between(a, b), a)
    assert np.allclose(turned / np.linalg.norm(turned, axis=-1, keepdims=True),
                       b / np.linalg.norm(b, axis=-1, keepdims=True))  # fmt: skip


@pytest.mark.parametrize("direction", np.vstack([np.eye(3), -np.eye(3), [[1.0, 2.0, -3.0]]]))
def test_between_opposite_directions_is_a_half_turn(direction):
    quat = rot.between(direction, -direction)
    assert np.allclose(rot.rotate(quat, direction), -direction)
    assert np.linalg.norm(quat) == pytest.approx(1.0)


@laws
@given(st.floats(-3.1, 3.1))
def test_rotation_about_the_vertical(angle):
    rotation = rot.about_y(angle)
    assert np.allclose(rot.rotate(rotation, np.array([0.0, 0.0, 1.0])), [np.sin(angle), 0.0, np.cos(angle)])
    assert float(rot.yaw(rotation)) == pytest.approx(angle)


@laws
@given(seeds, shapes)
def test_turns_about_the_vertical_are_those_of_quaternions(seed, shape):
    rng = np.random.default_rng(seed)
    angle, vector = 9 * rng.normal(size=(*shape, 1)), rng.normal(size=(*shape, 5, 3))
    expected = rot.rotate(rot.about_y(angle), vector)
    np.testing.assert_array_equal(rot.rotate_about_y(angle, vector), expected)


def test_a_quaternion_of_zero_is_the_identity():
    assert np.array_equal(rot.normalize(np.zeros((2, 4))), np.tile(rot.IDENTITY, (2, 1)))


def test_signs_are_made_continuous_in_place():
    quat = np.random.default_rng(0).normal(size=(9000, 2, 4))  # more than one block of frames
    expected, kept = rot.make_continuous(quat), quat.copy()
    np.testing.assert_array_equal(quat, kept)
    assert rot.make_continuous(quat, out=quat) is quat
    np.testing.assert_array_equal(quat, expected)


def in_parts(function, *given):
    """The results of few quaternions at a time, which no kernel computes."""
    return np.concatenate(
        [function(*(one[at : at + 50] for one in given)) for at in range(0, len(given[0]), 50)]
    )


def one_by_one(quat):
    """Signs that continue from frame to frame."""
    made = quat.copy()
    for frame in range(1, len(made)):
        made[frame][np.sum(made[frame] * made[frame - 1], axis=-1) < 0] *= -1
    return made


@pytest.mark.parametrize("shape", [(700, 5), (400, 3, 2), (4000,)])
def test_many_quaternions_give_the_numbers_of_few(shape):
    rng = np.random.default_rng(3)
    a, b = rng.normal(size=(2, *shape, 4))
    a[0] = 0.0  # becomes the identity
    part = b[..., ::-1, :]  # not contiguous
    in_place = b.copy()
    rot.make_continuous(in_place, out=in_place)
    np.testing.assert_array_equal(rot.multiply(a, b), in_parts(rot.multiply, a, b))
    np.testing.assert_array_equal(rot.multiply(part, a), in_parts(rot.multiply, part, a))
    np.testing.assert_array_equal(
        rot.multiply(a, rot.IDENTITY), in_parts(lambda few: rot.multiply(few, rot.IDENTITY), a)
    )
    np.testing.assert_array_equal(rot.normalize(a), in_parts(rot.normalize, a))
    np.testing.assert_array_equal(rot.make_continuous(b), one_by_one(b))
    np.testing.assert_array_equal(in_place, one_by_one(b))
    np.testing.assert_array_equal(rot.make_continuous(part), one_by_one(part))
    assert rot.make_continuous(b).flags.writeable and not np.array_equal(b, in_place)


def test_kernels_read_arrays_that_cannot_be_written():
    fixed = quats(0, (1100, 2))
    fixed.flags.writeable = False
    assert np.allclose(rot.multiply(fixed, rot.invert(fixed)), rot.IDENTITY)
    assert np.allclose(rot.normalize(rot.make_continuous(fixed)), rot.make_continuous(fixed))
