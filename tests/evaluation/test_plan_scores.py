"""Playback speeds of synthetic time maps, and the counts and figures of takes in the time of a dance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from synthetic_repertoire import PERIODS_S, synthetic_repertoire, synthetic_takes, with_counts

from choreograph.evaluation.plan_scores import (
    counted_share,
    danced_counts,
    figure_borders_s,
    playback_speed_scores,
)
from choreograph.library.repertoire import Repertoire
from choreograph.motion.motion import Credits
from choreograph.plan.plan import Plan, PlannedSecond, PlannedWord


@given(slope=st.floats(0.5, 2.0), start=st.floats(-50, 50))
def test_an_even_map_has_one_slope(slope, start):
    assume(min(abs(slope - 0.51), abs(slope - 1.96)) > 1e-9)
    scores = playback_speed_scores(start + slope * np.arange(80) * np.ones((3, 1)))
    assert [scores["slope_median"], scores["slope_p95"]] == pytest.approx([slope, slope])
    assert scores["share_at_slowest"] == (slope <= 0.51) and scores["share_at_fastest"] == (slope >= 1.96)


def test_a_staircase_runs_along_and_beyond_the_limits():
    scores = playback_speed_scores(np.cumsum([[0, 2, 0.5, 2, 1, 3, 0, 1, 1]], axis=1))
    assert (scores["share_at_slowest"], scores["share_at_fastest"]) == (2 / 8, 3 / 8)


# The counts of a dance: planted plans whose time maps are known, joins, held poses, takes without counts.


NOBODY = Credits()


@pytest.fixture(scope="module")
def repertoire(tmp_path_factory) -> Repertoire:
    """Takes counted every 0.5, 0.6 and 0.75 s; the last without counts."""
    counted = with_counts(synthetic_takes())
    counted[2] = synthetic_takes()[2]
    return synthetic_repertoire(tmp_path_factory.mktemp("db") / "rep.h5", counted)


def plan_of(seconds=(), words=(), *, duration_s: float, engine: str = "graph", **more) -> Plan:
    return Plan(
        song="song", duration_s=duration_s, start_s=0.0, repertoire="rep.h5", planner="exact",
        blending="inertial", seed=0, fps=30.0, weights={}, music_beats_s=(), seconds=tuple(seconds),
        engine=engine, words=tuple(words), **more,
    )  # fmt: skip


def second(index: int, take: str, from_s: float, *, speed: float = 1.0) -> PlannedSecond:
    times_s = tuple(np.linspace(from_s, from_s + speed, 21).tolist())
    return PlannedSecond(index, take, 0, 0.0, index, 0, times_s, float(index), 0.3, {}, NOBODY)


def played(take: str, from_s: float, n_seconds: int, *, first: int = 0, speed: float = 1.0):
    return [second(first + i, take, from_s + speed * i, speed=speed) for i in range(n_seconds)]


def test_a_take_played_as_recorded(repertoire):
    counts = danced_counts(plan_of(played("take0", 3.2, 6), duration_s=6.0), repertoire)
    assert counts.times_s == pytest.approx(0.3 + 0.5 * np.arange(12), abs=2e-3)
    assert counts.numbers[:3].tolist() == [4, 1, 2]  # of the take's 3.5, 4.0 and 4.5 s
    assert (counts.metre, counts.source, counts.confidence) == (4, "takes", 1.0)


@pytest.mark.parametrize("speed", [0.5, 1.25, 2.0])
def test_a_take_played_at_another_speed(repertoire, speed):
    counts = danced_counts(plan_of(played("take0", 2.0, 8, speed=speed), duration_s=8.0), repertoire)
    assert np.diff(counts.times_s) == pytest.approx(0.5 / speed, abs=2e-3)
    assert counts.times_s[0] == pytest.approx(0.0, abs=2e-3) and counts.numbers[0] == 1


def test_a_tempo_that_changes_within_a_second(repertoire):
    """An accelerating map: its counts are where it says, not where a straight line would have them."""
    grid = np.linspace(0.0, 2.0, 41)
    map_s = 4.0 + 0.7 * grid + 0.3 * grid**2
    seconds = [
        replace(second(i, "take0", 0.0), source_times_s=tuple(map_s[20 * i : 20 * i + 21])) for i in (0, 1)
    ]
    counts = danced_counts(plan_of(seconds, duration_s=2.0), repertoire)
    expected = np.interp([4.0, 4.5, 5.0, 5.5, 6.0, 6.5], map_s, grid)
    assert counts.times_s == pytest.approx(expected, abs=2e-3)


def test_a_count_at_a_join_is_counted_once(repertoire):
    """Both takes are at a count when one gives way to the other; the incoming one numbers it."""
    joined = played("take0", 2.0, 3) + played("take1", 3.6, 3, first=3)
    counts = danced_counts(plan_of(joined, duration_s=6.0), repertoire)
    assert counts.times_s == pytest.approx([0, 0.5, 1, 1.5, 2, 2.5, 3, 3.6, 4.2, 4.8, 5.4, 6.0], abs=2e-3)
    at_join = np.flatnonzero(np.isclose(counts.times_s, 3.0, atol=5e-3))
    assert counts.numbers[at_join].tolist() == [3]  # the take's seventh count, at 3.6 s
    assert (np.diff(counts.times_s) > 0.1).all()


def test_words_of_takes(repertoire):
    words = [
        PlannedWord(0.0, 1.2, 0, "take0", 4.0, 5.0, NOBODY),  # slower
        PlannedWord(1.2, 2.4, 0, "take1", 6.0, 7.2, NOBODY),
    ]
    plan = plan_of(words=words, duration_s=2.4, engine="mixer")
    counts = danced_counts(plan, repertoire)
    assert counts.times_s == pytest.approx([0.0, 0.6, 1.2, 1.8, 2.4], abs=2e-3)
    assert counted_share(plan, repertoire) == pytest.approx(1.0)


def test_takes_without_counts_have_none(repertoire):
    plan = plan_of(played("take0", 2.0, 1) + played("take2", 2.0, 3, first=1), duration_s=4.0)
    assert danced_counts(plan, repertoire).times_s.max() < 1.06
    assert counted_share(plan, repertoire) == pytest.approx(0.25)
    cut = plan_of(played("take0", 2.0, 4), duration_s=3.4)
    assert counted_share(cut, repertoire) == pytest.approx(1.0)
    alone = plan_of(played("take2", 2.0, 3), duration_s=3.0)
    assert len(danced_counts(alone, repertoire)) == counted_share(alone, repertoire) == 0


def test_motion_of_a_network_has_no_counts(repertoire):
    words = [PlannedWord(0.0, 1.0, 3, "", 0.0, 0.0, NOBODY)]
    plan = plan_of(words=words, duration_s=1.0, engine="rollout")
    assert len(danced_counts(plan, repertoire)) == len(figure_borders_s(plan, repertoire)) == 0
    assert counted_share(plan, repertoire) == 0.0


def test_held_poses_are_not_counted(repertoire):
    plan = plan_of(played("take0", 2.0, 6), duration_s=6.0, opening_s=1.0, closing_s=5.0)
    counts = danced_counts(plan, repertoire)
    assert counts.times_s == pytest.approx(np.arange(1.0, 5.1, 0.5), abs=2e-3)


def test_borders_of_figures_at_a_join(repertoire):
    """take0's figures have borders every 4 s, take1's every 4.8 s."""
    assert PERIODS_S[:2] == (0.5, 0.6)
    plan = plan_of(played("take0", 1.9, 2) + played("take1", 4.5, 3, first=2), duration_s=5.0)
    assert figure_borders_s(plan, repertoire) == pytest.approx([2.1, 2.3], abs=2e-3)
    assert len(figure_borders_s(plan_of(played("take0", 1.9, 4), duration_s=4.0), repertoire)) == 0
