"""The base class of costs, what a cost declares, and weighted sums of costs, whose values are checked."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.graph.layers import Layer, PhraseReturns, PoseBank
from choreograph.choreography.motif_sequences import MotifGoal
from choreograph.core.arguments import as_array, check_kind, unexpected
from choreograph.core.errors import NoPathError, ParameterError
from choreograph.core.numerics import AnyFloats
from choreograph.music.song_features import SongFeatures

Goals = Sequence[tuple[int, MotifGoal]]  # (first second, goal) of each part of the song, in order


@dataclass(frozen=True, eq=False)
class CostContext:
    """What the costs of one dance are made from."""

    seed: int
    """The seed of the dance."""
    stage_m: tuple[float, float] | None
    """Width and depth of the stage in metres, or None if it has no borders."""
    poses: PoseBank
    """The motion of all clips of the repertoire."""
    returns: PhraseReturns | None
    """The phrases of the song that return, or None if none does."""
    goals: Goals
    """The motifs that each part of the song should have. There may be none."""
    song_features: SongFeatures
    """The song, analysed."""


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
    default_weight : weight if no other is given
    highest_weight : upper end of the studio's slider for the weight. The default is four times the default
        weight, and at least 1
    label : name on pages. The default is the name with spaces
    unit : unit of the values, such as "m". The default is none, for a share, a rank or a distance of vectors
    sentence : why a node is dear if this cost is high, as the studio says it. The default is the first line
        of the docstring
    also_called : names that users may expect instead of `name`. A weight of such a name is refused with a
        hint
    min_jump_cost : lower bound of every edge between two warped segments. With it, the exact planner skips
        edges that cannot be on the cheapest path. Set it to 0 if no edge is negative.
    of_path : whether its values depend on the path to a node, by what `Layer.path` holds
    min_path_cost : lower bound of the sum of its values over a whole path, of a cost with `of_path`
    is_compiled : whether the module `kernels` evaluates its edges as well, by the same formula. A search is
        compiled if all its costs of edges are

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
    default_weight: ClassVar[float] = 1.0
    highest_weight: ClassVar[float] = 4.0
    label: ClassVar[str] = ""
    unit: ClassVar[str] = ""
    sentence: ClassVar[str] = ""
    also_called: ClassVar[tuple[str, ...]] = ()
    min_jump_cost: float = -math.inf
    of_path: bool = False
    min_path_cost: float = -math.inf
    is_compiled: ClassVar[bool] = False

    def __init_subclass__(cls, **kwargs: object) -> None:
        super().__init_subclass__(**kwargs)
        own = cls.__dict__
        if "name" not in own:
            cls.name = cls.__name__.lower()
        if "label" not in own:
            cls.label = cls.name.replace("_", " ")
        if "highest_weight" not in own:
            cls.highest_weight = max(4.0 * cls.default_weight, 1.0)
        if "sentence" not in own:
            cls.sentence = (cls.__doc__ or "").strip().partition("\n")[0] or "A cost of your own."

    @classmethod
    def for_dance(cls, context: CostContext) -> Cost | None:
        """The cost for one dance, or None if the dance has nothing that it rates.

        Override it in a built-in cost that is made with arguments. Costs of users are given as they are.
        Raises `ParameterError` for another context.
        """
        check_kind("the context of a cost", context, CostContext)
        return cls()

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


def resolve_weights(given: Mapping[str, float], costs: Sequence[Cost | type[Cost]]) -> dict[str, float]:
    """The weight of every cost by name: as given, else its default.

    Raises `ParameterError` for a weight that belongs to no cost.
    """
    weights = {cost.name: float(given.get(cost.name, cost.default_weight)) for cost in costs}
    for name in sorted(set(given) - set(weights)):
        meant = [f"the cost {name!r} is called {cost.name!r}" for cost in costs if name in cost.also_called]
        raise unexpected(f"weights of costs among {', '.join(weights)}", name, *meant[:1])
    return weights


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
