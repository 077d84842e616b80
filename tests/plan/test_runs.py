"""Runs of seconds and of words: what is one run, what is cut out of another."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from synthetic_motions import swaying

from choreograph.core.cache import Memory
from choreograph.motion.body import BODY_JOINTS
from choreograph.motion.contacts import CONTACT_JOINTS
from choreograph.plan.joins import sample_kept_run, sample_run
from choreograph.plan.runs import (
    Run,
    TransitionTiming,
    overlay_runs,
    to_runs,
    with_transitions,
    words_to_runs,
)


def spans(runs):
    return [(run.take, round(run.start_s, 6), round(run.stop_s, 6)) for run in runs]


def covers(runs, duration_s):
    """Whether the runs fill the dance without gap or overlap."""
    borders = [(run.start_s, run.stop_s) for run in runs]
    return np.allclose([b for b, _ in borders], [0.0, *(e for _, e in borders[:-1])]) and np.isclose(
        borders[-1][1], duration_s
    )


def test_words_that_follow_one_another_in_their_take_are_one_run():
    beats = np.array([0.0, 0.5, 1.1, 1.5, 2.0])
    runs = words_to_runs(
        ["a", "a", "a", "b"],
        np.stack([beats[:-1], beats[1:]], axis=1),
        np.array([[3.0, 3.6], [3.6, 4.0], [9.0, 9.5], [9.5, 10.0]]),
        [False, True, False, False],
    )
    assert [run.locked for run in runs] == [True, False, False]
    assert spans(runs) == [("a", 0.0, 1.1), ("a", 1.1, 1.5), ("b", 1.5, 2.0)]
    assert runs[0].source_s(beats[:3]) == pytest.approx([3.0, 3.6, 4.0], abs=0.02)
    assert (np.diff(runs[0].source_times_s) > 0).all()
    assert runs[1].source_s(np.array([1.3])) == pytest.approx([9.25])


def test_a_cut_run_plays_the_same():
    run = Run("a", 2.0, 5.0, 4.0 + 1.2 * np.linspace(0.0, 3.0, 61))
    part = run.cut(2.7, 4.13)
    times = np.linspace(2.7, 4.13, 50)
    assert part.source_s(times) == pytest.approx(run.source_s(times), abs=1e-6)
    assert run.source_s(np.array([1.0, 6.0])) == pytest.approx([2.8, 8.8])


@pytest.mark.parametrize("cover", [(0.3, 0.9), (0.0, 0.5), (1.5, 2.6), (2.5, 4.0), (0.5, 3.5), (1.0, 2.0)])
def test_overlaid_runs_leave_no_gap(cover):
    seconds = [tuple(3.0 + s + np.arange(21) / 20) for s in range(2)]
    runs = to_runs(["a", "a", "b", "b"], seconds + seconds)
    instead = Run("x", *cover, np.linspace(7.0, 8.0, 11))
    made = overlay_runs(runs, [instead])
    assert covers(made, 4.0)
    assert instead in made
    assert [run.take for run in made if run.start_s == cover[0]] == ["x"]
    assert overlay_runs(runs, []) == runs


def test_moving_a_transition_changes_nothing_else():
    runs = to_runs(
        ["a"] * 3 + ["b"] * 2 + ["c"] * 2, [np.linspace(t, t + 1, 21) for t in (5, 6, 7, 1, 2, 9, 10)]
    )
    moved = with_transitions(
        runs, [TransitionTiming(0.0), TransitionTiming(2.9, 0.25), TransitionTiming(5.2)]
    )
    assert [run.start_s for run in moved] == [0.0, 2.9, 5.2]
    assert [run.stop_s for run in moved] == [2.9, 5.2, 7.0]
    assert [run.transition_s for run in moved] == [None, 0.25, None]
    for run, old in zip(moved, runs, strict=True):
        at = np.linspace(run.start_s, run.stop_s, 50)
        np.testing.assert_allclose(run.source_s(at), old.source_s(at), atol=1e-6)
    for stays_s in (3.0, 7.5):  # where it is, and not within the runs
        stayed = with_transitions(
            runs, [TransitionTiming(0.0), TransitionTiming(stays_s), TransitionTiming(5.0)]
        )
        assert [(run.start_s, run.stop_s) for run in stayed] == [(run.start_s, run.stop_s) for run in runs]


# Runs at the frame rate of the dance.


def test_kept_runs_are_those_of_sample_run_and_read_their_take_once():
    motion, reads = swaying(600, fps=60.0, seed=3), []

    def read_motion(take, start_s, stop_s):
        reads.append(take)
        return motion, 0.0

    kept = partial(sample_kept_run, Memory(1 << 26))
    runs = [
        Run("a", 0.0, 2.0, np.linspace(1.0, 3.0, 41)),
        Run("a", 0.0, 2.0, np.linspace(1.0, 3.1, 41)),  # at another speed
        Run("a", 0.5, 2.5, np.linspace(1.0, 3.0, 41)),  # later
        Run("b", 0.0, 2.0, np.linspace(1.0, 3.0, 41), locked=True, transition_s=0.3),
    ]
    for _ in range(3):
        for run in runs:
            made, expected = (
                kept(run, read_motion, 60.0, 9),
                sample_run(run, read_motion, 60.0, 9),
            )
            np.testing.assert_array_equal(made.root, expected.root)
            np.testing.assert_array_equal(made.quat, expected.quat)
            assert (made.first_frame, made.start, made.stop) == (expected.first_frame, made.start, made.stop)
            assert (made.locked, made.transition_s) == (run.locked, run.transition_s)
    assert len(reads) == len(runs) + 3 * len(runs)  # ours once, the others each time
    again = kept(Run("a", 0.0, 2.0, np.linspace(1.0, 3.0, 41), True, 0.5), read_motion, 60.0, 9)
    assert len(reads) == 4 * len(runs) and (again.locked, again.transition_s) == (True, 0.5)
    kept(runs[0], read_motion, 30.0, 9)
    kept(runs[0], read_motion, 60.0, 8)
    assert len(reads) == 4 * len(runs) + 2


def test_some_joints_of_some_frames_are_those_of_the_whole_body():
    run = Run("a", 0.0, 4.0, np.linspace(1.0, 5.0, 81))
    sampled = sample_run(run, lambda *_: (swaying(600, fps=60.0, seed=4), 0.0), 60.0, 5)
    whole = sampled.bodies_m(-5, 245)
    assert whole.shape == (250, len(BODY_JOINTS), 3)
    feet = [BODY_JOINTS.index(name) for name in CONTACT_JOINTS]
    np.testing.assert_array_equal(sampled.bodies_m(30, 70, CONTACT_JOINTS), whole[35:75, feet])
    np.testing.assert_array_equal(sampled.body_at(-2), whole[3])
