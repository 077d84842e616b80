"""Compiled loops of the planner: distances from a matrix product, and the cheapest predecessor."""

from __future__ import annotations

import numpy as np
from numba import njit, prange


@njit(cache=True, parallel=True)
def root_of_differences(product, sq_a, sq_b, scale):  # pragma: no cover - compiled
    """√(scale · max(0, |a|² + |b|² - 2 a·b)) in place of a·b, (P, N) float32."""
    n_a, n_b = product.shape
    for i in prange(n_a):
        for j in range(n_b):
            d = sq_a[i] + sq_b[j] - np.float32(2.0) * product[i, j]
            product[i, j] = np.sqrt(max(d, np.float32(0.0)) * scale)
    return product


@njit(cache=True, parallel=True)
def add_scaled(total, cost, weight):  # pragma: no cover - compiled
    """total += weight · cost in place, (P, N) float32; True if every entry of cost is ≥ 0 and no nan."""
    n_a, n_b = total.shape
    sound = np.ones(n_a, np.bool_)
    for i in prange(n_a):
        good = True
        for j in range(n_b):
            c = cost[i, j]
            good = good and c >= 0
            total[i, j] += weight * c
        sound[i] = good
    return sound.all()


@njit(cache=True, parallel=True)
def cheapest_predecessor(reached, edges):  # pragma: no cover - compiled
    """min and argmin over i of reached[i] + edges[i, j]: (N,) float64 and (N,) int64."""
    n_a, n_b = edges.shape
    best = np.full(n_b, np.inf)
    who = np.zeros(n_b, np.int64)
    block = 256
    for b in prange((n_b + block - 1) // block):
        stop = min(n_b, (b + 1) * block)
        for i in range(n_a):
            r = reached[i]
            for j in range(b * block, stop):
                c = r + edges[i, j]
                if c < best[j]:
                    best[j] = c
                    who[j] = i
    return best, who
