"""Planted jumps are put back on their path; everything else, quick motion above all, stays as it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from choreograph.motion import rotations as rot
from choreograph.motion.cleaning import without_jumps
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import CANONICAL_JOINTS, canonical_skeleton

INDEX = {name: joint for joint, name in enumerate(CANONICAL_JOINTS)}


def _dancing(fps: float = 60.0, duration_s: float = 4.0, speed: float = 1.0) -> Motion:
    """All joints swing at up to 2 turns a second and the body travels."""
    rng = np.random.default_rng(5)
    time = np.arange(round(duration_s * fps)) / fps * speed
    waves = rng.uniform(0.3, 2.0, (24, 3))[None] * time[:, None, None] * 2 * np.pi  # (T, 24, 3)
    quat = rot.from_rotvec(0.35 * np.sin(waves + rng.uniform(0, 6, (24, 3))))
    root = np.stack([np.sin(time), 1 + 0.05 * np.sin(9 * time), 0.5 * time], axis=-1)
    return Motion(canonical_skeleton(), root, rot.make_continuous(quat), fps)


def _jumping(motion: Motion, joint: str, span: slice, turn_rad: float = 0.6) -> Motion:
    quat = np.array(motion.local_quat)
    index = INDEX[joint]
    quat[span, index] = rot.multiply(quat[span, index], rot.from_rotvec(np.array([turn_rad, 0.0, turn_rad])))
    return replace(motion, local_quat=quat)


@pytest.mark.parametrize("fps", [25.0, 60.0])
@pytest.mark.parametrize("speed", [0.0, 0.5, 1.0])
def test_smooth_motion_stays_as_it_is(fps, speed):
    motion = _dancing(fps, speed=speed)
    assert without_jumps(motion) == (motion, 0, ())


@given(frame=st.integers(3, 230), length=st.integers(1, 3), side=st.sampled_from(("left", "right")))
def test_a_jump_of_a_leg_goes_and_nothing_else_changes(frame, length, side):
    motion = _dancing()
    span = slice(frame, frame + length)
    clean, count, limbs = without_jumps(_jumping(motion, f"{side}_hip", span))
    assert (count, limbs) == (1, ("legs",))
    changed = clean.local_quat != motion.local_quat
    leg = [INDEX[f"{side}_{part}"] for part in ("hip", "knee", "ankle", "foot")]
    assert not np.delete(changed, range(span.start, span.stop), axis=0).any()
    assert not np.delete(changed, leg, axis=1).any()
    assert np.array_equal(clean.root_pos_m, motion.root_pos_m)
    assert np.abs(clean.joint_pos_m() - motion.joint_pos_m()).max() < 0.01


def test_jumps_of_limbs_and_body_are_told_apart():
    motion = _jumping(_dancing(), "left_elbow", slice(50, 51), 1.0)
    motion = _jumping(_jumping(motion, "right_knee", slice(50, 51), 1.0), "pelvis", slice(120, 122))
    clean, count, limbs = without_jumps(motion)
    assert (count, limbs) == (2, ("arms", "body", "legs"))
    assert np.abs(clean.joint_pos_m() - _dancing().joint_pos_m()).max() < 0.01


def test_a_jump_of_the_root_is_put_back():
    motion = _dancing()
    root = np.array(motion.root_pos_m)
    root[100] += [0.0, 0.0, 0.2]
    clean, count, limbs = without_jumps(replace(motion, root_pos_m=root))
    assert (count, limbs) == (1, ("body",))
    assert np.abs(clean.root_pos_m - motion.root_pos_m).max() < 0.002


def test_a_step_to_another_place_is_no_jump():
    motion = _dancing(25.0, speed=0.0)
    root = np.array(motion.root_pos_m)
    root[40:, 0] += 0.1
    root[41:, 0] += 0.1
    stepped = replace(motion, root_pos_m=root)
    assert without_jumps(stepped)[1] == 0


@pytest.mark.parametrize("n_frames", [1, 2, 5, 7])
def test_short_motions_and_their_ends_stay(n_frames):
    motion = _dancing().sliced(0, n_frames)
    assert without_jumps(motion)[1] == 0
    assert without_jumps(_jumping(_dancing(), "left_hip", slice(0, 1)))[1] == 0
