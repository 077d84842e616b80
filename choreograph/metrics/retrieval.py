"""Retrieval: of what a query finds, how much is of its kind (a song's genre), and how early.

Conventions: `relevant` (Q, N) says of the items of every query, best first, whether they are of its kind:
all N items that there are, or the first of them where a function says that they do. Every score has its
chance level, what a random order gives in the mean, exactly: without it none says anything, since a genre
with half of the items is found half of the time. What does not fit is refused with a `ParameterError`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import ParameterError

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


def validate(relevant: Bools, k: int = 1) -> Bools:
    """The table (Q, N) as bools; `ParameterError` unless it is one, with a query and `k` items or more."""
    table = np.asarray(relevant)
    if table.ndim != 2 or table.dtype != np.bool_ or 0 in table.shape:
        raise ParameterError(f"expected true or false (Q, N), got {table.dtype} of shape {table.shape}")
    if not 1 <= k <= table.shape[1]:
        raise ParameterError(f"expected 1 to {table.shape[1]} of the items looked at, got {k}")
    return table


def precision_at_k(relevant: Bools, k: int) -> Floats:
    """Share of the first `k` items that are relevant, (Q,); K or more items a query are enough."""
    return validate(relevant, k)[:, :k].mean(axis=1)


def recall_at_k(relevant: Bools, k: int) -> Floats:
    """Share of the relevant items that are among the first `k` of all, (Q,); `nan` if there are none."""
    table = validate(relevant, k)
    total = table.sum(axis=1)
    return np.where(total > 0, table[:, :k].sum(axis=1) / np.maximum(total, 1), np.nan)


def reciprocal_rank(relevant: Bools) -> Floats:
    """One over the rank of the first relevant item, (Q,); 0 if there is none."""
    table = validate(relevant)
    return np.where(table.any(axis=1), 1.0 / (table.argmax(axis=1) + 1), 0.0)


def chance_precision(n_relevant: NDArray[np.integer] | int, n_items: int) -> Floats:
    """`precision_at_k` of a random order, (Q,), whatever k."""
    return _checked_counts(n_relevant, n_items) / n_items


def chance_recall(k: int, n_items: int) -> float:
    """`recall_at_k` of a random order, however many are relevant."""
    if not 1 <= k <= n_items:
        raise ParameterError(f"expected 1 to {n_items} of the items looked at, got {k}")
    return k / n_items


def chance_reciprocal_rank(n_relevant: NDArray[np.integer] | int, n_items: int) -> Floats:
    """Expected `reciprocal_rank` of a random order, (Q,): drawing without putting back."""
    counts = _checked_counts(n_relevant, n_items)
    drawn = np.arange(n_items)  # before the draw
    left = np.maximum(n_items - counts[..., None] - drawn, 0) / (n_items - drawn)  # (Q, N) not relevant
    still_none = np.cumprod(left, axis=-1)
    before = np.concatenate([np.ones((*counts.shape, 1)), still_none[..., :-1]], axis=-1)
    return ((before - still_none) / (drawn + 1)).sum(axis=-1)


def mean_over_groups(values: Floats, groups: Sequence[str]) -> float:
    """Mean of the means of each group of queries (Q,), so that a genre with many songs counts once."""
    values, names = np.asarray(values, np.float64), np.asarray(groups)
    if values.shape != names.shape or len(values) == 0:
        raise ParameterError(f"expected a group a query, got {names.shape} for {values.shape}")
    return float(np.mean([values[names == name].mean() for name in np.unique(names)]))


def evaluate(relevant: Bools, k: int, *, groups: Sequence[str] | None = None) -> dict[str, float]:
    """All metrics of whole rankings by name, each beside its chance; means over groups if there are any.

    A query without a relevant item can find nothing, and is refused.
    """
    table = validate(relevant, k)
    total, n_items = table.sum(axis=1), table.shape[1]
    if (total == 0).any():
        raise ParameterError(f"expected a relevant item a query, query {int(np.argmin(total))} has none")
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
