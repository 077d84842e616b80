"""Motifs: clusters of embedded motion words, each represented by its medoid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.distances import squared_distances
from choreograph.errors import ParameterError

Floats = NDArray[np.floating]
Indices = NDArray[np.int64]

MAX_MOTIFS = 500
WORDS_PER_MOTIF = 20  # with 12, dances of one genre share fewer motifs; 60, as in the paper, is coarse
_RESTARTS = 3
_CHUNK = 4096  # words per block of distances


@dataclass(frozen=True, eq=False)
class Motifs:
    """The motifs of a repertoire: the medoid of every cluster of words."""

    embeddings: NDArray[np.float32]  # (K, D) of the medoids
    words: Indices  # (K,) index of each medoid among the words that were clustered
    counts: Indices  # (K,) words in each cluster, at least 1

    def __len__(self) -> int:
        return len(self.words)

    def nearest(self, embeddings: Floats) -> Indices:
        """The motif of each word (N,) from its embedding (N, D): the closest medoid (section 3.3)."""
        vectors = _checked(embeddings, self.embeddings.shape[1])
        return _nearest(vectors, self.embeddings)


def n_motifs_for(n_words: int) -> int:
    """Number of motifs to look for: one per 20 words, at most 500 (as in the paper, with 30,000 words)."""
    return max(1, min(MAX_MOTIFS, n_words // WORDS_PER_MOTIF))


def find_motifs(embeddings: Floats, *, n_motifs: int | None = None, seed: int = 0) -> tuple[Motifs, Indices]:
    """Cluster embedded words by k-means and find the medoids (Rhythm is a Dancer, section 3.3).

    Parameters
    ----------
    embeddings : float array (N, D)   of all words of all takes
    n_motifs : number of clusters; default `n_motifs_for(N)`

    Returns the motifs, the most frequent first, and the motif of every word (N,): that of its closest
    medoid. There are fewer than `n_motifs` if fewer words are distinct. The same seed gives the same
    motifs, on any number of threads.

    Raises `ParameterError` if there is no word, a value is not finite, or `n_motifs` is not in 1 … N.
    """
    vectors = _checked(embeddings)
    if len(vectors) == 0:
        raise ParameterError("expected motion words to cluster, got none")
    n_motifs = n_motifs_for(len(vectors)) if n_motifs is None else n_motifs
    if not 1 <= n_motifs <= len(vectors):
        raise ParameterError(f"expected 1 to {len(vectors)} motifs for as many words, got {n_motifs}")
    medoids = _medoids(vectors, _centroids(vectors, n_motifs, seed))
    labels = _nearest(vectors, vectors[medoids])
    counts = np.bincount(labels, minlength=len(medoids))
    order = np.argsort(-counts, kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return Motifs(vectors[medoids[order]], medoids[order], counts[order]), rank[labels]


def _centroids(vectors: NDArray[np.float32], n_motifs: int, seed: int) -> NDArray[np.float32]:
    from sklearn.cluster import KMeans
    from threadpoolctl import threadpool_limits

    n_distinct = len(np.unique(vectors, axis=0))
    kmeans = KMeans(min(n_motifs, n_distinct), n_init=_RESTARTS, random_state=seed)
    with threadpool_limits(1):  # the order of sums over threads varies
        return kmeans.fit(vectors).cluster_centers_


def _medoids(vectors: NDArray[np.float32], centroids: NDArray[np.float32]) -> Indices:
    """The word nearest to each centroid; each word at most once."""
    nearest = [_nearest(centroids[i : i + 1], vectors)[0] for i in range(len(centroids))]
    return np.unique(np.array(nearest, np.int64))


def _nearest(vectors: Floats, targets: Floats) -> Indices:
    """Index of the closest target (K, D) of every vector (N, D); the first of equal ones."""
    to = np.asarray(targets, np.float64)
    squares = np.sum(to**2, axis=1)  # (K,)
    parts = [
        np.argmin(
            squared_distances(vectors[i : i + _CHUNK].astype(np.float64), to, b_squares=squares), axis=1
        )
        for i in range(0, len(vectors), _CHUNK)
    ]
    return np.concatenate(parts) if parts else np.zeros(0, np.int64)


def _checked(embeddings: Floats, dim: int | None = None) -> NDArray[np.float32]:
    vectors = np.asarray(embeddings, np.float32)
    if vectors.ndim != 2 or (dim is not None and vectors.shape[1] != dim):
        raise ParameterError(f"expected embeddings (N, {dim or 'D'}), got {vectors.shape}")
    if not np.isfinite(vectors).all():
        raise ParameterError("expected finite embeddings, got nan or infinity")
    return vectors
