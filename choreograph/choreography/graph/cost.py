"""The base class of costs, weighted sums of costs, whose values are checked, and functions for edges."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.graph.layers import Layer
from choreograph.core.arguments import as_array
from choreograph.core.errors import NoPathError, ParameterError
from choreograph.core.kernel_cache import njit
from choreograph.core.numerics import AnyFloats, AnyInts
from choreograph.music.song_features import SongFeatures


class Cost:
    """A cost of nodes, of edges, or of both.

    A node is one second of a warped take. In the mixer and the rollout, it is a motion word in one beat. An
    edge leads from a node of one second, or beat, to a node of the next. The rollout has no edges.
    Subclass `Cost` and override `node`, `edge` or both. Values may have any unit, since the weight of the
    cost scales them. `inf` forbids a node or an edge, and `nan` is an error. `choreograph settings
    weights` prints the first line of the docstring, and what follows "Raise its weight".

    Attributes
    ----------
    name : name in plans, weights and errors. The default is the class name in lower case
    min_jump_cost : lower bound of every edge between two warped segments. With it, the exact planner skips
        edges that cannot be on the cheapest path. Set it to 0 if no edge is negative.
    of_path : whether its values depend on the path to a node, by `Layer.motif_counts`, `Layer.take_usage_s`,
        `Layer.danced`, `Layer.turn_rad` or `Layer.place_m`
    min_path_cost : lower bound of the sum of its values over a whole path, of a cost with `of_path`

    References
    ----------
    ChoreoGraph, section 3.3.

    Examples
    --------
    A cost that prefers slow motion. Its values are mean joint speeds in m/s.

    >>> class Calm(cg.Cost):
    ...     def node(self, layer, song_features):
    ...         return np.linalg.norm(layer.first_velocity_m_s, axis=-1).mean(axis=1)  # (N,)
    >>> song = cg.example_songs()["house"]
    >>> dance = cg.dance(song, duration_s=4, costs=[Calm()], weights={"calm": 2.0})
    >>> dance.plan.seconds[0].costs["calm"] >= 0.0
    True
    """

    name: str = ""
    min_jump_cost: float = -math.inf
    of_path: bool = False
    min_path_cost: float = -math.inf

    def __init_subclass__(cls, **kwargs: object) -> None:
        super().__init_subclass__(**kwargs)
        if "name" not in cls.__dict__:
            cls.name = cls.__name__.lower()

    def node(self, layer: Layer, song_features: SongFeatures) -> AnyFloats | None:
        """The cost of dancing each node of a layer.

        Parameters
        ----------
        layer : the N nodes of one second, `layer.second`
        song_features : the song, with one row for each second S of `style` (S, 32), `energy` (S,), ...

        Returns
        -------
        float array (N,)   `inf` forbids a node
        or None            if the cost is 0 for all of them
        """
        return None

    def edge(self, previous: Layer, next: Layer, song_features: SongFeatures) -> AnyFloats | None:
        """The cost of going from each node of one second to each node of the next.

        Parameters
        ----------
        previous : P nodes of one second, or a part of them
        next : N nodes of the second after it, or a part of them
        song_features : the song, as in `node`

        Returns
        -------
        float array (P, N)   `inf` forbids an edge
        or None              if the cost is 0 for all of them
        """
        return None

    def min_edge_costs(self, previous: Layer, next: Layer, song_features: SongFeatures) -> AnyFloats | float:
        """Lower bounds of the edges between segments.

        The default is `min_jump_cost`. Override it if a tighter bound of each node of `next` is known.

        Returns
        -------
        float array (N,)   a bound for each node of `next`
        or float           one bound for all of them
        """
        return self.min_jump_cost


@dataclass(frozen=True)
class WeightedCost:
    """A cost and its weight. A cost with weight 0 is not evaluated."""

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
    costs: Sequence[WeightedCost], evaluate: Callable[[Cost], AnyFloats | None], shape: tuple[int, ...]
) -> Iterator[tuple[str, AnyFloats]]:
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


def _checked(value: Any, shape: tuple[int, ...], cost: Cost) -> NDArray[Any]:
    """The values of a cost as an array. Raises `ParameterError` for other values or another shape."""
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


# Array functions for the costs of edges, some of them compiled.
#
# Each call runs on one thread. The planner starts its own threads, which evaluate parts of a block of edges.


F32 = NDArray[np.float32]

# A squared distance is the difference of sums. Below this share of them, it is their rounding error, which
# depends on the number of rows that are multiplied at once.
_ROUNDING = np.float32(2e-6)


@njit(
    "float32[:,::1](float32[:,::1], float32[::1], float32[::1], float32)",
    nogil=True,
)
def distances_from_product(
    product: F32, sq_a: F32, sq_b: F32, scale: np.float32
) -> F32:  # pragma: no cover - compiled
    """√(scale · (|a|² + |b|² - 2 a·b)), replacing the products a·b, (P, N) float32. 0 within rounding."""
    n_a, n_b = product.shape
    for i in range(n_a):
        for j in range(n_b):
            product[i, j] = distance_from_product(product[i, j], sq_a[i], sq_b[j], scale)
    return product


@njit(inline="always")
def distance_from_product(
    product: Any, sq_a: Any, sq_b: Any, scale: Any
) -> Any:  # pragma: no cover - compiled
    """One of the `distances_from_product`."""
    both = sq_a + sq_b
    d = both - np.float32(2.0) * product
    return np.sqrt(d * scale) if d > _ROUNDING * both else np.float32(0.0)


@njit(
    "float32[:,::1](int32[::1], float64[::1], int32[::1], float64[::1], int64, int64)",
    nogil=True,
)
def revisits(
    take_a: AnyInts,
    end_a: AnyFloats,
    take_b: AnyInts,
    start_b: AnyFloats,
    min_frames: int,
    max_frames: int,
) -> F32:  # pragma: no cover - compiled
    """1 where a and b share a take and b starts between `min_frames` and `max_frames` before a ends, (P, N).

    Both limits are exclusive.
    """
    n_a, n_b = len(take_a), len(take_b)
    back = np.zeros((n_a, n_b), np.float32)
    for i in range(n_a):
        for j in range(n_b):
            if take_a[i] == take_b[j] and min_frames < end_a[i] - start_b[j] < max_frames:
                back[i, j] = 1.0
    return back


def random_numbers(keys: NDArray[np.uint64], seed: int) -> NDArray[np.float64]:
    """A number in [0, 1) for each key (N,), always the same for the same key and seed (SplitMix64)."""
    mixed = keys + _offset_of(seed)
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        mixed = (mixed ^ (mixed >> np.uint64(shift))) * np.uint64(factor)
    return (mixed ^ (mixed >> np.uint64(31))) / 2.0**64


@lru_cache(maxsize=64)
def _offset_of(seed: int) -> np.uint64:
    """The number that a seed adds to keys. To make a generator takes longer than to mix a layer's keys."""
    offset: np.uint64 = np.random.default_rng(seed).integers(0, 2**63, dtype=np.uint64)
    return offset


