"""The compiled forward kinematics gives the very numbers of the quaternion functions, for any hierarchy."""

from __future__ import annotations

import numpy as np
import pytest

from choreograph.motion import rotations as rot
from choreograph.motion.kinematics import forward, to_local
from choreograph.motion.skeleton import Skeleton, canonical_skeleton


def by_joints(skeleton, root_pos_m, local_quat, joints=None):
    """Positions and rotations of all joints, one joint after another with `rotations`."""
    quat = np.zeros(local_quat.shape)
    pos_m = np.zeros((*local_quat.shape[:-1], 3))
    quat[..., 0, :], pos_m[..., 0, :] = local_quat[..., 0, :], root_pos_m
    for joint in range(1, skeleton.n_joints) if joints is None else joints:
        parent = quat[..., skeleton.parents[joint], :]
        quat[..., joint, :] = rot.multiply(parent, local_quat[..., joint, :])
        offset_m = rot.rotate(parent, skeleton.offsets_m[joint])
        pos_m[..., joint, :] = pos_m[..., skeleton.parents[joint], :] + offset_m
    return pos_m, quat


def random_skeleton(n_joints: int, rng) -> Skeleton:
    parents = [-1, *(int(rng.integers(0, joint)) for joint in range(1, n_joints))]
    return Skeleton(tuple(f"j{joint}" for joint in range(n_joints)), parents, rng.normal(size=(n_joints, 3)))


@pytest.mark.parametrize("shape", [(), (1,), (3,), (257,), (2, 5), (0,)])
@pytest.mark.parametrize("n_joints", [1, 2, 24, 60])
def test_the_numbers_are_those_of_the_quaternion_functions(n_joints, shape):
    rng = np.random.default_rng(n_joints)
    skeleton = canonical_skeleton() if n_joints == 24 else random_skeleton(n_joints, rng)
    quat = rot.normalize(rng.normal(size=(*shape, n_joints, 4)))
    root = 3.0 * rng.normal(size=(*shape, 3))
    for made, expected in zip(forward(skeleton, root, quat), by_joints(skeleton, root, quat), strict=True):
        assert made.dtype == np.float64
        np.testing.assert_array_equal(made, expected)
    local = quat.copy()
    for joint in range(1, n_joints):
        parent = quat[..., skeleton.parents[joint], :]
        local[..., joint, :] = rot.multiply(rot.invert(parent), quat[..., joint, :])
    np.testing.assert_array_equal(to_local(skeleton, quat), local)


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_other_types_parts_of_arrays_and_chosen_joints(kind):
    rng = np.random.default_rng(1)
    skeleton = canonical_skeleton()
    quat = rot.normalize(rng.normal(size=(40, 24, 4))).astype(kind)[3:37:2]
    root = rng.normal(size=(40, 3)).astype(kind)[3:37:2]
    quat.flags.writeable = False
    legs = [1, 4, 7, 10]
    for joints in (None, legs):
        made = forward(skeleton, root, quat, joints)
        for ours, expected in zip(made, by_joints(skeleton, root, quat, joints), strict=True):
            np.testing.assert_array_equal(ours, expected)
