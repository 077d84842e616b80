"""The steps of a search whose costs depend on the path, compiled for the built-in ones of these costs.

All values are those of `Cost.edge` and `local_search.with_history`, to the bit.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.graph.cost import Cost, turned_cost
from choreograph.choreography.graph.costs import TURNED_TAKE, USAGE_SCALE_S, Front, Variety, heading_series
from choreograph.choreography.graph.layers import USAGE_DECAY_S, Layer, positions
from choreograph.choreography.graph.motif_costs import Signature
from choreograph.choreography.graph.returns import SAME_FRAMES, FormCost, moments_of
from choreograph.core.kernel_cache import njit
from choreograph.core.numerics import AnyFloats, AnyInts
from choreograph.music.song_features import SongFeatures

COMPILED: tuple[type[Cost], ...] = (Front, Variety, FormCost, Signature)  # in the order of their sum
NO_NODE = -1
OF_NODES = 9  # of the `arrays_of` a layer, the first ones, which have a row for each node
_USAGE_KEPT = np.float32(np.exp(-1.0 / USAGE_DECAY_S))
PER_USAGE = np.float32(1.0 / USAGE_SCALE_S)
_SLACK = 1e-4  # of a bound, times the weights, for rounding errors of costs


def arrays_of(
    layer: Layer, form: FormCost | None, signature: Signature | None, song_features: SongFeatures
) -> tuple[Any, ...]:
    """What `extended` reads of the nodes of a layer, the first two as its beginnings, and of the costs."""
    series, constant = heading_series(layer, song_features)
    start_rad, end_rad = layer.join_heading_rad.T.astype(np.float32)
    moments = () if form is None else moments_of(layer)
    number = np.array([number for number, _ in moments], np.int64)
    places = [positions(layer, share) for _, share in moments]
    is_return, form_weight = np.zeros(0, bool), np.zeros(0, np.float32)
    if form is not None:
        is_return = form.returns.is_return[number]
        form_weight = form.returns.weights[number].astype(np.float32)
    step_cost = np.zeros((1, 1), np.float32) if signature is None else signature.step_costs(layer.second)
    steer = layer.steer_rad, np.cos(layer.steer_rad), np.sin(layer.steer_rad)
    return (
        end_rad, layer.next_part.astype(np.int64), layer.take.astype(np.int64), start_rad,
        layer.part.astype(np.int64), np.ascontiguousarray(series, np.float64),
        np.asarray(Front().min_edge_costs(layer, layer, song_features), np.float64),
        np.stack([*places, np.zeros(layer.n_nodes)], axis=1),
        np.ascontiguousarray(layer.motifs, np.int16), number, is_return, form_weight, step_cost,
        np.array([constant, *steer]), len(layer.moments) if moments else 0, layer.new_goal,
    )  # fmt: skip


@njit(
    "Tuple((float64[::1], int64[::1], float64[::1], float32[:,::1], float64[:,::1], int16[:,::1]))("
    "float32[::1], float32[:,::1], float64[::1], int64, float64[::1], float32[:,::1], float64[:,::1], "
    "int16[:,::1], float32[::1], int64[::1], float32[::1], float64[::1], int16[::1], int64[::1], "
    "float32[::1], int64[::1], float64[:,::1], float64[::1], float64[:,::1], int16[:,::1], int64[::1], "
    "bool_[::1], float32[::1], float32[:,::1], float64[::1], int64, bool_)",
    nogil=True,
)
def extended(
    weights: NDArray[np.float32], edges: NDArray[np.float32], reached: AnyFloats, path_node: int,
    turn_rad: AnyFloats, usage_s: AnyFloats, danced: AnyFloats, counts: AnyInts,
    end_rad: AnyFloats, next_part: AnyInts,
    rest_usage_s: AnyFloats, rest_danced: AnyFloats, rest_counts: AnyInts,
    take: AnyInts, start_rad: AnyFloats, part: AnyInts, series: AnyFloats, least_front: AnyFloats,
    places: AnyFloats, motifs: AnyInts,
    number: AnyInts, is_return: NDArray[np.bool_], form_weight: AnyFloats, step_cost: AnyFloats,
    constants: AnyFloats, n_own: int, new_goal: bool,
) -> tuple[Any, ...]:  # fmt: skip  # pragma: no cover - compiled
    """As the step of `CheapNodes`: the least costs (N,), the parents (N,), and the history of every node.

    `weights` (4,) are those of `COMPILED`. `edges` (P, N) and `reached` (P,) are costs without them. The path
    continues with `path_node`, or with `NO_NODE` if it ends here. Then follow the history of the beginnings,
    their arrays of `arrays_of`, what the rest of the path dances, and the arrays of the nodes.
    An edge whose lower bound is above the best one into its node is not evaluated.
    """
    n_a, n_b = edges.shape
    before = (
        np.cos(turn_rad), np.sin(turn_rad), np.cos(turn_rad + end_rad), np.sin(turn_rad + end_rad), next_part,
        usage_s, *seen_of(danced, counts, rest_danced, rest_counts, number, new_goal),
    )  # fmt: skip
    repeats, bound = bounds_of(weights, weights[3], before[-1], motifs, step_cost)
    nodes = (
        take, np.cos(start_rad), np.sin(start_rad), part, series, least_front, places, is_return, form_weight,
        motifs, repeats,
    )  # fmt: skip
    others = before, nodes, weights, rest_usage_s, step_cost, constants
    costs, least = np.empty((n_a, n_b)), np.full(n_b, np.inf)
    if path_node >= 0:
        nothing = np.zeros((n_a, n_b), np.float32)
        every, unbounded = np.arange(n_a), np.full(n_b, -np.inf)
        here = path_node, path_node + 1
        _evaluate(every, here, np.zeros(n_a), nothing, unbounded, least, costs, *others)
        reached = reached - costs[:, path_node]
        least[path_node] = np.inf
    _evaluate(np.argsort(reached), (0, n_b), reached, edges, bound, least, costs, *others)
    best, parent = np.full(n_b, np.inf), np.zeros(n_b, np.int64)
    for i in range(n_a):
        for j in range(n_b):
            if costs[i, j] < best[j]:
                best[j], parent[j] = costs[i, j], i

    steer_rad, history = constants[1], (
        np.empty(n_b), usage_s[parent] * _USAGE_KEPT, danced[parent], counts[parent]
    )  # fmt: skip
    for j in range(n_b):
        i = parent[j]
        history[0][j] = turn_rad[i]
        if next_part[i] != part[j]:
            joined = (turn_rad[i] + end_rad[i] - start_rad[j] + np.pi) % (2 * np.pi) - np.pi
            history[0][j] = joined - min(max(joined, -steer_rad), steer_rad)
        if usage_s.shape[1]:
            history[1][j, take[j]] += np.float32(1.0)
        for m in range(n_own):
            history[2][j, number[m]] = places[j, m]
        if new_goal:
            history[3][j] = 0
        for w in range(motifs.shape[1]):
            if motifs[j, w] >= 0 and counts.shape[1]:
                history[3][j, motifs[j, w]] += 1
    return best, parent, history[0], history[1], history[2], history[3]


@njit()
def _evaluate(
    rows: Any, columns: Any, reached: Any, edges: Any, bound: Any, least: Any, costs: Any,
    before: Any, nodes: Any, weights: Any, rest_usage_s: Any, step_cost: Any, constants: Any,
) -> None:  # fmt: skip  # pragma: no cover - compiled
    """Write to `costs` (P, N) what the beginnings of a range of `rows` cost with the nodes of `columns`.

    `least` (N,) becomes the least cost of each node. Where a lower bound is above it, the cost is inf. Costs
    are added as by `edge_costs`.
    """
    cos_turn, sin_turn, cos_end, sin_end, next_part, usage_s, seen_danced, seen = before
    take, cos_start, sin_start, part, series, least_front, places, is_return, form_weight, motifs, repeats = (
        nodes
    )
    steer = constants[2], constants[3]
    has_usage = weights[1] != 0.0 and usage_s.shape[1] > 0
    for i in rows:
        turn, end = (cos_turn[i], sin_turn[i]), (cos_end[i], sin_end[i])
        for j in range(columns[0], columns[1]):
            cost = np.float64(edges[i, j]) + reached[i]
            if cost + bound[j] > least[j]:
                costs[i, j] = np.inf
                continue
            continues, usage = next_part[i] == part[j], np.float32(0.0)
            if has_usage:
                usage = weights[1] * ((usage_s[i, take[j]] + rest_usage_s[take[j]]) * PER_USAGE)
            front_at_least = 0.0 if continues else weights[0] * least_front[j]
            if cost + bound[j] + usage + front_at_least > least[j]:
                costs[i, j] = np.inf
                continue
            total = np.float32(0.0)
            if weights[0] != 0.0:
                front = turned_cost(
                    continues, turn, end, (cos_start[j], sin_start[j]), steer,
                    (series[j, 0], series[j, 1], series[j, 2], series[j, 3]), constants[0], TURNED_TAKE,
                )  # fmt: skip
                total += weights[0] * np.float32(front)
            total += usage
            if weights[2] != 0.0:
                total += weights[2] * form_of(i, j, seen_danced, places, is_return, form_weight)
            if weights[3] != 0.0:
                total += weights[3] * words_of(i, j, seen, motifs, repeats, step_cost)
            costs[i, j] = cost + total
            least[j] = min(least[j], costs[i, j])


@njit(inline="always")
def form_of(
    i: int, j: int, danced: Any, places: Any, is_return: Any, form_weight: Any
) -> Any:  # pragma: no cover - compiled
    """The `FormCost` of an edge, from positions (P, m) of the beginnings and (N, m) of the nodes."""
    form = np.float32(0.0)
    for m in range(len(form_weight)):
        away = abs(danced[i, m] - places[j, m])
        wrong = away > SAME_FRAMES if is_return[m] else away <= SAME_FRAMES
        form += form_weight[m] if wrong else np.float32(0.0)
    return form


@njit(inline="always")
def words_of(
    i: int, j: int, counts: Any, motifs: Any, repeats: Any, step_cost: Any
) -> Any:  # pragma: no cover - compiled
    """The `Signature` cost of an edge, from the motif counts (P, M) of the beginnings."""
    words, most = np.float32(0.0), step_cost.shape[1] - 1
    for w in range(motifs.shape[1]):
        if motifs[j, w] < 0:
            break
        words += step_cost[motifs[j, w], min(counts[i, motifs[j, w]] + repeats[j, w], most)]
    return words


@njit(
    "Tuple((float64[:,::1], int16[:,::1]))(float64[:,::1], int16[:,::1], float64[::1], int16[::1], "
    "int64[::1], bool_)"
)
def seen_of(
    danced: Any, counts: Any, rest_danced: Any, rest_counts: Any, number: Any, new_goal: bool
) -> tuple[Any, Any]:  # pragma: no cover - compiled
    """Positions (P, m) and motif counts (P, M) of each beginning with the rest of the path."""
    seen_danced, seen = np.empty((len(danced), len(number))), np.empty(counts.shape, np.int16)
    for i in range(len(danced)):
        for m in range(len(number)):
            at = danced[i, number[m]]
            seen_danced[i, m] = rest_danced[number[m]] if np.isnan(at) else at
        for k in range(counts.shape[1]):
            seen[i, k] = rest_counts[k] + (0 if new_goal else counts[i, k])
    return seen_danced, seen


@njit(
    "Tuple((int64[:,::1], float64[::1]))(float32[::1], float32, int16[:,::1], int16[:,::1], float32[:,::1])"
)
def bounds_of(
    weights: Any, weight: Any, seen: Any, motifs: Any, step_cost: Any
) -> tuple[Any, Any]:  # pragma: no cover - compiled
    """How many earlier words of a node have the same motif (N, W), and lower bounds (N,) of the costs.

    `weight` is that of the signature. A word costs more, the more often its motif has been danced. The other
    costs are never below 0.
    """
    fewest = np.full(seen.shape[1], np.iinfo(np.int16).max)
    for i in range(len(seen)):
        for k in range(seen.shape[1]):
            fewest[k] = min(fewest[k], seen[i, k])
    repeats, bound = np.zeros(motifs.shape, np.int64), np.zeros(len(motifs))
    for j in range(len(motifs)):
        for w in range(motifs.shape[1]):
            if motifs[j, w] < 0:
                break
            for v in range(w):
                repeats[j, w] += motifs[j, v] == motifs[j, w]
            if weight != 0.0:
                count = min(fewest[motifs[j, w]] + repeats[j, w], step_cost.shape[1] - 1)
                bound[j] += weight * step_cost[motifs[j, w], count]
        bound[j] = -np.inf if weights.min() < 0.0 else bound[j] - _SLACK * (1.0 + weights.sum())
    return repeats, bound
