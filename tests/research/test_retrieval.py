"""Retrieval: rankings with known scores, and chance levels against simulated random rankings."""

from __future__ import annotations

import numpy as np
import pytest
from golden.regenerate import golden, retrieval_scores
from hypothesis import given, settings
from hypothesis import strategies as st

from choreograph.core.errors import ParameterError
from research import retrieval


def row(*relevant: int) -> np.ndarray:
    return np.array([relevant], bool)


def test_perfect_and_worst():
    best = retrieval.evaluate(row(1, 1, 1, 0, 0, 0), 3)
    assert best["precision_at_3"] == best["recall_at_3"] == best["mean_reciprocal_rank"] == 1
    worst = retrieval.evaluate(row(0, 0, 0, 1, 1, 1), 3)
    assert worst["precision_at_3"] == worst["recall_at_3"] == 0
    assert worst["mean_reciprocal_rank"] == 1 / 4
    assert best["precision_at_3_chance"] == worst["recall_at_3_chance"] == 0.5


def test_by_hand():
    table = np.concatenate([row(0, 1, 1, 0, 1), row(1, 0, 0, 0, 0)])
    assert retrieval.precision_at_k(table, 2).tolist() == [0.5, 0.5]
    assert retrieval.recall_at_k(table, 2).tolist() == [1 / 3, 1.0]
    assert retrieval.reciprocal_rank(table).tolist() == [0.5, 1.0]


def test_without_relevant_items():
    nothing = row(0, 0, 0)
    assert np.isnan(retrieval.recall_at_k(nothing, 1)) and retrieval.reciprocal_rank(nothing) == 0
    assert retrieval.chance_reciprocal_rank(0, 3) == 0
    with pytest.raises(ParameterError, match="query 0"):
        retrieval.evaluate(nothing, 1)


@settings(max_examples=15, deadline=None)
@given(n_items=st.integers(1, 12), data=st.data())
def test_chance_is_the_mean_over_random_rankings(n_items, data):
    n_relevant, k = data.draw(st.integers(1, n_items)), data.draw(st.integers(1, n_items))
    rng = np.random.default_rng(0)
    table = rng.permuted(np.tile(np.arange(n_items) < n_relevant, (20_000, 1)), axis=1)
    scores = retrieval.evaluate(table, k)
    for name in (f"precision_at_{k}", f"recall_at_{k}", "mean_reciprocal_rank"):
        assert scores[f"{name}_chance"] == pytest.approx(scores[name], abs=0.02)


def test_chance_of_many_queries_at_once():
    counts = np.array([1, 2, 3])
    assert retrieval.chance_precision(counts, 4).tolist() == [0.25, 0.5, 0.75]
    assert retrieval.chance_reciprocal_rank(counts, 4)[0] == pytest.approx((1 + 1 / 2 + 1 / 3 + 1 / 4) / 4)


def test_a_group_counts_once_however_many_queries_it_has():
    table = np.concatenate([row(1, 0)] * 9 + [row(0, 1)])
    assert retrieval.evaluate(table, 1)["precision_at_1"] == pytest.approx(0.9)
    groups = ["waltz"] * 9 + ["tango"]
    assert retrieval.evaluate(table, 1, groups=groups)["precision_at_1"] == pytest.approx(0.5)


@pytest.mark.parametrize(
    "table", [np.zeros((0, 3), bool), np.zeros((3, 0), bool), np.zeros(3, bool), np.eye(3)]
)
def test_broken_tables_are_refused(table):
    with pytest.raises(ParameterError, match="true or false"):
        retrieval.evaluate(table, 1)


def test_broken_numbers_are_refused():
    for k in (0, 4):
        with pytest.raises(ParameterError, match="k from 1 to 3"):
            retrieval.precision_at_k(np.ones((1, 3), bool), k)
        with pytest.raises(ParameterError, match="k from 1 to 3"):
            retrieval.chance_recall(k, 3)
    for count, items in ((4, 3), (-1, 3), (0, 0)):
        with pytest.raises(ParameterError, match="relevant"):
            retrieval.chance_precision(count, items)
    with pytest.raises(ParameterError, match="group"):
        retrieval.evaluate(np.ones((2, 3), bool), 1, groups=["a"])


def test_golden():
    assert retrieval_scores() == pytest.approx(golden("retrieval"))
