"""The first part of a dance is that of the finished dance up to floor and feet, and it changes nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from choreograph.choreography.constraints import Keep
from choreograph.choreography.graph.local_search import CheapNodes
from choreograph.core.cache import Memory
from choreograph.motion.body import body_pos_m
from choreograph.pipeline.dancing import dance_with
from choreograph.plan.runs import Run
from choreograph.render.rendering import FirstPart, part_of_plan, render_planned

LENGTH_S = 3.0


@pytest.fixture(scope="module")
def dance(song, repertoire):
    made = dance_with(Memory(10**7), song, repertoire)
    amplitudes = tuple(np.linspace(0.6, 1.0, len(made.plan.seconds)).round(2).tolist())
    plan = replace(made.plan, amplitudes=amplitudes, stops_s=((5.0, 6.9),))
    return replace(made, plan=plan, motion=render_planned(plan, repertoire))


def shown(dance, repertoire, start_s: float, end_s: float):
    """What is told of a part, and the whole dance that is rendered with it."""
    told = []
    first = FirstPart(start_s, end_s, lambda motion, from_s: told.append((motion, from_s)))
    whole = render_planned(dance.plan, repertoire, first=first)
    return told, whole


@pytest.mark.parametrize("start_s", [0.0, 0.3, 2.2, 4.0, 6.0, 7.5, 9.0, 11.5])
def test_a_part_is_that_of_the_whole_dance(dance, repertoire, start_s):
    told, whole = shown(dance, repertoire, start_s, start_s + LENGTH_S)
    assert whole.local_quat.tobytes() == dance.motion.local_quat.tobytes()
    assert whole.root_pos_m.tobytes() == dance.motion.root_pos_m.tobytes()
    [(part, from_s)] = told
    first = round(start_s * part.fps)
    assert from_s == pytest.approx(first / part.fps)
    assert part.n_frames == min(round(LENGTH_S * part.fps), whole.n_frames - first)
    same = whole.sliced(first, first + part.n_frames)
    apart_m = np.linalg.norm(body_pos_m(part) - body_pos_m(same), axis=-1)
    assert apart_m.mean() < 2e-3 and apart_m.max() < 0.03
    assert np.abs(part.root_pos_m - same.root_pos_m).max() < 5e-3


def test_a_part_of_a_dance_in_the_memory_is_told_once(dance, repertoire):
    memory, told = Memory(10**7), []
    first = FirstPart(2.0, 5.0, lambda motion, from_s: told.append((motion, from_s)))
    for _ in range(2):
        whole = render_planned(dance.plan, repertoire, memory, first=first)
    [_, (part, from_s)] = told
    start = round(2.0 * part.fps)
    assert from_s == 2.0 and part.n_frames == round(3.0 * part.fps)
    assert part.local_quat.tobytes() == whole.local_quat[start : start + part.n_frames].tobytes()
    FirstPart(whole.duration_s, whole.duration_s + 1.0, pytest.fail).show_rendered(whole)


@pytest.mark.parametrize("settings", [{}, {"bound": True}, {"planner": "greedy"}])
def test_a_dance_whose_first_part_is_told_is_planned_and_explained_as_any(song, repertoire, settings):
    told = []
    first = FirstPart(1.0, 3.0, lambda *part: told.append(part))
    made = dance_with(Memory(10**7), song, repertoire, first=first, **settings)
    plain = dance_with(Memory(10**7), song, repertoire, **settings)
    assert made.plan == plain.plan and made.notes == plain.notes
    assert all(second.costs for second in made.plan.seconds)
    assert made.motion.local_quat.tobytes() == plain.motion.local_quat.tobytes()
    assert len(told) == 1


@pytest.mark.parametrize("changes", [False, True])
def test_a_part_is_told_before_the_local_search_which_may_change_the_dance(
    song, repertoire, monkeypatch, changes
):
    told, told_before = [], []
    improved = CheapNodes.improved

    def searched(nodes, path):
        told_before.append(len(told))
        return improved(nodes, path) if changes else path

    monkeypatch.setattr(CheapNodes, "improved", searched)
    first = FirstPart(4.0, 7.0, lambda *part: told.append(part))
    made = dance_with(Memory(10**7), song, repertoire, first=first)
    plain = dance_with(Memory(10**7), song, repertoire)
    assert told_before == [1, 1] and len(told) == 1
    assert made.plan == plain.plan and made.notes == plain.notes
    assert made.motion.local_quat.tobytes() == plain.motion.local_quat.tobytes()
    [(part, from_s)] = told
    same = made.motion.sliced(round(from_s * part.fps), round(from_s * part.fps) + part.n_frames)
    apart_m = np.linalg.norm(body_pos_m(part) - body_pos_m(same), axis=-1).mean()
    assert (apart_m > 0.02) if changes else (apart_m < 2e-3)


def test_a_kept_dance_has_no_part_that_is_told(song, repertoire, dance):
    told = []
    first = FirstPart(1.0, 3.0, lambda *part: told.append(part))
    given = {"existing": dance, "keep": [Keep(0.0, 4.0)]}
    made = dance_with(Memory(10**7), song, repertoire, first=first, **given)
    assert made.plan == dance_with(Memory(10**7), song, repertoire, **given).plan and not told


def test_few_runs_before_the_end_of_a_part_are_assembled_first(dance, repertoire):
    times_s = np.linspace(0.0, 2.0, 41)
    runs = [Run("a", 2.0 * i, 2.0 * i + 2.0, times_s) for i in range(20)]
    assert FirstPart(1.0, 4.0, print).runs_of(runs) == runs[:6]  # the last one begins 4 s after the part
    assert FirstPart(30.0, 34.0, print).runs_of(runs) == ()
    assert FirstPart(1.0, 4.0, print).runs_of(runs[:3]) == ()


def test_a_part_of_few_runs_is_that_of_the_whole_dance(dance, repertoire, monkeypatch):
    whole = FirstPart.runs_of
    monkeypatch.setattr(FirstPart, "runs_of", lambda self, runs: [])
    [(expected, _)], _ = shown(dance, repertoire, 0.5, 1.5)
    counts = []

    def few(self, runs):
        found = whole(self, [*runs, *runs])  # as if the dance were twice as long
        counts.append((len(found), len(runs)))
        return found

    monkeypatch.setattr(FirstPart, "runs_of", few)
    [(part, _)], rendered = shown(dance, repertoire, 0.5, 1.5)
    assert 0 < counts[0][0] < counts[0][1]
    assert part.local_quat.tobytes() == expected.local_quat.tobytes()
    assert part.root_pos_m.tobytes() == expected.root_pos_m.tobytes()
    assert rendered.local_quat.tobytes() == dance.motion.local_quat.tobytes()


def test_nothing_is_told_beyond_the_end(dance, repertoire):
    told, whole = shown(dance, repertoire, 100.0, 105.0)
    assert told == [] and whole.local_quat.tobytes() == dance.motion.local_quat.tobytes()


def test_held_poses_of_a_part_of_a_plan_have_its_times(dance):
    part = part_of_plan(dance.plan, 2, 8.0)
    assert part.opening_s == max(0.0, dance.plan.opening_s - 2)
    assert part.stops_s == ((3.0, 4.9),) and part.amplitudes == dance.plan.amplitudes[2:]
    assert part_of_plan(dance.plan, 6, 4.0).stops_s == ()
