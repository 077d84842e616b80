"""Constraints on every move of every genre (floor, feet, body, beat) over tempi and sizes."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from body_capsules import depths_m

from choreograph.evaluation.metrics.beat import f_score
from choreograph.motion import rotations as rot
from choreograph.motion.body import body_pos_m
from choreograph.motion.contacts import sole_pos_m
from choreograph.motion.kinematics import forward
from choreograph.motion.motion_beats import motion_beat_times_s
from content.moves.genres import GENRES
from content.moves.notation import SIDES, Move, pose, step, touch
from content.moves.sequencer import RenderedTake, render, sequence_moves
from content.songs.danced_styles import DANCED

pytestmark = pytest.mark.slow

MOVES = {f"{genre.name}: {move.name}": move for genre in GENRES.values() for move in genre.moves}
REPEATS = 3
START_S = 1.0

every_move = pytest.mark.parametrize("name", MOVES)


@cache
def danced(name: str, bpm: float = 120.0, size: float = 1.0) -> tuple[RenderedTake, np.ndarray]:
    """The move three times, on alternate sides if it ends on the other foot, and the times of its counts."""
    row: list[Move] = []
    for _ in range(REPEATS):
        move = MOVES[name]
        if row and None not in (row[-1].free_foot, move.first_foot) and move.first_foot != row[-1].free_foot:
            move = move.mirrored()
        row.append(move)
    counts_s = START_S + np.arange(REPEATS * MOVES[name].counts) * 60.0 / bpm
    return render(sequence_moves(row, size=size), counts_s, rng=np.random.default_rng(1)), counts_s


@pytest.mark.parametrize("genre", [genre.name for genre in GENRES.values() if genre.moves])
@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_moves_are_danced_to_the_counts(genre: str, share: float) -> None:
    scores = [_f_score(name, share) for name in MOVES if name.startswith(f"{genre}:")]
    assert np.mean(scores) >= 0.88 and min(scores) >= 0.5


def _f_score(name: str, share: float) -> float:
    low, high = DANCED[name.partition(":")[0]].bpm  # the range of its songs and takes
    bpm = max(90.0, low + share * (high - low))
    rendered, counts_s = danced(name, bpm)
    counts_s, half = counts_s[1:-2], 30.0 / bpm
    beats = motion_beat_times_s(body_pos_m(rendered.motion), rendered.motion.fps)
    beats = beats[(beats > counts_s[0] - half) & (beats < counts_s[-1] + half)]
    return f_score(beats, counts_s)


@every_move
@pytest.mark.parametrize("size", [0.7, 1.25])
def test_planted_feet_stand_still_on_the_floor(name: str, size: float) -> None:
    rendered, _ = danced(name, 120.0, size)
    motion = rendered.motion
    pos = motion.joint_pos_m()
    for side in SIDES:
        path = rendered.feet[side]
        assert path.planted.mean() > 0.3
        rolls = path.toe_pitch_rad > 1e-9
        assert (path.planted | rolls | (path.ball_m[:, 1] > 0.02)).mean() > 0.87  # low feet stand or roll
        for joint, still in (("foot", path.planted), ("ankle", path.flat)):
            place = pos[:, motion.skeleton.index(f"{side}_{joint}")]
            speed = np.linalg.norm(np.diff(place, axis=0), axis=1) * motion.fps
            stays = speed[still[1:] & still[:-1]]  # a foot may be on its ball throughout
            assert not len(stays) or stays.max() < 0.02
        ball_y = pos[path.planted, motion.skeleton.index(f"{side}_foot"), 1]
        np.testing.assert_allclose(ball_y, 0.015, atol=0.003)


@every_move
def test_feet_stay_over_the_floor(name: str) -> None:
    for size in (0.7, 1.25):
        assert sole_pos_m(danced(name, 120.0, size)[0].motion)[..., 1].min() > -0.005


@every_move
def test_legs_reach_the_feet(name: str) -> None:
    for size in (0.7, 1.25):
        rendered, _ = danced(name, 120.0, size)
        skeleton, pos = rendered.motion.skeleton, rendered.motion.joint_pos_m()
        for side in SIDES:
            ankle = pos[:, skeleton.index(f"{side}_ankle")]
            assert np.abs(ankle - rendered.feet[side].ankle_m()).max() < 0.005


@every_move
@pytest.mark.parametrize("size", [0.7, 1.0, 1.25])
def test_the_body_does_not_pass_through_itself(name: str, size: float) -> None:
    depths = depths_m(danced(name, 120.0, size)[0].motion)
    deep = {pair: (depth > 0.02).mean() for pair, depth in depths.items()}
    assert {pair: share for pair, share in deep.items() if share > 0.05} == {}


@every_move
def test_joints_turn_no_faster_than_real_ones(name: str) -> None:
    """Real takes (cha-cha): the fastest joint 20 rad/s and 600 rad/s² in 99 of 100 frames."""
    motion = danced(name, 150.0)[0].motion
    turn = rot.multiply(rot.invert(motion.local_quat[:-1]), motion.local_quat[1:])
    speed = rot.to_rotvec(turn) * motion.fps  # (T-1, J, 3)
    assert np.percentile(np.linalg.norm(speed, axis=-1).max(axis=1), 99) < 22.0
    change = np.linalg.norm(np.diff(speed, axis=0), axis=-1).max(axis=1) * motion.fps
    assert np.percentile(change, 99) < 750.0


@every_move
def test_quaternions_are_unit_and_continuous(name: str) -> None:
    quat = danced(name)[0].motion.local_quat
    np.testing.assert_allclose(np.linalg.norm(quat, axis=-1), 1.0, atol=1e-9)
    assert (np.sum(quat[1:] * quat[:-1], axis=-1) > 0.9).all()


@every_move
def test_knees_bend_the_right_way(name: str) -> None:
    motion = danced(name)[0].motion
    pos, _ = forward(motion.skeleton, motion.root_pos_m, motion.local_quat)
    for side in SIDES:
        hip, knee, ankle = (pos[:, motion.skeleton.index(f"{side}_{j}")] for j in ("hip", "knee", "ankle"))
        ahead = rot.rotate(rot.about_y(danced(name)[0].feet[side].yaw_rad), np.array([0.0, 0.0, 1.0]))
        assert (np.sum((knee - 0.5 * (hip + ankle)) * ahead, axis=-1) > -0.02).all()


@pytest.mark.parametrize("tilt", [15.0, -15.0])
def test_hip_tilt_puts_the_tail_back_under_a_quiet_chest(tilt: float) -> None:
    move = Move("tilt", 2, (step("left", 1), touch("right", 2)), {c: pose(hip_tilt=tilt) for c in (1, 2)})
    motion = render(sequence_moves([move, move.mirrored()]), START_S + 0.5 * np.arange(4), rng=None).motion
    frame = round((START_S + 1.0) * motion.fps)
    _, quat = forward(motion.skeleton, motion.root_pos_m, motion.local_quat)
    pelvis, chest = (
        rot.rotate(quat[frame, motion.skeleton.index(joint)], np.array([0.0, 1.0, 0.0]))[2]
        for joint in ("pelvis", "spine3")
    )
    assert np.sign(pelvis) == np.sign(tilt) and abs(pelvis) > 0.2  # the top forward, the tail back
    assert abs(chest) < 0.6 * abs(pelvis)
