"""The cheapest nodes of every second, which a search keeps for `local_search`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.graph.cost import WeightedCost, allowed_nodes, edge_costs
from choreograph.choreography.graph.costs import F32
from choreograph.choreography.graph.layers import ARRAYS, Layer, changed_layer, repeated
from choreograph.choreography.graph.local_search import CheapNodes, is_compiled
from choreograph.choreography.graph.path_costs import last_pose
from choreograph.choreography.graph.segments import LayerSource
from choreograph.core.scratch import StoredArrays
from choreograph.core.timebase import SEGMENT_S
from choreograph.music.song_features import SongFeatures

N_CHEAP = 128  # nodes of each second that are searched
_MOST_WHOLE_S = 600  # of a dance whose nodes are kept with their poses: 85 MB
_OF_EDGES = ("first_pose_m", "last_pose_m", "first_velocity_m_s", "last_velocity_m_s")  # of fixed costs
_OF_NODES = (  # for costs of nodes
    "style", "take_names", "genre", "heading_rad", "source_frames", "clip", "density_mismatch",
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
        self._has_poses = source.n_seconds <= _MOST_WHOLE_S or not is_compiled(of_path)
        self._nodes: list[_Nodes] = []
        # Those of a long dance are on disk: 0.24 GB for an hour.
        self._edge_cost = StoredArrays(in_memory=source.n_seconds <= _MOST_WHOLE_S)
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
            self._source.node(int(layer.segment[node] * SEGMENT_S + layer.offset[node]))
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
        return layer if self._has_poses else self._source.nodes(layer.segment, layer.offset)


def _without_poses(layer: Layer, song_features: SongFeatures) -> Layer:
    """The layer with what the costs that depend on the path need alone."""
    is_needed = layer.second == 0 or last_pose(layer, song_features) is not None
    names = _OF_EDGES if is_needed else (*_OF_EDGES, *_OF_NODES)
    return changed_layer(layer, **{name: _nothing(getattr(layer, name)) for name in names})


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
    found = np.flatnonzero((layer.segment == segment) & (layer.offset == offset))
    if len(found) == 0:
        one, its_cost = make()
        return (_joined([layer, one]), np.append(cost, its_cost)), len(cost)
    return nodes, int(found[0])


def _joined(parts: Sequence[Layer]) -> Layer:
    """The nodes of several layers of one second, in order."""
    n_nodes = sum(part.n_nodes for part in parts)

    def joined(name: str) -> NDArray[Any]:
        values = [getattr(part, name) for part in parts]
        rows = [of_part[:1] for of_part in values if of_part.strides[0] == 0 or len(of_part) == 1]
        if len(rows) < len(parts) or any(row.tobytes() != rows[0].tobytes() for row in rows):
            return np.concatenate(values)
        return repeated(rows[0][0], n_nodes)  # one row of all nodes, as `subset` leaves it

    return changed_layer(parts[0], **{name: joined(name) for name in ARRAYS})
