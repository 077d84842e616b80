"""Compiled loops of the planners: edge costs, and the cheapest predecessor of each node.

Each call runs on one thread: the planner evaluates parts of a block of edges in threads of its own.
"""

from __future__ import annotations

import numpy as np

from choreograph.kernel_cache import njit

# A squared distance is the difference of sums: below this share of them it is their rounding error, which
# depends on how many rows are multiplied at once.
_ROUNDING = np.float32(2e-6)


@njit(nogil=True)
def distances_from_product(product, sq_a, sq_b, scale):  # pragma: no cover - compiled
    """√(scale · (|a|² + |b|² - 2 a·b)) in place of the products a·b, (P, N) float32; 0 within rounding."""
    n_a, n_b = product.shape
    for i in range(n_a):
        for j in range(n_b):
            both = sq_a[i] + sq_b[j]
            d = both - np.float32(2.0) * product[i, j]
            product[i, j] = np.sqrt(d * scale) if d > _ROUNDING * both else np.float32(0.0)
    return product


@njit(nogil=True)
def cheapest_predecessor(reached, edges):  # pragma: no cover - compiled
    """The row i with the least reached[i] + edges[i, j] for every column, (N,) int32; float32 in."""
    n_a, n_b = edges.shape
    parent = np.zeros(n_b, np.int32)
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
                    parent[first + j] = i
    return parent


@njit(nogil=True)
def revisits(take_a, end_a, take_b, start_b, min_frames, max_frames):  # pragma: no cover - compiled
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


@njit(nogil=True)
def motif_count_costs(step_cost, counts, motifs):  # pragma: no cover - compiled
    """Sum over a node's motifs of step_cost[motif, times danced before], (P, N) float32.

    step_cost (K, C) float32; counts (P, K) along the path to each predecessor; motifs (N, W) padded with -1.
    """
    n_a, n_b, width = len(counts), len(motifs), motifs.shape[1]
    n_motifs, n_counts = step_cost.shape
    repeats = np.zeros((n_b, width), np.int64)  # how often the node itself has danced the motif before
    for j in range(n_b):
        for w in range(width):
            for v in range(w):
                repeats[j, w] += motifs[j, v] == motifs[j, w]
    next_cost = np.empty(n_motifs, np.float32)
    total = np.zeros((n_a, n_b), np.float32)
    for i in range(n_a):
        for k in range(n_motifs):
            next_cost[k] = step_cost[k, min(counts[i, k], n_counts - 1)]
        for j in range(n_b):
            cost = np.float32(0.0)
            for w in range(width):
                motif = motifs[j, w]
                if motif < 0:
                    break
                if repeats[j, w] == 0:
                    cost += next_cost[motif]
                else:
                    cost += step_cost[motif, min(counts[i, motif] + repeats[j, w], n_counts - 1)]
            total[i, j] = cost
    return total
