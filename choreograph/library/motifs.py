"""Motifs: clusters of motion words, and the motif of any span of a take."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import AnyFloats, AnyInts, Floats, Indices, frame_blocks, squared_distances
from choreograph.core.timebase import WORD_FRAMES
from choreograph.motion.body import clips_to_root_frame

# Motifs: clusters of embedded motion words, each represented by its medoid.


MAX_MOTIFS = 500
WORDS_PER_MOTIF = 20  # with 12, dances of one genre share fewer motifs. 60, as in the paper, is coarse
_RESTARTS = 3
_CHUNK = 4096  # words per block of distances


@dataclass(frozen=True, eq=False)
class Motifs:
    """The motifs of a repertoire: the medoid of every cluster of words."""

    embeddings: NDArray[np.float32]  # (K, D) of the medoids
    words: Indices  # (K,) index of each medoid among the words, or of the nearest one if it was removed
    counts: Indices  # (K,) words in each cluster, at least 1

    def __len__(self) -> int:
        return len(self.words)

    def nearest(self, embeddings: AnyFloats) -> Indices:
        """The motif of each word (N,) from its embedding (N, D): the closest medoid (section 3.3)."""
        vectors = _checked(embeddings, self.embeddings.shape[1])
        return _nearest(vectors, self.embeddings)


_SAME_M = 1e-4  # largest distance of embeddings of the same word


def n_motifs_for(n_words: int) -> int:
    """Number of motifs to search for: one per 20 words, at most 500 (as in the paper, with 30,000 words)."""
    return max(1, min(MAX_MOTIFS, n_words // WORDS_PER_MOTIF))


def find_motifs(
    embeddings: AnyFloats, *, n_motifs: int | None = None, seed: int = 0
) -> tuple[Motifs, Indices]:
    """Cluster embedded words by k-means and find the medoids (Rhythm is a Dancer, section 3.3).

    Parameters
    ----------
    embeddings : float array (N, D)   of all words of all takes
    n_motifs : number of clusters, by default `n_motifs_for(N)`

    Returns the motifs, the most frequent first, and the motif of every word (N,), which is that of its
    closest medoid. There are fewer than `n_motifs` if fewer words differ by more than rounding. The same seed
    gives the same motifs, on any number of threads.

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
        result: NDArray[np.float32] = kmeans.fit(vectors).cluster_centers_
        return result


def _medoids(vectors: NDArray[np.float32], centroids: NDArray[np.float32]) -> Indices:
    """The word nearest to each centroid. No word is used twice, nor two that are the same but for rounding.

    Otherwise rounding, which differs between CPUs, would decide which of two motifs a word shows.
    """
    nearest = [_nearest(centroids[i : i + 1], vectors)[0] for i in range(len(centroids))]
    medoids = np.unique(np.array(nearest, np.int64))
    of_medoids = vectors[medoids].astype(np.float64)
    is_same = squared_distances(of_medoids, of_medoids) < _SAME_M**2  # (K, K)
    is_first = ~np.tril(is_same, -1).any(axis=1)
    return medoids[is_first]


def _nearest(vectors: AnyFloats, targets: AnyFloats) -> Indices:
    """Index of the closest target (K, D) of every vector (N, D), or the first of several closest ones."""
    to = np.asarray(targets, np.float64)
    squares = np.sum(to**2, axis=1)  # (K,)
    parts = [
        np.argmin(
            squared_distances(vectors[i : i + _CHUNK].astype(np.float64), to, b_squares=squares), axis=1
        )
        for i in range(0, len(vectors), _CHUNK)
    ]
    return np.concatenate(parts) if parts else np.zeros(0, np.int64)


def _checked(embeddings: AnyFloats, dim: int | None = None) -> NDArray[np.float32]:
    vectors = np.asarray(embeddings, np.float32)
    if vectors.ndim != 2 or (dim is not None and vectors.shape[1] != dim):
        raise ParameterError(f"expected embeddings (N, {dim or 'D'}), got {vectors.shape}")
    if not np.isfinite(vectors).all():
        raise ParameterError("expected finite embeddings, got nan or infinity")
    return vectors


# The motif of any span of a take.


_START_STEP_S = 0.05
_LENGTH_STEP = 1.15  # factor between length bins
_LENGTHS = 64  # length bins from 0.05 s on: more than any word needs
_MIN_LENGTH_S = 0.05
_STARTS = 2**21  # start bins: more than a day
_AT_ONCE = 128  # words, always as many: the rounding of a product of matrices depends on their number


