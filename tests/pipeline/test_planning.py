"""The first part of a dance is that of the finished dance up to floor and feet, and it changes nothing."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest

from choreograph.choreography.constraints import Keep
from choreograph.choreography.graph.local_search import CheapNodes
from choreograph.core.cache import Memory
from choreograph.motion.body import body_pos_m
from choreograph.pipeline.dancing import dance_with
from choreograph.pipeline.planning import FirstPart
from choreograph.plan.runs import plan_runs
from choreograph.render.assembly import assemble
from choreograph.render.rendering import part_of_plan, render_part, render_planned

LENGTH_S = 3.0


@pytest.fixture(scope="module")
def dance(song, repertoire):
    made = dance_with(Memory(10**7), song, repertoire)
    amplitudes = tuple(np.linspace(0.6, 1.0, len(made.plan.seconds)).round(2).tolist())
    plan = replace(made.plan, amplitudes=amplitudes, stops_s=((5.0, 6.9),))
    return replace(made, plan=plan, motion=render_planned(plan, repertoire))


@pytest.mark.parametrize("start_s", [0.0, 0.3, 2.2, 4.0, 6.0, 7.5, 9.0, 11.5])
def test_a_part_is_that_of_the_whole_dance(dance, repertoire, start_s):
    whole = dance.motion
    part, from_s = render_part(dance.plan, repertoire, Memory(), start_s, start_s + LENGTH_S)
    first = round(start_s * part.fps)
    assert from_s == pytest.approx(first / part.fps)
    assert part.n_frames == min(round(LENGTH_S * part.fps), whole.n_frames - first)
    same = whole.sliced(first, first + part.n_frames)
    apart_m = np.linalg.norm(body_pos_m(part) - body_pos_m(same), axis=-1)
    assert apart_m.mean() < 2e-3 and apart_m.max() < 0.03
    assert np.abs(part.root_pos_m - same.root_pos_m).max() < 5e-3


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


def test_a_part_is_that_of_the_runs_until_shortly_after_it(dance, repertoire, monkeypatch):
    counts = []

    def counted(runs, *given, **settings):
        counts.append(len(runs))
        return assemble(runs, *given, **settings)

    module = sys.modules["choreograph.render.rendering"]  # `cg.render` is a function
    monkeypatch.setattr(module, "assemble", counted)
    n_runs = len(plan_runs(dance.plan))
    for end_s in (1.5, dance.plan.duration_s):
        render_part(dance.plan, repertoire, Memory(), 0.5, end_s)
    assert counts[0] < counts[1] == n_runs


def test_nothing_is_shown_beyond_the_end(dance, repertoire):
    assert render_part(dance.plan, repertoire, Memory(), 100.0, 105.0) is None
    FirstPart(100.0, 105.0, pytest.fail).show(dance.plan, repertoire, Memory())


def test_held_poses_of_a_part_of_a_plan_have_its_times(dance):
    part = part_of_plan(dance.plan, 2, 8.0)
    assert part.opening_s == max(0.0, dance.plan.opening_s - 2)
    assert part.stops_s == ((3.0, 4.9),) and part.amplitudes == dance.plan.amplitudes[2:]
    assert part_of_plan(dance.plan, 6, 4.0).stops_s == ()
