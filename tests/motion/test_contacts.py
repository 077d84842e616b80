"""Contacts of feet, and feet that are locked in them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic_motions import stepping

from choreograph.core.errors import ParameterError
from choreograph.evaluation.metrics.physical import evaluate, foot_slide_cm_s, jerk_ratio_at
from choreograph.motion import rotations as rot
from choreograph.motion.body import BODY_JOINTS, body_pos_m
from choreograph.motion.contacts import (
    CONTACT_JOINTS,
    FootLockStream,
    foot_contacts,
    lock_feet,
    locking_shift,
    sole_pos_m,
)
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import canonical_skeleton

FEET = [BODY_JOINTS.index(name) for name in CONTACT_JOINTS]


def _walking(fps: float, *, step_s: float = 0.6, seconds: float = 6.0) -> tuple[np.ndarray, np.ndarray]:
    """Body positions that step left and right in turn, and which foot (T, 2) stands."""
    times = np.arange(round(seconds * fps)) / fps
    pos = np.zeros((len(times), len(BODY_JOINTS), 3))
    standing = np.stack([np.floor(times / step_s) % 2 == 0, np.floor(times / step_s) % 2 == 1], axis=1)
    phase = (times % step_s) / step_s
    for column, joint in enumerate(FEET):
        swings = ~standing[:, column // 2]
        pos[swings, joint, 1] = 0.2 * np.sin(np.pi * phase[swings]) ** 2
        pos[:, joint, 2] = np.cumsum(swings * np.sin(np.pi * phase) ** 2) * 2.0 / fps
    return pos, standing


@pytest.mark.parametrize("fps", [20.0, 25.0, 60.0, 120.0])
def test_synthetic_steps_are_found(fps):
    pos, standing = _walking(fps)
    contacts = foot_contacts(pos, fps)
    for column in range(4):
        stands = standing[:, column // 2]
        assert np.mean((contacts[:, column] > 0.5) == stands) > 0.75
        assert contacts[stands, column].mean() > 0.7
        assert contacts[~stands, column].mean() < 0.35


@given(st.floats(10, 240), st.integers(1, 60), st.integers(0, 2**32 - 1))
def test_contacts_are_between_0_and_1(fps, n_frames, seed):
    pos = np.random.default_rng(seed).normal(0, 0.1, (n_frames, len(BODY_JOINTS), 3))
    contacts = foot_contacts(pos, fps)
    assert contacts.shape == (n_frames, 4)
    assert ((contacts >= 0) & (contacts <= 1)).all()


def test_faster_feet_have_lower_confidence():
    means = []
    for speed_m_s in (0.0, 0.1, 0.5, 2.0):
        pos = np.zeros((60, len(BODY_JOINTS), 3))
        pos[..., 0] = (np.arange(60) / 60 * speed_m_s)[:, None]
        means.append(foot_contacts(pos, 60).mean())
    assert means == sorted(means, reverse=True)
    assert means[0] > 0.95
    assert means[-1] < 0.15


def test_rotating_and_moving_the_scene_changes_nothing():
    pos, _ = _walking(60.0)
    turned = pos[..., [2, 1, 0]] * [1.0, 1.0, -1.0] + [3.0, 0.4, -2.0]
    assert np.allclose(foot_contacts(pos, 60), foot_contacts(turned, 60))


@pytest.mark.parametrize("pos", [np.zeros((0, 21, 3)), np.zeros((5, 21)), np.full((5, 21, 3), np.nan)])
def test_invalid_positions_are_refused(pos):
    with pytest.raises(ParameterError, match="body positions"):
        foot_contacts(pos, 60)


@pytest.mark.parametrize("fps", [0.0, -5.0, np.nan])
def test_invalid_rates_are_refused(fps):
    with pytest.raises(ParameterError, match="rate"):
        foot_contacts(np.zeros((5, 21, 3)), fps)


def _sliding() -> Motion:
    quat = np.zeros((90, 24, 4))
    quat[..., 0] = 1.0
    root = np.tile([0.0, 0.9, 0.0], (90, 1))
    root[:, 0] = 0.03 * np.sin(np.arange(90) / 10)
    return Motion(canonical_skeleton(), root, quat, 30.0)


def test_locked_feet_do_not_slide():
    motion = _sliding()
    contacts = np.ones((90, 4), bool)
    locked = lock_feet(motion, contacts)
    before, after = foot_slide_cm_s(body_pos_m(motion), 30), foot_slide_cm_s(body_pos_m(locked), 30)
    assert before > 3
    assert after < 0.2 * before


@pytest.mark.parametrize("n_given", [0, 1, 2, 10])
@pytest.mark.parametrize("each_frame", [False, True])
def test_the_shift_is_the_minimum_of_its_definition(each_frame, n_given):
    """The sum of contact * |v + d'|^2 + a * |d|^2 + b * |third derivative of d|^2, with whole matrices."""
    rng, fps, n = np.random.default_rng(n_given), 30.0, 40
    points_m, contacts = rng.normal(size=(n, 2, 3)).cumsum(axis=0) * 0.01, rng.uniform(size=(n, 2))
    shift_s = rng.uniform(0.05, 0.3, n) if each_frame else 0.2
    first, third = (np.diff(np.eye(n), order, axis=0) for order in (1, 3))
    still = np.minimum(contacts[1:], contacts[:-1])  # a step from or to a frame in the air may be long
    around = np.broadcast_to((np.asarray(shift_s) * fps) ** 6, n)
    stiff = (around[1:-2] + around[2:-1]) / 2  # between the two frames in the middle of four
    matrix = np.eye(n) + fps**2 * first.T @ np.diag(still.sum(axis=1)) @ first
    matrix += third.T @ np.diag(stiff) @ third
    wanted = -(fps**2) * first.T @ np.einsum("tp,tpi->ti", still, np.diff(points_m, axis=0))
    given = rng.normal(size=(n_given, 3)) * 0.01
    free = slice(n_given, n)
    rest = np.linalg.solve(matrix[free, free], wanted[free] - matrix[free, :n_given] @ given)
    found = locking_shift(points_m, contacts, fps, shift_s, given if n_given else None)
    np.testing.assert_allclose(found, np.concatenate([given, rest]), rtol=0, atol=1e-10)


