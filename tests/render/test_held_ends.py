"""The first and last pose are held: a body whose position says at which time it is played."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from synthetic_motions import swaying

from choreograph.music.sections import held_times_s
from choreograph.render.rendering import hold_ends

FPS = 60.0
LENGTH_S = 8.0
EASE_IN_S, EASE_OUT_S, SETTLE_S = 0.4, 0.3, 0.08
MOTION = swaying(round(LENGTH_S * FPS), fps=FPS)
TIMES_S = np.arange(MOTION.n_frames) / FPS
CLOCK = replace(MOTION, root_pos_m=TIMES_S[:, None] * np.array([1.0, 0.0, 0.0]))

OPENINGS_S = st.just(0.0) | st.floats(0.01, 5.0)


def played_s(opening_s: float, closing_s: float | None) -> np.ndarray:
    return hold_ends(CLOCK, opening_s, closing_s).root_pos_m[:, 0]


def test_poses_are_held_and_the_dance_between_is_untouched():
    held = hold_ends(MOTION, 1.5, 6.0)
    before, after = TIMES_S <= 1.5 - EASE_IN_S, TIMES_S >= 6.0 + SETTLE_S
    danced = (TIMES_S >= 1.5) & (TIMES_S <= 6.0 - EASE_OUT_S)
    for part in (before, after):
        assert np.ptp(held.root_pos_m[part], axis=0).max() < 1e-9
        assert np.ptp(held.local_quat[part], axis=0).max() < 1e-9
    assert np.array_equal(held.root_pos_m[danced], MOTION.root_pos_m[danced])
    assert np.abs(np.abs((held.local_quat * MOTION.local_quat).sum(-1))[danced] - 1).max() < 1e-12


def test_the_pose_of_the_first_count_is_on_the_count_and_the_last_within_a_tenth_of_a_second():
    at_s = played_s(1.5, 6.0)
    assert at_s[90] == pytest.approx(1.5)
    assert at_s[0] == pytest.approx(1.5 - EASE_IN_S / 2)
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