KnownSpans = tuple[Indices, NDArray[np.int16]]  # increasing keys (N,) of spans, and their motifs (N,)


def _joined(some: KnownSpans, others: KnownSpans) -> KnownSpans:
    """The spans of both, which have no key in common."""
    keys, motifs = np.concatenate([some[0], others[0]]), np.concatenate([some[1], others[1]])
    order = np.argsort(keys)
    return keys[order], motifs[order]


class SpanMotifLookup:
    """Motifs of spans of takes, for the graph.

    In the graph a word is the motion between two beats of the music. That may be any span of a take, not only
    the words that the vocabulary segmented on the beats of the take. Spans are quantised, to 0.05 s in time
    and 15 % in length, and embedded on first use: a song needs a small part of all spans.

    `poses_at` returns poses (N, 13, 21, 3) of takes (N,) at times (N, 13). `embed` returns embeddings (N, D)
    of words (N, 13, 21, 3), as `nets.words.WordNet.embed` does.
    """

    def __init__(
        self,
        poses_at: Callable[[AnyInts, AnyFloats], Floats],
        embed: Callable[[AnyFloats], NDArray[np.float32]],
        motifs: Motifs,
    ) -> None:
        self._poses_at = poses_at
        self._embed = embed
        self._motifs = motifs
        self._known: KnownSpans = (np.zeros(0, np.int64), np.zeros(0, np.int16))

    @property
    def known(self) -> KnownSpans:
        """The keys (N,) of the spans that are known, increasing, and their motifs (N,)."""
        return self._known

    def add(self, keys: Indices, motifs: NDArray[np.int16]) -> None:
        """Add the `known` spans of another lookup with the same takes, motifs and network."""
        known = self._known  # of one moment, since threads may share a lookup
        new = ~np.isin(keys, known[0])
        self._known = _joined(known, (keys[new], motifs[new]))

    def motifs_of(self, take: Indices, start_s: AnyFloats, stop_s: AnyFloats) -> NDArray[np.int16]:
        """Motifs (...) of spans, all arrays (...). Beyond its ends a take holds its first or last pose."""
        length_s = np.maximum(np.asarray(stop_s) - start_s, _MIN_LENGTH_S)
        length = np.round(np.log(length_s / _MIN_LENGTH_S) / np.log(_LENGTH_STEP)).astype(np.int64)
        # Bins are those of the middle, not of the start, since the middle does not move when the length is
        # quantised.
        middle = np.maximum((np.asarray(start_s) + stop_s) / 2, 0.0)
        key = np.round(middle / _START_STEP_S).astype(np.int64) * _LENGTHS + np.minimum(length, _LENGTHS - 1)
        key += np.asarray(take, np.int64) * (_STARTS * _LENGTHS)
        unique, inverse = np.unique(key, return_inverse=True)
        known = self._known
        new = np.setdiff1d(unique, known[0], assume_unique=True)
        if len(new):
            known = self._known = _joined(known, (new, self._motifs_of_keys(new)))
        keys, motifs = known
        return motifs[np.searchsorted(keys, unique)][inverse].reshape(key.shape)

    def _motifs_of_keys(self, keys: Indices) -> NDArray[np.int16]:
        takes, bins = np.divmod(keys, _STARTS * _LENGTHS)
        middle_s = bins // _LENGTHS * _START_STEP_S
        length_s = _MIN_LENGTH_S * _LENGTH_STEP ** (bins % _LENGTHS)
        found = np.empty(len(keys), np.int16)
        for batch in frame_blocks(len(keys), _AT_ONCE):
            n_words = batch.stop - batch.start
            words = self._words(takes[batch], middle_s[batch], length_s[batch])
            filled = np.concatenate([words, np.zeros((_AT_ONCE - n_words, *words.shape[1:]), words.dtype)])
            found[batch] = self._motifs.nearest(self._embed(filled))[:n_words]
        return found

    def _words(self, take: Indices, middle_s: AnyFloats, length_s: AnyFloats) -> AnyFloats:
        """Words (N, 13, 21, 3) around the given middles in their takes (N,), in their root frames."""
        times_s = middle_s[:, None] + length_s[:, None] * np.linspace(-0.5, 0.5, WORD_FRAMES)  # (N, 13)
        return clips_to_root_frame(self._poses_at(take, times_s))
