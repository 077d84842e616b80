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
OF_NODES = 8  # of the `arrays_of` a layer, the first ones, which have a row for each node
_USAGE_KEPT = np.float32(np.exp(-1.0 / USAGE_DECAY_S))
PER_USAGE = np.float32(1.0 / USAGE_SCALE_S)
_MANY = np.iinfo(np.int16).max  # more words of a motif than a dance has
_SLACK = 1e-4  # of a bound, times the weights, for rounding errors of costs


def arrays_of(
    layer: Layer, form: FormCost | None, signature: Signature | None, song_features: SongFeatures
) -> tuple[Any, ...]:
    """What `extended` reads of the nodes of a layer, the first two as its beginnings, and of the costs."""
    series, constant = heading_series(layer, song_features)
    start_rad, end_rad = np.ascontiguousarray(layer.join_heading_rad.T, np.float32)
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
        end_rad, layer.next_part.astype(np.int64), layer.usage_column.astype(np.int64), start_rad,
        layer.part.astype(np.int64), np.ascontiguousarray(series, np.float64),
        np.stack([*places, np.zeros(layer.n_nodes)], axis=1),
        np.ascontiguousarray(layer.motifs, np.int16), number, is_return, form_weight, step_cost,
        np.array([constant, *steer]), len(layer.moments) if moments else 0, layer.new_goal,
    )  # fmt: skip


@njit(
    "Tuple((float64[::1], int64[::1], float64[::1], float32[:,::1], float64[:,::1], int16[:,::1]))("
    "float32[::1], float32[:,::1], float64[::1], int64, float64[::1], float32[:,::1], float64[:,::1], "
    "int16[:,::1], float32[::1], int64[::1], float32[::1], float64[::1], int16[::1], int64[::1], "
    "float32[::1], int64[::1], float64[:,::1], float64[:,::1], int16[:,::1], int64[::1], "
    "bool_[::1], float32[::1], float32[:,::1], float64[::1], int64, bool_)",
    nogil=True,
)
def extended(
    weights: NDArray[np.float32], edges: NDArray[np.float32], reached: AnyFloats, path_node: int,
    turn_rad: AnyFloats, usage_s: AnyFloats, danced: AnyFloats, counts: AnyInts,
    end_rad: AnyFloats, next_part: AnyInts,
    rest_usage_s: AnyFloats, rest_danced: AnyFloats, rest_counts: AnyInts,
    take: AnyInts, start_rad: AnyFloats, part: AnyInts, series: AnyFloats,
    places: AnyFloats, motifs: AnyInts,
    number: AnyInts, is_return: NDArray[np.bool_], form_weight: AnyFloats, step_cost: AnyFloats,
    constants: AnyFloats, n_own: int, new_goal: bool,
) -> tuple[Any, ...]:  # fmt: skip  # pragma: no cover - compiled
    """As the step of `CheapNodes`: the least costs (N,), the parents (N,), and the history of every node.

    `weights` (4,) are those of `COMPILED`. `edges` (P, N) and `reached` (P,) are costs without them. The path
    continues with `path_node`, or with `NO_NODE` if it ends here. Then follow the history of the beginnings,
    their arrays of `arrays_of`, what the rest of the path dances, and the arrays of the nodes.
    Costs that are looked up are evaluated only where a lower bound of the edge is below the best one.
    """
    n_a, n_b = edges.shape
    seen_danced, seen = seen_of(danced, counts, rest_danced, rest_counts, number, new_goal)
    angles, of_starts = np.empty((4, n_a)), np.empty((2, n_b), np.float32)
    for i in range(n_a):
        end = turn_rad[i] + end_rad[i]
        angles[0, i], angles[1, i] = np.cos(turn_rad[i]), np.sin(turn_rad[i])
        angles[2, i], angles[3, i] = np.cos(end), np.sin(end)
    for j in range(n_b):
        of_starts[0, j], of_starts[1, j] = np.cos(start_rad[j]), np.sin(start_rad[j])
    before = (angles, next_part, usage_s, seen_danced, seen)
    repeats, bound = bounds_of(weights, weights[3], seen, motifs, step_cost)
    nodes = (take, of_starts, part, series.T.copy(), places, is_return, form_weight, motifs, repeats)
    others = before, nodes, weights, rest_usage_s, step_cost, constants
    order, left = np.empty(n_a, np.int64), np.empty(n_a)
    for i in range(n_a):
        left[i] = reached[i]
        if path_node >= 0:
            left[i] -= np.float64(_of_edge(i, path_node, *others))
        place = i
        while place > 0 and left[order[place - 1]] > left[i]:  # promising beginnings first
            order[place] = order[place - 1]
            place -= 1
        order[place] = i
    best, parent = _cheapest(order, left, edges, bound, *others)
    steer_rad, history = constants[1], (
        np.empty(n_b), np.empty((n_b, usage_s.shape[1]), np.float32), np.empty((n_b, danced.shape[1])),
        np.empty((n_b, counts.shape[1]), np.int16),
    )  # fmt: skip
    for j in range(n_b):
        i = parent[j]
        history[0][j] = turn_rad[i]
        for k in range(usage_s.shape[1]):
            history[1][j, k] = usage_s[i, k] * _USAGE_KEPT
        for k in range(danced.shape[1]):
            history[2][j, k] = danced[i, k]
        for k in range(counts.shape[1]):
            history[3][j, k] = 0 if new_goal else counts[i, k]
        if next_part[i] != part[j]:
            joined = (turn_rad[i] + end_rad[i] - start_rad[j] + np.pi) % (2 * np.pi) - np.pi
            history[0][j] = joined - min(max(joined, -steer_rad), steer_rad)
        if usage_s.shape[1]:
            history[1][j, take[j]] += np.float32(1.0)
        for m in range(n_own):
            history[2][j, number[m]] = places[j, m]
        for w in range(motifs.shape[1]):
            if motifs[j, w] >= 0 and counts.shape[1]:
                history[3][j, motifs[j, w]] += 1
    return best, parent, history[0], history[1], history[2], history[3]


