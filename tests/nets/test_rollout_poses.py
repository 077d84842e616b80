"""Pose rows of motions and back, and conditions of frames."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic_rollouts import random_motion

from choreograph.motion import rotations as rot
from choreograph.motion.body import body_pos_m
from choreograph.nets.rollout_poses import N_FEET, ROOT_DIM, to_motion, to_poses, word_conditions


@given(st.integers(0, 1000), st.floats(-3, 3), st.floats(-5, 5), st.floats(-5, 5))
def test_poses_do_not_depend_on_position_and_heading(seed, yaw, x, z):
    motion = random_motion(seed)
    moved = motion.moved(yaw_rad=yaw, shift_m=np.array([x, 0.0, z]))
    assert np.allclose(to_poses(motion), to_poses(moved), atol=1e-4)


@given(st.integers(0, 1000))
def test_motion_of_poses_is_the_same_motion_from_the_origin(seed):
    motion = random_motion(seed)
    again = to_motion(to_poses(motion), motion.skeleton, heading_rad=float(rot.yaw(motion.local_quat[0, 0])))
    shift = motion.root_pos_m[0] * [1, 0, 1]
    assert np.allclose(body_pos_m(again), body_pos_m(motion) - shift, atol=2e-4)


def test_rotations_of_poses_mostly_have_no_negative_w():
    poses = to_poses(random_motion(3))
    w = poses[:, ROOT_DIM:-N_FEET].reshape(len(poses), -1, 4)[..., 0]
    assert (w.sum(axis=0) >= 0).all()


def test_every_frame_is_conditioned_on_its_word():
    motif = np.arange(3)[:, None] * np.ones(184)
    rhythm = np.arange(60)[:, None] * np.ones(4)
    phase = np.arange(60)[:, None] * np.ones(4)
    conditions = word_conditions(
        np.array([0.5, 1.0, 1.5]), np.array([1.0, 1.5, 2.0]), 70, rhythm, phase, motif, None
    )
    assert conditions.motif[:, 0].tolist() == [0] * 30 + [1] * 15 + [2] * 25
    assert float(conditions.progress[15]) == 0.0
    assert float(conditions.progress[29]) == pytest.approx(14 / 15)
    assert conditions.progress.max() <= 1.0
    # Rhythm is looked up ahead, and its last row is repeated.
    assert conditions.rhythm[0, 0] == 9
    assert conditions.rhythm[-1, 0] == 59
    # Phases are those of the frame itself.
    assert conditions.count_phase[:, 0].tolist() == [*range(60), *[59] * 10]
