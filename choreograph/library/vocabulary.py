"""Motion words, motifs and signatures, and the vocabulary of a repertoire (Rhythm is a Dancer, section 3).

A motion word is the motion between two beats, resampled to 13 frames in its root frame. A motif is a cluster
of embedded words and is represented by its medoid. The signature of a dance has the share of each motif. The
template of a genre is the mean signature of its dances, and its transitions say which motif follows which.

A repertoire stores the words, motifs, templates and transitions of its takes as its `Vocabulary`. The graph
needs the motif of any span of a take, which `SpanMotifLookup` finds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.core.arguments import check_choice
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import (
    AnyFloats,
    AnyInts,
    Floats,
    Indices,
    frame_blocks,
    interpolate_frames,
    squared_distances,
)
from choreograph.core.timebase import WORD_FRAMES, times_to_frames
from choreograph.library.schema import SUM_TOLERANCE, expect
from choreograph.motion.body import checked_body_pos_m, clips_to_root_frame

# Motion words: a dance segmented on its beats, each word resampled to 13 frames in its root frame.


MIN_WORD_S = 0.2  # beats that are closer count as one, since movements do not change so fast
DEFAULT_WORD_S = 0.5  # length of words where there are no beats
MAX_WORD_S = 1.5  # longer gaps, in which no beat was found, are divided evenly
WORDS_AT_ONCE = 512  # of a long dance, in whole batches of a network, so that its results stay as they are
_NEAR_GAPS = 8  # gaps between beats that determine the beat period before the first and after the last beat


@dataclass(frozen=True, eq=False)
class Words:
    """The words of one dance in order. Each begins where the one before it ends."""

    body_pos_m: Floats  # (N, 13, 21, 3) each in its root frame
    start_s: Floats  # (N,)
    end_s: Floats  # (N,)

    def __len__(self) -> int:
        return len(self.start_s)


def segment_words(body_pos_m: NDArray[np.floating], fps: float, beat_times_s: NDArray[np.floating]) -> Words:
    """Segment a dance on its beats (Rhythm is a Dancer, section 3.3).

    Parameters
    ----------
    body_pos_m : float array (T, 21, 3)   world positions at `fps`, preferably 30 or more
    beat_times_s : float array (Q,)       of the music, or of the motion where there is no music

    A word lasts from beat to beat, both included, and is resampled evenly to 13 frames, linear between
    frames. Beats outside the motion are ignored. See `word_bounds_s` for beats too close or too far apart.
    As in the paper, the duration of a word is discarded. Unlike in the paper, a word is also transformed to
    its root frame (`clips_to_root_frame`). The paper leaves that to its network.

    Returns the words, which may be none. Raises `ParameterError` if a shape is wrong or a value is not
    finite.
    """
    pos = checked_body_pos_m(body_pos_m, fps)
    return words_between(pos, fps, word_bounds_s(beat_times_s, (len(pos) - 1) / fps))


def words_between(body_pos_m: Floats, fps: float, bounds_s: Floats) -> Words:
    """As `segment_words`, for the bounds (N + 1,) of `word_bounds_s` or some of them, without checks."""
    start_s, end_s = bounds_s[:-1], bounds_s[1:]
    times = start_s[:, None] + (end_s - start_s)[:, None] * np.linspace(0.0, 1.0, WORD_FRAMES)  # (N, 13)
    body = poses_at(body_pos_m, fps, times)  # (N, 13, 21, 3)
    return Words(clips_to_root_frame(body), start_s, end_s)


def word_bounds_s(beat_times_s: NDArray[np.floating], duration_s: float) -> Floats:
    """Times (N + 1,) where words begin and end, from beats (Q,) in any order. N is 0 below two beats.

    Drops a beat less than `MIN_WORD_S` after the one before it, and divides gaps of over `MAX_WORD_S`
    evenly. Raises `ParameterError` if a beat is not finite.
    """
    beats = np.asarray(beat_times_s, np.float64)
    if beats.ndim != 1 or not np.isfinite(beats).all():
        raise ParameterError(f"expected finite beat times (Q,), got shape {beats.shape} or values not finite")
    bounds: list[float] = []
    for beat in np.sort(beats[(beats >= 0.0) & (beats <= duration_s)]):
        if not bounds:
            bounds.append(float(beat))
            continue
        gap = float(beat) - bounds[-1]
        if gap >= MIN_WORD_S:
            pieces = int(np.ceil(gap / MAX_WORD_S))
            bounds.extend(bounds[-1] + gap * np.arange(1, pieces + 1) / pieces)
    return np.array(bounds, np.float64) if len(bounds) > 1 else np.zeros(1)


def dance_bounds_s(beat_times_s: NDArray[np.floating], duration_s: float) -> Floats:
    """Times (N + 1,) where the words of a whole dance begin and end, N at least 1.

    Extends `word_bounds_s` to the start and the end of the dance with the beat period found there. If less
    than half a beat remains, no word is added: the first word begins a little after the dance does, or the
    last ends a little before. Without beats, words last `DEFAULT_WORD_S`.
    """
    inner = word_bounds_s(beat_times_s, duration_s)
    if len(inner) < 2:
        inner = np.array([0.0, min(DEFAULT_WORD_S, duration_s)])
    gaps = np.diff(inner)
    before_s, after_s = np.median(gaps[:_NEAR_GAPS]), np.median(gaps[-_NEAR_GAPS:])
    n_before, n_after = _pieces(inner[0], before_s), _pieces(duration_s - inner[-1], after_s)
    before = np.linspace(0.0, inner[0], n_before + 1)[:-1] if n_before else inner[:0]
    after = np.linspace(inner[-1], duration_s, n_after + 1)[1:] if n_after else inner[:0]
    return np.concatenate([before, inner, after])


def _pieces(gap_s: float, beat_s: float) -> int:
    """Number of words in a gap, or none if it is less than half a beat."""
    return int(np.clip(round(gap_s / beat_s), gap_s // MAX_WORD_S, gap_s // MIN_WORD_S))


def poses_at(body_pos_m: NDArray[np.floating], fps: float, times_s: NDArray[np.floating]) -> Floats:
    """Poses (..., 21, 3) of a motion (T, 21, 3) at times (...), linear between frames, constant outside."""
    return interpolate_frames(np.asarray(body_pos_m, np.float64), times_to_frames(times_s, fps))


# Signatures and motif transitions of dances (Rhythm is a Dancer, sections 3.4 and 4.3).


def signature(motifs: AnyInts, n_motifs: int) -> Floats:
    """Share of every motif, (K,), in a sequence of motifs (N,). The shares sum to 1.

    Raises `ParameterError` if the sequence is empty or has a motif outside 0 … K - 1.
    """
    sequence = checked_sequence(motifs, n_motifs)
    if len(sequence) == 0:
        raise ParameterError("expected a dance of at least one motif, got none: it has no signature")
    return np.bincount(sequence, minlength=n_motifs) / len(sequence)


def template(dances: Sequence[AnyInts], n_motifs: int) -> Floats:
    """A genre's signature, (K,): the mean of the signatures of its dances, independent of their lengths.

    Skips dances without words. Raises `ParameterError` if none is left.
    """
    signatures = [signature(dance, n_motifs) for dance in dances if len(dance)]
    if not signatures:
        raise ParameterError("expected a dance with motion words for the template, got none")
    result: Floats = np.mean(signatures, axis=0)
    return result


def transition_matrix(dances: Sequence[AnyInts], n_motifs: int) -> Floats:
    """Probability that motif j follows motif i, (K, K), counted over the dances. Rows sum to 1.

    As in the paper, pairs of consecutive motifs are counted within a dance and not smoothed. A motif may
    follow itself. Unlike in the paper, the end of a dance counts as one more transition, to all motifs in
    proportion to their frequency, so that every motif of the genre can be reached from every other. Otherwise
    a motif that only ends a dance would be an absorbing state. A motif that occurs in no dance gets the same
    proportions.

    Raises `ParameterError` if no dance has a motif, or one is outside 0 … K - 1.
    """
    sequences = [checked_sequence(dance, n_motifs) for dance in dances]
    all_motifs = np.concatenate(sequences) if sequences else np.zeros(0, np.int64)
    if len(all_motifs) == 0:
        raise ParameterError("expected a dance with motion words to count transitions, got none")
    frequency = signature(all_motifs, n_motifs)
    counts = np.zeros((n_motifs, n_motifs))
    for sequence in sequences:
        np.add.at(counts, (sequence[:-1], sequence[1:]), 1.0)
        counts[sequence[-1:]] += frequency
    totals = counts.sum(axis=1, keepdims=True)  # (K, 1)
    return np.where(totals > 0, counts / np.maximum(totals, 1.0), frequency)


def checked_sequence(motifs: AnyInts, n_motifs: int) -> NDArray[np.int64]:
    """A sequence of motifs (N,) as integers. Raises `ParameterError` unless all lie in 0 … K - 1."""
    sequence = np.asarray(motifs)
    if sequence.ndim != 1 or (len(sequence) and not np.issubdtype(sequence.dtype, np.integer)):
        raise ParameterError(f"expected motif numbers (N,), got {sequence.dtype} of shape {sequence.shape}")
    outside = sequence[(sequence < 0) | (sequence >= n_motifs)]
    if len(outside):
        raise ParameterError(f"expected motifs 0 to {n_motifs - 1}, got motif {outside[0]}")
    return sequence.astype(np.int64)


def checked_signature(values: Floats, n_motifs: int) -> Floats:
    """A signature (K,). Raises `ParameterError` unless its shares are 0 or more and sum to 1."""
    shares = np.asarray(values, np.float64)
    if shares.shape != (n_motifs,):
        raise ParameterError(f"expected a signature of {n_motifs} motifs, got an array {shares.shape}")
    if not (np.isfinite(shares).all() and (shares >= 0).all() and abs(shares.sum() - 1) <= SUM_TOLERANCE):
        raise ParameterError(
            f"expected shares of at least 0 that sum to 1 as signature, got a sum of {shares.sum():.6g}"
        )
    return shares


# Motifs: clusters of embedded motion words, each represented by its medoid.


MAX_MOTIFS = 500
WORDS_PER_MOTIF = 20  # with 12, dances of one genre share fewer motifs. 60, as in the paper, is coarse
_RESTARTS = 3
_CHUNK = 4096  # words per block of distances


@dataclass(frozen=True, eq=False)
class Motifs:
    """The motifs of a repertoire: the medoid of every cluster of words."""

    embeddings: NDArray[np.float32]
    """(K, D) embedding of each medoid, in metres of joint distance."""

    words: Indices
    """(K,) index of each medoid among the words, or of the nearest word if it was removed."""

    counts: Indices
    """(K,) number of words in each cluster, at least 1."""

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
    return Motifs(vectors[medoids[order]], medoids[order], counts[order]), np.argsort(order)[labels]


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


# The vocabulary of a repertoire.


ALL_GENRES = "all"  # the template and transitions of all takes together


class GenreTransitions:
    """The transitions (G, K, K) of a file, by genre. Those of a genre are read when they are first used.

    They are larger than all other arrays of a vocabulary together, and a dance uses those of one genre.
    """

    def __init__(self, read: Callable[[str, slice], Floats], n_genres: int) -> None:
        self._read = read
        self._genres = range(n_genres)
        self._known: dict[int, Floats] = {}

    def __iter__(self) -> Iterator[Floats]:
        return map(self.__getitem__, self._genres)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.array(list(self), dtype)

    def __getitem__(self, genre: int) -> Floats:
        row = self._genres[genre]
        if row not in self._known:
            self._known[row] = self._read("motifs/transitions", slice(row, row + 1))[0]
        return self._known[row]


@dataclass(frozen=True, eq=False)
class Vocabulary:
    """Motifs, words and genres (Rhythm is a Dancer, sections 3.3 and 3.4).

    Words are ordered by take, then by time. Within a take, each begins where the one before it ends.
    """

    motifs: Motifs
    """The K motifs, the most frequent first where they were found. Their `words` are indices of the words
    here."""

    word_take: Indices
    """(N,) index of each word's take."""

    word_start_s: Floats
    """(N,) when each word begins in its take, in seconds."""

    word_end_s: Floats
    """(N,) when each word ends in its take, in seconds."""

    word_motif: Indices
    """(N,) motif of each word."""

    genres: tuple[str, ...]
    """G names, sorted, and last `ALL_GENRES`."""

    signatures: Floats
    """(G, K) template of each genre."""

    transitions: Floats | GenreTransitions
    """(G, K, K) probabilities. Row i of a genre is of the motif after motif i."""

    @property
    def n_motifs(self) -> int:
        """Number of motifs K."""
        return len(self.motifs)

    def genre_index(self, genre: str) -> int:
        """Row of a genre. Raises `ParameterError` for an unknown one, with the known genres."""
        check_choice("a genre", genre, self.genres)
        return self.genres.index(genre)

    def words_of_motif(self, motif: int) -> Indices:
        """All words of a motif, (M,), at least one."""
        return np.flatnonzero(self.word_motif == motif)

    def words_of_take(self, take: int) -> Indices:
        """All words of a take in order, (M,), perhaps none."""
        return np.arange(*np.searchsorted(self.word_take, [take, take + 1]))  # words are ordered by take


