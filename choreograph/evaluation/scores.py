"""`Scores`: metric values by name with their chance levels."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True, eq=False)
class Scores:
    """Values by the names in `metric_catalogue.METRICS`, and chance levels where they are known."""

    values: Mapping[str, float]
    chance: Mapping[str, float] = field(default_factory=dict)

    def __or__(self, other: Scores) -> Scores:
        return Scores({**self.values, **other.values}, {**self.chance, **other.chance})


def split_chance(metrics: Mapping[str, float]) -> Scores:
    """`Scores` of a metric module's `evaluate`, whose chance levels are named `…_chance`."""
    return Scores(
        {name: value for name, value in metrics.items() if not name.endswith("_chance")},
        {name.removesuffix("_chance"): value for name, value in metrics.items() if name.endswith("_chance")},
    )


def weighted_mean(values: Mapping[str, Mapping[str, float]], weights: Mapping[str, float]) -> Scores:
    """Means by metric over the items that have a weight; a value that is not finite is left out."""
    names = {name for item in weights for name in values[item]}
    means = {}
    for name in sorted(names):
        pairs = [(values[item][name], weight) for item, weight in weights.items() if name in values[item]]
        pairs = [(value, weight) for value, weight in pairs if np.isfinite(value)]
        if pairs:
            finite, shares = zip(*pairs, strict=True)
            means[name] = float(np.average(finite, weights=shares))
    return Scores(means)
