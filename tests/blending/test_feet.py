"""A sliding foot is held; a motion without contacts is left alone; contacts and slide agree."""

from __future__ import annotations

import numpy as np
import pytest

from choreograph.blending.feet import lock_feet
from choreograph.errors import ParameterError
from choreograph.features.contacts import foot_contacts
from choreograph.metrics.physical import evaluate, foot_slide_cm_s, jerk_ratio_at
from choreograph.motion.body import BODY_JOINTS, body_pos_m
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import canonical_skeleton


def _sliding() -> Motion:
    quat = np.zeros((90, 24, 4))
    quat[..., 0] = 1.0
    root = np.tile([0.0, 0.9, 0.0], (90, 1))
    root[:, 0] = 0.03 * np.sin(np.arange(90) / 10)
    return Motion(canonical_skeleton(), root, quat, 30.0)


def test_held_feet_do_not_slide():
    motion = _sliding()
    contacts = np.ones((90, 4), bool)
    locked = lock_feet(motion, contacts)
    before, after = foot_slide_cm_s(body_pos_m(motion), 30), foot_slide_cm_s(body_pos_m(locked), 30)
    assert before > 3
    assert after < 0.2 * before


def test_without_contacts_only_sinking_feet_move():
    motion = _sliding().moved(shift_m=np.array([0, 0.3, 0]))
    locked = lock_feet(motion, np.zeros((90, 4), bool))
    assert np.allclose(body_pos_m(locked), body_pos_m(motion), atol=1e-6)


def test_standing_is_contact_and_stepping_is_not():
    pos = body_pos_m(_sliding()).copy()
    pos[30:60, BODY_JOINTS.index("left_foot"), 1] += 0.3
    contacts = foot_contacts(pos, 30) > 0.5
    assert contacts[:25].all()
    assert not contacts[32:58, 1].any()
    assert contacts[:, 3].all()


def test_a_jump_shows_in_the_jerk_ratio():
    pos = body_pos_m(_sliding()).copy()
    pos[45:] += 0.2
    assert jerk_ratio_at(pos, 30, [1.5]) > 5
    assert np.isnan(jerk_ratio_at(pos, 30, []))
    assert evaluate(pos, 30)["floor_penetration_cm"] >= 0


def test_wrong_contacts_shape():
    with pytest.raises(ParameterError, match="contacts"):
        lock_feet(_sliding(), np.zeros((90, 2), bool))
