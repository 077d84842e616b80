"""The steps of a search whose costs depend on the path, compiled for the built-in ones of these costs.

All values are those of `Cost.edge` and `local_search.with_history`, to the bit.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.graph.cost import Cost
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
    Beginnings are tried in the order of their costs so far. A cost is evaluated only where the others and
    lower bounds leave an edge below the best one into its node. All are added as by `edge_costs`.
    """
    n_a, n_b = edges.shape
    seen_danced, seen = seen_of(danced, counts, rest_danced, rest_counts, number, new_goal)
    repeats, bound = bounds_of(weights, weights[3], seen, motifs, step_cost)
    starts, rest_s = np.empty((2, n_b), np.float32), np.zeros(n_b, np.float32)
    for j in range(n_b):
        starts[0, j], starts[1, j] = np.cos(start_rad[j]), np.sin(start_rad[j])
        if usage_s.shape[1]:
            rest_s[j] = rest_usage_s[take[j]]
    series, places = series.T.copy(), places.T.copy()
    form, total, low = np.empty(n_b, np.float32), np.empty(n_b, np.float32), np.empty(n_b)
    order: Any = np.empty(n_a, np.int64)
    none: Any = np.int64(0)
    left, has_words = np.empty(n_a), weights[3] != 0.0
    for i in range(n_a):
        left[i] = reached[i]
        if path_node >= 0:
            j = path_node
            _vectorised_costs(
                i, j, j + 1, weights, turn_rad, end_rad, next_part, usage_s, seen_danced, starts, part,
                series, take, rest_s, places, is_return, form_weight, constants, form, total,
            )  # fmt: skip
            if has_words:
                total[j] += weights[3] * words_of(i, j, seen, motifs, repeats, step_cost)
            left[i] -= np.float64(total[j])
        place = i
        while place > 0 and left[order[place - 1]] > left[i]:  # promising beginnings first
            order[place] = order[place - 1]
            place -= 1
        order[place] = i
    best, parent = np.full(n_b, np.inf), np.zeros(n_b, np.int64)
    for i in order:
        n_near = 0
        for j in range(n_b):
            low[j] = np.float64(edges[i, j]) + left[i] + bound[j]
            n_near += low[j] <= best[j]
        if n_near == 0:
            continue
        _vectorised_costs(
            i, none, n_b, weights, turn_rad, end_rad, next_part, usage_s, seen_danced, starts, part,
            series, take, rest_s, places, is_return, form_weight, constants, form, total,
        )  # fmt: skip
        for j in range(n_b):
            low[j] += total[j]
        for j in range(n_b):
            if low[j] <= best[j]:
                if has_words:
                    total[j] += weights[3] * words_of(i, j, seen, motifs, repeats, step_cost)
                cost = np.float64(edges[i, j]) + left[i]
                cost += np.float64(total[j])
                if cost < best[j] or (cost == best[j] and i < parent[j]):  # the first of those that have it
                    best[j], parent[j] = cost, i
    return best, parent, *_histories(
        parent, turn_rad, usage_s, danced, counts, end_rad, next_part, take, start_rad, part, places, motifs,
        number, constants[1], n_own, new_goal,
    )  # fmt: skip


