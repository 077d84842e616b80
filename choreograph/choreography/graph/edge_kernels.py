"""Array functions for the costs of edges, some of them compiled.

Each call runs on one thread. The planner starts its own threads, which evaluate parts of a block of edges.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.core.kernel_cache import njit
from choreograph.core.numerics import AnyFloats, AnyInts

F32 = NDArray[np.float32]

# A squared distance is the difference of sums. Below this share of them, it is their rounding error, which
# depends on the number of rows that are multiplied at once.
_ROUNDING = np.float32(2e-6)


@njit(nogil=True)
def distances_from_product(
    product: F32, sq_a: F32, sq_b: F32, scale: np.float32
) -> F32:  # pragma: no cover - compiled
    """√(scale · (|a|² + |b|² - 2 a·b)), replacing the products a·b, (P, N) float32. 0 within rounding."""
    n_a, n_b = product.shape
    for i in range(n_a):
        for j in range(n_b):
            both = sq_a[i] + sq_b[j]
            d = both - np.float32(2.0) * product[i, j]
            product[i, j] = np.sqrt(d * scale) if d > _ROUNDING * both else np.float32(0.0)
    return product


@njit(nogil=True)
def revisits(
    take_a: AnyInts,
    end_a: AnyFloats,
    take_b: AnyInts,
    start_b: AnyFloats,
    min_frames: float,
    max_frames: float,
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
    mixed = keys + np.random.default_rng(seed).integers(0, 2**63, dtype=np.uint64)
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        mixed = (mixed ^ (mixed >> np.uint64(shift))) * np.uint64(factor)
    return (mixed ^ (mixed >> np.uint64(31))) / 2.0**64


def rms_distances(a: AnyFloats, b: AnyFloats) -> AnyFloats:
    """Root mean square joint distances (P, N) of poses (P, 21, 3) and (N, 21, 3)."""

    n_joints = a.shape[1]
    flat_a = np.ascontiguousarray(a, np.float32).reshape(len(a), -1)
    flat_b = np.ascontiguousarray(b, np.float32).reshape(len(b), -1)
    sq_a = np.einsum("pd,pd->p", flat_a, flat_a)
    sq_b = np.einsum("nd,nd->n", flat_b, flat_b)
    distances_m: AnyFloats = distances_from_product(flat_a @ flat_b.T, sq_a, sq_b, np.float32(1.0 / n_joints))
    return distances_m


def rms_speed_m_s(velocity_m_s: AnyFloats) -> NDArray[np.float32]:
    """Root mean square joint speeds (N,) of velocities (N, 21, 3)."""
    speed_m_s: NDArray[np.float32] = np.sqrt(
        np.einsum("njd,njd->n", velocity_m_s, velocity_m_s) / velocity_m_s.shape[1], dtype=np.float32
    )
    return speed_m_s


@njit(nogil=True)
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
    cos_steer, sin_steer = np.cos(steer_rad), np.sin(steer_rad)
    for i in range(n_a):
        cos_turn, sin_turn = np.cos(turn_rad[i]), np.sin(turn_rad[i])
        cos_a, sin_a = np.cos(turn_rad[i] + end_rad[i]), np.sin(turn_rad[i] + end_rad[i])
        for j in range(n_b):
            cosine, sine, rotated = cos_turn, sin_turn, 0.0
            if next_part[i] != part[j]:
                joined_cos = cos_a * cos_b[j] + sin_a * sin_b[j]
                joined_sin = sin_a * cos_b[j] - cos_a * sin_b[j]
                cosine, sine = 1.0, 0.0
                if joined_cos < cos_steer:
                    side = sin_steer if joined_sin >= 0 else -sin_steer
                    cosine = joined_cos * cos_steer + joined_sin * side
                    sine = joined_sin * cos_steer - joined_cos * side
                rotated = of_rotation * max(1.0 - cosine, 0.0)
            cost = constant + series[j, 0] * cosine + series[j, 1] * sine
            cost += series[j, 2] * (2.0 * cosine * cosine - 1.0) + series[j, 3] * (2.0 * sine * cosine)
            costs[i, j] = max(cost, 0.0) + rotated
    return costs