def make_vocabulary(
    motifs: Motifs,
    word_motif: Indices,
    word_take: Indices,
    word_start_s: Floats,
    word_end_s: Floats,
    take_genres: Sequence[str],
) -> Vocabulary:
    """Templates and transitions of every genre among the takes, and of all takes together.

    `take_genres` holds the genre of every take. Takes without words are ignored, and so are genres that
    have no other takes. Raises `ParameterError` if there is no word.
    """
    words = np.split(word_motif, np.searchsorted(word_take, np.arange(1, len(take_genres))))
    danced = [(genre, sequence) for genre, sequence in zip(take_genres, words, strict=True) if len(sequence)]
    genres = (*sorted({genre for genre, _ in danced if genre and genre != ALL_GENRES}), ALL_GENRES)
    dances = [[s for genre, s in danced if name in (genre, ALL_GENRES)] for name in genres]
    k = len(motifs)
    return Vocabulary(
        motifs, word_take, word_start_s, word_end_s, word_motif, genres,
        np.stack([template(of_genre, k) for of_genre in dances]),
        np.stack([transition_matrix(of_genre, k) for of_genre in dances]),
    )  # fmt: skip


# A vocabulary as the arrays of a repertoire file, and back with every property checked.


_TOLERANCE_S = 1e-6  # between the end of a word and the beginning of the next