def test_a_foot_that_leaves_the_floor_or_comes_down_is_not_held_back():
    """It stands, steps 0.3 m within the frames in the air, and stands: no step is one of a contact."""
    at_m = np.concatenate([np.zeros(30), np.linspace(0.0, 0.3, 12), np.full(30, 0.3)])
    points_m = np.stack([at_m, 0.0 * at_m, 0.0 * at_m], axis=-1)[:, None]
    contacts = np.ones((72, 1))
    contacts[31:41] = 0.0
    assert np.abs(locking_shift(points_m, contacts, 30.0, 0.2)).max() < 1e-9


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


def test_contacts_outside_zero_to_one():
    with pytest.raises(ParameterError, match="0 to 1"):
        lock_feet(_sliding(), np.full((90, 4), 2.0))


def test_a_foot_that_stops_and_goes_is_locked_without_jerk():
    """Slide noise on a foot in contact goes, the jerk of the whole does not grow."""
    motion = _sliding()
    contacts = np.zeros((90, 4))
    contacts[20:50] = contacts[65:80] = 1.0
    before, after = body_pos_m(motion), body_pos_m(lock_feet(motion, contacts))
    ball = BODY_JOINTS.index("left_foot")
    slid, locked = (np.ptp(pos[25:45, ball, 0]) for pos in (before, after))
    assert locked < 0.3 * slid
    assert evaluate(after, 30)["jerk_p95_m_s3"] < evaluate(before, 30)["jerk_p95_m_s3"] + 2.0
    head = BODY_JOINTS.index("head")
    assert np.abs(after[:, head] - before[:, head]).max() < 0.03


def test_the_body_above_the_legs_stays():
    """Legs out of reach, too: the whole body moved would be a beat that nobody danced."""
    motion = _sliding()
    far = motion.moved(shift_m=np.array([0.0, 0.02, 0.0]))
    for upper in ("pelvis", "head", "left_wrist", "right_hip"):
        joint = BODY_JOINTS.index(upper)
        locked = body_pos_m(lock_feet(far, np.ones((90, 4))))
        assert np.allclose(locked[:, joint], body_pos_m(far)[:, joint], atol=1e-9)


def test_contacts_are_found_if_not_given():
    motion = _sliding()
    locked = lock_feet(motion, foot_contacts(body_pos_m(motion), motion.fps))
    assert (lock_feet(motion).local_quat == locked.local_quat).all()


@pytest.mark.parametrize("n_frames", [1, 2, 3, 4])
def test_short_motions(n_frames):
    motion = _sliding().sliced(0, n_frames)
    locked = lock_feet(motion, np.ones((n_frames, 4)))
    assert np.isfinite(body_pos_m(locked)).all()


