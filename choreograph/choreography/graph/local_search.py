"""Iterated local search for a cheaper path, among the cheapest nodes of every second.

`CheapSoFar` keeps these nodes, and the costs of edges between them, while the exact planner passes.
`CheapNodes` then searches for a path that costs less with what depends on the path. If all such costs are
built-in ones, its steps are compiled.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from itertools import pairwise
from typing import Any, ClassVar, cast

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.graph.cost import WeightedCost, allowed_nodes, edge_costs, weighted_terms
from choreograph.choreography.graph.costs import F32
from choreograph.choreography.graph.kernels import COMPILED_OF_PATH, NO_NODE, OF_NODES, arrays_of, extended
from choreograph.choreography.graph.layers import (
    MIDDLE,
    USAGE_DECAY_S,
    Layer,
    arrays_by_name,
    changed_layer,
    position,
    repeated,
)
from choreograph.choreography.graph.motif_costs import Signature
from choreograph.choreography.graph.path_costs import FormCost, last_pose
from choreograph.choreography.graph.segments import LayerSource
from choreograph.core.long_songs import StoredArrays, is_long
from choreograph.core.numerics import AnyInts
from choreograph.core.timebase import SEGMENT_S
from choreograph.music.song_features import SongFeatures

_MOST_STARTS = 6  # random changes of the best path, from each of which the search starts again
_IN_VAIN = 3  # starts without a gain, after which there is no other
_NOISE = 0.3  # standard deviation of a random change of a cost, as a share of it
_N_FACTORS = 1 << 18  # of random changes that are drawn
_LEAST_GAIN = 1e-3  # a pass that gains less is the last


def with_history(layer: Layer, before: Layer, parent: AnyInts | slice = slice(None)) -> Layer:
    """The layer with what depends on the path to each node: motifs, takes, positions and rotation."""
    with_counts = layer.with_motif_counts(before.path.motif_counts[parent])
    with_usage = with_counts.with_take_usage(before.path.take_usage_s[parent])
    return with_usage.with_danced(before.path.danced[parent]).with_turn(before, parent)


@dataclass(frozen=True, eq=False)
class CheapNodes:
    """The cheapest nodes of every second, and their costs.

    Costs that depend on the path (`Cost.of_path`) are evaluated along paths. All others are evaluated once.
    """

    _n_threads: ClassVar[int] = 1  # costs of the user need not be made for threads

    layers: tuple[Layer, ...]  # S, of N nodes each, before anything is danced
    node_cost: tuple[NDArray[np.float64], ...]  # S arrays (N,)
    edge_cost: Sequence[NDArray[np.float32]]  # S - 1 arrays (P, N), of costs that do not depend on the path
    of_path: tuple[WeightedCost, ...]  # costs that depend on the path
    song_features: SongFeatures
    _one: dict[tuple[int, int], Layer] = field(default_factory=dict)  # layers of one node, by second and node
    _next: dict[bytes, NDArray[np.int64]] = field(default_factory=dict)  # the result of a pass, by its path

    @staticmethod
    def of(
        nodes: Sequence[tuple[Layer, NDArray[np.float64]]],
        costs: Sequence[WeightedCost],
        song_features: SongFeatures,
        edge_cost: Sequence[NDArray[np.float32]] | None = None,
    ) -> CheapNodes:
        """The nodes of every second, given with their costs (N,), and with those of edges if they are known.

        The search is compiled if all costs that depend on the path are built-in ones.
        """
        of_path = tuple(weighted for weighted in costs if weighted.weight and weighted.cost.of_path)
        fixed = [weighted for weighted in costs if not weighted.cost.of_path]
        layers = tuple(layer for layer, _ in nodes)
        node_cost = [cost for _, cost in nodes]
        # The costs of the first node that depend on the path are evaluated with the path.
        node_cost[0] = node_cost[0] - _first_cost(layers[0], of_path, song_features)
        if edge_cost is None:
            edge_cost = [edge_costs(here, there, fixed, song_features) for here, there in pairwise(layers)]
        compiled = is_compiled(of_path)
        kind = _CompiledNodes if compiled else CheapNodes
        if compiled:
            layers, of_path = _with_few_columns(layers, of_path)
        return kind(layers, tuple(node_cost), edge_cost, of_path, song_features)

    def improved(self, path: AnyInts) -> NDArray[np.int64]:
        """The cheapest path found, as the index (S,) of its node in each second: `path` or a cheaper one."""
        best, least = self._descent(np.asarray(path, np.int64))
        if not self.of_path:
            return best
        n_nodes = [cost.size for cost in self.node_cost]
        n_edges = [before * after for before, after in pairwise(n_nodes)]
        sizes = [n_nodes[0], *(size for of in zip(n_edges, n_nodes[1:], strict=True) for size in of)]
        noises = [_Noise.of(n_edges)]
        while len(noises) < _MOST_STARTS:
            noises.append(noises[-1].after_a_pass(sizes))
        n_done = in_vain = 0
        with ThreadPoolExecutor(self._n_threads) as pool:
            while n_done < _MOST_STARTS and in_vain < _IN_VAIN:
                # Starts that follow each other if none of them gains are searched at once.
                n_next = min(self._n_threads, _MOST_STARTS - n_done, _IN_VAIN - in_vain)
                tried = [
                    pool.submit(self._started_from, best, noise) for noise in noises[n_done : n_done + n_next]
                ]
                for found, cost in (one.result() for one in tried):
                    n_done += 1
                    in_vain = 0 if cost < least else in_vain + 1
                    if cost < least:
                        best, least = found, cost
                        break  # the others did not start from it
        return best

    def _started_from(self, path: NDArray[np.int64], noise: _Noise) -> tuple[NDArray[np.int64], float]:
        """The descent from a random change of a path."""
        return self._descent(self._pass(path, noise.after_a_pass(())))

    def cost(self, path: AnyInts) -> float:
        """The cost of a path (S,)."""
        last = self._node(0, path)
        total = float(self.node_cost[0][path[0]] + _first_cost(last, self.of_path, self.song_features)[0])
        last = with_history(last, last)
        for second in range(1, len(path)):
            node = self._node(second, path)
            total += float(self.node_cost[second][path[second]])
            total += float(self.edge_cost[second - 1][path[second - 1], path[second]])
            total += float(edge_costs(last, node, self.of_path, self.song_features)[0, 0])
            last = with_history(node, last)
        return total

    def _node(self, second: int, path: AnyInts) -> Layer:
        """The layer with the node of a path in a second. Most paths have most of their nodes in common."""
        key = second, int(path[second])
        if key not in self._one:
            self._one[key] = self.layers[second].subset(path[second : second + 1])
        return self._one[key]

    def _descent(self, path: NDArray[np.int64]) -> tuple[NDArray[np.int64], float]:
        """The best path, and its cost, after passes that start with `path` until one gains nothing."""
        cost = self.cost(path)
        while self.of_path:
            # Descents from several starts meet.
            if path.tobytes() not in self._next:
                self._next[path.tobytes()] = self._pass(path)
            found = self._next[path.tobytes()]
            found_cost = self.cost(found)
            if found_cost > cost - _LEAST_GAIN:
                break
            path, cost = found, found_cost
        return path, cost

    def _pass(self, path: NDArray[np.int64], noise: _Noise | None = None) -> NDArray[np.int64]:
        """The cheapest path by dynamic programming, which continues every beginning with the rest of `path`.

        With `noise`, costs are changed at random. Where a beginning has another node in second t than `path`,
        the difference in cost is that with the rest of `path` after t.
        """
        rest = _Rest.of(self.layers, path)
        seen = rest.added_to(self.layers[0], 0)
        reached = _changed(self.node_cost[0], noise) + _first_cost(seen, self.of_path, self.song_features)
        before = self._started(with_history(self.layers[0], self.layers[0]))
        parents = []
        for second in range(1, len(path)):
            edges = _changed(self.edge_cost[second - 1], noise)
            reached, parent, before = self._step(before, rest, second, reached, edges, path[second])
            reached = reached + _changed(self.node_cost[second], noise)
            parents.append(parent)
        found = [int(np.argmin(reached))]
        for parent in reversed(parents):
            found.append(int(parent[found[-1]]))
        return np.array(found[::-1])

    def _started(self, layer: Layer) -> Any:
        """What `_step` begins with."""
        return layer

    def _step(
        self,
        before: Any,
        rest: _Rest,
        second: int,
        reached: NDArray[np.float64],
        edges: NDArray[np.floating],
        node: int,
    ) -> tuple[NDArray[np.float64], NDArray[np.int64], Any]:
        """The costs (N,) of the cheapest beginnings of a pass that end in each node, without its own cost.

        `reached` (P,) are those of the second before, with the history `before`, and with the rest of the
        path, which continues with `node`. `edges` (P, N) do not depend on the path. Returns also the parents
        (N,) of the nodes, and their history.
        """
        layer = self.layers[second]
        seen = rest.added_to(before, second, new_goal=layer.new_goal)
        layer_in_goal = changed_layer(layer, new_goal=False)
        of_path = edge_costs(seen, layer_in_goal, self.of_path, self.song_features)
        total = edges + (reached - of_path[:, node])[:, None]
        total = total + of_path
        parent = np.argmin(total, axis=0)
        return total[parent, np.arange(layer.n_nodes)], parent, with_history(layer, before, parent)


def _first_cost(
    layer: Layer, of_path: Sequence[WeightedCost], song_features: SongFeatures
) -> NDArray[np.float64]:
    """The sum (N,) of the costs that depend on the path, for the nodes of the first layer."""
    total = np.zeros(layer.n_nodes)
    for _, cost in weighted_terms(of_path, lambda c: c.node(layer, song_features), total.shape):
        total += cost
    return total


@dataclass(frozen=True, eq=False)
class _Noise:
    """Random changes of costs, read from one array at random places. To draw each takes as long as a step."""

    factors: NDArray[np.float32]
    rng: np.random.Generator

    @staticmethod
    def of(sizes: Sequence[int]) -> _Noise:
        """Draw changes, enough for costs of these sizes."""
        rng = np.random.default_rng(0)
        n_factors = max(_N_FACTORS, 2 * max(sizes, default=0))
        return _Noise(1.0 + np.float32(_NOISE) * rng.standard_normal(n_factors, np.float32), rng)

    def after_a_pass(self, sizes: Sequence[int]) -> _Noise:
        """The noise of the pass after one that draws changes of costs of these sizes, in order."""
        rng = deepcopy(self.rng)
        for size in sizes:
            rng.integers(len(self.factors) - size)
        return _Noise(self.factors, rng)


def _changed(cost: NDArray[np.floating], noise: _Noise | None) -> NDArray[np.floating]:
    """Costs with a random change in proportion to each, or as they are without noise."""
    if noise is None:
        return cost
    first = int(noise.rng.integers(len(noise.factors) - cost.size))
    return cost * noise.factors[first : first + cost.size].reshape(cost.shape)


@dataclass(frozen=True, eq=False)
class _Rest:
    """What a path dances after each second: its motifs and takes, and where the music returns."""

    motif_counts: NDArray[np.int16]  # (S, M) in the rest of the second's goal
    take_usage_s: NDArray[np.float32]  # (S, takes) less, the later a take is used
    danced: NDArray[np.float64]  # (R,) positions in the seconds that return to each moment

    @classmethod
    def of(cls, layers: Sequence[Layer], path: AnyInts) -> _Rest:
        """Count them along a path (S,) through the nodes of layers."""
        counts = np.zeros((len(path), layers[0].path.motif_counts.shape[1]), np.int16)
        usage_s = np.zeros((len(path), layers[0].path.take_usage_s.shape[1]), np.float32)
        kept = np.float32(np.exp(-1.0 / USAGE_DECAY_S))
        for second in range(len(path) - 2, -1, -1):
            layer, node = layers[second + 1], path[second + 1]
            if counts.shape[1] and not layer.new_goal:
                counts[second] = counts[second + 1]
                for motif in layer.motifs[node].tolist():
                    if motif >= 0:
                        counts[second, motif] += 1
            if usage_s.shape[1]:
                usage_s[second] = usage_s[second + 1] * kept
                usage_s[second, layer.usage_column[node]] += 1.0
        danced = np.full(layers[0].path.danced.shape[1], np.nan)
        for layer, node in zip(layers, path, strict=True):
            if layer.returns is not None:
                first, last = layer.take_frames[node]
                danced[layer.returns] = position(layer.take[node], first, last, MIDDLE)
        return cls(counts, usage_s, danced)

    def added_to(self, layer: Layer, second: int, *, new_goal: bool = False) -> Layer:
        """The layer before `second`, as if the rest of the path after that second had been danced as well."""
        counts = np.zeros_like(layer.path.motif_counts) if new_goal else layer.path.motif_counts
        return changed_layer(
            layer,
            motif_counts=counts + self.motif_counts[second],
            take_usage_s=layer.path.take_usage_s + self.take_usage_s[second],
            danced=np.where(np.isnan(layer.path.danced), self.danced, layer.path.danced),
        )


# The same search, compiled for the built-in costs that depend on the path.


def is_compiled(of_path: Sequence[WeightedCost]) -> bool:
    """Whether the search with these costs that depend on the path is compiled."""
    kinds = [type(weighted.cost) for weighted in of_path]
    return len(set(kinds)) == len(kinds) and set(kinds) <= set(COMPILED_OF_PATH)


def _with_few_columns(
    layers: tuple[Layer, ...], of_path: tuple[WeightedCost, ...]
) -> tuple[tuple[Layer, ...], tuple[WeightedCost, ...]]:
    """The layers and built-in costs with columns for the motifs and takes of these layers alone.

    The others are never counted, but every step would copy their columns.
    """
    motifs = np.unique(np.concatenate([layer.motifs.ravel() for layer in layers]))
    motifs = motifs[motifs >= 0]
    number = np.full(layers[0].path.motif_counts.shape[1] + 1, -1, np.int16)  # the last one for no motif
    number[motifs] = np.arange(len(motifs))
    takes = np.unique(np.concatenate([layer.usage_column for layer in layers]))
    takes = takes[: layers[0].path.take_usage_s.shape[1]]  # none if usage is not counted
    few = tuple(
        changed_layer(
            layer, motifs=number[layer.motifs],
            motif_counts=_columns(layer.path.motif_counts, motifs),
            usage_column=np.searchsorted(takes, layer.usage_column),
            take_usage_s=_columns(layer.path.take_usage_s, takes),
        )
        for layer in layers
    )  # fmt: skip
    costs = [w.cost.among(motifs) if isinstance(w.cost, Signature) else w.cost for w in of_path]
    return few, tuple(replace(w, cost=cost) for w, cost in zip(of_path, costs, strict=True))


def _columns(values: NDArray[Any], columns: AnyInts) -> NDArray[Any]:
    """Columns of an array (N, C), contiguous as kernels are compiled for, or of the one row of all nodes."""
    if len(values) and values.strides[0] == 0:
        return repeated(values[0, columns], len(values))
    return np.ascontiguousarray(values[:, columns])


# Of each of P nodes: turn_rad (P,), take_usage_s (P, takes), danced (P, R), motif_counts (P, M).
_History = tuple[Any, ...]


class _CompiledNodes(CheapNodes):
    """`CheapNodes` whose steps are compiled. Paths and costs are those of `CheapNodes`, to the bit."""

    _n_threads: ClassVar[int] = min(2, os.cpu_count() or 1)  # for kernels release the interpreter

    @cached_property
    def _of_one(self) -> dict[tuple[int, int], tuple[Any, ...]]:
        return {}

    @cached_property
    def _weights(self) -> NDArray[np.float32]:
        of = {type(weighted.cost): weighted.weight for weighted in self.of_path}
        return np.array([of.get(kind, 0.0) for kind in COMPILED_OF_PATH], np.float32)

    @cached_property
    def _arrays(self) -> list[tuple[Any, ...]]:
        """What `kernels.extended` reads of the nodes of every second."""
        of = {type(weighted.cost): weighted.cost for weighted in self.of_path}
        form, signature = cast(FormCost | None, of.get(FormCost)), cast(Signature | None, of.get(Signature))
        return [arrays_of(layer, form, signature, self.song_features) for layer in self.layers]

    def cost(self, path: AnyInts) -> float:
        """As `CheapNodes.cost`."""
        first = self._node(0, path)
        reached = self.node_cost[0][path[:1]] + _first_cost(first, self.of_path, self.song_features)
        before: _History = self._started(with_history(first, first))
        none = _Rest.of([first], np.zeros(1, np.int64))
        for second in range(1, len(path)):
            edge = self.edge_cost[second - 1][path[second - 1], path[second]]
            arguments: tuple[Any, ...] = (
                self._weights, np.full((1, 1), edge), reached + self.node_cost[second][path[second]],
                NO_NODE, *before, *self._one_node(second - 1, path)[:2], none.take_usage_s[0], none.danced,
                none.motif_counts[0], *self._one_node(second, path)[2:],
            )  # fmt: skip
            reached, _, *after = extended(*arguments)
            before = tuple(after)
        return float(reached[0])

    def _one_node(self, second: int, path: AnyInts) -> tuple[Any, ...]:
        """The arrays of the node of a path in a second."""
        key = second, int(path[second])
        if key not in self._of_one:
            arrays, node = self._arrays[second], slice(key[1], key[1] + 1)
            self._of_one[key] = (*(array[node] for array in arrays[:OF_NODES]), *arrays[OF_NODES:])
        return self._of_one[key]

    def _started(self, layer: Layer) -> _History:
        return (
            np.ascontiguousarray(layer.path.turn_rad), np.ascontiguousarray(layer.path.take_usage_s),
            np.ascontiguousarray(layer.path.danced), np.ascontiguousarray(layer.path.motif_counts),
        )  # fmt: skip

    def _step(
        self,
        before: _History,
        rest: _Rest,
        second: int,
        reached: NDArray[np.float64],
        edges: NDArray[np.floating],
        node: int,
    ) -> tuple[NDArray[np.float64], NDArray[np.int64], _History]:
        arguments: tuple[Any, ...] = (
            self._weights, edges, reached, node, *before, *self._arrays[second - 1][:2],
            rest.take_usage_s[second], rest.danced, rest.motif_counts[second], *self._arrays[second][2:],
        )  # fmt: skip
        best, parent, *history = extended(*arguments)
        return best, parent, tuple(history)


N_CHEAP = 128  # nodes of each second that are searched
_OF_EDGES = ("first_pose_m", "last_pose_m", "first_velocity_m_s", "last_velocity_m_s")  # of fixed costs
_OF_NODES = (  # for costs of nodes
    "style", "take_names", "genre", "heading_rad", "source", "source_frames", "clip", "density_mismatch",
    "unmatched_beat", "first_beat", "last_beat", "count_uncertainty", "off_bar", "enter_penalty",
    "leave_penalty", "liveliness", "steps",
)  # fmt: skip

_Nodes = tuple[Layer, NDArray[np.float64]]  # nodes of a second, and the costs (N,) of each


class CheapSoFar:
    """The cheapest nodes of the seconds that a search has reached, and the costs of edges between them.

    The nodes of a long dance are kept without their poses, from which only the costs of edges follow.
    """

    def __init__(
        self, source: LayerSource, costs: Sequence[WeightedCost], song_features: SongFeatures
    ) -> None:
        self._source, self._costs, self._song_features = source, costs, song_features
        self._fixed = [weighted for weighted in costs if not weighted.cost.of_path]
        of_path = [weighted for weighted in costs if weighted.weight and weighted.cost.of_path]
        self._has_poses = not is_long(source.n_seconds) or not is_compiled(of_path)
        self._nodes: list[_Nodes] = []
        # Those of a long dance are on disk: 0.24 GB for an hour.
        self._edge_cost = StoredArrays(in_memory=not is_long(source.n_seconds))
        self._coming: Future[F32] | None = None  # which are being evaluated
        self._last: tuple[Layer, NDArray[np.int64]] | None = None  # with its poses, and its nodes' indices

    def add(
        self,
        layer: Layer,
        node_cost: NDArray[np.float64],
        reached: NDArray[np.float64],
        fixed: Callable[[NDArray[np.int64], NDArray[np.int64]], Future[F32] | None] = lambda *_: None,
    ) -> None:
        """Keep the cheapest nodes of the next second: see `cheapest`.

        `fixed` begins to evaluate the costs (P, N) of edges that do not depend on the path, from nodes (P,)
        of the second before to nodes (N,) of this one, if it can.
        """
        found = cheapest(reached)
        nodes = layer.subset(found)
        if self._last is not None:
            last, rows = self._last
            coming = fixed(rows, found)
            self._keep_edges()
            self._coming = coming
            if coming is None:
                self._edge_cost.append(edge_costs(last, nodes, self._fixed, self._song_features))
        self._last = nodes, found
        kept = nodes if self._has_poses else _without_poses(nodes, self._song_features)
        self._nodes.append((kept, node_cost[found]))

    def _keep_edges(self) -> None:
        """Keep the costs that are being evaluated, if there are any."""
        if self._coming is not None:
            self._edge_cost.append(self._coming.result())
            self._coming = None

    def improved(self, keys: Sequence[int], likely: Callable[[list[Layer]], None] | None) -> list[Layer]:
        """The nodes of the path with these `keys`, or of a cheaper one through the nodes of every second.

        `likely` first gets the nodes of the path with these keys.
        """
        self._keep_edges()
        path = np.array([self._include(second, key) for second, key in enumerate(keys)])
        if likely is not None:
            likely(self._path(path))
        cheap = CheapNodes.of(self._nodes, self._costs, self._song_features, self._edge_cost)
        found = cheap.improved(path)
        del cheap
        self._edge_cost.clear()  # which are large, before the nodes of the path are made
        return self._path(found)

    def _path(self, found: NDArray[np.int64]) -> list[Layer]:
        """The nodes of a path by their indices (S,)."""
        if self._has_poses:
            rows = zip(self._nodes, found.tolist(), strict=True)
            return [layer.subset(slice(node, node + 1)) for (layer, _), node in rows]
        return [
            self._source.node(int(layer.warp.segment[node] * SEGMENT_S + layer.warp.offset[node]))
            for (layer, _), node in zip(self._nodes, found.tolist(), strict=True)
        ]

    def _include(self, second: int, key: int) -> int:
        """The index of the node `key` among those of a second, to which it is added if it is missing."""
        segment, offset = divmod(key, SEGMENT_S)
        nodes = self._nodes[second]
        self._nodes[second], index = including(nodes, segment, offset, partial(self._allowed_node, key))
        if self._nodes[second] is not nodes:
            for before in range(max(0, second - 1), min(second + 1, len(self._edge_cost))):
                here, there = (self._with_poses(self._nodes[at][0]) for at in (before, before + 1))
                self._edge_cost[before] = edge_costs(here, there, self._fixed, self._song_features)
        return index

    def _allowed_node(self, key: int) -> _Nodes:
        node, cost = allowed_nodes(self._source.node(key), self._costs, self._song_features)
        return node if self._has_poses else _without_poses(node, self._song_features), cost

    def _with_poses(self, layer: Layer) -> Layer:
        return layer if self._has_poses else self._source.nodes(layer.warp.segment, layer.warp.offset)


def _without_poses(layer: Layer, song_features: SongFeatures) -> Layer:
    """The layer with what the costs that depend on the path need alone."""
    is_needed = layer.second == 0 or last_pose(layer, song_features) is not None
    names = _OF_EDGES if is_needed else (*_OF_EDGES, *_OF_NODES)
    arrays = arrays_by_name(layer)
    return changed_layer(layer, **{name: _nothing(arrays[name]) for name in names})


def _nothing(values: NDArray[Any]) -> NDArray[Any]:
    """An array of nothing (N, 0), or of one value for each node, in place of others."""
    if values.ndim > 1:
        return np.zeros((len(values), 0), values.dtype)
    return repeated(np.zeros((), values.dtype), len(values))


def cheapest(reached: NDArray[np.float64]) -> NDArray[np.int64]:
    """The indices, in order, of the `N_CHEAP` nodes that are reached (N,) at the least cost."""
    nodes = np.sort(np.argsort(reached, kind="stable")[:N_CHEAP])
    return nodes[np.isfinite(reached[nodes])]


def including(
    nodes: tuple[Layer, NDArray[np.float64]],
    segment: int,
    offset: int,
    make: Callable[[], tuple[Layer, NDArray[np.float64]]],
) -> tuple[tuple[Layer, NDArray[np.float64]], int]:
    """The nodes of a second with another one, which is made unless they contain it, and its index."""
    layer, cost = nodes
    found = np.flatnonzero((layer.warp.segment == segment) & (layer.warp.offset == offset))
    if len(found) == 0:
        one, its_cost = make()
        return (_joined([layer, one]), np.append(cost, its_cost)), len(cost)
    return nodes, int(found[0])


def _joined(parts: Sequence[Layer]) -> Layer:
    """The nodes of several layers of one second, in order."""
    n_nodes = sum(part.n_nodes for part in parts)
    arrays = [arrays_by_name(part) for part in parts]

    def joined(name: str) -> NDArray[Any]:
        values = [of_part[name] for of_part in arrays]
        rows = [of_part[:1] for of_part in values if of_part.strides[0] == 0 or len(of_part) == 1]
        if len(rows) < len(parts) or any(row.tobytes() != rows[0].tobytes() for row in rows):
            return np.concatenate(values)
        return repeated(rows[0][0], n_nodes)  # one row of all nodes, as `subset` leaves it

    return changed_layer(parts[0], **{name: joined(name) for name in arrays[0]})