def motif_arrays(vocabulary: Vocabulary) -> dict[str, NDArray[Any]]:
    """The arrays of `schema.MOTIFS` by path."""
    return {
        "motifs/embeddings": vocabulary.motifs.embeddings,
        "motifs/words": vocabulary.motifs.words,
        "motifs/counts": vocabulary.motifs.counts,
        "motifs/word_take": vocabulary.word_take,
        "motifs/word_start_s": vocabulary.word_start_s,
        "motifs/word_end_s": vocabulary.word_end_s,
        "motifs/word_motif": vocabulary.word_motif,
        "motifs/genres": np.array(vocabulary.genres),
        "motifs/signatures": vocabulary.signatures,
        "motifs/transitions": np.asarray(vocabulary.transitions),
    }


def vocabulary_from(read: Callable[..., NDArray[Any]], n_takes: int) -> Vocabulary:
    """The vocabulary of a file. `read(path)` returns an array of `schema.MOTIFS`, `read(path, rows)` rows.

    Raises `RepertoireError`, without the file name, if the arrays are inconsistent.
    """
    genres = tuple(str(genre) for genre in read("motifs/genres"))
    motifs = Motifs(
        read("motifs/embeddings").astype(np.float32),
        read("motifs/words").astype(np.int64),
        read("motifs/counts").astype(np.int64),
    )
    vocabulary = Vocabulary(
        motifs,
        read("motifs/word_take").astype(np.int64),
        read("motifs/word_start_s"),
        read("motifs/word_end_s"),
        read("motifs/word_motif").astype(np.int64),
        genres,
        read("motifs/signatures"),
        GenreTransitions(read, len(genres)),
    )
    _check(vocabulary, n_takes)
    return vocabulary


def _check(vocabulary: Vocabulary, n_takes: int) -> None:
    """Raise `RepertoireError` if arrays contradict each other. Values were checked as they were read."""
    take, start_s, end_s = vocabulary.word_take, vocabulary.word_start_s, vocabulary.word_end_s
    expect(len(take) > 0, "expected motion words, got none")
    expect(
        bool((np.diff(take) >= 0).all()),
        f"expected motion words of takes 0 to {n_takes - 1} in order, got another order",
    )
    expect(bool((start_s < end_s).all()), "expected every motion word to end after it begins, got another")
    follows = np.diff(take) == 0
    expect(
        bool((np.abs(start_s[1:] - end_s[:-1])[follows] <= _TOLERANCE_S).all()),
        "expected every motion word to begin where the previous one ends, got a gap or overlap",
    )
    counts = np.bincount(vocabulary.word_motif, minlength=vocabulary.n_motifs)
    expect(
        bool((counts == vocabulary.motifs.counts).all()),
        "expected motif counts that match the motion words, got others",
    )
    genres = vocabulary.genres
    expect(
        len(set(genres)) == len(genres) and genres[-1:] == (ALL_GENRES,),
        f"expected distinct genres with {ALL_GENRES!r} last, got {', '.join(genres)}",
    )