@njit()
def _histories(
    parent: Any, turn_rad: Any, usage_s: Any, danced: Any, counts: Any, end_rad: Any, next_part: Any,
    take: Any, start_rad: Any, part: Any, places: Any, motifs: Any, number: Any, steer_rad: Any, n_own: Any,
    new_goal: Any,
) -> tuple[Any, ...]:  # fmt: skip  # pragma: no cover - compiled
    """What was danced when each node has been reached from its parent: turns, takes, moments and motifs."""
    n_b = len(parent)
    turns_rad, usages_s = np.empty(n_b), np.empty((n_b, usage_s.shape[1]), np.float32)
    dances, sums = np.empty((n_b, danced.shape[1])), np.empty((n_b, counts.shape[1]), np.int16)
    for j in range(n_b):
        i = parent[j]
        turns_rad[j] = turn_rad[i]
        for k in range(usage_s.shape[1]):
            usages_s[j, k] = usage_s[i, k] * _USAGE_KEPT
        for k in range(danced.shape[1]):
            dances[j, k] = danced[i, k]
        for k in range(counts.shape[1]):
            sums[j, k] = 0 if new_goal else counts[i, k]
        if next_part[i] != part[j]:
            joined = (turn_rad[i] + end_rad[i] - start_rad[j] + np.pi) % (2 * np.pi) - np.pi
            turns_rad[j] = joined - min(max(joined, -steer_rad), steer_rad)
        if usage_s.shape[1]:
            usages_s[j, take[j]] += np.float32(1.0)
        for m in range(n_own):
            dances[j, number[m]] = places[m, j]
        for w in range(motifs.shape[1]):
            if motifs[j, w] >= 0 and counts.shape[1]:
                sums[j, motifs[j, w]] += 1
    return turns_rad, usages_s, dances, sums


@njit()
def _vectorised_costs(
    i: int, first: int, stop: int, weights: Any, turn_rad: Any, end_rad: Any, next_part: Any, usage_s: Any,
    seen_danced: Any, starts: Any, part: Any, series: Any, take: Any, rest_s: Any, places: Any,
    is_return: Any, form_weight: Any, constants: Any, form: Any, total: Any,
) -> None:  # fmt: skip  # pragma: no cover - compiled
    """Write the costs of going from beginning `i` to some nodes, without those of words, to `total` (N,).

    The nodes are those from `first` to `stop`. The loops have no branches, so that several nodes are
    evaluated by one instruction. An index that may be negative would be a branch. The first loop is
    `turned_cost`. For literals it would be compiled once more.
    """
    begin, beyond = np.uint64(first), np.uint64(stop)
    constant, steer_cos, steer_sin, continued = constants[0], constants[2], constants[3], next_part[i]
    turn_cos, turn_sin, end = np.cos(turn_rad[i]), np.sin(turn_rad[i]), turn_rad[i] + end_rad[i]
    end_cos, end_sin = np.cos(end), np.sin(end)
    for j in range(begin, beyond):
        joined_cos = end_cos * starts[0, j] + end_sin * starts[1, j]
        joined_sin = end_sin * starts[0, j] - end_cos * starts[1, j]
        side = steer_sin if joined_sin >= 0 else -steer_sin
        is_turned, continues = joined_cos < steer_cos, continued == part[j]
        cosine = joined_cos * steer_cos + joined_sin * side if is_turned else 1.0
        sine = joined_sin * steer_cos - joined_cos * side if is_turned else 0.0
        rotated = TURNED_TAKE * max(1.0 - cosine, 0.0)
        cosine = turn_cos if continues else cosine
        sine = turn_sin if continues else sine
        rotated = 0.0 if continues else rotated
        cost = constant + series[0, j] * cosine + series[1, j] * sine
        cost += series[2, j] * (2.0 * cosine * cosine - 1.0) + series[3, j] * (2.0 * sine * cosine)
        total[j] = weights[0] * np.float32(max(cost, 0.0) + rotated)
    if weights[1] != 0.0 and usage_s.shape[1] > 0:
        for j in range(begin, beyond):
            total[j] += weights[1] * ((usage_s[i, take[j]] + rest_s[j]) * PER_USAGE)
    if weights[2] != 0.0 and len(form_weight):
        for j in range(begin, beyond):
            form[j] = np.float32(0.0)
        for m in range(len(form_weight)):
            danced, returns, weight = seen_danced[i, m], is_return[m], form_weight[m]
            for j in range(begin, beyond):
                away = abs(danced - places[m, j])
                wrong = away > SAME_FRAMES if returns else away <= SAME_FRAMES
                form[j] += weight if wrong else np.float32(0.0)
        for j in range(begin, beyond):
            total[j] += weights[2] * form[j]


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
