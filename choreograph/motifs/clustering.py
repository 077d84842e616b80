"""Motifs: clusters of embedded motion words, each stood for by the word nearest to its middle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import ParameterError

Floats = NDArray[np.floating]
Indices = NDArray[np.int64]

MOST_MOTIFS = 500
WORDS_A_MOTIF = 20  # twelve: finer, but dances of one genre share less; sixty, as in the paper: coarse
_RESTARTS = 3
_CHUNK = 4096  # words measured at a time


@dataclass(frozen=True, eq=False)
class Motifs:
    """The vocabulary of a repertoire: which words stand for clusters, and where those lie."""

    embeddings: NDArray[np.float32]  # (K, D) of the medoids
    words: Indices  # (K,) which word each medoid is, among those that were clustered
    counts: Indices  # (K,) words in each cluster, never 0

    def __len__(self) -> int:
        return len(self.words)

    def nearest(self, embeddings: Floats) -> Indices:
        """The motif of each word, (N,), of embeddings (N, D): the closest medoid (section 3.3)."""
        vectors = _checked(embeddings, self.embeddings.shape[1])
        return _nearest(vectors, self.embeddings)


def n_motifs_for(n_words: int) -> int:
    """How many motifs to look for: one for 20 words, 500 at most (the paper's, of about 30,000 words)."""
    return max(1, min(MOST_MOTIFS, n_words // WORDS_A_MOTIF))


def find_motifs(embeddings: Floats, *, n_motifs: int | None = None, seed: int = 0) -> tuple[Motifs, Indices]:
    """Cluster embedded words by k-means and choose the medoids (Rhythm is a Dancer, section 3.3).

    Parameters
    ----------
    embeddings : float array (N, D)   of all words of all takes
    n_motifs : how many to look for; default `n_motifs_for(N)`

    Returns the motifs, the most frequent first, and the motif of every word (N,): that of its closest
    medoid. There are fewer motifs than asked for if fewer words differ. The same seed gives the same
    motifs, on any number of threads.

    Raises `ParameterError` if there is no word, a value is not finite, or `n_motifs` is not in 1 … N.
    """
    vectors = _checked(embeddings)
    if len(vectors) == 0:
        raise ParameterError("expected motion words to find motifs among, got none")
    n_motifs = n_motifs_for(len(vectors)) if n_motifs is None else n_motifs
    if not 1 <= n_motifs <= len(vectors):
        raise ParameterError(f"expected 1 to {len(vectors)} motifs, as there are words, got {n_motifs}")
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

    n_different = len(np.unique(vectors, axis=0))
    means = KMeans(min(n_motifs, n_different), n_init=_RESTARTS, random_state=seed)
    with threadpool_limits(1):  # sums over threads are not the same twice
        return means.fit(vectors).cluster_centers_


def _medoids(vectors: NDArray[np.float32], centroids: NDArray[np.float32]) -> Indices:
    """The word nearest to each centroid, each word once."""
    nearest = [_nearest(centroids[i : i + 1], vectors)[0] for i in range(len(centroids))]
    return np.unique(np.array(nearest, np.int64))


def _nearest(vectors: Floats, targets: Floats) -> Indices:
    """Index of the closest target (K, D) of every vector (N, D); of equals, the first."""
    squares = np.sum(np.square(targets, dtype=np.float64), axis=1)  # (K,)
    parts = [
        np.argmin(squares - 2.0 * (vectors[i : i + _CHUNK].astype(np.float64) @ targets.T), axis=1)
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