def rms_distances(a: AnyFloats, b: AnyFloats) -> AnyFloats:
    """Root mean square joint distances (P, N) of poses (P, 21, 3) and (N, 21, 3)."""

    (flat_a, sq_a), (flat_b, sq_b) = flat_poses(a), flat_poses(b)
    scale = np.float32(1.0 / a.shape[1])
    distances_m: AnyFloats = distances_from_product(flat_a @ flat_b.T, sq_a, sq_b, scale)
    return distances_m


def flat_poses(poses: AnyFloats) -> tuple[F32, F32]:
    """Poses (N, 21, 3) as vectors (N, 63), and the squares (N,) of their lengths."""
    flat = np.ascontiguousarray(poses, np.float32).reshape(len(poses), -1)
    return flat, np.einsum("nd,nd->n", flat, flat)


def rms_speed_m_s(velocity_m_s: AnyFloats) -> NDArray[np.float32]:
    """Root mean square joint speeds (N,) of velocities (N, 21, 3)."""
    speed_m_s: NDArray[np.float32] = np.sqrt(
        np.einsum("njd,njd->n", velocity_m_s, velocity_m_s) / velocity_m_s.shape[1], dtype=np.float32
    )
    return speed_m_s


@njit(
    "float32[:,::1](float64[::1], float32[::1], float32[::1], float64, int64[::1], int64[::1], "
    "float64[:,::1], float64, float64)",
    nogil=True,
)
def turned_costs(
    turn_rad: AnyFloats,
    end_rad: AnyFloats,
    start_rad: AnyFloats,
    steer_rad: float,
    next_part: AnyInts,
    part: AnyInts,
    series: AnyFloats,
    constant: float,
    of_rotation: float,
) -> F32:  # pragma: no cover - compiled
    """Costs (P, N) of the rotations φ at which the takes of N nodes are danced after those of P nodes.

    With the Fourier series (a, b, c, d) of each node, `series` (N, 4), the cost is `constant` + a cos φ +
    b sin φ + c cos 2φ + d sin 2φ, and of_rotation · (1 - cos φ) where takes change. Where a node continues
    the other (`Layer.part`), φ is `turn_rad` (P,). Otherwise φ brings the heading `start_rad` (N,) to
    `turn_rad` + `end_rad` (P,), and is then steered towards 0 by `steer_rad`.
    """
    n_a, n_b = len(end_rad), len(start_rad)
    costs = np.empty((n_a, n_b), np.float32)
    cos_b, sin_b = np.cos(start_rad), np.sin(start_rad)
    steer = np.cos(steer_rad), np.sin(steer_rad)
    for i in range(n_a):
        turn = np.cos(turn_rad[i]), np.sin(turn_rad[i])
        end = np.cos(turn_rad[i] + end_rad[i]), np.sin(turn_rad[i] + end_rad[i])
        for j in range(n_b):
            continues = next_part[i] == part[j]
            costs[i, j] = turned_cost(
                continues,
                turn,
                end,
                (cos_b[j], sin_b[j]),
                steer,
                (series[j, 0], series[j, 1], series[j, 2], series[j, 3]),
                constant,
                of_rotation,
            )
    return costs


_Angle = tuple[float, float]  # cosine and sine


@njit(inline="always")
def turned_cost(
    continues: bool,
    turn: _Angle,
    end: _Angle,
    start: _Angle,
    steer: _Angle,
    series: tuple[float, float, float, float],
    constant: float,
    of_rotation: float,
) -> float:  # pragma: no cover - compiled
    """One of the `turned_costs`. `end` is that of `turn_rad` + `end_rad`, and `series` those of the node."""
    cosine, sine, rotated = turn[0], turn[1], 0.0
    if not continues:
        joined_cos = end[0] * start[0] + end[1] * start[1]
        joined_sin = end[1] * start[0] - end[0] * start[1]
        cosine, sine = 1.0, 0.0
        if joined_cos < steer[0]:
            side = steer[1] if joined_sin >= 0 else -steer[1]
            cosine = joined_cos * steer[0] + joined_sin * side
            sine = joined_sin * steer[0] - joined_cos * side
        rotated = of_rotation * max(1.0 - cosine, 0.0)
    cost = constant + series[0] * cosine + series[1] * sine
    cost += series[2] * (2.0 * cosine * cosine - 1.0) + series[3] * (2.0 * sine * cosine)
    turned: float = max(cost, 0.0) + rotated
    return turned
