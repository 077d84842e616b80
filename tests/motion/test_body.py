"""Poses in the root frame, and mirror images."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_motions import stepping, swaying

from choreograph.motion import rotations as rot
from choreograph.motion.body import (
    BODY_JOINTS,
    body_pos_m,
    clips_to_root_frame,
    ground_pos_m,
    heading_rad,
    mirrored,
    mirrored_motion,
    to_root_frame,
)
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import canonical_skeleton

BODY = body_pos_m(swaying(20, seed=3))  # (T, 21, 3)
angles = st.floats(-3.1, 3.1)
metres = st.floats(-5, 5)


def turned_by(a, b):
    """The difference of angles, in (-π, π]."""
    return np.angle(np.exp(1j * (a - b)))


def test_the_rest_pose_faces_z():
    skeleton = canonical_skeleton()
    rest = Motion(skeleton, np.zeros((1, 3)), np.tile(rot.IDENTITY, (1, skeleton.n_joints, 1)), 1.0)
    assert heading_rad(body_pos_m(rest)) == pytest.approx([0.0], abs=1e-9)


@settings(max_examples=40, deadline=None)
@given(angles, metres, metres)
def test_heading_and_position_move_with_the_body_and_the_pose_does_not(angle, x, z):
    moved = rot.rotate(rot.about_y(angle), BODY) + np.array([x, 0.0, z])
    assert np.allclose(turned_by(heading_rad(moved), heading_rad(BODY)), angle, atol=1e-9)
    expected = rot.rotate(rot.about_y(angle), ground_pos_m(BODY)) + np.array([x, 0.0, z])
    assert np.allclose(ground_pos_m(moved), expected)
    assert np.allclose(to_root_frame(moved), to_root_frame(BODY))
    velocities = np.gradient(BODY, axis=0)
    turned = rot.rotate(rot.about_y(angle), velocities)
    assert np.allclose(to_root_frame(moved, turned), to_root_frame(BODY, velocities))


def test_in_the_root_frame_a_body_is_above_the_origin_and_faces_z():
    in_root = to_root_frame(BODY)
    assert np.allclose(heading_rad(in_root), 0, atol=1e-9)
    assert np.allclose(ground_pos_m(in_root), 0, atol=1e-9)
    assert np.allclose(in_root[..., 1], BODY[..., 1])  # heights are kept
    assert np.allclose(to_root_frame(in_root), in_root)


def test_any_leading_dimensions():
    boxed = BODY.reshape(4, 5, 21, 3)
    assert np.allclose(to_root_frame(boxed).reshape(BODY.shape), to_root_frame(BODY))
    assert heading_rad(boxed).shape == (4, 5)


def test_mirroring_negates_the_heading_and_swaps_sides():
    mirror = mirrored(BODY)
    assert np.allclose(turned_by(heading_rad(mirror), -heading_rad(BODY)), 0, atol=1e-9)
    assert np.allclose(mirrored(mirror), BODY)
    left, right = BODY_JOINTS.index("left_wrist"), BODY_JOINTS.index("right_wrist")
    assert np.allclose(mirror[:, left], BODY[:, right] * [-1, 1, 1])


def test_a_clip_in_the_root_frame_keeps_its_travel_but_not_its_position():
    clip = clips_to_root_frame(BODY[None])[0]
    moved = rot.rotate(rot.about_y(1.3), BODY) + np.array([2.0, 0.0, -1.0])
    assert np.allclose(clips_to_root_frame(moved[None])[0], clip)
    assert heading_rad(clip[len(BODY) // 2]) == pytest.approx(0.0, abs=1e-9)
    assert np.allclose(ground_pos_m(clip).mean(axis=0), 0.0)
    travel = np.linalg.norm(BODY[-1] - BODY[0], axis=-1)
    assert np.allclose(np.linalg.norm(clip[-1] - clip[0], axis=-1), travel)


MOTION = stepping(60).moved(yaw_rad=0.4)


def test_the_joints_of_a_mirrored_motion_are_the_mirrored_joints():
    np.testing.assert_allclose(body_pos_m(mirrored_motion(MOTION)), mirrored(body_pos_m(MOTION)), atol=1e-9)


def test_a_motion_mirrored_twice_is_the_same():
    twice = mirrored_motion(mirrored_motion(MOTION))
    np.testing.assert_allclose(twice.root_pos_m, MOTION.root_pos_m)
    np.testing.assert_allclose(twice.local_quat, MOTION.local_quat)


def test_headings_are_mirrored():
    before, after = (heading_rad(body_pos_m(one)) for one in (MOTION, mirrored_motion(MOTION)))
    np.testing.assert_allclose(after, -before, atol=1e-9)
