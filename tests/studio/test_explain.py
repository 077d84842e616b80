"""Explanations: parts, costs and sentences of what is danced, and the next best of it."""

from __future__ import annotations

from dataclasses import fields, replace
from itertools import pairwise
from types import SimpleNamespace

import pytest

from choreograph.choreography.graph.costs import DEFAULT_WEIGHTS
from choreograph.choreography.pieces import PieceRequest
from choreograph.core.errors import ParameterError
from choreograph.plan.plan import PlannedSecond, goes_on
from choreograph.studio import explain
from choreograph.studio.explain import (
    OF_PIECE,
    explained,
    next_best,
    of_dance,
    reasons,
    run_at,
    weight_choices,
)


def test_costs_are_in_order_with_their_shares_and_sentences():
    found = reasons({"genre": 1.0, "rhythm": 3.0, "front": 0.0, "mine": 4.0}, of_dance())
    assert [(one["name"], one["share"]) for one in found] == [
        ("mine", 0.5),
        ("rhythm", 0.375),
        ("genre", 0.125),
    ]
    assert [one["sentence"] for one in found] == [
        "A cost of your own.",
        of_dance()["rhythm"],
        of_dance()["genre"],
    ]
    assert reasons({}, of_dance()) == reasons({"genre": 0.0}, of_dance()) == []


def test_every_weight_has_a_slider_and_a_sentence():
    assert [choice["name"] for choice in weight_choices()] == list(DEFAULT_WEIGHTS)
    for choice in weight_choices():
        assert choice["low"] <= choice["default"] < choice["high"]
        assert choice["sentence"] == of_dance()[choice["name"]] and choice["sentence"].endswith(".")


def test_the_blocks_of_a_time_are_one_run(made):
    plan = made.plan
    times = [0.5 * (block.start_s + block.end_s) for block in plan.blocks]
    for at_s in times:
        run = run_at(plan, at_s)
        assert run[0].start_s <= at_s < run[-1].end_s
        assert all(goes_on(a, b) for a, b in pairwise(run))
    runs = {run_at(plan, at_s)[0].start_s: run_at(plan, at_s) for at_s in times}
    assert sum(len(run) for run in runs.values()) == len(plan.blocks)
    assert run_at(plan, plan.duration_s)[-1] == plan.blocks[-1]  # the end belongs to the last


def test_a_planted_jump_ends_the_run(made):
    plan = made.plan
    run = next(run for run in (run_at(plan, block.start_s) for block in plan.blocks) if len(run) > 2)
    middle = plan.blocks.index(run[1])
    jumped = replace(run[1], source_start_s=run[1].source_start_s + 3, source_end_s=run[1].source_end_s + 3)
    blocks = (*plan.blocks[:middle], jumped, *plan.blocks[middle + 1 :])
    planted = SimpleNamespace(blocks=blocks)
    assert list(run_at(planted, jumped.start_s)) == [jumped]
    assert run_at(planted, run[0].start_s)[-1] == run[0]


def test_an_explanation_is_of_the_run_and_its_costs(made, repertoire):
    run = run_at(made.plan, 5.0)
    found = explained(made, repertoire, 5.0)
    assert (found["take"], found["start_s"]) == (run[0].source, pytest.approx(run[0].start_s, abs=1e-4))
    assert found["end_s"] == pytest.approx(run[-1].end_s, abs=1e-4)
    source_s = run[-1].source_end_s - run[0].source_start_s
    assert found["stretched"] == pytest.approx((run[-1].end_s - run[0].start_s) / source_s, abs=1e-3)
    total = sum(sum(b.planned.costs.values()) for b in run if isinstance(b.planned, PlannedSecond))
    assert sum(one["cost"] for one in found["reasons"]) == pytest.approx(total, abs=1e-2)
    assert {field.name for field in fields(run[0].planned.credits)} <= set(found)
    assert found["edits"] == [] and found["bars"] == sorted(found["bars"])


@pytest.mark.parametrize("at_s", [-0.1, 1e3, float("nan"), float("inf")])
def test_a_time_outside_of_the_dance_is_refused(made, repertoire, at_s):
    with pytest.raises(ParameterError, match="expected a time within the dance"):
        explained(made, repertoire, at_s)


def test_the_next_best_is_the_cheapest_piece(made, repertoire, monkeypatch):
    asked = []
    pieces = explain.Editor.pieces

    def noted(self, slots, request):
        asked.append((slots, request, pieces(self, slots, request)))
        return asked[-1][2]

    monkeypatch.setattr(explain.Editor, "pieces", noted)
    best = next_best(made, repertoire, (0.0, made.plan.duration_s), 5.0)
    [(_, request, (_, found))] = asked
    assert isinstance(request, PieceRequest) and best is not None
    assert best["cost"] == pytest.approx(min(piece.cost for piece in found), abs=1e-3)
    assert best["start_s"] < 5.0 < best["end_s"] and best["end_s"] - best["start_s"] < 7.5
    assert {one["name"] for one in best["reasons"]} <= set(OF_PIECE)


def test_without_pieces_there_is_no_next_best(made, repertoire, monkeypatch):
    monkeypatch.setattr(explain.Editor, "pieces", lambda self, slots, request: (None, []))
    assert next_best(made, repertoire, (2.0, 6.0), 4.0) is None
