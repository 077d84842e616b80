"""Mirror images of motions, against mirrored positions of joints."""

from __future__ import annotations

import numpy as np
from synthetic_motions import stepping

from choreograph.motion.body import body_pos_m, heading_rad, mirrored
from choreograph.motion.mirroring import mirrored_motion

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