def test_soles_come_up_to_the_floor():
    sunk = _sliding().moved(
        shift_m=np.array([0, -0.93, 0]) - [0, sole_pos_m(_sliding())[..., 1].min() - 0.9, 0]
    )
    assert sole_pos_m(sunk)[..., 1].min() < -0.02
    assert sole_pos_m(lock_feet(sunk, np.zeros((90, 4))))[..., 1].min() > -0.001


def test_a_leg_that_kicks_through_straight_keeps_its_knee_on_its_path():
    """Its foot has slid until then, so a shift is left when the knee is bent the wrong way."""
    n_frames, skeleton = 180, canonical_skeleton()
    time_s = np.arange(n_frames) / 60
    since_s = np.clip(time_s - 1.5, -0.2, 0.2)
    flexion = 0.1 - 0.5 * np.cos(since_s / 0.2 * np.pi)  # 0.6, down to -0.4 and back
    quat = np.zeros((n_frames, 24, 4))
    quat[..., 0] = 1.0
    knee = skeleton.index("left_knee")
    quat[:, knee] = rot.from_rotvec(flexion[:, None] * [1.0, 0.0, 0.0])
    root = skeleton.offsets_m[0] + np.minimum(time_s, 1.35)[:, None] * [0.0, 0.0, 0.15]
    motion = Motion(skeleton, root, quat, 60.0)
    contacts = np.zeros((n_frames, 4))
    contacts[30:82, :2] = 1.0
    locked = lock_feet(motion, contacts, floor_m=-1.0)
    jump_m = np.linalg.norm(np.diff(locked.joint_pos_m()[:, knee], n=2, axis=0), axis=-1)
    assert jump_m.max() < 0.02  # 0.035 if the foot were shifted all the time


FPS = 60.0


def test_shifts_that_are_given_are_gone_on_from():
    rng = np.random.default_rng(0)
    points_m, contacts = rng.normal(0, 0.02, (60, 2, 3)).cumsum(axis=0), rng.random((60, 2))
    whole = locking_shift(points_m, contacts, FPS, 0.1)
    for n_given in (1, 3, 7):
        rest = locking_shift(points_m, contacts, FPS, 0.1, whole[:n_given])
        assert np.allclose(rest, whole, atol=1e-9)


def sliding():
    """Steps on the spot that drift sideways by 0.2 m/s: every foot slides in contact."""
    steps = stepping(8 * 60, fps=FPS, period_s=0.5, seed=1)
    drift = np.outer(np.arange(steps.n_frames) / FPS, [0.2, 0.0, 0.0])
    return Motion(steps.skeleton, steps.root_pos_m + drift, steps.local_quat, FPS)


def locked(motion, block, ahead):
    """All frames, locked in blocks when `ahead` frames after them are known."""
    stream, quats, known = FootLockStream(motion.skeleton, FPS, 0.1), [], 0
    for first in range(0, motion.n_frames - block - ahead + 1, block):
        stop = first + block + ahead
        contacts = np.ones((stop - known, 2))
        stream.push(motion.root_pos_m[known:stop], motion.local_quat[known:stop], contacts)
        quats.append(stream.pop(block))
        known = stop
    quat = np.concatenate(quats)
    return Motion(motion.skeleton, motion.root_pos_m[: len(quat)], quat, FPS)


def test_feet_slide_less_and_only_legs_move():
    motion = sliding()
    dance = locked(motion, block=2, ahead=2)
    before, after = (foot_slide_cm_s(body_pos_m(one), FPS) for one in (motion, dance))
    assert after < 0.6 * before
    same = np.isclose(dance.local_quat, motion.local_quat[: dance.n_frames]).all(axis=(0, 2))
    moved = {name for name, kept in zip(motion.skeleton.names, same, strict=True) if not kept}
    assert moved and all(name.split("_")[-1] in ("hip", "knee", "ankle") for name in moved)


def test_frames_depend_on_no_later_frame_than_those_known():
    motion = sliding()
    later = motion.local_quat.copy()
    later[200:] = later[:1]
    altered = Motion(motion.skeleton, motion.root_pos_m, later, FPS)
    first, other = (locked(one, block=2, ahead=2).local_quat for one in (motion, altered))
    assert np.array_equal(first[:198], other[:198]) and not np.allclose(first[200:], other[200:])
