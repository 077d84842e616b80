"""Feet at joins: bodies meet at their standing feet, and contacts of both takes are locked there."""

from __future__ import annotations

import numpy as np
import pytest

from choreograph.evaluation.metrics.physical import foot_slide_cm_s
from choreograph.motion import rotations as rot
from choreograph.motion.body import BODY_JOINTS, body_pos_m, ground_pos_m
from choreograph.motion.contacts import DANCE_SHIFT_S, foot_contacts, lock_feet, locking_shift
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import canonical_skeleton
from choreograph.plan.joins import alignment_at, sample_run
from choreograph.plan.runs import Run
from choreograph.render.assembly import Joins, assemble
from choreograph.render.dynamics import copied
from choreograph.render.rendering import lock_feet_at_joins

FPS = 60.0
FEET = [BODY_JOINTS.index(f"{side}_{part}") for side in ("left", "right") for part in ("ankle", "foot")]
SKELETON = canonical_skeleton()


def standing(left_rad: float, right_rad: float, *, raised_m: float = 0.0) -> Motion:
    """4 s of a body whose legs are turned sideways by these angles, with the lower foot on the floor."""
    quat = np.tile(rot.IDENTITY, (240, SKELETON.n_joints, 1))
    for side, angle in (("left", left_rad), ("right", right_rad)):
        quat[:, SKELETON.names.index(f"{side}_hip")] = rot.from_rotvec(np.array([0.0, 0.0, angle]))
    motion = Motion(SKELETON, np.tile(SKELETON.rest_pos_m()[0], (240, 1)), quat, FPS)
    low_m = body_pos_m(motion)[0, FEET, 1].min() - SKELETON.rest_pos_m()[:, 1].min()
    return motion.moved(shift_m=np.array([0.0, raised_m - low_m, 0.0]))


def joined(takes: dict[str, Motion]) -> tuple[Motion, Joins]:
    """2 s of each take."""
    runs = [
        Run(name, 2.0 * i, 2.0 * i + 2.0, 1.0 + np.linspace(0.0, 2.0, 41)) for i, name in enumerate(takes)
    ]
    return assemble(
        runs, lambda take, *_: (takes[take], 0.0), fps=FPS, duration_s=2.0 * len(takes), blending="inertial"
    )


def aligned(a: Motion, b: Motion) -> tuple[np.ndarray, np.ndarray]:
    """The body of a, and that of b once it is aligned, (21, 3) each."""
    before, after = (
        sample_run(Run("", 0.0, 2.0, np.linspace(0.5, 2.5, 41)), lambda *_, m=m: (m, 0.0), FPS, 2)
        for m in (a, b)
    )
    return before.body_at(30), after.moved(*alignment_at(before, after, 30)).body_at(30)


def test_bodies_meet_at_their_standing_feet():
    lean_left, lean_right = standing(0.1, 0.1), standing(-0.1, -0.1)  # the same feet, the pelvis elsewhere
    before, after = aligned(lean_left, lean_right.moved(shift_m=np.array([3.0, 0.0, 1.0])))
    assert np.linalg.norm((before - after)[FEET][:, [0, 2]], axis=1).max() < 0.03
    assert np.linalg.norm(ground_pos_m(before) - ground_pos_m(after)) > 0.1


def test_bodies_in_the_air_meet_at_the_pelvis():
    before, after = aligned(standing(0.1, 0.1, raised_m=0.4), standing(-0.1, -0.1, raised_m=0.4))
    assert np.linalg.norm(ground_pos_m(before) - ground_pos_m(after)) < 1e-3


def test_a_foot_in_the_air_does_not_count():
    before, after = aligned(standing(0.0, 0.0), standing(1.2, 0.0))  # the left leg is raised to the side
    apart = np.linalg.norm((before - after)[FEET][:, [0, 2]], axis=1)
    assert apart[2:].max() < 0.02 < 0.3 < apart[:2].min()


def test_feet_that_stand_in_both_takes_slide_less_while_these_are_blended():
    takes = {"narrow": standing(0.02, -0.02), "wide": standing(0.12, -0.12), "again": standing(0.02, -0.02)}
    made, joins = joined(takes)
    locked = copied(made)
    lock_feet_at_joins(locked, joins)
    slide = {
        "blended": foot_slide_cm_s(body_pos_m(made), FPS),
        "locked": foot_slide_cm_s(body_pos_m(lock_feet(made, shift_s=DANCE_SHIFT_S)), FPS),
        "at joins": foot_slide_cm_s(body_pos_m(locked), FPS),
    }
    assert slide["at joins"] < 0.75 * slide["locked"] < slide["blended"]
    bend_m = np.diff(body_pos_m(locked), n=2, axis=0)
    assert np.linalg.norm(bend_m, axis=-1).max() < 0.01  # no jump


def test_contacts_are_those_of_the_takes_near_joins_alone():
    made, joins = joined({"narrow": standing(0.02, -0.02), "wide": standing(0.35, -0.35)})
    of_motion = foot_contacts(body_pos_m(made), FPS)
    contacts = joins.contacts(made, 0.0, 4.0)
    assert contacts.min() >= 0 and contacts.max() <= 1 and (contacts >= of_motion).all()
    assert contacts[110:130].min() > 0.9 > of_motion[110:130].min()
    assert np.array_equal(contacts[:60], of_motion[:60])
    assert np.array_equal(joins.contacts(made, 3.0, 4.0), of_motion)


def test_shifts_are_quick_near_joins():
    _, joins = joined({"narrow": standing(0.02, -0.02), "wide": standing(0.12, -0.12)})
    shift_s = joins.shift_s(240, FPS, 0.3)
    assert shift_s[120] == pytest.approx(0.06) and shift_s[[0, 239]] == pytest.approx(0.3)
    assert (np.diff(shift_s[:120]) <= 0).all() and (np.diff(shift_s[120:]) >= 0).all()
    assert (Joins(np.zeros(0), ()).shift_s(60, FPS, 0.3) == 0.3).all()


def test_one_time_for_all_frames_is_that_time_for_each():
    rng = np.random.default_rng(0)
    points, contacts = rng.normal(size=(80, 2, 3)).cumsum(axis=0) * 0.01, rng.uniform(size=(80, 2))
    one, each = (locking_shift(points, contacts, FPS, given) for given in (0.2, np.full(80, 0.2)))
    assert np.array_equal(one, each)