@njit()
def _cheapest(
    order: Any, left: Any, edges: Any, bound: Any,
    before: Any, nodes: Any, weights: Any, rest_usage_s: Any, step_cost: Any, constants: Any,
) -> tuple[Any, Any]:  # fmt: skip  # pragma: no cover - compiled
    """The least cost of each node (N,), and the first of the beginnings that have it.

    The beginnings are tried in an `order` (P,). What they cost so far is `left` (P,). The costs that are
    looked up in tables are evaluated only for edges whose other costs and `bound` (N,) leave the edge below
    the best one into its node. Costs are added as by `edge_costs`.
    """
    usage_s, take, n_b = before[2], nodes[0], len(bound)
    has_usage = weights[1] != 0.0 and usage_s.shape[1] > 0
    total, low, rest_s = np.zeros(n_b, np.float32), np.empty(n_b), np.zeros(n_b, np.float32)
    best, parent = np.full(n_b, np.inf), np.zeros(n_b, np.int64)
    for j in range(n_b if has_usage else 0):
        rest_s[j] = rest_usage_s[take[j]]
    for i in order:
        n_near = 0
        for j in range(n_b):
            low[j] = np.float64(edges[i, j]) + left[i] + bound[j]
            n_near += low[j] <= best[j]
        if n_near == 0:
            continue
        if weights[0] != 0.0:
            _front_costs(i, before, nodes, weights[0], constants, total)
        else:
            total[:] = np.float32(0.0)
        if has_usage:
            for j in range(n_b):
                total[j] += weights[1] * ((usage_s[i, take[j]] + rest_s[j]) * PER_USAGE)
        for j in range(n_b):
            low[j] += total[j]
        for j in range(n_b):
            if low[j] <= best[j]:
                cost = np.float64(edges[i, j]) + left[i]
                cost += _with_looked_up(total[j], i, j, before, nodes, weights, step_cost)
                if cost < best[j] or (cost == best[j] and i < parent[j]):
                    best[j], parent[j] = cost, i
    return best, parent


