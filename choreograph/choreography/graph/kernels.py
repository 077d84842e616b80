"""The compiled loops of a search by the built-in costs.

The formula of each cost stands with its class. Here they are compiled into the loops over the nodes of two
seconds. `cheapest_edges` and `fixed_edges` evaluate the edges of a step of `forward`, and `extended` makes a
step of `local_search`. All values are those of `Cost.edge` and `local_search.with_history`, to the bit. A new
cost of edges need not be here: a search in which it takes part evaluates arrays instead.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.graph import costs, path_costs
from choreograph.choreography.graph.cost import Cost
from choreograph.choreography.graph.costs import (
    BUILTIN_COSTS,
    Completeness,
    Phrasing,
    RepeatCost,
    Transition,
    Velocity,
    distance_from_product,
    repeats,
)
from choreograph.choreography.graph.layers import USAGE_DECAY_S, Layer, moments_of, positions
from choreograph.choreography.graph.motif_costs import MotifTransition, Signature, repeats_of, words_cost
from choreograph.choreography.graph.path_costs import (
    PER_USAGE,
    TURNED_TAKE,
    FormCost,
    FrontCost,
    Variety,
    heading_series,
    turned_cost,
)
from choreograph.core.kernel_cache import njit
from choreograph.core.numerics import AnyFloats, AnyInts
from choreograph.motion.body import BODY_JOINTS
from choreograph.music.song_features import SongFeatures

F32 = NDArray[np.float32]
# The costs whose edges are compiled, and those of them that depend on the path, in the order of their sum.
COMPILED: tuple[type[Cost], ...] = tuple(kind for kind in BUILTIN_COSTS if kind.is_compiled)
COMPILED_OF_PATH: tuple[type[Cost], ...] = tuple(kind for kind in COMPILED if kind.of_path)
# Their places in the weights of a kernel.
_COMPLETENESS, _TRANSITION, _VELOCITY, _PHRASING, _FRONT, _VARIETY, _REPEAT, _FORM, _SIGNATURE, _MOTIFS = (
    COMPILED.index(kind)
    for kind in (
        Completeness, Transition, Velocity, Phrasing, FrontCost, Variety, RepeatCost, FormCost, Signature,
        MotifTransition,
    )
)  # fmt: skip
_PATH_FRONT, _PATH_VARIETY, _PATH_FORM, _PATH_SIGNATURE = map(
    COMPILED_OF_PATH.index, (FrontCost, Variety, FormCost, Signature)
)
_relative_change = njit(inline="always")(costs.relative_change)
_mean_penalty = njit(inline="always")(costs.mean_penalty)
_breaks_form = njit(inline="always")(path_costs.breaks_form)

NO_NODE = -1
OF_NODES = 8  # of the `arrays_of` a layer, the first ones, which have a row for each node
_USAGE_KEPT = np.float32(np.exp(-1.0 / USAGE_DECAY_S))
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

    `weights` (4,) are those of `COMPILED_OF_PATH`. `edges` (P, N) and `reached` (P,) are costs without them.
    The path continues with `path_node`, or with `NO_NODE` if it ends here. Then follow the history of the
    beginnings, their arrays of `arrays_of`, what the rest of the path dances, and the arrays of the nodes.
    Beginnings are tried in the order of their costs so far. A cost is evaluated only where the others and
    lower bounds leave an edge below the best one into its node. All are added as by `edge_costs`.
    """
    n_a, n_b = edges.shape
    seen_danced, seen = seen_of(danced, counts, rest_danced, rest_counts, number, new_goal)
    earlier, bound = bounds_of(weights, weights[_PATH_SIGNATURE], seen, motifs, step_cost)
    starts, rest_s = np.empty((2, n_b), np.float32), np.zeros(n_b, np.float32)
    for j in range(n_b):
        starts[0, j], starts[1, j] = np.cos(start_rad[j]), np.sin(start_rad[j])
        if usage_s.shape[1]:
            rest_s[j] = rest_usage_s[take[j]]
    series, places = series.T.copy(), places.T.copy()
    form, total, low = np.empty(n_b, np.float32), np.empty(n_b, np.float32), np.empty(n_b)
    order: Any = np.empty(n_a, np.int64)
    none: Any = np.int64(0)
    left, has_words = np.empty(n_a), weights[_PATH_SIGNATURE] != 0.0
    for i in range(n_a):
        left[i] = reached[i]
        if path_node >= 0:
            j = path_node
            _vectorised_costs(
                i, j, j + 1, weights, turn_rad, end_rad, next_part, usage_s, seen_danced, starts, part,
                series, take, rest_s, places, is_return, form_weight, constants, form, total,
            )  # fmt: skip
            if has_words:
                total[j] += weights[_PATH_SIGNATURE] * words_cost(i, j, seen, motifs, earlier, step_cost)
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
                    total[j] += weights[_PATH_SIGNATURE] * words_cost(i, j, seen, motifs, earlier, step_cost)
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
    evaluated by one instruction. An index that may be negative would be a branch. For literals, the
    function would be compiled once more.
    """
    begin, beyond = np.uint64(first), np.uint64(stop)
    constant, steer, continued = constants[0], (constants[2], constants[3]), next_part[i]
    turn, end_rad_i = (np.cos(turn_rad[i]), np.sin(turn_rad[i])), turn_rad[i] + end_rad[i]
    end = np.cos(end_rad_i), np.sin(end_rad_i)
    for j in range(begin, beyond):
        front = turned_cost(
            continued == part[j], turn, end, (starts[0, j], starts[1, j]), steer,
            (series[0, j], series[1, j], series[2, j], series[3, j]), constant, TURNED_TAKE,
        )  # fmt: skip
        total[j] = weights[_PATH_FRONT] * np.float32(front)
    if weights[_PATH_VARIETY] != 0.0 and usage_s.shape[1] > 0:
        for j in range(begin, beyond):
            total[j] += weights[_PATH_VARIETY] * ((usage_s[i, take[j]] + rest_s[j]) * PER_USAGE)
    if weights[_PATH_FORM] != 0.0 and len(form_weight):
        for j in range(begin, beyond):
            form[j] = np.float32(0.0)
        for m in range(len(form_weight)):
            danced, returns, weight = seen_danced[i, m], is_return[m], form_weight[m]
            for j in range(begin, beyond):
                form[j] += weight if _breaks_form(danced, places[m, j], returns) else np.float32(0.0)
        for j in range(begin, beyond):
            total[j] += weights[_PATH_FORM] * form[j]


@njit(inline="always")
def form_of(
    i: int, j: int, danced: Any, places: Any, is_return: Any, form_weight: Any
) -> Any:  # pragma: no cover - compiled
    """The `FormCost` of an edge, from positions (P, m) of the beginnings and (N, m) of the nodes."""
    form = np.float32(0.0)
    for m in range(len(form_weight)):
        broken = _breaks_form(danced[i, m], places[j, m], is_return[m])
        form += form_weight[m] if broken else np.float32(0.0)
    return form


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
    earlier, bound = repeats_of(motifs), np.empty(len(motifs))
    for j in range(len(motifs)):
        bound[j] = 0.0
        if weight != 0.0:
            for w in range(motifs.shape[1]):
                if motifs[j, w] < 0:
                    break
                count = min(fewest[motifs[j, w]] + earlier[j, w], step_cost.shape[1] - 1)
                bound[j] += weight * step_cost[motifs[j, w], count]
        bound[j] = -np.inf if least_weight < 0.0 else bound[j] - _SLACK * (1.0 + most)
    return earlier, bound


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


@njit(
    "Tuple((float64[::1], float64[::1], float64[::1], float64[::1], float32[::1], float32[::1]))("
    "float64[::1], float32[::1], float32[::1])"
)
def angles_of(turn_rad: Any, end_rad: Any, start_rad: Any) -> tuple[Any, ...]:  # pragma: no cover - compiled
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
_BEFORE = (
    "Tuple((float64[::1], float64[::1], float64[::1], float64[::1], int64[::1], float32[:,::1], "
    f"float64[:,::1], int16[:,::1], {_AT_BORDER}, int64[::1]))"
)
_NODES = (
    "Tuple((float32[::1], float32[::1], int64[::1], int64[::1], float64[:,::1], float64[:,::1], "
    f"int16[:,::1], int64[:,::1], float64[::1], float32[::1], {_AT_BORDER}))"
)
_OF_COSTS = "Tuple((bool_[::1], float32[::1], float32[:,::1], float32[:,::1], float64[::1]))"
_SCALE = np.float32(1.0 / len(BODY_JOINTS))


@njit(
    "Tuple((int32[::1], float32[::1]))(int64[::1], int64[::1], bool_, float32[::1], float32[::1], "
    f"float32[:,::1], float32[:,::1], float32[::1], {_BEFORE}, {_NODES}, {_OF_COSTS})",
    nogil=True,
    error_model="numpy",
)
def cheapest_edges(
    block: AnyInts, part: AnyInts, paired: bool, beyond: F32, most: F32, poses: F32, velocities: F32,
    weights: F32, before: Any, nodes: Any, of_costs: Any,
) -> tuple[NDArray[np.int32], F32]:  # fmt: skip  # pragma: no cover - compiled
    """The node of `block` (B,) from which each node of `part` (C,) is reached at the least cost.

    Returns its index in `block`, and the cost of the edge.

    If `paired`, the edges from each node of `block` to the node of `part` beside it.

    `poses` and `velocities` (B, C), or (B, 1), are products of those of both nodes. The terms are added as by
    `edge_costs`. If the sum of the first ones and a lower bound of the others is too large, the others are
    not evaluated.
    """
    (
        cos_turn, sin_turn, cos_end, sin_end, next_part, usage_s, danced, seen, last_sq, last_velocity_sq,
        last_speed, end, leave, last_words, last_take,
    ) = before  # fmt: skip
    (
        cos_start, sin_start, starts_part, take, series, places, motifs, earlier, bound, stay, first_sq,
        first_velocity_sq, first_speed, start, enter, first_words,
    ) = nodes  # fmt: skip
    is_return, form_weight, step_cost, transition_cost, constants = of_costs
    steer = constants[2], constants[3]
    has_usage = weights[_VARIETY] != 0.0 and usage_s.shape[1] > 0
    rows, edges = np.zeros(len(part), np.int32), np.full(len(part), np.inf, np.float32)
    starts, stays, enters, bounds = starts_part[part], stay[part], enter[part], bound[part]
    sq, velocity_sq, speeds = first_sq[part], first_velocity_sq[part], first_speed[part]
    of_pairs, velocities_of_pairs = poses.reshape(poses.size), velocities.reshape(velocities.size)
    sums = np.empty(len(part), np.float32)  # of the first terms
    for r in range(len(block)):
        i = block[r]
        turn, end_turn = (cos_turn[i], sin_turn[i]), (cos_end[i], sin_end[i])
        following, last, last_velocity = next_part[i], last_sq[i], last_velocity_sq[i]
        product, product_velocity = poses[r], velocities[r]
        if paired:
            product, product_velocity = of_pairs, velocities_of_pairs
        # Several edges are evaluated by one instruction, since these loops have no branches. Indices that may
        # be negative, and divisions that may raise an error, would be branches.
        first, stop = np.uint64(r if paired else 0), np.uint64(r + 1 if paired else len(part))
        for c in range(first, stop):
            sums[c] = weights[_COMPLETENESS] * (stays[c] if following == starts[c] else np.float32(1.0))
        if weights[_TRANSITION] != 0.0:
            for c in range(first, stop):
                sums[c] += weights[_TRANSITION] * distance_from_product(product[c], last, sq[c], _SCALE)
        if weights[_VELOCITY] != 0.0:
            for c in range(first, stop):
                change = distance_from_product(product_velocity[c], last_velocity, velocity_sq[c], _SCALE)
                sums[c] += weights[_VELOCITY] * _relative_change(change, last_speed[i], speeds[c])
        if weights[_PHRASING] != 0.0:
            for c in range(first, stop):
                jump = weights[_PHRASING] * _mean_penalty(leave[i], enters[c])
                sums[c] += np.float32(0.0) if following == starts[c] else jump
        for c in range(first, stop):
            if np.float64(beyond[r] + sums[c]) + bounds[c] > most[c]:
                continue
            j, total, continues = part[c], sums[c], following == starts[c]
            if weights[_FRONT] != 0.0:
                front = turned_cost(
                    continues, turn, end_turn, (cos_start[j], sin_start[j]), steer,
                    (series[j, 0], series[j, 1], series[j, 2], series[j, 3]), constants[0], TURNED_TAKE,
                )  # fmt: skip
                total += weights[_FRONT] * np.float32(front)
            if has_usage:
                total += weights[_VARIETY] * (usage_s[i, take[j]] * PER_USAGE)
            if repeats(last_take[i], end[i], take[j], start[j]):
                total += weights[_REPEAT]
            if weights[_FORM] != 0.0:
                total += weights[_FORM] * form_of(i, j, danced, places, is_return, form_weight)
            if weights[_SIGNATURE] != 0.0:
                total += weights[_SIGNATURE] * words_cost(i, j, seen, motifs, earlier, step_cost)
            if weights[_MOTIFS] != 0.0:
                total += weights[_MOTIFS] * transition_cost[last_words[i], first_words[j]]
            if beyond[r] + total < most[c]:
                most[c] = beyond[r] + total
                rows[c], edges[c] = r, total
    return rows, edges


@njit(
    "float32[:,::1](int64[::1], int64[::1], float32[:,::1], float32[:,::1], float32[::1], "
    f"{_BEFORE}, {_NODES}, {_OF_COSTS})",
    nogil=True,
)
def fixed_edges(
    here: AnyInts, there: AnyInts, poses: F32, velocities: F32, weights: F32, before: Any, nodes: Any,
    of_costs: Any,
) -> F32:  # fmt: skip  # pragma: no cover - compiled
    """The costs (P, N) of the edges from nodes `here` to nodes `there` that do not depend on the path.

    `poses` and `velocities` (P, N) are products of those of both nodes. The terms are added as by
    `edge_costs`.
    """
    (
        _, _, _, _, next_part, _, _, _, last_sq, last_velocity_sq, last_speed, end, leave, last_words,
        last_take,
    ) = before  # fmt: skip
    (
        _, _, starts_part, take, _, _, _, _, _, stay, first_sq, first_velocity_sq, first_speed, start, enter,
        first_words,
    ) = nodes  # fmt: skip
    transition_cost, n_b = of_costs[3], len(there)
    starts_part, take, stay, start = starts_part[there], take[there], stay[there], start[there]
    first_sq, first_velocity_sq, first_words = first_sq[there], first_velocity_sq[there], first_words[there]
    first_speed, enter = first_speed[there], enter[there]
    edges = np.empty((len(here), n_b), np.float32)
    for r in range(len(here)):
        i = here[r]
        part, last, speed, out, ends = next_part[i], last_sq[i], last_speed[i], leave[i], end[i]
        last_velocity, from_take = last_velocity_sq[i], last_take[i]
        # Several edges are evaluated by one instruction, since these loops have no branches.
        for c in range(n_b):
            edges[r, c] = weights[_COMPLETENESS] * (stay[c] if part == starts_part[c] else np.float32(1.0))
        if weights[_TRANSITION] != 0.0:
            for c in range(n_b):
                distance = distance_from_product(poses[r, c], last, first_sq[c], _SCALE)
                edges[r, c] += weights[_TRANSITION] * distance
        if weights[_VELOCITY] != 0.0:
            for c in range(n_b):
                change = distance_from_product(velocities[r, c], last_velocity, first_velocity_sq[c], _SCALE)
                edges[r, c] += weights[_VELOCITY] * _relative_change(change, speed, first_speed[c])
        if weights[_PHRASING] != 0.0:
            for c in range(n_b):
                jump = weights[_PHRASING] * _mean_penalty(out, enter[c])
                edges[r, c] += np.float32(0.0) if part == starts_part[c] else jump
        for c in range(n_b):
            again = repeats(from_take, ends, take[c], start[c])
            edges[r, c] += weights[_REPEAT] if again else np.float32(0.0)
        if weights[_MOTIFS] != 0.0:
            for c in range(n_b):
                edges[r, c] += weights[_MOTIFS] * transition_cost[last_words[i], first_words[c]]
    return edges
