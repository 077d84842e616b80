"""The first and last pose are held: times that stand still, bodies that breathe, feet on the floor."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from synthetic_motions import swaying

from choreograph.evaluation.metrics.transitions import frozen_ends_share
from choreograph.motion import rotations as rot
from choreograph.motion.body import BODY_JOINTS, body_pos_m
from choreograph.motion.contacts import sole_pos_m
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import canonical_skeleton
from choreograph.music.count_grids import held_times_s
from choreograph.render.dynamics import (
    _played,
    copied,
    hold_ends,
    hold_ends_in_place,
    hold_stops_in_place,
    played_times_s,
)

FPS = 60.0
LENGTH_S = 8.0
EASE_IN_S, EASE_OUT_S, SETTLE_S = 0.4, 0.3, 0.08
PICK_UP_S = 0.5
MOTION = swaying(round(LENGTH_S * FPS), fps=FPS)
TIMES_S = np.arange(MOTION.n_frames) / FPS
FEET = [BODY_JOINTS.index(f"{side}_{part}") for side in ("left", "right") for part in ("ankle", "foot")]

OPENINGS_S = st.just(0.0) | st.floats(0.01, 5.0)


def played_s(opening_s: float, closing_s: float | None) -> np.ndarray:
    return played_times_s(TIMES_S, opening_s, closing_s)


def on_one_leg(lift_m: float, *, aside_rad: float = 0.25, n_frames: int = 240) -> Motion:
    """A body that stands, its left foot pulled up behind it and to the side."""
    skeleton = canonical_skeleton()
    quat = np.tile(rot.IDENTITY, (n_frames, skeleton.n_joints, 1))
    bend = np.arccos(1.0 - lift_m / 0.8)
    names = list(skeleton.names)
    for name, turn in (("left_hip", [-bend, 0.0, aside_rad]), ("left_knee", [2.0 * bend, 0.0, 0.0])):
        quat[:, names.index(name)] = rot.from_rotvec(np.array(turn))
    root = np.tile(skeleton.rest_pos_m()[0], (n_frames, 1))
    return Motion(skeleton, root, quat, FPS)


def test_the_dance_between_the_held_poses_is_untouched():
    held = hold_ends(MOTION, 1.5, 6.0)
    danced = (TIMES_S >= 1.5 - PICK_UP_S) & (TIMES_S <= 6.0 - EASE_OUT_S)
    assert np.array_equal(held.root_pos_m[danced], MOTION.root_pos_m[danced])
    assert np.abs(np.abs((held.local_quat * MOTION.local_quat).sum(-1))[danced] - 1).max() < 1e-12


def test_frames_that_were_held_in_place_are_put_back():
    held = copied(MOTION)
    replaced = hold_ends_in_place(held, 3.0, 5.0) + hold_stops_in_place(held, [(3.5, 4.5)], 0.35)
    whole = hold_ends(MOTION, 3.0, 5.0)
    hold_stops_in_place(whole, [(3.5, 4.5)], 0.35)
    assert np.array_equal(held.local_quat, whole.local_quat)
    for frames in reversed(replaced):
        frames.put_back(held)
    assert np.array_equal(held.root_pos_m, MOTION.root_pos_m)
    assert np.array_equal(rot.make_continuous(held.local_quat), MOTION.local_quat)
    assert hold_ends_in_place(held, 0.0, None) == hold_stops_in_place(held, [], 0.35) == []


def test_held_poses_breathe_and_shift_their_weight_over_feet_that_stay():
    held = hold_ends(MOTION, 3.0, 5.0)
    body = body_pos_m(held)
    assert frozen_ends_share(body, FPS) < 0.15 < 0.5 < frozen_ends_share(_frozen(3.0, 5.0), FPS)
    speed = np.linalg.norm(np.diff(body, axis=0), axis=-1) * FPS  # (T - 1, 21)
    for part in (slice(0, round(1.9 * FPS)), slice(round(5.2 * FPS), None)):
        assert np.median(speed[part].mean(axis=1)) > 0.05 and speed[part].max() < 0.25
        assert np.ptp(body[part][:, FEET], axis=0).max() < 0.012
        assert np.ptp(body[part][:, 0], axis=0)[[0, 2]].max() > 0.02  # the pelvis


def _frozen(opening_s: float, closing_s: float) -> np.ndarray:
    return body_pos_m(MOTION.sampled_smooth(played_s(opening_s, closing_s) * FPS))


@pytest.mark.parametrize("lift_m", [0.1, 0.3])
def test_a_lifted_foot_is_put_down(lift_m):
    motion = on_one_leg(lift_m)
    assert sole_pos_m(motion)[0, :, 1].max() > 0.08
    held = hold_ends(motion, 1.6, 2.8)
    soles = sole_pos_m(held).reshape(held.n_frames, 2, -1, 3)[..., 1].min(axis=2)  # (T, foot)
    for frame in (0, 30, -30, -1):
        assert soles[frame].max() < 0.03
    assert soles[round(2.0 * FPS)].max() > 0.05  # and pulled up in the dance
    body = body_pos_m(held)
    ankles = body[:, [BODY_JOINTS.index("left_ankle"), BODY_JOINTS.index("right_ankle")]]
    assert np.linalg.norm(ankles[-1, 0] - ankles[-1, 1]) > 0.08
    assert np.linalg.norm(np.diff(body, n=2, axis=0), axis=-1).max() < 0.02  # no jump


def test_a_standing_foot_stays():
    motion = on_one_leg(0.0, aside_rad=0.0)
    held = hold_ends(motion, 1.6, 2.8)
    assert np.abs(body_pos_m(held)[:, FEET] - body_pos_m(motion)[:, FEET]).max() < 0.012


def test_the_pose_of_the_first_count_is_prepared_and_the_last_one_is_reached_on_its_count():
    at_s = played_s(2.5, 6.0)
    assert at_s[120:150] == pytest.approx(TIMES_S[120:150])  # half a second at full speed
    assert at_s[0] == pytest.approx(2.5 - PICK_UP_S - EASE_IN_S / 2)
    assert at_s[-1] == pytest.approx(6.0 + SETTLE_S - (EASE_OUT_S + SETTLE_S) / 2)
    assert at_s[-1] == pytest.approx(at_s[round((6.0 + SETTLE_S) * FPS) + 1])


@given(st.floats(0.01, 5.0), st.floats(0.05, 2.5))
@example(0.2, 1.0)  # less time than it takes to set off
@example(3.0, 0.1)  # and than to come to rest
def test_the_poses_that_the_graph_weighs_are_those_that_are_held(opening_s, danced_s):
    at_s = played_s(opening_s, opening_s + danced_s)
    first_s, last_s = held_times_s(opening_s, opening_s + danced_s)
    assert [at_s[0], at_s[-1]] == pytest.approx([first_s, last_s])


@given(OPENINGS_S, st.none() | st.floats(0.05, 2.5))
def test_time_never_runs_backwards_nor_faster_nor_jumps(opening_s, danced_s):
    at_s = played_s(opening_s, None if danced_s is None else opening_s + danced_s)
    steps = np.diff(at_s) * FPS
    assert steps.min() > -1e-6 and steps.max() < 1 + 1e-6
    ease_s = min(EASE_IN_S, opening_s, *([] if danced_s is None else [danced_s + SETTLE_S]))
    if ease_s > 0.1:  # speed rises and falls smoothly: 1.5 / ease at most, and once the halves meet, twice
        assert np.abs(np.diff(steps)).max() < 2 * 2.0 / (ease_s * FPS)


@given(OPENINGS_S)
def test_without_a_last_count_it_dances_to_its_end(opening_s):
    at_s = played_s(opening_s, None)
    assert at_s[opening_s <= TIMES_S] == pytest.approx(TIMES_S[opening_s <= TIMES_S])


def test_a_dance_from_start_to_end_is_untouched():
    assert hold_ends(MOTION, 0.0, None) is MOTION


def test_a_first_count_within_the_first_frames_leaves_no_pose_to_hold():
    at_s = played_s(1.0 / FPS, None)
    assert at_s[1:] == pytest.approx(TIMES_S[1:]) and 0 <= at_s[0] < 1 / FPS


def test_a_last_count_at_the_very_end_is_eased_into():
    at_s = played_s(0.0, LENGTH_S)
    assert np.diff(at_s)[-1] * FPS < 0.5 and at_s[-1] <= TIMES_S[-1]


def test_held_poses_of_a_long_dance_are_those_of_splines_through_all_of_it():
    """Only the frames near the held poses are read. Those far away change nothing that can be written."""
    motion = swaying(3000, fps=FPS)
    opening_s, closing_s = 2.0, 47.0
    played = played_times_s(np.arange(motion.n_frames) / FPS, opening_s, closing_s)
    moved = np.flatnonzero(played != np.arange(motion.n_frames) / FPS)
    frames = np.clip(played[moved] * FPS, 0.0, motion.n_frames - 1)
    expected = motion.sampled_smooth(frames)
    for part in np.split(np.arange(len(moved)), np.flatnonzero(np.diff(moved) > 1) + 1):
        ours = _played(motion, frames[part])
        np.testing.assert_allclose(ours.root_pos_m, expected.root_pos_m[part], atol=1e-15)
        np.testing.assert_allclose(ours.local_quat, expected.local_quat[part], atol=1e-15)
    assert len(moved) < 600
