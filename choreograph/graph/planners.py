"""Planners: which node to dance in each second."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from choreograph.errors import NoPathError, ParameterError
from choreograph.features.song_features import SongFeatures
from choreograph.graph.costs import BUILTIN_COSTS, Cost
from choreograph.graph.layers import Layer, LayerSource
from choreograph.graph.motif_costs import MOTIF_COSTS

Floats = NDArray[np.floating]
Ints = NDArray[np.integer]
Report = Callable[[int, int], None]  # seconds planned, seconds in all

_WORTH_CUTTING = 0.8  # copying a layer costs about a fifth of pricing its edges
_BLOCK = 128  # predecessors whose edges are priced at once: 1 MB at 2,048 nodes
_THREADS = min(4, os.cpu_count() or 1)
_WORTH_THREADS = 100_000  # edges: a millisecond's work
_PAIRS = 64  # pairs that play on are priced as the diagonal of so small a block of edges
_ROUNDING = 1e-4


@dataclass(frozen=True)
class WeightedCost:
    """A cost and what it counts for; a weight of 0 leaves it out."""

    cost: Cost
    weight: float


@dataclass(frozen=True, eq=False)
class Path:
    """The chosen node of every second, as layers of one node, and what each paid for what."""

    nodes: tuple[Layer, ...]  # S layers of one node
    costs: tuple[dict[str, float], ...]  # S: cost name -> weighted cost, node and edge from the last

    @property
    def total(self) -> float:
        """Sum of all weighted costs."""
        return sum(sum(costs.values()) for costs in self.costs)


# BLAS on threads of its own fights the planner's, and whatever else runs, for the cores: four times slower.
@threadpool_limits.wrap(limits=1, user_api="blas")
def plan_exact(
    source: LayerSource,
    costs: Sequence[WeightedCost],
    song_features: SongFeatures,
    *,
    report: Report | None = None,
) -> Path:
    """The cheapest path over the whole song, by dynamic programming over the layers.

    A cost that depends on all that has been danced (`Signature`) is priced for each node by the cheapest way
    found to it: a beam of as many ways as a layer has nodes, and the path is then cheap rather than the
    cheapest. Takes tire by what the cheapest way so far has danced: each second's prices are fixed when it is
    reached. Never costlier than `plan_greedy` on the same layers where takes do not tire. Raises
    `NoPathError` naming the second if no path is allowed, `ParameterError` if a cost returns nan or a wrong
    shape. The paper plans greedily (section 3.3).
    """
    usage_s = [source.recent_usage_after([])]
    layer, reached = _allowed(source.layer(0).with_recent_usage(usage_s[0]), costs, song_features)
    walk = _Walk(layer, reached) if layer.danced.size else None
    layer = layer.after(layer.danced)
    kept = [layer.segment * 4 + layer.offset]
    takes = [layer.take]
    parents: list[NDArray[np.int32]] = []
    with ThreadPoolExecutor(_THREADS) as pool:
        for second in range(1, source.n_seconds):
            usage_s.append(source.recent_usage_after(_along(parents, takes, int(np.argmin(reached)))))
            following, node_cost = _allowed(
                source.layer(second).with_recent_usage(usage_s[-1]), costs, song_features
            )
            best, who = _step(layer, following, reached, costs, song_features, pool)
            if not np.isfinite(best).any():
                raise NoPathError(f"no allowed way into second {second}: every edge is forbidden")
            if walk is not None and not walk.goes_on(following, node_cost, costs, song_features):
                walk = None
            # Nodes that cannot be reached stay, at infinite cost, so that indices agree.
            reached = best + node_cost
            layer = following.after(layer.danced[who])
            kept.append(layer.segment * 4 + layer.offset)
            takes.append(layer.take)
            parents.append(who.astype(np.int32))
            if report is not None:
                report(second + 1, source.n_seconds)
    keys = _along(parents, kept, int(np.argmin(reached)))
    if walk is not None and walk.total < reached.min():
        keys = walk.keys
    return _priced(source, keys, usage_s, costs, song_features)


def plan_greedy(
    source: LayerSource,
    costs: Sequence[WeightedCost],
    song_features: SongFeatures,
    *,
    report: Report | None = None,
) -> Path:
    """The cheapest next node, second by second (ChoreoGraph, section 3.3).

    Raises as `plan_exact`; it can also walk into a dead end that `plan_exact` avoids.
    """
    usage_s = [source.recent_usage_after([])]
    walk = _Walk(*_allowed(source.layer(0).with_recent_usage(usage_s[0]), costs, song_features))
    for second in range(1, source.n_seconds):
        usage_s.append(source.recent_usage_after(walk.takes))
        layer = source.layer(second).with_recent_usage(usage_s[-1])
        if not walk.goes_on(*_allowed(layer, costs, song_features), costs, song_features):
            raise NoPathError(f"no allowed way into second {second}: every edge is forbidden")
        if report is not None:
            report(second + 1, source.n_seconds)
    return _priced(source, walk.keys, usage_s, costs, song_features)


class _Walk:
    """The greedy walk: where it stands, what it has cost, and the nodes it came by."""

    def __init__(self, layer: Layer, node_cost: NDArray[np.float64]) -> None:
        self.total = float(node_cost.min())
        self.keys: list[int] = []
        self.takes: list[int] = []
        self._stand_on(layer, int(np.argmin(node_cost)), layer.danced[:1])

    def goes_on(
        self,
        layer: Layer,
        node_cost: NDArray[np.float64],
        costs: Sequence[WeightedCost],
        song_features: SongFeatures,
    ) -> bool:
        """Take the cheapest step into `layer`; False if there is none."""
        total = node_cost + _edges(self._here, layer, costs, song_features)[0]
        best = int(np.argmin(total))
        if not np.isfinite(total[best]):
            return False
        self.total += float(total[best])
        self._stand_on(layer, best, self._here.danced)
        return True

    def _stand_on(self, layer: Layer, node: int, danced: NDArray[np.integer]) -> None:
        self._here = layer.chosen(np.array([node])).after(danced)
        self.keys.append(int(self._here.segment[0] * 4 + self._here.offset[0]))
        self.takes.append(int(self._here.take[0]))


def _along(parents: Sequence[NDArray[np.int32]], values: Sequence[Ints], last: int) -> list[int]:
    """What `values` (N,) of every layer are along the cheapest way to node `last` of the last layer."""
    found = [int(values[-1][last])]
    for parent, here in zip(reversed(parents), reversed(values[:-1]), strict=True):
        last = int(parent[last])
        found.append(int(here[last]))
    return found[::-1]


def _allowed(
    layer: Layer, costs: Sequence[WeightedCost], song_features: SongFeatures
) -> tuple[Layer, NDArray[np.float64]]:
    """The layer without its forbidden nodes, and the weighted node costs (N,) of the rest."""
    total = np.zeros(layer.n_nodes)
    for name, cost in _terms(costs, lambda c: c.node(layer, song_features), (layer.n_nodes,)):
        del name
        total += cost
    allowed = np.isfinite(total)
    if not allowed.any():
        raise NoPathError(f"every node of second {layer.second} is forbidden: relax a cost that returns inf")
    return (layer, total) if allowed.all() else (layer.chosen(allowed), total[allowed])


def _terms(costs, evaluate, shape):
    """Weighted values of every cost that has any, checked."""
    for weighted in costs:
        if weighted.weight == 0:
            continue
        value = evaluate(weighted.cost)
        if value is None:
            continue
        value = np.asarray(value)
        if value.shape != shape:
            raise ParameterError(f"cost {weighted.cost.name!r} must return {shape}, got {value.shape}")
        if np.isnan(np.min(value, initial=0.0)):
            raise ParameterError(f"cost {weighted.cost.name!r} returned nan")
        yield weighted.cost.name, weighted.weight * value


def _edges(
    previous: Layer, following: Layer, costs: Sequence[WeightedCost], song_features: SongFeatures
) -> NDArray[np.float32]:
    """Weighted edge costs (P, N) float32."""
    total = np.zeros((previous.n_nodes, following.n_nodes), np.float32)
    for weighted in costs:
        if weighted.weight == 0:
            continue
        value = weighted.cost.edge(previous, following, song_features)
        if value is None:
            continue
        value = np.asarray(value, np.float32)
        if value.shape != total.shape:
            raise ParameterError(f"cost {weighted.cost.name!r} must return {total.shape}, got {value.shape}")
        least = value.min(initial=np.inf)
        if np.isnan(least):
            raise ParameterError(f"cost {weighted.cost.name!r} returned nan")
        if least < weighted.cost.least_jump:
            _check_jumps(previous, following, value, weighted.cost)
        total += np.float32(weighted.weight) * value
    return total


def _check_jumps(previous: Layer, following: Layer, value: NDArray[np.float32], cost: Cost) -> None:
    """Raise `ParameterError` if an edge between segments costs less than the cost says."""
    jumps = np.array(value)
    jumps[previous.successors_in(following)] = np.inf
    if jumps.min(initial=np.inf) < cost.least_jump:
        raise ParameterError(
            f"cost {cost.name!r} says least_jump = {cost.least_jump:g}, got an edge of {jumps.min():g}"
        )


def _step(
    layer: Layer,
    following: Layer,
    reached: NDArray[np.float64],
    costs: Sequence[WeightedCost],
    song_features: SongFeatures,
    pool: ThreadPoolExecutor,
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Cheapest way into every node of `following`, and from where.

    First those that play on in their segment, one way into each. Then all predecessors, cheapest first,
    in blocks that grow: one that with the least jump is already dearer than the best way found into a
    node cannot improve it, and such rows and columns of the edges are never computed. Exact: the answer
    is that of all edges.
    """
    from choreograph.graph._kernels import cheapest_predecessor

    best, who = _playing_on(layer, following, reached, costs, song_features)
    order = np.argsort(reached, kind="stable")
    order = order[np.isfinite(reached[order])]
    priced = [w for w in costs if w.weight != 0 and type(w.cost).edge is not Cost.edge]
    in_threads = all(type(w.cost) in (*BUILTIN_COSTS, *MOTIF_COSTS) for w in priced)
    jump = np.zeros(following.n_nodes)
    for w in priced:
        jump += w.weight * w.cost.least_edges(layer, following, song_features) if w.weight > 0 else -np.inf
    start = 0
    while start < len(order):
        block = order[start : start + max(_BLOCK, start)]
        start += len(block)
        # The float32 sums of edges may fall short of their bound by their rounding.
        wanted = np.flatnonzero(best > reached[block[0]] + jump - _ROUNDING)
        if len(wanted) == 0:
            break
        if len(wanted) > _WORTH_CUTTING * following.n_nodes:
            wanted = np.arange(following.n_nodes)
        # Costs of one's own may keep things between calls: only the built-in ones are priced in threads.
        many = in_threads and len(block) * len(wanted) > _WORTH_THREADS

        def price(part: NDArray[np.int64], block: NDArray[np.int64] = block) -> None:
            there = following if len(part) == following.n_nodes else following.chosen(part)
            edges = _edges(layer.chosen(block), there, costs, song_features)
            rows = cheapest_predecessor((reached[block] - reached[block[0]]).astype(np.float32), edges)
            cost = reached[block[rows]] + edges[rows, np.arange(len(part))]
            better = cost < best[part]
            best[part[better]] = cost[better]
            who[part[better]] = block[rows[better]]

        if many:
            list(pool.map(price, np.array_split(wanted, _THREADS)))
        else:
            price(wanted)
    return best, who


