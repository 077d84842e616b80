"""Weighted sums of costs, with what user-defined costs return checked."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.arguments import as_array
from choreograph.errors import NoPathError, ParameterError
from choreograph.features.song_features import SongFeatures
from choreograph.graph.costs import Cost
from choreograph.graph.layers import Layer

Floats = NDArray[np.floating]


@dataclass(frozen=True)
class WeightedCost:
    """A cost and its weight; a weight of 0 leaves it out."""

    cost: Cost
    weight: float


def allowed_nodes(
    layer: Layer, costs: Sequence[WeightedCost], song_features: SongFeatures
) -> tuple[Layer, NDArray[np.float64]]:
    """The layer without its forbidden nodes, and the weighted node costs (N,) of the rest.

    Raises `NoPathError` if all are forbidden.
    """
    total = np.zeros(layer.n_nodes)
    for _, cost in weighted_terms(costs, lambda c: c.node(layer, song_features), (layer.n_nodes,)):
        total += cost
    allowed = np.isfinite(total)
    if not allowed.any():
        raise NoPathError(f"every node of second {layer.second} is forbidden: relax a cost that returns inf")
    return (layer, total) if allowed.all() else (layer.subset(allowed), total[allowed])


def weighted_terms(
    costs: Sequence[WeightedCost], evaluate: Callable[[Cost], Floats | None], shape: tuple[int, ...]
) -> Iterator[tuple[str, Floats]]:
    """Name and weighted values of every cost that `evaluate` gives values for.

    Raises `ParameterError` for nan or a wrong shape.
    """
    for weighted in costs:
        if weighted.weight == 0:
            continue
        value = evaluate(weighted.cost)
        if value is None:
            continue
        value = _checked(value, shape, weighted.cost)
        if np.isnan(np.min(value, initial=0.0)):
            raise _is_nan(weighted.cost)
        yield weighted.cost.name, weighted.weight * value


def _checked(value: Any, shape: tuple[int, ...], cost: Cost) -> NDArray:
    """What a cost returned as an array; `ParameterError` unless that is of numbers and the shape."""
    array = as_array(f"what cost {cost.name!r} returns", value)
    if array.shape != shape:
        raise ParameterError(f"expected an array {shape} of cost {cost.name!r}, got {array.shape}")
    return array


def _is_nan(cost: Cost) -> ParameterError:
    return ParameterError(f"expected numbers of cost {cost.name!r}, or inf to forbid, got nan")


def edge_costs(
    previous: Layer, following: Layer, costs: Sequence[WeightedCost], song_features: SongFeatures
) -> NDArray[np.float32]:
    """Weighted edge costs (P, N) float32.

    Raises `ParameterError` for nan, a wrong shape, or an edge below the cost's own lower bound.
    """
    total = np.zeros((previous.n_nodes, following.n_nodes), np.float32)
    for weighted in costs:
        if weighted.weight == 0:
            continue
        value = weighted.cost.edge(previous, following, song_features)
        if value is None:
            continue
        value = _checked(value, total.shape, weighted.cost).astype(np.float32, copy=False)
        least = value.min(initial=np.inf)
        if np.isnan(least):
            raise _is_nan(weighted.cost)
        if least < weighted.cost.min_jump_cost:
            _check_jumps(previous, following, value, weighted.cost)
        total += np.float32(weighted.weight) * value
    return total


def _check_jumps(previous: Layer, following: Layer, value: NDArray[np.float32], cost: Cost) -> None:
    """Raise `ParameterError` if an edge between segments is below the cost's lower bound."""
    jumps = np.array(value)
    jumps[previous.successors_in(following)] = np.inf
    if jumps.min(initial=np.inf) < cost.min_jump_cost:
        raise ParameterError(
            f"cost {cost.name!r}: expected no edge between segments below its min_jump_cost of "
            f"{cost.min_jump_cost:g}, got {jumps.min():g}"
        )
