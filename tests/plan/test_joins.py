"""Transitions are put on counts where both takes allow it, and are as short as is gentle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_motions import stepping

from choreograph.core.cache import Memory
from choreograph.motion import rotations as rot
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Credits, Motion
from choreograph.plan.joins import time_transitions
from choreograph.plan.plan import PlannedSecond, second_block
from choreograph.plan.runs import Run, to_runs, with_transitions
from choreograph.settings import TRANSITION_LENGTHS_S

FPS = 60.0
TAKES = {name: stepping(24 * 30, period_s=0.6, seed=seed) for seed, name in enumerate("abc")}
LENGTHS_S = {name: motion.duration_s for name, motion in TAKES.items()}


def read(take, start_s, stop_s):
    return TAKES[take], 0.0


def seconds(takes, *, from_s: float = 2.0) -> list[Run]:
    """Runs of one second and more; a take that others follow in goes on where the song is."""
    played = [np.linspace(second, second + 1.0, 21) + from_s for second in range(len(takes))]
    return to_runs(list(takes), played)


def timed(runs, joins_s, *, lengths_s=LENGTHS_S, blending="inertial", **options):
    return time_transitions(runs, joins_s, lengths_s, read, fps=FPS, blending=blending, **options)


def starts_s(timings) -> list[float]:
    return [timing.start_s for timing in timings]


def test_runs_take_over_on_their_counts():
    runs = seconds("aabbbcc")
    assert starts_s(timed(runs, [0.3, 1.7, 5.4])) == [0.0, 1.7, 5.4]  # the first at its start


def test_known_transitions_are_timed_without_reading_their_takes():
    memory, reads = Memory(1 << 20), []

    def reading(take, start_s, stop_s):
        reads.append(take)
        return read(take, start_s, stop_s)

    def timed_with_memory(runs, joins_s):
        reads.clear()
        return time_transitions(
            runs, joins_s, LENGTHS_S, reading, fps=FPS, blending="inertial", memory=memory
        )  # fmt: skip

    for joins_s, wanted in (
        ([0.3, 1.7, 5.4], ["a", "b", "b", "c"]),
        ([0.3, 1.7, 5.4], []),
        ([0.3, 1.7, 5.3], ["b", "c"]),
    ):
        found = timed_with_memory(seconds("aabbbcc"), joins_s)
        assert reads == wanted
        assert found == timed(seconds("aabbbcc"), joins_s)
    timed_with_memory(seconds("aabbbcc", from_s=1.0), [0.3, 1.7, 5.4])
    assert reads == ["a", "b", "b", "c"]


@pytest.mark.parametrize(
    ("joins_s", "wanted"),
    [
        ([0.0, 1.4, 2.0], [0.0, 1.4, 2.0]),
        ([0.0, 1.45, 2.0], [0.0, 1.0, 2.0]),  # it would last 0.55 s
        ([0.0, 1.4, 1.9], [0.0, 1.4, 2.0]),  # from 1.4 to 1.9 s
        ([0.0, 0.55, 2.0], [0.0, 1.0, 2.0]),
        ([0.0, 0.6, 2.4], [0.0, 0.6, 2.4]),
    ],
)
def test_no_run_is_made_shorter_than_six_tenths(joins_s, wanted):
    assert starts_s(timed(seconds("abc"), joins_s)) == wanted


def test_a_take_is_not_played_beyond_its_ends():
    late = to_runs("ab", [np.linspace(4.0, 5.0, 21), np.linspace(3.0, 4.0, 21)])
    for end_s, wanted_s in ((5.0, 1.0), (5.4, 1.3)):
        assert starts_s(timed(late, [0.0, 1.3], lengths_s=LENGTHS_S | {"a": end_s})) == [0.0, wanted_s]
    for begin_s, wanted_s in ((0.0, 1.0), (0.2, 1.0), (0.35, 0.7)):
        early = to_runs("ab", [np.linspace(4.0, 5.0, 21), np.linspace(begin_s, begin_s + 1, 21)])
        assert starts_s(timed(early, [0.0, 0.7])) == [0.0, wanted_s]


def test_a_take_whose_speed_has_a_corner_at_an_end_is_not_played_beyond_it():
    """The time map follows the border of its take for a frame: the spline there goes back in time."""
    corner = np.concatenate([[0.0, 0.5], 0.5 + 1.2 * np.arange(1, 20)]) / 20
    entered = to_runs("ab", [np.linspace(4.0, 5.0, 21), corner])
    assert entered[1].source_s(np.array([0.7]))[0] < -0.05
    assert starts_s(timed(entered, [0.0, 0.7])) == [0.0, 1.0]
    left = to_runs("ab", [5.0 - corner[::-1], np.linspace(4.0, 5.0, 21)])
    assert left[0].source_s(np.array([1.3]))[0] > 5.05
    assert starts_s(timed(left, [0.0, 1.3], lengths_s=LENGTHS_S | {"a": 5.0})) == [0.0, 1.0]


@settings(max_examples=50)
@given(st.integers(0, 2**32 - 1), st.integers(1, 3), st.floats(-0.5, 0.5))
def test_a_plan_names_the_part_of_a_take_that_is_played(seed, n_seconds, away_s):
    """Also before and after the seconds that are planned, and at any corners of the time map."""
    rng = np.random.default_rng(seed)
    slopes = rng.choice([0.5, 1.0, 1.2, 2.0], 20 * n_seconds)
    times_s = 3.0 + np.concatenate([[0.0], np.cumsum(slopes)]) / 20
    played = [times_s[20 * second : 20 * second + 21] for second in range(n_seconds)]
    (run,) = to_runs("a" * n_seconds, played)
    for at_s, second in ((min(away_s, 0.0), 0), (n_seconds + max(away_s, 0.0), n_seconds - 1)):
        planned = PlannedSecond(
            second, "a", 0, 3.0, 0, 0, tuple(played[second]), float(second), 0.3, {}, Credits()
        )
        named_s = second_block(planned, (at_s, second + 1.0) if at_s < second else (second, at_s))
        source_s = named_s.source_start_s if at_s < second else named_s.source_end_s
        assert source_s == pytest.approx(run.source_s(np.array([at_s]))[0], abs=1e-6)


def test_fixed_and_locked_runs_start_on_time():
    runs = seconds("abcab")
    joins_s = [0.0, 1.2, 2.2, 3.2, 4.2]
    assert starts_s(timed(runs, joins_s)) == joins_s
    fixed = [False, True, False, False, True]
    assert starts_s(timed(runs, joins_s, fixed=fixed)) == [0.0, 1.0, 2.2, 3.2, 4.0]
    held = runs[2]
    runs[2] = Run(held.take, held.start_s, held.stop_s, held.source_times_s, locked=True)
    assert starts_s(timed(runs, joins_s)) == [0.0, 1.2, 2.0, 3.0, 4.2]  # neither into it nor out of it


def test_a_run_that_has_to_give_way_alone_takes_more_time():
    """Beside a pinned run one side brings the whole offset to rest, from a standstill."""
    runs = seconds("ab")
    shared = timed(runs, [0.0, 1.0])[1].transition_s
    held = runs[0]
    runs[0] = Run(held.take, held.start_s, held.stop_s, held.source_times_s, locked=True)
    alone = timed(runs, [0.0, 1.0])[1].transition_s
    assert shared < alone


@settings(max_examples=25)
@given(st.text("abc", min_size=1, max_size=8), st.sampled_from(["inertial", "linear"]), st.data())
def test_transitions_stay_near_in_order_and_repeatable(takes, blending, data):
    runs = seconds(takes)
    reach = data.draw(st.lists(st.floats(-0.5, 0.5), min_size=len(runs), max_size=len(runs)))
    joins_s = [run.start_s + away for run, away in zip(runs, reach, strict=True)]
    timings = timed(runs, joins_s, blending=blending)
    assert timings == timed(runs, joins_s, blending=blending)
    assert timings[0].start_s == 0.0 and len(timings) == len(runs)
    for timing, run, at_s in list(zip(timings, runs, joins_s, strict=True))[1:]:
        assert timing.start_s in (run.start_s, at_s)
        assert timing.transition_s in TRANSITION_LENGTHS_S[blending]
    assert (np.diff([*starts_s(timings), runs[-1].stop_s]) >= 0.6 - 1e-9).all()
    moved = with_transitions(runs, timings)
    assert [run.start_s for run in moved] == starts_s(timings)
    assert [run.stop_s for run in moved] == [*starts_s(timings)[1:], runs[-1].stop_s]


def test_no_runs_need_no_transition():
    assert timed([], []) == []


def test_a_transition_is_the_shortest_that_is_gentle():
    """At rest, a body that stands as the other does needs the shortest; the farther apart, the longer."""
    shortest, *_, longest = sorted(TRANSITION_LENGTHS_S["inertial"])
    same = to_runs("aa", [np.linspace(2.4, 3.4, 21), np.linspace(4.6, 5.6, 21)])  # both at rest, 2 periods
    apart = to_runs("ab", [np.linspace(2.4, 3.4, 21), np.linspace(4.6, 5.6, 21)])
    assert timed(same, [0.0, 1.0])[1].transition_s == shortest
    lengths = [timed(apart, [0.0, at_s])[1].transition_s for at_s in np.linspace(0.7, 1.3, 7)]
    assert timed(apart, [0.0, 1.0])[1].transition_s > shortest
    assert max(lengths) <= longest
    assert timed(apart, [0.0, 1.0], blending="linear")[1].transition_s == TRANSITION_LENGTHS_S["linear"][0]


@pytest.mark.parametrize("turn_rad", [0.05, 0.3, 0.6, 1.2])
@pytest.mark.parametrize("locked", [False, True])
def test_no_joint_is_accelerated_by_more_than_4_m_s2(turn_rad, locked):
    """Two bodies stand still with different arms. A side that takes all of the offset starts at rest."""
    still = TAKES["a"].sliced(0, 1)
    quat = np.repeat(still.local_quat, 600, axis=0)
    raised = quat.copy()
    shoulder = still.skeleton.index("left_shoulder")
    raised[:, shoulder] = rot.multiply(rot.from_rotvec(np.array([0.0, 0.0, turn_rad])), raised[:, shoulder])
    root_pos_m = np.repeat(still.root_pos_m, 600, axis=0)
    bodies = {
        name: Motion(still.skeleton, root_pos_m, of, FPS) for name, of in (("a", quat), ("b", raised))
    }  # fmt: skip
    apart_m = np.linalg.norm(body_pos_m(bodies["b"])[0] - body_pos_m(bodies["a"])[0], axis=-1).max()
    runs = to_runs("ab", [np.linspace(3.0, 4.0, 21)] * 2)
    runs[0] = replace(runs[0], locked=locked)
    (_, timing) = time_transitions(
        runs, [0.0, 1.0], dict.fromkeys("ab", 10.0), lambda take, *_: (bodies[take], 0.0), fps=FPS,
        blending="inertial",
    )  # fmt: skip
    # Peaks of the second derivative of a quintic, with the speed of the minimum-jerk path and from rest.
    peak = 5.8 if locked else 1.45
    options = sorted(TRANSITION_LENGTHS_S["inertial"])
    gentle = [length_s for length_s in options if peak * apart_m / length_s**2 <= 4.0]
    assert timing.transition_s == (gentle or options[-1:])[0]
