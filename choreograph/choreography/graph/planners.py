"""Planners, which choose the node to dance in each second, and the steps of their searches.

`plan_exact` is dynamic programming over the layers, `plan_greedy` takes the cheapest next node, and
`plan_motion_graph` walks by transitions alone. `SearchStep` finds the cheapest way into every node of a
second from the nodes of the second before, by branch and bound. If all costs of edges are compiled, it is
compiled as well.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from choreograph.choreography.graph.cost import Cost, WeightedCost, allowed_nodes, edge_costs, weighted_terms
from choreograph.choreography.graph.costs import (
    BUILTIN_COSTS,
    F32,
    Completeness,
    Transition,
    flat_poses,
    is_of_walk,
    rms_speed_m_s,
)
from choreograph.choreography.graph.kernels import (
    COMPILED,
    angles_of,
    arrays_of,
    bounds_of,
    cheapest_edges,
    cheapest_predecessors,
    fixed_edges,
)
from choreograph.choreography.graph.layers import Layer
from choreograph.choreography.graph.local_search import CheapSoFar, with_history
from choreograph.choreography.graph.motif_costs import MotifTransition, Signature, first_motif, last_motif
from choreograph.choreography.graph.path_costs import FormCost
from choreograph.choreography.graph.segments import LayerSource
from choreograph.core.errors import NoPathError
from choreograph.core.numerics import AnyInts, Floats, frame_blocks
from choreograph.core.progress import StepReport, part
from choreograph.core.timebase import SEGMENT_S
from choreograph.music.song_features import SongFeatures

N_THREADS = min(4, os.cpu_count() or 1)
_BLOCK = 128  # predecessors whose edges are evaluated at once
_MIN_EDGES_FOR_THREADS = 100_000  # a millisecond's work
_PRUNE_BELOW = 0.8  # copying a part of a layer takes about a fifth of the time of its edges
_PAIR_BLOCK = 64  # successor pairs are evaluated as the diagonal of a block of edges of this size
_ROUNDING = 1e-4


class SearchStep:
    """The step of a search by these costs: from the nodes of one second to those of the next."""

    def __init__(
        self, costs: Sequence[WeightedCost], song_features: SongFeatures, pool: ThreadPoolExecutor
    ) -> None:
        self._costs, self._song_features, self._pool = costs, song_features, pool
        self._with_edges = [w for w in costs if w.weight != 0 and type(w.cost).edge is not Cost.edge]
        kinds = [type(w.cost) for w in self._with_edges]
        # User-defined costs may keep state between calls, so only the built-in ones are evaluated in threads.
        self._thread_safe = set(kinds) <= set(BUILTIN_COSTS)
        self._compiled = kinds == [kind for kind in COMPILED if kind in kinds]
        self._of = {type(w.cost): w for w in self._with_edges}
        self._edges: _Edges | None = None  # the latest

    def __call__(self, layer: Layer, following: Layer, reached: Floats) -> tuple[Floats, NDArray[np.int64]]:
        """Cost of the cheapest path into every node of `following`, and its last node in `layer`.

        The method is branch and bound. First the edges inside segments are evaluated, one into each node, and
        then all predecessors, cheapest first, in growing blocks. A predecessor whose cost plus the lower
        bound of a jump exceeds the best path found into a node cannot improve it. Such rows and columns of
        the edges are not evaluated. The result is that of all edges.
        """
        edges = self._edges = self._edges_to(layer, following)
        best, parent = np.full(following.n_nodes, np.inf), np.zeros(following.n_nodes, np.int64)
        here, there = edges.successors
        best[there] = reached[here] + edges.of_pairs(here, there)
        parent[there] = here
        order = np.argsort(reached, kind="stable")
        order = order[np.isfinite(reached[order])]
        bound = edges.bound(self._with_edges)
        start = 0
        while start < len(order):
            block = order[start : start + max(_BLOCK, start)]
            start += len(block)
            # The float32 sums of edges may be below their bound by a rounding error.
            improvable = np.flatnonzero(best > reached[block[0]] + bound - _ROUNDING)
            if len(improvable) == 0:
                break
            if len(improvable) > _PRUNE_BELOW * following.n_nodes:
                improvable = np.arange(following.n_nodes)
            beyond = (reached[block] - reached[block[0]]).astype(np.float32)

            def improve(
                part: NDArray[np.int64], block: NDArray[np.int64] = block, beyond: F32 = beyond
            ) -> None:
                rows, edge = edges.cheapest(block, part, beyond, best[part] - reached[block[0]])
                cost = reached[block[rows]] + edge
                better = cost < best[part]
                best[part[better]] = cost[better]
                parent[part[better]] = block[rows[better]]

            if self._thread_safe and len(block) * len(improvable) > _MIN_EDGES_FOR_THREADS:
                list(self._pool.map(improve, np.array_split(improvable, N_THREADS)))
            else:
                improve(improvable)
        return best, parent

    def from_one(self, last: Layer, node: int) -> F32:
        """The costs (N,) of the edges of the latest step from one node, whose history is that of `last`."""
        assert self._edges is not None
        return self._edges.from_one(last, node)

    def fixed(self, here: AnyInts, there: AnyInts) -> Future[F32] | None:
        """The costs (P, N) of the edges of the latest step that do not depend on the path, being evaluated.

        Those from nodes `here` (P,) to nodes `there` (N,), or None if they are not compiled.
        """
        if not isinstance(self._edges, _CompiledEdges):
            return None
        return self._pool.submit(self._edges.fixed, here, there)

    def _edges_to(self, layer: Layer, following: Layer) -> _Edges:
        if not self._compiled:
            return _Edges(layer, following, self._costs, self._song_features)
        last = self._edges.after if isinstance(self._edges, _CompiledEdges) else None
        is_known = last is not None and last.is_of(layer)
        before = last if is_known and last is not None else _Nodes(layer, self._of, self._song_features)
        after = _Nodes(following, self._of, self._song_features)
        return _CompiledEdges(layer, following, self._costs, self._song_features, before, after)


class _Edges:
    """The edges from P nodes to the N nodes of the next second, by any costs."""

    def __init__(
        self, layer: Layer, following: Layer, costs: Sequence[WeightedCost], song_features: SongFeatures
    ) -> None:
        self._layer, self._following, self._costs, self._song_features = (
            layer,
            following,
            costs,
            song_features,
        )
        self.successors = layer.successors_in(following)

    def of_pairs(self, here: AnyInts, there: AnyInts) -> F32:
        """The costs (M,) of the edges from nodes `here` (M,) to nodes `there` (M,)."""
        before, after = self._layer.subset(here), self._following.subset(there)
        found = np.empty(len(here), np.float32)
        for block in frame_blocks(len(here), _PAIR_BLOCK):
            edges = edge_costs(before.subset(block), after.subset(block), self._costs, self._song_features)
            found[block] = np.diagonal(edges)
        return found

    def from_one(self, last: Layer, node: int) -> F32:
        """The costs (N,) of the edges from one node, whose history is that of the layer `last` of it."""
        edges: F32 = edge_costs(last, self._following, self._costs, self._song_features)[0]
        return edges

    def bound(self, costs: Sequence[WeightedCost]) -> Floats:
        """Lower bounds (N,) of the edges between segments into each node."""
        bound = np.zeros(self._following.n_nodes)
        for w in costs:
            least = w.cost.min_edge_costs(self._layer, self._following, self._song_features)
            bound += w.weight * least if w.weight > 0 else -np.inf
        return bound

    def cheapest(
        self, block: AnyInts, part: AnyInts, beyond: F32, most: Floats
    ) -> tuple[NDArray[np.int32], F32]:
        """The node of `block` (B,) from which each node of `part` (C,) is reached at the least cost.

        The nodes of the block are reached at the costs `beyond` (B,). Returns the index (C,) in the block,
        and the cost (C,) of the edge. It may be inf if the sum of both is not below `most` (C,).
        """
        every = len(part) == self._following.n_nodes
        there = self._following if every else self._following.subset(part)
        edges = edge_costs(self._layer.subset(block), there, self._costs, self._song_features)
        rows, least = np.zeros(len(part), np.int32), np.full(len(part), np.inf, np.float32)
        cheapest_predecessors(beyond, edges, least, rows)
        return rows, edges[rows, np.arange(len(part))]


# The same edges, compiled for the built-in costs.


class _Nodes:
    """What the compiled edges read of the nodes of one second."""

    def __init__(self, layer: Layer, of: dict[type[Cost], WeightedCost], song_features: SongFeatures) -> None:
        form, signature = _cost_of(FormCost, of), _cost_of(Signature, of)
        transition = _cost_of(MotifTransition, of)
        (
            self.end_rad, self.next_part, self.take, self.start_rad, self.part, self.series,
            self.places, self.motifs, self.number, self.is_return, self.form_weight,
            self.step_cost, self.constants, *_,
        ) = arrays_of(layer, form, signature, song_features)  # fmt: skip
        self._first = layer.first_pose_m
        self.transition_cost = np.zeros((1, 1), np.float32)
        if transition is not None:
            self.transition_cost = np.ascontiguousarray(transition.costs_at(layer))
        self.weights = np.array([of[kind].weight if kind in of else 0.0 for kind in COMPILED], np.float32)
        self.first, first_sq = flat_poses(layer.first_pose_m)
        self.last, last_sq = flat_poses(layer.last_pose_m)
        self.first_velocity, first_velocity_sq = flat_poses(layer.first_velocity_m_s)
        self.last_velocity, last_velocity_sq = flat_poses(layer.last_velocity_m_s)
        starts, ends = np.ascontiguousarray(layer.take_frames.T, np.float64)
        self.at_start = (
            first_sq, first_velocity_sq, rms_speed_m_s(layer.first_velocity_m_s), starts,
            layer.warp.enter_penalty.astype(np.float32), first_motif(layer).astype(np.int64),
        )  # fmt: skip
        self.at_end = (
            last_sq, last_velocity_sq, rms_speed_m_s(layer.last_velocity_m_s), ends,
            layer.warp.leave_penalty.astype(np.float32), last_motif(layer).astype(np.int64),
        )  # fmt: skip

    def is_of(self, layer: Layer) -> bool:
        return layer.first_pose_m is self._first


_Kind = TypeVar("_Kind", bound=Cost)


def _cost_of(kind: type[_Kind], of: dict[type[Cost], WeightedCost]) -> _Kind | None:
    cost = of[kind].cost if kind in of else None
    return cost if isinstance(cost, kind) else None


class _CompiledEdges(_Edges):
    """`_Edges` of the built-in costs, to the bit."""

    def __init__(
        self,
        layer: Layer,
        following: Layer,
        costs: Sequence[WeightedCost],
        song_features: SongFeatures,
        before: _Nodes,
        after: _Nodes,
    ) -> None:
        super().__init__(layer, following, costs, song_features)
        self._before, self.after = before, after
        counts = np.ascontiguousarray(layer.path.motif_counts)
        seen = np.zeros_like(counts) if following.new_goal else counts
        weights = after.weights
        of_signature = weights[COMPILED.index(Signature)]
        earlier, self._least = bounds_of(weights, of_signature, seen, after.motifs, after.step_cost)
        angles = angles_of(np.ascontiguousarray(layer.path.turn_rad), before.end_rad, after.start_rad)
        danced = np.ascontiguousarray(layer.path.danced[:, after.number])
        self._stay = np.ones(following.n_nodes, np.float32)
        here, there = self.successors
        self._stay[there] = Completeness().staying(layer, following, here, there)
        usage_s = np.ascontiguousarray(layer.path.take_usage_s)
        self._history = (*angles[:4], before.next_part, usage_s, danced, seen, *before.at_end, before.take)
        self._ends = (
            *angles[4:], after.part, after.take, after.series, after.places, after.motifs, earlier,
            self._least, self._stay, *after.at_start,
        )  # fmt: skip
        self._of_costs = (
            after.is_return, after.form_weight, after.step_cost, after.transition_cost, after.constants
        )  # fmt: skip
        self._arguments = weights, self._history, self._ends, self._of_costs

    def of_pairs(self, here: AnyInts, there: AnyInts) -> F32:
        poses = np.einsum("md,md->m", self._before.last[here], self.after.first[there])
        velocities = np.einsum("md,md->m", self._before.last_velocity[here], self.after.first_velocity[there])
        nothing, most = np.zeros(len(here), np.float32), np.full(len(here), np.inf, np.float32)
        _, edges = cheapest_edges(
            here, there, True, nothing, most, poses[:, None], velocities[:, None], *self._arguments
        )
        return edges

    def from_one(self, last: Layer, node: int) -> F32:
        before, after, one = self._before, self.after, slice(node, node + 1)
        counts = np.ascontiguousarray(last.path.motif_counts)
        turn_rad = np.ascontiguousarray(last.path.turn_rad)
        history = (
            *angles_of(turn_rad, before.end_rad[one], after.start_rad[:0])[:4],
            before.next_part[one], np.ascontiguousarray(last.path.take_usage_s),
            np.ascontiguousarray(last.path.danced[:, after.number]),
            np.zeros_like(counts) if self._following.new_goal else counts,
            *(values[one] for values in before.at_end), before.take[one],
        )  # fmt: skip
        every, nothing = np.arange(self._following.n_nodes), np.zeros(1, np.float32)
        poses = before.last[one] @ after.first.T
        velocities = before.last_velocity[one] @ after.first_velocity.T
        _, edges = cheapest_edges(
            np.zeros(1, np.int64), every, False, nothing, np.full(len(every), np.inf, np.float32), poses,
            velocities, after.weights, history, self._ends, self._of_costs,
        )  # fmt: skip
        return edges

    def fixed(self, here: AnyInts, there: AnyInts) -> F32:
        """The costs (P, N) of the edges from nodes `here` to nodes `there` that do not depend on the path."""
        before, after = self._before, self.after
        poses = before.last[here] @ after.first[there].T
        velocities = before.last_velocity[here] @ after.first_velocity[there].T
        edges: F32 = fixed_edges(here, there, poses, velocities, *self._arguments)
        return edges

    def bound(self, costs: Sequence[WeightedCost]) -> Floats:
        bound: Floats = super().bound([w for w in costs if type(w.cost) is not Signature]) + self._least
        return bound

    def cheapest(
        self, block: AnyInts, part: AnyInts, beyond: F32, most: Floats
    ) -> tuple[NDArray[np.int32], F32]:
        every = len(part) == self._following.n_nodes
        there = slice(None) if every else part
        poses = self._before.last[block] @ self.after.first[there].T
        velocities = self._before.last_velocity[block] @ self.after.first_velocity[there].T
        rows, edges = cheapest_edges(
            block, part, False, beyond, (most + _ROUNDING).astype(np.float32), poses, velocities,
            *self._arguments,
        )  # fmt: skip
        return rows, edges


@dataclass(frozen=True, eq=False)
class PlannedPath:
    """The chosen node of every second, as layers of one node, and its costs."""

    nodes: tuple[Layer, ...]  # S layers of one node
    costs: tuple[dict[str, float], ...]  # S times, name -> weighted cost of the node and of the edge into it
    least_total: float | None = None  # a lower bound of the total of any path, if it was asked for

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
) -> PlannedPath:
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
    nodes = [source.node(key) for key in keys] if cheap is None else cheap.improved(keys, likely)
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


def plan_greedy(
    source: LayerSource,
    costs: Sequence[WeightedCost],
    song_features: SongFeatures,
    *,
    report: StepReport | None = None,
) -> PlannedPath:
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
        self.keys.append(int(self._last.warp.segment[0] * 4 + self._last.warp.offset[0]))


def _node_keys(layer: Layer) -> NDArray[np.int32]:
    """The keys (N,) of `LayerSource.node`. They overflow after 12 days of song."""
    return (layer.warp.segment * SEGMENT_S + layer.warp.offset).astype(np.int32)


def _backtrack(parents: Sequence[NDArray[np.int32]], values: Sequence[AnyInts], last: int) -> list[int]:
    """`values` (N,) of every layer along the cheapest path to node `last` of the last layer."""
    found = [int(values[-1][last])]
    for parent, here in zip(reversed(parents), reversed(values[:-1]), strict=True):
        last = int(parent[last])
        found.append(int(here[last]))
    return found[::-1]


def _path_along(
    layers: Sequence[Layer], costs: Sequence[WeightedCost], song_features: SongFeatures
) -> PlannedPath:
    """The path through layers of one node, with what was danced up to each."""
    nodes: list[Layer] = []
    for node in layers:
        nodes.append(with_history(node, nodes[-1] if nodes else node))

    pairs = zip([None, *nodes[:-1]], layers, strict=True)
    return PlannedPath(
        tuple(nodes), tuple(_costs_at(last, node, costs, song_features) for last, node in pairs)
    )


def _costs_at(
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
) -> PlannedPath:
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
        first = layer.warp.offset == 0
        inside = first & np.isin(layer.warp.clip, allowed_clips)
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
    return PlannedPath(tuple(nodes), tuple(terms))


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
    firsts = [layer.subset(layer.warp.offset == 0) for layer in layers]
    graph = nx.DiGraph()
    for done, (here, there) in enumerate(zip(firsts, [*firsts[1:], firsts[0]], strict=True), start=1):
        cost = np.asarray(Transition().edge(here, there, song_features))
        nearest = np.argsort(cost, axis=1)[:, :NEIGHBOURS]
        for row, columns in enumerate(nearest):
            graph.add_edges_from((int(here.warp.clip[row]), int(clip)) for clip in there.warp.clip[columns])
        if report is not None:
            report(done, len(firsts))
    largest = max(map(sorted, nx.strongly_connected_components(graph)), key=len)
    return np.array(largest)
