"""Differentiable kinematics against the kinematics of motions."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from synthetic_rollouts import random_motion

from choreograph.motion import rotations as rot
from choreograph.motion.body import body_pos_m
from choreograph.nets.stored import BodyKinematics, geodesic_rad


@given(st.integers(0, 1000))
def test_positions_agree_with_those_of_motions(seed):
    motion = random_motion(seed, 5)
    computed = BodyKinematics(motion.skeleton).body_pos_m(
        torch.from_numpy(motion.root_pos_m).float(), torch.from_numpy(motion.local_quat).float()
    )
    assert np.allclose(computed.numpy(), body_pos_m(motion), atol=1e-5)


@given(st.integers(0, 1000), st.floats(0.01, 3.0))
def test_geodesic_distance_is_the_angle_between_rotations(seed, angle):
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3)
    a = rot.normalize(rng.normal(size=4))
    b = rot.multiply(a, rot.from_rotvec(angle * axis / np.linalg.norm(axis)))
    sign = rng.choice([-1.0, 1.0])
    computed = geodesic_rad(torch.from_numpy(a), torch.from_numpy(sign * b))
    assert float(computed) == pytest.approx(angle, abs=2e-3)


def test_geodesic_distance_has_a_gradient_where_rotations_agree():
    quat = torch.tensor([1.0, 0.0, 0.0, 0.0], requires_grad=True)
    geodesic_rad(quat, quat.detach()).backward()
    assert torch.isfinite(quat.grad).all()
