"""Assembly of runs: lengths, identity, alignment, and transitions without a jump."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from synthetic_motions import stepping, swaying

from choreograph.core.errors import ParameterError
from choreograph.motion import rotations as rot
from choreograph.motion.body import body_pos_m, ground_pos_m, heading_rad
from choreograph.motion.motion import Motion
from choreograph.plan.joins import MAX_STEER_RAD, steer_rad
from choreograph.plan.runs import Run, to_runs
from choreograph.render.assembly import assemble
from choreograph.settings import TRANSITION_LENGTHS_S, Blending

TAKES = {
    "sway": swaying(900, fps=60.0, seed=1),
    "other": swaying(900, fps=60.0, seed=2).moved(yaw_rad=2.0, shift_m=np.array([4.0, 0.0, -3.0])),
    "slow": swaying(450, fps=30.0, seed=3).moved(yaw_rad=-1.0),
    "step": stepping(900, fps=60.0, period_s=0.6, seed=4),
}


def read_motion(take, start_s, stop_s):
    motion = TAKES[take]
    first = max(0, int(np.floor(start_s * motion.fps)))
    last = min(motion.n_frames, int(np.ceil(stop_s * motion.fps)) + 2)
    return motion.sliced(first, last), first / motion.fps


def seconds(*starts: float, speed: float = 1.0):
    """21 source instants of a second from each start."""
    return [tuple(start + speed * np.arange(21) / 20) for start in starts]


def assembled(takes, times, *, fps=60.0, duration_s=None, **settings):
    settings = {"blending": "inertial"} | settings
    return assemble(
        to_runs(takes, times), read_motion, fps=fps, duration_s=duration_s or len(takes), **settings
    )


def test_seconds_that_follow_one_another_are_one_run():
    runs = to_runs(["a", "a", "a", "b", "b"], seconds(2.0, 3.0, 5.0, 6.0, 7.0))
    assert [(run.take, run.start_s, run.stop_s) for run in runs] == [("a", 0, 2), ("a", 2, 3), ("b", 3, 5)]
    assert np.allclose(runs[0].source_times_s, np.arange(2.0, 4.001, 0.05))


@pytest.mark.parametrize("blending", get_args(Blending))
def test_one_run_is_the_take_itself(blending):
    made, joins = assembled(["sway"] * 3, seconds(4.0, 5.0, 6.0), blending=blending)
    assert len(joins.times_s) == 0
    assert np.allclose(made.joint_pos_m(), TAKES["sway"].sliced(240, 420).joint_pos_m(), atol=1e-6)


@pytest.mark.parametrize("blending", get_args(Blending))
def test_a_transition_of_a_take_to_itself_changes_nothing(blending):
    # Two runs by force, where the second plays on from the first.
    runs = [
        Run("sway", 0.0, 2.0, np.arange(4.0, 6.001, 0.05)),
        Run("sway", 2.0, 4.0, np.arange(6.0, 8.001, 0.05)),
    ]
    made, joins = assemble(runs, read_motion, fps=60.0, duration_s=4.0, blending=blending)
    assert joins.times_s.tolist() == [2.0]
    assert np.abs(made.joint_pos_m() - TAKES["sway"].sliced(240, 480).joint_pos_m()).max() < 1e-3


@pytest.mark.parametrize("fps", [24.0, 25.0, 29.97, 60.0])
@pytest.mark.parametrize("duration_s", [0.01, 1.5, 2.97, 3.0])
def test_length(fps, duration_s):
    made, _ = assembled(["sway", "other", "slow"], seconds(2.0, 2.0, 2.0), fps=fps, duration_s=duration_s)
    assert made.n_frames == max(1, round(duration_s * fps))
    assert made.fps == fps


@pytest.mark.parametrize("blending", get_args(Blending))
@pytest.mark.parametrize("second_take", ["other", "slow", "step"])
def test_a_run_is_aligned_with_the_one_before(blending, second_take):
    made, _ = assembled(
        ["sway", "sway", second_take, second_take],
        seconds(3, 4, 5, 6),
        blending=blending,
        stage="free",
        to_front=False,
    )
    body = body_pos_m(made)
    alone = body_pos_m(TAKES["sway"].sliced(180, 301))
    at = 120
    apart_m = np.linalg.norm(ground_pos_m(body[at]) - ground_pos_m(alone[at]))
    assert apart_m < (0.15 if second_take == "step" else 0.05)  # whose feet stand, and meet those before
    turn = np.angle(np.exp(1j * (heading_rad(body[at]) - heading_rad(alone[at]))))
    assert abs(turn) < 0.15
    # Heights are the take's: nobody sinks or floats.
    settled = 120 + int(60 * TRANSITION_LENGTHS_S[blending][0]) + 2
    source = TAKES[second_take].resampled(60.0)
    heights = source.sliced(300, 420).joint_pos_m()[settled - 120 :, 0, 1]
    assert np.allclose(made.root_pos_m[settled:, 1], heights, atol=5e-3)


@pytest.mark.parametrize("blending", get_args(Blending))
@pytest.mark.parametrize("transition_s", [0.001, 1.0])
def test_a_transition_has_the_given_length(blending, transition_s):
    """A plan may say any fade, also one that nothing searches for."""
    times = [t for start in (3, 6) for t in (start, start + 1, start + 2)]
    runs = to_runs(["sway"] * 3 + ["other"] * 3, seconds(*times))
    made = [
        assemble(given, read_motion, fps=60.0, duration_s=6.0, blending=blending)[0]
        for given in (runs, [runs[0], replace(runs[1], transition_s=transition_s)])
    ]
    assert np.isfinite(made[1].root_pos_m).all() and np.isfinite(made[1].local_quat).all()
    changed = np.abs(made[0].local_quat - made[1].local_quat).max(axis=(1, 2)) > 1e-6
    reach = round(60 * max(transition_s, TRANSITION_LENGTHS_S[blending][0])) + 1
    assert changed[180 - reach : 180 + reach].any()
    assert not changed[: 180 - reach].any() and not changed[180 + reach :].any()


def jerk(motion):
    """Jerk of the body, (T - 3,), m/s³, root mean square over joints."""
    return np.sqrt(((np.diff(body_pos_m(motion), n=3, axis=0) * motion.fps**3) ** 2).mean(axis=(1, 2)))


@pytest.mark.parametrize("blending", get_args(Blending))
def test_transitions_are_continuous(blending):
    made, joins = assembled(["sway", "other", "step", "slow"], seconds(3, 7, 2, 9), blending=blending)
    assert joins.times_s.tolist() == [1.0, 2.0, 3.0]
    step = np.linalg.norm(np.diff(body_pos_m(made), axis=0), axis=2).max(axis=1) * 60  # fastest joint, m/s
    assert step.max() < 8.0  # a hard cut between these poses is dozens of metres per second
    assert (np.sum(made.local_quat[1:] * made.local_quat[:-1], axis=-1) > 0.9).all()
    assert np.allclose(np.linalg.norm(made.local_quat, axis=-1), 1.0)


def test_inertialization_is_smooth_where_a_hard_cut_is_not():
    made, joins = assembled(["sway", "other", "step", "slow"], seconds(3, 7, 2, 9))
    cut = [TAKES[take].resampled(60.0) for take in ("sway", "other", "step", "slow")]
    cut_pos = [body_pos_m(m)[60 * s : 60 * s + 60] for m, s in zip(cut, (3, 7, 2, 9), strict=True)]
    for before, after in itertools.pairwise(cut_pos):
        after -= ground_pos_m(after[0]) - ground_pos_m(before[-1])
    hard = np.sqrt(((np.diff(np.concatenate(cut_pos), n=3, axis=0) * 60**3) ** 2).mean(axis=(1, 2)))
    near = (np.abs(np.arange(len(hard))[:, None] / 60 - joins.times_s) < 0.12).any(axis=1)
    assert jerk(made)[near].max() < 0.02 * hard[near].max()


def test_time_maps_are_played_smoothly():
    # Half speed to double speed in three seconds, without any knee at the seconds' borders.
    times = 2.0 + np.cumsum(np.concatenate([[0.0], np.linspace(0.5, 2.0, 60) / 20]))
    made, _ = assembled(["step"] * 3, [tuple(times[20 * s : 20 * s + 21]) for s in range(3)])
    played_s = np.interp(np.arange(180) / 60, np.arange(61) / 20, times)
    expected = TAKES["step"].sampled(played_s * 60).joint_pos_m()
    assert np.abs(made.joint_pos_m() - expected).max() < 0.01


def test_a_second_at_either_end_of_a_take():
    made, _ = assembled(["sway", "other", "sway"], seconds(0.0, 13.95, 13.95))
    assert np.isfinite(made.joint_pos_m()).all()


def test_an_unknown_blending():
    with pytest.raises(ParameterError, match="'glue'"):
        assembled(["sway"], seconds(2.0), blending="glue")


def test_a_dance_that_walks_away_is_steered_home():
    # One stretch that travels, again and again: as it stands it would leave the room in a line.
    walker = swaying(2400, fps=60.0)
    path = np.zeros((2400, 3))
    path[:, 2] = np.arange(2400) / 60.0  # 1 m/s ahead
    walker = Motion(walker.skeleton, walker.root_pos_m + path, walker.local_quat, 60.0)
    runs = [Run("walk", s, s + 1.0, np.arange(3.0, 4.001, 0.05)) for s in range(40)]
    made, _ = assemble(runs, lambda *_: (walker, 0.0), fps=60.0, duration_s=40.0, blending="inertial")
    away = np.linalg.norm((made.root_pos_m - made.root_pos_m[0])[:, [0, 2]], axis=1)
    assert away.max() < 12.0


def test_a_take_that_begins_turned_away_is_steered_back_to_the_front():
    # The take turns half around in its first five seconds. All runs after that begin at the front.
    dancer = swaying(2400, fps=60.0)
    turn = rot.about_y(np.pi * np.clip(np.arange(2400) / 300.0, 0.0, 1.0))
    quat = dancer.local_quat.copy()
    quat[:, 0] = rot.multiply(turn, quat[:, 0])
    turning = Motion(dancer.skeleton, dancer.root_pos_m, rot.make_continuous(quat), 60.0)
    takes = {"turns": turning, "even": dancer, "odd": dancer}
    runs = [Run("turns", 0.0, 6.0, np.arange(0.0, 6.001, 0.05))]
    runs += [Run(("even", "odd")[s % 2], s, s + 1.0, np.arange(s, s + 1.001, 0.05)) for s in range(6, 39)]
    made, _ = assemble(
        runs, lambda take, *_: (takes[take], 0.0), fps=60.0, duration_s=39.0, blending="inertial"
    )
    dancer = dancer.sliced(0, made.n_frames)
    away_rad = np.abs(
        np.angle(np.exp(1j * (heading_rad(body_pos_m(made)) - heading_rad(body_pos_m(dancer)))))
    )
    assert away_rad[350] > 3.0
    assert away_rad[30 * 60 :].max() < 0.7


def test_the_front_comes_before_the_stage_unless_the_stage_is_far_away():
    ahead, place = np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, 1.0])  # leaves the stage to the front
    assert abs(steer_rad(2.0 * place, ahead)) == pytest.approx(MAX_STEER_RAD)
    for turned in (0.5, -0.5):
        assert steer_rad(2.0 * place, ahead, turned) == pytest.approx(-np.sign(turned) * MAX_STEER_RAD)
    aside = steer_rad(
        np.array([3.0, 0.0, 0.0]), -ahead, 0.1
    )  # home is at +90°: after -0.1 rad, 0.15 are left
    assert aside == pytest.approx(-0.1 + MAX_STEER_RAD - 0.1)
    assert steer_rad(0.5 * place, ahead) == steer_rad(8.0 * place, 0.0 * ahead) == 0.0
    far = np.array([8.0, 0.0, 0.0])
    assert steer_rad(far, ahead, 0.5) == steer_rad(far, ahead) == pytest.approx(-MAX_STEER_RAD)


@pytest.mark.parametrize("blending", get_args(Blending))
def test_short_runs_are_blended_smoothly_and_keep_their_middles(blending):
    starts = np.arange(0.0, 6.0, 0.4)
    takes = ["sway", "other", "step"] * 5
    runs = [Run(t, s, s + 0.4, np.linspace(s + 2, s + 2.4, 9)) for t, s in zip(takes, starts, strict=True)]
    made, joins = assemble(runs, read_motion, fps=60.0, duration_s=6.0, blending=blending)
    assert joins.times_s == pytest.approx(starts[1:])
    assert made.n_frames == 360
    step = np.linalg.norm(np.diff(body_pos_m(made), axis=0), axis=2).max(axis=1) * 60  # m/s
    assert step.max() < 12.0
    middle = round(60 * (starts[4] + 0.2))  # of a run of "other"
    source = TAKES["other"].sampled(np.array([(starts[4] + 2.2) * 60]))
    arms = slice(made.skeleton.index("neck"), None)
    assert np.allclose(made.local_quat[middle, arms], source.local_quat[0, arms], atol=5e-3)
