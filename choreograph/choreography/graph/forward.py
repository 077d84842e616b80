"""One step of the exact planner: the cheapest way into every node of a second."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.graph.cost import (
    Cost,
    WeightedCost,
    distance_from_product,
    edge_costs,
    flat_poses,
    rms_speed_m_s,
    turned_cost,
)
from choreograph.choreography.graph.costs import (
    BUILTIN_COSTS,
    OVERLAP_FRAMES,
    STILL_M_S,
    TURNED_TAKE,
    Completeness,
    Front,
    Phrasing,
    Repeat,
    Transition,
    Variety,
    Velocity,
)
from choreograph.choreography.graph.layers import Layer
from choreograph.choreography.graph.motif_costs import (
    MOTIF_COSTS,
    MotifTransition,
    Signature,
    first_motif,
    last_motif,
)
from choreograph.choreography.graph.path_kernels import PER_USAGE, arrays_of, bounds_of, form_of, words_of
from choreograph.choreography.graph.returns import FormCost, Stage
from choreograph.core.kernel_cache import njit
from choreograph.core.numerics import AnyInts, Floats, frame_blocks
from choreograph.core.timebase import CLIP_FRAMES
from choreograph.motion.body import BODY_JOINTS
from choreograph.music.song_features import SongFeatures

N_THREADS = min(4, os.cpu_count() or 1)
_BLOCK = 128  # predecessors whose edges are evaluated at once
_MIN_EDGES_FOR_THREADS = 100_000  # a millisecond's work
_PRUNE_BELOW = 0.8  # copying a part of a layer takes about a fifth of the time of its edges
_PAIR_BLOCK = 64  # successor pairs are evaluated as the diagonal of a block of edges of this size
_ROUNDING = 1e-4

F32 = NDArray[np.float32]


class Steps:
    """The steps of a search by these costs: from the nodes of one second to those of the next."""

    def __init__(
        self, costs: Sequence[WeightedCost], song_features: SongFeatures, pool: ThreadPoolExecutor
    ) -> None:
        self._costs, self._song_features, self._pool = costs, song_features, pool
        self._with_edges = [w for w in costs if w.weight != 0 and type(w.cost).edge is not Cost.edge]
        kinds = [type(w.cost) for w in self._with_edges]
        # User-defined costs may keep state between calls, so only the built-in ones are evaluated in threads.
        self._thread_safe = set(kinds) <= {*BUILTIN_COSTS, *MOTIF_COSTS, FormCost, Stage}
        self._compiled = set(kinds) <= set(_ORDER) and kinds == [kind for kind in _ORDER if kind in kinds]
        self._of = {type(w.cost): w for w in self._with_edges}
        self._nodes: _Nodes | None = None  # the latest

    def __call__(self, layer: Layer, following: Layer, reached: Floats) -> tuple[Floats, NDArray[np.int64]]:
        """Cost of the cheapest path into every node of `following`, and its last node in `layer`.

        The method is branch and bound. First the edges inside segments are evaluated, one into each node, and
        then all predecessors, cheapest first, in growing blocks. A predecessor whose cost plus the lower
        bound of a jump exceeds the best path found into a node cannot improve it. Such rows and columns of
        the edges are not evaluated. The result is that of all edges.
        """
        edges = self._edges(layer, following)
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

    def from_one(self, last: Layer, following: Layer) -> F32:
        """The costs (N,) of the edges from a layer of one node to the nodes of `following`."""
        every = np.arange(following.n_nodes)
        edges = self._edges(last, following)
        nothing, most = np.zeros(1, np.float32), np.full(len(every), np.inf)
        return edges.cheapest(np.zeros(1, np.int64), every, nothing, most)[1]

    def _edges(self, layer: Layer, following: Layer) -> _Edges:
        if not self._compiled:
            return _Edges(layer, following, self._costs, self._song_features)
        before, after = self._nodes_of(layer), self._nodes_of(following)
        self._nodes = after
        return _CompiledEdges(layer, following, self._costs, self._song_features, before, after)

    def _nodes_of(self, layer: Layer) -> _Nodes:
        if self._nodes is not None and self._nodes.is_of(layer):
            return self._nodes
        return _Nodes(layer, self._of, self._song_features)


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


@njit(
    "void(float32[::1], float32[:,::1], float32[::1], int32[::1])",
    nogil=True,
)
def cheapest_predecessors(
    reached: NDArray[np.float32],
    edges: NDArray[np.float32],
    least: NDArray[np.float32],
    rows: NDArray[np.int32],
) -> None:  # pragma: no cover - compiled
    """Write the least reached[i] + edges[i, j] of each column j to `least` (N,), and i to `rows` (N,)."""
    n_a, n_b = edges.shape
    for i in range(n_a):
        for j in range(n_b):
            cost = reached[i] + edges[i, j]
            if cost < least[j]:
                least[j] = cost
                rows[j] = i


# The same edges, compiled for the built-in costs.

_ORDER: tuple[type[Cost], ...] = (
    Completeness, Transition, Velocity, Phrasing, Front, Variety, Repeat, FormCost, Signature,
    MotifTransition,
)  # in the order of their sum  # fmt: skip
_OF_SIGNATURE = _ORDER.index(Signature)
_STILL = np.float32(STILL_M_S)


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
        self.weights = np.array([of[kind].weight if kind in of else 0.0 for kind in _ORDER], np.float32)
        self.first, first_sq = flat_poses(layer.first_pose_m)
        self.last, last_sq = flat_poses(layer.last_pose_m)
        self.first_velocity, first_velocity_sq = flat_poses(layer.first_velocity_m_s)
        self.last_velocity, last_velocity_sq = flat_poses(layer.last_velocity_m_s)
        starts, ends = np.ascontiguousarray(layer.take_frames.T, np.float64)
        self.at_start = (
            first_sq, first_velocity_sq, rms_speed_m_s(layer.first_velocity_m_s), starts,
            layer.enter_penalty.astype(np.float32), first_motif(layer).astype(np.int64),
        )  # fmt: skip
        self.at_end = (
            last_sq, last_velocity_sq, rms_speed_m_s(layer.last_velocity_m_s), ends,
            layer.leave_penalty.astype(np.float32), last_motif(layer).astype(np.int64),
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
        self._before, self._after = before, after
        counts = np.ascontiguousarray(layer.motif_counts)
        seen = np.zeros_like(counts) if following.new_goal else counts
        weights = after.weights
        repeats, self._least = bounds_of(weights, weights[_OF_SIGNATURE], seen, after.motifs, after.step_cost)
        angles = _angles(np.ascontiguousarray(layer.turn_rad), before.end_rad, after.start_rad)
        danced = np.ascontiguousarray(layer.danced[:, after.number])
        self._stay = np.ones(following.n_nodes, np.float32)
        here, there = self.successors
        self._stay[there] = Completeness().staying(layer, following, here, there)
        usage_s = np.ascontiguousarray(layer.take_usage_s)
        self._arguments = (
            weights, (*angles[:4], before.next_part, usage_s, danced, seen, *before.at_end, before.take),
            (
                *angles[4:], after.part, after.take, after.series, after.places, after.motifs, repeats,
                self._least, self._stay, *after.at_start,
            ),
            (after.is_return, after.form_weight, after.step_cost, after.transition_cost, after.constants),
        )  # fmt: skip

    def of_pairs(self, here: AnyInts, there: AnyInts) -> F32:
        poses = np.einsum("md,md->m", self._before.last[here], self._after.first[there])
        velocities = np.einsum(
            "md,md->m", self._before.last_velocity[here], self._after.first_velocity[there]
        )
        nothing, most = np.zeros(len(here), np.float32), np.full(len(here), np.inf, np.float32)
        _, edges = _cheapest_edges(
            here, there, True, nothing, most, poses[:, None], velocities[:, None], *self._arguments
        )
        return edges

    def bound(self, costs: Sequence[WeightedCost]) -> Floats:
        bound: Floats = super().bound([w for w in costs if type(w.cost) is not Signature]) + self._least
        return bound

    def cheapest(
        self, block: AnyInts, part: AnyInts, beyond: F32, most: Floats
    ) -> tuple[NDArray[np.int32], F32]:
        every = len(part) == self._following.n_nodes
        there = slice(None) if every else part
        poses = self._before.last[block] @ self._after.first[there].T
        velocities = self._before.last_velocity[block] @ self._after.first_velocity[there].T
        rows, edges = _cheapest_edges(
            block, part, False, beyond, (most + _ROUNDING).astype(np.float32), poses, velocities,
            *self._arguments,
        )  # fmt: skip
        return rows, edges


@njit(
    "Tuple((float64[::1], float64[::1], float64[::1], float64[::1], float32[::1], float32[::1]))("
    "float64[::1], float32[::1], float32[::1])"
)
def _angles(turn_rad: Any, end_rad: Any, start_rad: Any) -> tuple[Any, ...]:  # pragma: no cover - compiled
    """Cosines and sines as in `turned_costs`."""
    n_a, n_b = len(turn_rad), len(start_rad)
    turn_cos, turn_sin, end_cos, end_sin = np.empty(n_a), np.empty(n_a), np.empty(n_a), np.empty(n_a)
    start_cos, start_sin = np.empty(n_b, np.float32), np.empty(n_b, np.float32)
    for i in range(n_a):
        end = turn_rad[i] + end_rad[i]
        turn_cos[i], turn_sin[i] = np.cos(turn_rad[i]), np.sin(turn_rad[i])
        end_cos[i], end_sin[i] = np.cos(end), np.sin(end)
    for j in range(n_b):
        start_cos[j], start_sin[j] = np.cos(start_rad[j]), np.sin(start_rad[j])
    return turn_cos, turn_sin, end_cos, end_sin, start_cos, start_sin


_AT_BORDER = "float32[::1], float32[::1], float32[::1], float64[::1], float32[::1], int64[::1]"


@njit(
    "Tuple((int32[::1], float32[::1]))(int64[::1], int64[::1], bool_, float32[::1], float32[::1], "
    "float32[:,::1], float32[:,::1], float32[::1], Tuple((float64[::1], float64[::1], float64[::1], "
    f"float64[::1], int64[::1], float32[:,::1], float64[:,::1], int16[:,::1], {_AT_BORDER}, int64[::1])), "
    "Tuple((float32[::1], float32[::1], int64[::1], int64[::1], float64[:,::1], float64[:,::1], "
    f"int16[:,::1], int64[:,::1], float64[::1], float32[::1], {_AT_BORDER})), "
    "Tuple((bool_[::1], float32[::1], float32[:,::1], float32[:,::1], float64[::1])))",
    nogil=True,
)
def _cheapest_edges(
    block: AnyInts, part: AnyInts, paired: bool, beyond: F32, most: F32, poses: F32, velocities: F32,
    weights: F32, before: Any, nodes: Any, of_costs: Any,
) -> tuple[NDArray[np.int32], F32]:  # fmt: skip  # pragma: no cover - compiled
    """As `_Edges.cheapest`, or, if `paired`, the edges from each node of `block` to that of `part` beside it.

    `poses` and `velocities` (B, C), or (B, 1), are products of those of both nodes. The terms are added as by
    `edge_costs`. If the sum of the first ones and a lower bound of the others is too large, the others are
    not evaluated.
    """
    (
        cos_turn, sin_turn, cos_end, sin_end, next_part, usage_s, danced, seen, last_sq, last_velocity_sq,
        last_speed, end, leave, last_words, last_take,
    ) = before  # fmt: skip
    (
        cos_start, sin_start, starts_part, take, series, places, motifs, repeats, bound, stay, first_sq,
        first_velocity_sq, first_speed, start, enter, first_words,
    ) = nodes  # fmt: skip
    is_return, form_weight, step_cost, transition_cost, constants = of_costs
    scale, half, steer = np.float32(1.0 / len(BODY_JOINTS)), np.float32(0.5), (constants[2], constants[3])
    has_usage = weights[5] != 0.0 and usage_s.shape[1] > 0
    rows, edges = np.zeros(len(part), np.int32), np.full(len(part), np.inf, np.float32)
    for r in range(len(block)):
        i = block[r]
        turn, end_turn = (cos_turn[i], sin_turn[i]), (cos_end[i], sin_end[i])
        for c in range(r if paired else 0, r + 1 if paired else len(part)):
            j, k = part[c], 0 if paired else c
            continues = next_part[i] == starts_part[j]
            total = weights[0] * (stay[j] if continues else np.float32(1.0))
            if weights[1] != 0.0:
                total += weights[1] * distance_from_product(poses[r, k], last_sq[i], first_sq[j], scale)
            if weights[2] != 0.0:
                change = distance_from_product(
                    velocities[r, k], last_velocity_sq[i], first_velocity_sq[j], scale
                )
                total += weights[2] * (change / (half * (last_speed[i] + first_speed[j]) + _STILL))
            if weights[3] != 0.0 and not continues:
                total += weights[3] * (half * (leave[i] + enter[j]))
            if np.float64(beyond[r] + total) + bound[j] > most[c]:
                continue
            if weights[4] != 0.0:
                front = turned_cost(
                    continues, turn, end_turn, (cos_start[j], sin_start[j]), steer,
                    (series[j, 0], series[j, 1], series[j, 2], series[j, 3]), constants[0], TURNED_TAKE,
                )  # fmt: skip
                total += weights[4] * np.float32(front)
            if has_usage:
                total += weights[5] * (usage_s[i, take[j]] * PER_USAGE)
            if last_take[i] == take[j] and OVERLAP_FRAMES < end[i] - start[j] < CLIP_FRAMES:
                total += weights[6]
            if weights[7] != 0.0:
                total += weights[7] * form_of(i, j, danced, places, is_return, form_weight)
            if weights[8] != 0.0:
                total += weights[8] * words_of(i, j, seen, motifs, repeats, step_cost)
            if weights[9] != 0.0:
                total += weights[9] * transition_cost[last_words[i], first_words[j]]
            if beyond[r] + total < most[c]:
                most[c] = beyond[r] + total
                rows[c], edges[c] = r, total
    return rows, edges
