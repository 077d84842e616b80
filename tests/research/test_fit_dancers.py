"""Fitting dancers to real dancing: what is changed, and what costs."""

from __future__ import annotations

import pytest

from choreograph.evaluation.movement import ALL_REAL, Range
from content.moves.genres import GENRES
from research.fit_dancers import AMOUNTS, FAR, OUTSIDE, Judge, amounts_of, changed_cost, with_amounts

WALTZ = GENRES["waltz"]


def judge_of(**real: Range) -> Judge:
    judge = Judge.__new__(Judge)
    judge.name, judge.ranges = "waltz", ({"waltz": {}, ALL_REAL: real}, {ALL_REAL: {}})
    return judge


def test_amounts_are_read_and_written() -> None:
    assert with_amounts(WALTZ, amounts_of(WALTZ)) == WALTZ
    changed = with_amounts(WALTZ, {"carriage.lean": 3.0, "manner.swing": 0.6, "genre.size": 1.1})
    assert (changed.carriage.lean, changed.manner.swing, changed.size) == (3.0, 0.6, 1.1)
    assert changed.figures == WALTZ.figures


def test_a_change_costs_more_the_larger_it_is() -> None:
    written = amounts_of(WALTZ)
    costs = [
        changed_cost({**written, "carriage.lean": written["carriage.lean"] + by}, written)
        for by in (0.0, 1.0, 4.0)
    ]
    assert costs[0] == 0.0 < costs[1] < costs[2]


@pytest.mark.parametrize(
    ("value", "cost", "outside"),
    [(0.5, 0.0, 0), (0.97, 0.01 * FAR, 0), (1.26, 0.3 * FAR + OUTSIDE, 1), (9.0, FAR + OUTSIDE, 1)],
)
def test_a_cell_costs_outside_its_range_and_near_its_ends(value: float, cost: float, outside: int) -> None:
    found = judge_of(knees=Range(0.0, 0.5, 1.0)).cost([{"knees": [value]}, {}])
    assert found == (pytest.approx(cost), outside)


def test_a_measure_without_a_range_costs_nothing() -> None:
    assert judge_of().cost([{"knees": [9.0]}, {"feet": [9.0]}]) == (0.0, 0)


def test_every_amount_of_every_genre_can_be_read() -> None:
    for genre in GENRES.values():
        assert set(amounts_of(genre)) == set(AMOUNTS)
