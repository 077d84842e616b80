"""Compiled edges from the nodes of one second to those of the next, by the built-in costs."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.graph.cost import distance_from_product, turned_cost
from choreograph.choreography.graph.costs import OVERLAP_FRAMES, STILL_M_S, TURNED_TAKE
from choreograph.choreography.graph.path_kernels import PER_USAGE, form_of, words_of
from choreograph.core.kernel_cache import njit
from choreograph.core.numerics import AnyInts
from choreograph.core.timebase import CLIP_FRAMES
from choreograph.motion.body import BODY_JOINTS

F32 = NDArray[np.float32]
_STILL = np.float32(STILL_M_S)


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
_SCALE, _HALF = np.float32(1.0 / len(BODY_JOINTS)), np.float32(0.5)


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
        cos_start, sin_start, starts_part, take, series, places, motifs, repeats, bound, stay, first_sq,
        first_velocity_sq, first_speed, start, enter, first_words,
    ) = nodes  # fmt: skip
    is_return, form_weight, step_cost, transition_cost, constants = of_costs
    steer = constants[2], constants[3]
    has_usage = weights[5] != 0.0 and usage_s.shape[1] > 0
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
            sums[c] = weights[0] * (stays[c] if following == starts[c] else np.float32(1.0))
        if weights[1] != 0.0:
            for c in range(first, stop):
                sums[c] += weights[1] * distance_from_product(product[c], last, sq[c], _SCALE)
        if weights[2] != 0.0:
            for c in range(first, stop):
                change = distance_from_product(product_velocity[c], last_velocity, velocity_sq[c], _SCALE)
                sums[c] += weights[2] * (change / (_HALF * (last_speed[i] + speeds[c]) + _STILL))
        if weights[3] != 0.0:
            for c in range(first, stop):
                jump = weights[3] * (_HALF * (leave[i] + enters[c]))
                sums[c] += np.float32(0.0) if following == starts[c] else jump
        for c in range(first, stop):
            if np.float64(beyond[r] + sums[c]) + bounds[c] > most[c]:
                continue
            j, total, continues = part[c], sums[c], following == starts[c]
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
            edges[r, c] = weights[0] * (stay[c] if part == starts_part[c] else np.float32(1.0))
        if weights[1] != 0.0:
            for c in range(n_b):
                edges[r, c] += weights[1] * distance_from_product(poses[r, c], last, first_sq[c], _SCALE)
        if weights[2] != 0.0:
            for c in range(n_b):
                change = distance_from_product(velocities[r, c], last_velocity, first_velocity_sq[c], _SCALE)
                edges[r, c] += weights[2] * (change / (_HALF * (speed + first_speed[c]) + _STILL))
        if weights[3] != 0.0:
            for c in range(n_b):
                jump = weights[3] * (_HALF * (out + enter[c]))
                edges[r, c] += np.float32(0.0) if part == starts_part[c] else jump
        for c in range(n_b):
            overlaps = (from_take == take[c]) & (OVERLAP_FRAMES < ends - start[c] < CLIP_FRAMES)
            edges[r, c] += weights[6] if overlaps else np.float32(0.0)
        if weights[9] != 0.0:
            for c in range(n_b):
                edges[r, c] += weights[9] * transition_cost[last_words[i], first_words[c]]
    return edges
