"""Compiled loops of the planner: distances from a matrix product, and the cheapest predecessor.

One thread a call: the planner prices parts of a block of edges in threads of its own.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def root_of_differences(product, sq_a, sq_b, scale):  # pragma: no cover - compiled
    """√(scale · max(0, |a|² + |b|² - 2 a·b)) in place of a·b, (P, N) float32."""
    n_a, n_b = product.shape
    for i in range(n_a):
        for j in range(n_b):
            d = (sq_a[i] + sq_b[j] - np.float32(2.0) * product[i, j]) * scale
            product[i, j] = np.sqrt(d if d > np.float32(0.0) else np.float32(0.0))
    return product


@njit(cache=True, nogil=True)
def cheapest_predecessor(reached, edges):  # pragma: no cover - compiled
    """The row i with the least reached[i] + edges[i, j] for every column, (N,) int32; float32 in."""
    n_a, n_b = edges.shape
    who = np.zeros(n_b, np.int32)
    block = 512
    for b in range((n_b + block - 1) // block):
        best = np.full(block, np.float32(np.inf))
        first = b * block
        width = min(block, n_b - first)
        for i in range(n_a):
            r = reached[i]
            for j in range(width):
                c = r + edges[i, first + j]
                if c < best[j]:
                    best[j] = c
                    who[first + j] = i
    return who


@njit(cache=True, nogil=True)
def goes_back(take_a, end_a, take_b, start_b, least, most):  # pragma: no cover - compiled
    """1 where b's take is a's and b starts more than `least` and less than `most` before a ends, (P, N)."""
    n_a, n_b = len(take_a), len(take_b)
    back = np.zeros((n_a, n_b), np.float32)
    for i in range(n_a):
        for j in range(n_b):
            if take_a[i] == take_b[j] and least < end_a[i] - start_b[j] < most:
                back[i, j] = 1.0
    return back


@njit(cache=True, nogil=True)
def prices_after(step, danced, motifs):  # pragma: no cover - compiled
    """Sum over a node's motifs of step[motif, times danced before], (P, N) float32.

    step (K, C) float32; danced (P, K) on the way to each predecessor; motifs (N, W) padded with -1.
    """
    n_a, n_b, width = len(danced), len(motifs), motifs.shape[1]
    n_motifs, most = step.shape
    again = np.zeros((n_b, width), np.int64)  # how often a node has danced the motif before
    for j in range(n_b):
        for w in range(width):
            for v in range(w):
                again[j, w] += motifs[j, v] == motifs[j, w]
    price = np.empty(n_motifs, np.float32)
    total = np.zeros((n_a, n_b), np.float32)
    for i in range(n_a):
        for k in range(n_motifs):
            price[k] = step[k, min(danced[i, k], most - 1)]
        for j in range(n_b):
            cost = np.float32(0.0)
            for w in range(width):
                motif = motifs[j, w]
                if motif < 0:
                    break
                if again[j, w] == 0:
                    cost += price[motif]
                else:
                    cost += step[motif, min(danced[i, motif] + again[j, w], most - 1)]
            total[i, j] = cost
    return total
