"""Planners, which choose the node to dance in each second."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from choreograph.choreography.graph.cheap_nodes import CheapSoFar
from choreograph.choreography.graph.cost import WeightedCost, allowed_nodes, edge_costs, weighted_terms
from choreograph.choreography.graph.costs import Transition, is_of_walk
from choreograph.choreography.graph.forward import N_THREADS, SearchStep
from choreograph.choreography.graph.layers import Layer
from choreograph.choreography.graph.local_search import with_history
from choreograph.choreography.graph.segments import LayerSource
from choreograph.core.errors import NoPathError
from choreograph.core.numerics import AnyInts
from choreograph.core.progress import StepReport, part
from choreograph.core.timebase import SEGMENT_S
from choreograph.music.song_features import SongFeatures


@dataclass(frozen=True, eq=False)
class Path:
    """The chosen node of every second, as layers of one node, and its costs."""

    nodes: tuple[Layer, ...]  # S layers of one node
    terms: Callable[[], tuple[dict[str, float], ...]]  # evaluates `costs`
    least_total: float | None = None  # a lower bound of the total of any path, if it was asked for

    @cached_property
    def costs(self) -> tuple[dict[str, float], ...]:
        """S times, cost name -> weighted cost of the node and of the edge into it."""
        return self.terms()

    @property
    def total(self) -> float:
        """Sum of all weighted costs."""
        return sum(sum(costs.values()) for costs in self.costs)


# Multi-threaded BLAS competes with the planner's threads for the cores: four times slower.
@threadpool_limits.wrap(limits=1, user_api="blas")  # type: ignore[untyped-decorator, unused-ignore]
def plan_exact(
    source: LayerSource,
    costs: Sequence[WeightedCost],
    song_features: SongFeatures,
    *,
    with_bound: bool = False,
    report: StepReport | None = None,
    likely: Callable[[list[Layer]], None] | None = None,
) -> Path:
    """The cheapest path over the whole song, by dynamic programming over the layers (Viterbi).

    The paper plans greedily (section 3.3). With costs that depend on the path (`Cost.of_path`), the result is
    not always the cheapest path. They are evaluated along the cheapest path found to each node, as in a beam
    search with the width of a layer, and `local_search` then improves the path. It never costs more than that
    of `plan_greedy` on the same layers. `likely` gets the nodes of the path before that. `with_bound`
    searches once more, without the costs that depend on the path, for a lower bound of all paths.

    Raises `NoPathError` naming the second if no path is allowed, `ParameterError` if a cost returns nan, a
    wrong shape, or an edge below its own lower bound.
    """
    of_path = [weighted for weighted in costs if weighted.weight and weighted.cost.of_path]
    cheap = CheapSoFar(source, costs, song_features) if of_path else None
    keys, total = _search(source, costs, song_features, cheap, report)
    nodes = [source.node(key) for key in keys] if cheap is None else _improved(cheap, keys, likely)
    path = _path_along(nodes, costs, song_features)
    if not with_bound:
        return path
    fixed = [weighted for weighted in costs if not weighted.cost.of_path]
    least = _search(source, fixed, song_features)[1] if of_path else total
    for weighted in of_path:
        least += weighted.weight * weighted.cost.min_path_cost if weighted.weight > 0 else -np.inf
    return replace(path, least_total=least if np.isfinite(least) else None)


def _search(
    source: LayerSource,
    costs: Sequence[WeightedCost],
    song_features: SongFeatures,
    cheap: CheapSoFar | None = None,
    report: StepReport | None = None,
) -> tuple[list[int], float]:
    """The keys of a path by dynamic programming, and its cost. `cheap` keeps nodes of every second."""
    layer, reached = allowed_nodes(source.layer(0), costs, song_features)
    greedy: _GreedyPath | None = _GreedyPath(layer, reached)
    if cheap is not None:
        cheap.add(layer, reached, reached)
    layer = with_history(layer, layer)
    node_keys = [_node_keys(layer)]
    parents: list[NDArray[np.int32]] = []
    with ThreadPoolExecutor(N_THREADS) as pool:
        step = SearchStep(costs, song_features, pool)
        for second in range(1, source.n_seconds):
            following, node_cost = allowed_nodes(source.layer(second), costs, song_features)
            best, parent = step(layer, following, reached)
            if not np.isfinite(best).any():
                raise NoPathError(f"no allowed edge into second {second}: relax a cost that returns inf")
            if greedy is not None and not greedy.extend(following, node_cost, step.from_one):
                greedy = None
            # Nodes that cannot be reached keep their place, with infinite cost, so that indices agree.
            reached = best + node_cost
            if cheap is not None:
                cheap.add(following, node_cost, reached, step.fixed)
            layer = with_history(following, layer, parent)
            node_keys.append(_node_keys(layer))
            parents.append(parent.astype(np.int32))
            if report is not None:
                report(second + 1, source.n_seconds)
    keys = _backtrack(parents, node_keys, int(np.argmin(reached)))
    if greedy is not None and greedy.total < reached.min():
        return greedy.keys, greedy.total
    return keys, float(reached.min())


def _improved(
    cheap: CheapSoFar, keys: Sequence[int], likely: Callable[[list[Layer]], None] | None
) -> list[Layer]:
    """`CheapSoFar.improved`, a stage of its own in `tests/benchmarks`."""
    return cheap.improved(keys, likely)


def plan_greedy(
    source: LayerSource,
    costs: Sequence[WeightedCost],
    song_features: SongFeatures,
    *,
    report: StepReport | None = None,
) -> Path:
    """The cheapest next node, second by second (ChoreoGraph, section 3.3).

    Raises as `plan_exact`. It can also run into a dead end that `plan_exact` avoids.
    """

    path = _GreedyPath(*allowed_nodes(source.layer(0), costs, song_features))
    for second in range(1, source.n_seconds):
        layer, node_cost = allowed_nodes(source.layer(second), costs, song_features)

        def edges(last: Layer, _: int, layer: Layer = layer) -> NDArray[np.float32]:
            from_last: NDArray[np.float32] = edge_costs(last, layer, costs, song_features)[0]
            return from_last

        if not path.extend(layer, node_cost, edges):
            raise NoPathError(f"no allowed edge into second {second}: relax a cost that returns inf")
        if report is not None:
            report(second + 1, source.n_seconds)
    return _path_along([source.node(key) for key in path.keys], costs, song_features)


class _GreedyPath:
    """The greedy path so far: its cost, its nodes, and the last of them."""

    def __init__(self, layer: Layer, node_cost: NDArray[np.float64]) -> None:
        self.total = float(node_cost.min())
        self.keys: list[int] = []
        first = int(np.argmin(node_cost))
        self._append(layer, first, layer.subset(np.array([first])))

    def extend(
        self,
        layer: Layer,
        node_cost: NDArray[np.float64],
        edges: Callable[[Layer, int], NDArray[np.float32]],
    ) -> bool:
        """Append the cheapest node of `layer`. Return False if no edge into it is allowed.

        `edges` gives the costs (N,) of going to its nodes from a layer of the last node alone, which has this
        index in the layer before.
        """
        total = node_cost + edges(self._last, self._node)
        best = int(np.argmin(total))
        if not np.isfinite(total[best]):
            return False
        self.total += float(total[best])
        self._append(layer, best, self._last)
        return True

    def _append(self, layer: Layer, node: int, before: Layer) -> None:
        self._last, self._node = with_history(layer.subset(np.array([node])), before), node
        self.keys.append(int(self._last.segment[0] * 4 + self._last.offset[0]))


def _node_keys(layer: Layer) -> NDArray[np.int32]:
    """The keys (N,) of `LayerSource.node`. They overflow after 12 days of song."""
    return (layer.segment * SEGMENT_S + layer.offset).astype(np.int32)


def _backtrack(parents: Sequence[NDArray[np.int32]], values: Sequence[AnyInts], last: int) -> list[int]:
    """`values` (N,) of every layer along the cheapest path to node `last` of the last layer."""
    found = [int(values[-1][last])]
    for parent, here in zip(reversed(parents), reversed(values[:-1]), strict=True):
        last = int(parent[last])
        found.append(int(here[last]))
    return found[::-1]


def _path_along(layers: Sequence[Layer], costs: Sequence[WeightedCost], song_features: SongFeatures) -> Path:
    """The path through layers of one node, with what was danced up to each."""
    nodes: list[Layer] = []
    for node in layers:
        nodes.append(with_history(node, nodes[-1] if nodes else node))

    def terms() -> tuple[dict[str, float], ...]:
        pairs = zip([None, *nodes[:-1]], layers, strict=True)
        return tuple(_terms_of(last, node, costs, song_features) for last, node in pairs)

    return Path(tuple(nodes), terms)


def _terms_of(
    last: Layer | None, node: Layer, costs: Sequence[WeightedCost], song_features: SongFeatures
) -> dict[str, float]:
    """Weighted cost of a node and of the edge from the last one, by cost name."""
    terms = {weighted.cost.name: 0.0 for weighted in costs}
    for name, value in weighted_terms(costs, lambda c: c.node(node, song_features), (1,)):
        terms[name] += float(value[0])
    if last is not None:
        for name, value in weighted_terms(costs, lambda c: c.edge(last, node, song_features), (1, 1)):
            terms[name] += float(value[0, 0])
    return terms


NEIGHBOURS = 32  # edges of each clip, with the smoothest transitions from its first second


def plan_motion_graph(
    source: LayerSource,
    costs: Sequence[WeightedCost],
    song_features: SongFeatures,
    *,
    report: StepReport | None = None,
) -> Path:
    """A walk on the first warped seconds of clips by transition alone (ChoreoGraph, section 4, a baseline).

    Only the first second of each warped segment is a node, so completeness and style have no effect. As in
    Kovar's motion graphs, the graph over clips is pruned to its largest strongly connected component, so that
    the walk has no dead ends. The edge is then chosen by the warped poses of the candidates of each second.
    User-defined costs are used as in the other planners.
    """
    n_seconds = source.n_seconds
    allowed_clips = _largest_component(source, song_features, part(report, 0, n_seconds, 2 * n_seconds))
    transition = [w for w in costs if w.cost.name == Transition.name]
    others = [w for w in costs if w.cost.name != Transition.name and is_of_walk(w.cost)]
    nodes: list[Layer] = []
    terms: list[dict[str, float]] = []
    for second in range(n_seconds):
        layer = source.layer(second)
        first = layer.offset == 0
        inside = first & np.isin(layer.clip, allowed_clips)
        layer = layer.subset(inside if inside.any() else first)
        total, smoothness = np.zeros((2, layer.n_nodes))
        for w in others:
            value = w.cost.node(layer, song_features)
            total += 0.0 if value is None else w.weight * np.asarray(value)
        if nodes:
            smoothness = _edges(transition, nodes[-1], layer, song_features)
            total += _edges(others, nodes[-1], layer, song_features)
        if not np.isfinite(total + smoothness).any():
            raise NoPathError(f"every node of second {second} is forbidden: relax a cost that returns inf")
        best = int(np.argmin(total + smoothness))
        nodes.append(layer.subset(np.array([best])))
        terms.append({Transition.name: float(smoothness[best])})
        if report is not None:
            report(n_seconds + second + 1, 2 * n_seconds)
    return Path(tuple(nodes), lambda: tuple(terms))


def _edges(
    costs: Sequence[WeightedCost], before: Layer, layer: Layer, song_features: SongFeatures
) -> NDArray[np.float64]:
    """The weighted costs of going from the one node `before` to each of a layer (N,)."""
    total = np.zeros(layer.n_nodes)
    for w in costs:
        value = w.cost.edge(before, layer, song_features)
        total += 0.0 if value is None else w.weight * np.asarray(value)[0]
    return total


def _largest_component(
    source: LayerSource, song_features: SongFeatures, report: StepReport | None
) -> NDArray[np.integer]:
    """Clips of the largest strongly connected component of the graph of smooth transitions."""
    import networkx as nx  # for this planner only

    layers = map(source.layer, range(0, source.n_seconds, 4))
    firsts = [layer.subset(layer.offset == 0) for layer in layers]
    graph = nx.DiGraph()
    for done, (here, there) in enumerate(zip(firsts, [*firsts[1:], firsts[0]], strict=True), start=1):
        cost = np.asarray(Transition().edge(here, there, song_features))
        nearest = np.argsort(cost, axis=1)[:, :NEIGHBOURS]
        for row, columns in enumerate(nearest):
            graph.add_edges_from((int(here.clip[row]), int(clip)) for clip in there.clip[columns])
        if report is not None:
            report(done, len(firsts))
    largest = max(map(sorted, nx.strongly_connected_components(graph)), key=len)
    return np.array(largest)
