"""Cameras: all is in the picture, cuts lie on borders, and shots in a row differ."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from synthetic_motions import stepping

from choreograph.core.errors import ParameterError
from choreograph.motion.cameras import (
    ASPECT,
    CAMERA_MODES,
    FOV_RAD,
    LEAST_SIZE_RATIO,
    LEAST_TURN_RAD,
    LOWEST_M,
    plan_cameras,
)

BORDERS_S = (4.0, 8.0, 12.0, 12.5, 16.0, 20.0, 24.0, 28.0, 31.0)
CUTS_S = [4.0, 8.0, 12.0, 16.0, 20.0, 24.0, 28.0]  # 12.5 is too near to the last one, and 31 to the end


def moved(motion, x_m, z_m, *, walks_m=0.0):
    """A dancer at a place, who walks sideways and back."""
    way = walks_m * np.sin(np.linspace(0.0, 4 * np.pi, motion.n_frames))
    place = np.stack([x_m + way, np.zeros_like(way), np.full_like(way, z_m)], axis=1)
    return replace(motion, root_pos_m=motion.root_pos_m + place)


ONE = [moved(stepping(32 * 30, seed=1), 0.0, 0.0, walks_m=1.5)]
FOUR = [
    moved(stepping(32 * 30, seed=seed), x, z, walks_m=0.5)
    for seed, (x, z) in enumerate([(-2.0, 0.0), (0.0, 1.0), (2.0, 0.5), (0.5, -2.0)])
]


def in_picture(path, motions, aspect=ASPECT):
    """The places of all joints in the picture, (T, N, 2), ±1 at its edges, and their depth."""
    times_s = np.arange(0.0, motions[0].duration_s, 1 / 30)
    eye, target = path.at(times_s)
    points = np.concatenate([m.resampled(30).joint_pos_m()[: len(times_s)] for m in motions], axis=1)
    ahead = (target - eye) / np.linalg.norm(target - eye, axis=1, keepdims=True)
    right = np.cross(ahead, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    up = np.cross(right, ahead)
    seen = points - eye[:, None]
    depth = np.einsum("tnk,tk->tn", seen, ahead)
    high = np.tan(FOV_RAD / 2)
    x = np.einsum("tnk,tk->tn", seen, right) / (depth * high * aspect)
    return times_s, np.stack([x, np.einsum("tnk,tk->tn", seen, up) / (depth * high)], axis=-1), depth


@pytest.mark.parametrize("motions", [ONE, FOUR], ids=["one", "four"])
@pytest.mark.parametrize("mode", CAMERA_MODES)
def test_every_joint_of_every_dancer_is_in_the_picture(motions, mode):
    path = plan_cameras(motions, mode, BORDERS_S)
    times_s, places, depth = in_picture(path, motions)
    number = np.searchsorted(path.cuts_s, times_s, side="right")
    for index, shot in enumerate(path.shots):
        here = number == index
        if shot.name == "close":
            continue
        assert (depth[here] > 0).all()
        assert np.abs(places[here]).max() < 1.0, shot.name
        if shot.name == "wide":
            assert np.abs(places[here]).max() < 0.8
        if len(path.shots) == 1:  # and it is not farther than needed
            assert np.abs(places[here]).max() > 0.5


def test_cuts_are_on_borders_and_the_shots_follow_each_other_without_gaps():
    path = plan_cameras(ONE, "cuts", BORDERS_S)
    assert path.cuts_s == CUTS_S
    assert [shot.start_s for shot in path.shots[1:]] == [shot.end_s for shot in path.shots[:-1]]
    assert path.shots[-1].end_s == ONE[0].duration_s
    assert {shot.name for shot in path.shots} == {"wide", "follow", "close", "low"}
    assert path.shots[0].name == path.shots[-1].name == "wide"
    for mode in ("front", "follow"):
        assert plan_cameras(ONE, mode, BORDERS_S).cuts_s == []


@pytest.mark.parametrize("motions", [ONE, FOUR], ids=["one", "four"])
@pytest.mark.parametrize("n_borders", range(len(CUTS_S) + 1))
def test_shots_in_a_row_differ_in_direction_and_size(motions, n_borders):
    shots = plan_cameras(motions, "cuts", CUTS_S[:n_borders]).shots
    assert len(shots) == n_borders + 1
    for before, after in pairwise(shots):
        sights = [shot.target_m[0] - shot.eye_m[0] for shot in (before, after)]
        one, other = (sight / np.linalg.norm(sight) for sight in sights)
        assert np.arccos(one @ other) >= LEAST_TURN_RAD
        sizes = sorted(shot.shown_m for shot in (before, after))
        assert sizes[1] / sizes[0] >= LEAST_SIZE_RATIO * (1 - 1e-9), (before.name, after.name)


@pytest.mark.parametrize("motions", [ONE, FOUR], ids=["one", "four"])
def test_cameras_stay_above_the_floor_and_on_the_side_of_the_audience(motions):
    for mode in CAMERA_MODES:
        for shot in plan_cameras(motions, mode, BORDERS_S).shots:
            assert (shot.eye_m[:, 1] >= LOWEST_M - 1e-9).all()
            assert (shot.eye_m[:, 2] > shot.target_m[:, 2]).all()


def test_a_low_shot_looks_up_and_a_close_one_shows_the_upper_body():
    shots = {shot.name: shot for shot in plan_cameras(ONE, "cuts", BORDERS_S).shots}
    assert shots["low"].eye_m[0, 1] < 0.8 and shots["low"].target_m[0, 1] > shots["low"].eye_m[0, 1]
    assert shots["close"].shown_m < 0.75 * shots["follow"].shown_m
    assert shots["close"].target_m[0, 1] > 1.0


def test_cameras_that_follow_move_smoothly_and_wide_ones_stand_still():
    path = plan_cameras(ONE, "cuts", BORDERS_S)
    for shot in path.shots:
        speed = np.linalg.norm(np.diff(shot.eye_m, axis=0), axis=1) / np.diff(shot.times_s)
        assert speed.max() < 1.5
        assert (speed.max() > 0.1) == (shot.name != "wide")
        turns = np.diff(shot.target_m - shot.eye_m, axis=0)
        assert np.abs(turns).max() < 1e-9  # a direction of a shot is fixed


def test_a_camera_does_not_glide_over_a_cut():
    path = plan_cameras(ONE, "cuts", BORDERS_S)
    for before, after in pairwise(path.shots):
        eye, _ = path.at([after.start_s - 0.01, after.start_s])
        assert np.linalg.norm(eye[0] - before.eye_m[-1]) < 0.05
        assert np.allclose(eye[1], after.eye_m[0])
    times_s, eyes, targets = path.keys
    assert (np.diff(times_s) > 0).all() and len(eyes) == len(targets) == len(times_s)


def test_no_other_dancer_stands_before_a_close_camera():
    blocking = [moved(stepping(12 * 30, seed=1), 0.0, 0.0), moved(stepping(12 * 30, seed=2), -1.2, 1.3)]
    close = plan_cameras(blocking, "cuts", (4.0, 8.0)).shots
    (shot,) = [shot for shot in plan_cameras(blocking, "cuts", (3.0, 6.0, 9.0)).shots if shot.name == "close"]
    eye, target = shot.eye_m[0], shot.target_m[0]
    for motion in blocking:
        root = motion.root_pos_m[100]
        along = np.clip((root - eye) @ (target - eye) / ((target - eye) @ (target - eye)), 0, 1)
        distance = np.linalg.norm(root - eye - along * (target - eye))
        assert distance > 0.5 or along > 0.95  # the dancer that is shown stands at the end of the sight
    assert close[0].name == "wide"


def test_what_is_wrong_is_refused():
    with pytest.raises(ParameterError, match="at least one dancer"):
        plan_cameras([], "front")
    with pytest.raises(ParameterError, match="among front, follow, cuts, got 'drone'"):
        plan_cameras(ONE, "drone")
    for borders in ((2.0, 1.0), (np.nan,), ((1.0,),)):
        with pytest.raises(ParameterError, match="increasing times"):
            plan_cameras(ONE, "cuts", borders)