@njit()
def _front_costs(
    i: int, before: Any, nodes: Any, weight: Any, constants: Any, costs: Any
) -> None:  # pragma: no cover - compiled
    """Write the weighted `turned_cost` of going from beginning `i` to each node to `costs` (N,).

    It has no branches, so that several nodes are evaluated by one instruction.
    """
    angles, next_part, of_starts, part, series = before[0], before[1][i], nodes[1], nodes[2], nodes[3]
    constant, steer_cos, steer_sin = constants[0], constants[2], constants[3]
    turn_cos, turn_sin, end_cos, end_sin = angles[0, i], angles[1, i], angles[2, i], angles[3, i]
    for j in range(len(costs)):
        joined_cos = end_cos * of_starts[0, j] + end_sin * of_starts[1, j]
        joined_sin = end_sin * of_starts[0, j] - end_cos * of_starts[1, j]
        side = steer_sin if joined_sin >= 0 else -steer_sin
        is_turned, continues = joined_cos < steer_cos, next_part == part[j]
        cosine = joined_cos * steer_cos + joined_sin * side if is_turned else 1.0
        sine = joined_sin * steer_cos - joined_cos * side if is_turned else 0.0
        rotated = TURNED_TAKE * max(1.0 - cosine, 0.0)
        cosine = turn_cos if continues else cosine
        sine = turn_sin if continues else sine
        rotated = 0.0 if continues else rotated
        cost = constant + series[0, j] * cosine + series[1, j] * sine
        cost += series[2, j] * (2.0 * cosine * cosine - 1.0) + series[3, j] * (2.0 * sine * cosine)
        costs[j] = weight * np.float32(max(cost, 0.0) + rotated)


@njit()
def _of_edge(
    i: int, j: int, before: Any, nodes: Any, weights: Any, rest_usage_s: Any, step_cost: Any, constants: Any
) -> Any:  # pragma: no cover - compiled
    """The costs of going from beginning `i` to node `j`."""
    angles, next_part, usage_s = before[0], before[1], before[2]
    take, of_starts, part, series = nodes[0], nodes[1], nodes[2], nodes[3]
    total = np.float32(0.0)
    if weights[0] != 0.0:
        front = turned_cost(
            next_part[i] == part[j], (angles[0, i], angles[1, i]), (angles[2, i], angles[3, i]),
            (of_starts[0, j], of_starts[1, j]), (constants[2], constants[3]),
            (series[0, j], series[1, j], series[2, j], series[3, j]), constants[0], TURNED_TAKE,
        )  # fmt: skip
        total += weights[0] * np.float32(front)
    if weights[1] != 0.0 and usage_s.shape[1] > 0:
        total += weights[1] * ((usage_s[i, take[j]] + rest_usage_s[take[j]]) * PER_USAGE)
    return _with_looked_up(total, i, j, before, nodes, weights, step_cost)


@njit(inline="always")
def _with_looked_up(
    total: Any, i: int, j: int, before: Any, nodes: Any, weights: Any, step_cost: Any
) -> Any:  # pragma: no cover - compiled
    """The costs of front and variety of an edge with those of form and signature."""
    places, is_return, form_weight, motifs, repeats = nodes[4], nodes[5], nodes[6], nodes[7], nodes[8]
    if weights[2] != 0.0:
        total += weights[2] * form_of(i, j, before[3], places, is_return, form_weight)
    if weights[3] != 0.0:
        total += weights[3] * words_of(i, j, before[4], motifs, repeats, step_cost)
    return total


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
    fewest, least_weight, most = np.empty(seen.shape[1], np.int64), weights[0], np.float32(0.0)
    for each in weights:
        least_weight, most = min(least_weight, each), most + each
    for k in range(seen.shape[1]):
        fewest[k] = _MANY
    for i in range(len(seen)):
        for k in range(seen.shape[1]):
            fewest[k] = min(fewest[k], seen[i, k])
    repeats, bound = np.empty(motifs.shape, np.int64), np.empty(len(motifs))
    for j in range(len(motifs)):
        bound[j] = 0.0
        for w in range(motifs.shape[1]):
            repeats[j, w] = 0
        for w in range(motifs.shape[1]):
            if motifs[j, w] < 0:
                break
            for v in range(w):
                repeats[j, w] += motifs[j, v] == motifs[j, w]
            if weight != 0.0:
                count = min(fewest[motifs[j, w]] + repeats[j, w], step_cost.shape[1] - 1)
                bound[j] += weight * step_cost[motifs[j, w], count]
        bound[j] = -np.inf if least_weight < 0.0 else bound[j] - _SLACK * (1.0 + most)
    return repeats, bound