def _playing_on(
    layer: Layer,
    following: Layer,
    reached: NDArray[np.float64],
    costs: Sequence[WeightedCost],
    song_features: SongFeatures,
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """The way into each node from the one before it in its segment; infinite where there is none."""
    best = np.full(following.n_nodes, np.inf)
    who = np.zeros(following.n_nodes, np.int64)
    here, there = layer.successors_in(following)
    for start in range(0, len(here), _PAIRS):
        a, b = here[start : start + _PAIRS], there[start : start + _PAIRS]
        edges = _edges(layer.chosen(a), following.chosen(b), costs, song_features)
        best[b] = reached[a] + np.diagonal(edges)
        who[b] = a
    return best, who


def _priced(
    source: LayerSource,
    keys: list[int],
    usage_s: Sequence[Floats],
    costs: Sequence[WeightedCost],
    song_features: SongFeatures,
) -> Path:
    """The path through nodes given by segment × 4 + offset, with every cost term it pays."""
    nodes: list[Layer] = []
    priced: list[dict[str, float]] = []
    for key, recent_usage_s in zip(keys, usage_s, strict=True):
        node = source.node(key).with_recent_usage(recent_usage_s)
        terms = {weighted.cost.name: 0.0 for weighted in costs}
        for name, value in _terms(costs, lambda c, n=node: c.node(n, song_features), (1,)):
            terms[name] += float(value[0])
        if nodes:
            last = nodes[-1]
            for name, value in _terms(costs, lambda c, a=last, b=node: c.edge(a, b, song_features), (1, 1)):
                terms[name] += float(value[0, 0])
        nodes.append(node.after(nodes[-1].danced if nodes else node.danced))
        priced.append(terms)
    return Path(tuple(nodes), tuple(priced))
