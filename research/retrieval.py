"""Retrieval: precision and recall at k, and mean reciprocal rank, each with its exact chance level.

Conventions: `relevant` (Q, N) holds for every query whether each of its ranked items, best first, is relevant
(of the query's genre, for example). N is all items, unless a function accepts the first ones alone. The
chance level of a score is its expected value for a random ranking. It is needed to read the score: a genre
with half of the items has a precision of one half by chance. Input that does not fit raises `ParameterError`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats, default_numerics


def validate(relevant: NDArray[np.bool_], k: int = 1) -> NDArray[np.bool_]:
    """The table (Q, N) as bools. `ParameterError` unless it has at least one query and `k` items."""
    table = np.asarray(relevant)
    if table.ndim != 2 or table.dtype != np.bool_ or 0 in table.shape:
        raise ParameterError(f"expected true or false (Q, N), got {table.dtype} of shape {table.shape}")
    if not 1 <= k <= table.shape[1]:
        raise ParameterError(f"expected k from 1 to {table.shape[1]} items, got {k}")
    return table


def precision_at_k(relevant: NDArray[np.bool_], k: int) -> Floats:
    """Share of the first `k` items that are relevant, (Q,). The first `k` items per query are enough."""
    return validate(relevant, k)[:, :k].mean(axis=1)


def recall_at_k(relevant: NDArray[np.bool_], k: int) -> Floats:
    """Share of the relevant items that are among the first `k`, (Q,). `nan` without relevant items."""
    table = validate(relevant, k)
    total = table.sum(axis=1)
    return np.where(total > 0, table[:, :k].sum(axis=1) / np.maximum(total, 1), np.nan)


def reciprocal_rank(relevant: NDArray[np.bool_]) -> Floats:
    """One over the rank of the first relevant item, (Q,). 0 without relevant items."""
    table = validate(relevant)
    return np.where(table.any(axis=1), 1.0 / (table.argmax(axis=1) + 1), 0.0)


def chance_precision(n_relevant: NDArray[np.integer] | int, n_items: int) -> Floats:
    """Expected `precision_at_k` of a random ranking, (Q,), the same for every k."""
    return _checked_counts(n_relevant, n_items) / n_items


def chance_recall(k: int, n_items: int) -> float:
    """Expected `recall_at_k` of a random ranking, whatever the number of relevant items."""
    if not 1 <= k <= n_items:
        raise ParameterError(f"expected k from 1 to {n_items} items, got {k}")
    return k / n_items


def chance_reciprocal_rank(n_relevant: NDArray[np.integer] | int, n_items: int) -> Floats:
    """Expected `reciprocal_rank` of a random ranking, (Q,): draws without replacement."""
    counts = _checked_counts(n_relevant, n_items)
    drawn = np.arange(n_items)  # items already drawn
    miss = np.maximum(n_items - counts[..., None] - drawn, 0) / (n_items - drawn)  # (Q, N) probability
    no_hit = np.cumprod(miss, axis=-1)
    no_hit_before = np.concatenate([np.ones((*counts.shape, 1)), no_hit[..., :-1]], axis=-1)
    return ((no_hit_before - no_hit) / (drawn + 1)).sum(axis=-1)


def mean_over_groups(values: Floats, groups: Sequence[str]) -> float:
    """Macro average of `values` (Q,): the mean of the group means, so that every genre counts once."""
    values, names = np.asarray(values, np.float64), np.asarray(groups)
    if values.shape != names.shape or len(values) == 0:
        raise ParameterError(f"expected one group per query, got {names.shape} for {values.shape}")
    return float(np.mean([values[names == name].mean() for name in np.unique(names)]))


@default_numerics()
def evaluate(relevant: NDArray[np.bool_], k: int, *, groups: Sequence[str] | None = None) -> dict[str, float]:
    """All metrics of complete rankings by name, each with its chance level, averaged over groups if given.

    Raises `ParameterError` as `validate` does, and for a query without a relevant item.
    """
    table = validate(relevant, k)
    total, n_items = table.sum(axis=1), table.shape[1]
    if (total == 0).any():
        raise ParameterError(
            f"expected a relevant item per query, got none for query {int(np.argmin(total))}"
        )
    names = list(groups) if groups is not None else ["all"] * len(table)
    scores = {
        f"precision_at_{k}": precision_at_k(table, k),
        f"precision_at_{k}_chance": chance_precision(total, n_items),
        f"recall_at_{k}": recall_at_k(table, k),
        f"recall_at_{k}_chance": np.full(len(table), chance_recall(k, n_items)),
        "mean_reciprocal_rank": reciprocal_rank(table),
        "mean_reciprocal_rank_chance": chance_reciprocal_rank(total, n_items),
    }
    return {name: mean_over_groups(values, names) for name, values in scores.items()}


def _checked_counts(n_relevant: NDArray[np.integer] | int, n_items: int) -> NDArray[np.int64]:
    counts = np.asarray(n_relevant)
    if (
        n_items < 1
        or not np.issubdtype(counts.dtype, np.integer)
        or (counts < 0).any()
        or (counts > n_items).any()
    ):
        raise ParameterError(f"expected 0 to {n_items} relevant items of 1 or more, got {n_relevant}")
    return counts.astype(np.int64)
