"""Selection of the K clips that are candidates in each second of a dance."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import AnyFloats, AnyInts, Floats, squared_distances
from choreograph.core.timebase import CLIP_S
from choreograph.library.vocabulary import Vocabulary

# The effort of motion, its size and the density of its steps, for a part of the song (not in the paper).
#
# Effort cannot be learned from pairs of music and motion. The dancers of dance-with-melody move in the
# softest part of a song almost as in the loudest (0.97 of the speed). It is therefore a rule: loud parts get
# large motion, and parts with many onsets get many steps. Motion is ranked within its genre, from 0 to 1.
# Clips are selected by their rank, and nodes have a cost for it (`choreography.graph.costs`).


def energy_mismatch(louder: float, liveliness: AnyFloats) -> AnyFloats:
    """Mismatch of ranks of liveliness (N,) with a part that is `louder` than its song, -1 … 1.

    A part that is as loud as the song on average has no mismatch.
    """
    return 2.0 * abs(louder) * (1.0 - liveliness if louder > 0 else liveliness)


def steps_mismatch(onset_density: float, steps: AnyFloats) -> AnyFloats:
    """Mismatch of ranks of steps (N,) with the density of onsets, as a rank in the song."""
    mismatch: AnyFloats = np.abs(steps - onset_density)
    return mismatch


# The distance of music from the genres of a repertoire, in the space of style vectors.


_RIDGE = 0.3  # of the mean variance: limits the influence of single clips of a genre
_LEAST_VARIANCE = 1e-4  # of style vectors of length 1, where clips of real takes have 3e-3


def genre_distances(
    music_style: NDArray[np.floating], clip_style: NDArray[np.floating], clip_genre: NDArray[np.integer]
) -> Floats:
    """Squared Mahalanobis distance (S, G) of each second's style (S, D) from the mean clip of each genre.

    `clip_style` (N, D) are the clips' styles and `clip_genre` (N,) their genres 0 … G - 1, each of at least
    one clip. The covariance is that of the clips within their genres, pooled (linear discriminant analysis).
    Directions in which the takes of every genre vary therefore have little weight.
    """
    style = np.asarray(clip_style, np.float64)
    n_genres = int(clip_genre.max()) + 1
    means = np.stack([style[clip_genre == genre].mean(axis=0) for genre in range(n_genres)])  # (G, D)
    within = style - means[clip_genre]
    covariance = within.T @ within / len(within)  # (D, D)
    ridge = max(_RIDGE * np.trace(covariance) / len(covariance), _LEAST_VARIANCE)
    away = np.asarray(music_style, np.float64)[:, None] - means  # (S, G, D)
    precision = np.linalg.inv(covariance + ridge * np.eye(len(covariance)))
    distances: Floats = np.einsum("sgd,de,sge->sg", away, precision, away, optimize=True)
    return distances


# Selection by signature. Clips with the motifs that it needs come first.


def clip_signature_mismatch(
    vocabulary: Vocabulary,
    signature: Floats,
    clip_take: NDArray[np.integer],
    clip_start_s: Floats,
    *,
    n_words: int,
) -> Floats:
    """Mismatch (N,) of each clip with a signature (K,), for a dance of `n_words` words.

    It is the mean over the clip's words of (1 - n) / (1 + n), with n the expected count of the word's motif.
    This is the cost of the word as the first one of a dance (`choreography.graph.motif_costs.Signature`). The
    mismatch is -1 if all motifs are frequent, 1 if none is expected, and 0 for a clip without words. Words
    are those that were segmented on the beats of the take.
    """
    expected = n_words * signature[vocabulary.word_motif]  # (W,)
    word_cost = (1.0 - expected) / (1.0 + expected)
    middle_s = (vocabulary.word_start_s + vocabulary.word_end_s) / 2
    mismatch = np.zeros(len(clip_take))
    order = np.argsort(clip_take, kind="stable")
    takes, firsts = np.unique(clip_take[order], return_index=True)
    for take, clips in zip(takes.tolist(), np.split(order, firsts[1:]), strict=True):
        words = vocabulary.words_of_take(take)
        sums = np.concatenate([[0.0], np.cumsum(word_cost[words])])
        first, last = (
            np.searchsorted(middle_s[words], clip_start_s[clips] + edge_s) for edge_s in (0.0, CLIP_S)
        )
        mismatch[clips] = (sums[last] - sums[first]) / np.maximum(last - first, 1)
    return mismatch


# The paper's style-based selection.


_BLOCK_BYTES = 64e6


def select_clips(
    music_style: NDArray[np.floating],
    music_beat_count: NDArray[np.floating],
    clip_style: NDArray[np.floating],
    clip_beat_count: NDArray[np.floating],
    *,
    candidates: int,
    beat_weight: float,
    penalty: Callable[[int], NDArray[np.floating]] | None = None,
) -> NDArray[np.int64]:
    """The clips with the smallest style loss for each music segment, best first.

    Parameters
    ----------
    music_style : float array (S, D)        s_m of the 4 s from every second
    music_beat_count : float array (S,)     B_m(s_m)
    clip_style : float array (N, D)         s_x of every clip's middle 4 s
    clip_beat_count : float array (N,)      motion beats in the clip's middle 4 s
    candidates : int                        K. All clips if there are fewer
    beat_weight : float                     λ_b against λ_cs = 1, as in training
    penalty : second -> float array (N,)    added to the losses of the clips

    Returns
    -------
    int array (S, min(K, N))   of two equal clips, the earlier one is taken

    Raises
    ------
    ParameterError   if there are no clips, or `candidates` is less than 1

    References
    ----------
    ChoreoGraph, section 3.1, equation 1.
    """
    if candidates < 1:
        raise ParameterError(f"expected at least 1 candidate, got {candidates}")
    n_clips = len(clip_style)
    if n_clips == 0:
        raise ParameterError("expected clips to select from, got none: every take is shorter than 8 s")
    k = min(candidates, n_clips)
    chosen = np.empty((len(music_style), k), np.int64)
    losses = style_losses(
        music_style, music_beat_count, clip_style, clip_beat_count, beat_weight=beat_weight
    )  # fmt: skip
    for start, loss in losses:
        if penalty is not None:
            loss = loss + np.stack([penalty(start + row) for row in range(len(loss))])
        if k < n_clips:
            nearest = np.argpartition(loss, k - 1, axis=1)[:, :k]
            nearest.sort(axis=1)
        else:
            nearest = np.broadcast_to(np.arange(n_clips), loss.shape)
        order = np.argsort(np.take_along_axis(loss, nearest, axis=1), axis=1, kind="stable")
        chosen[start : start + len(loss)] = np.take_along_axis(nearest, order, axis=1)
    return chosen


def style_losses(
    music_style: NDArray[np.floating],
    music_beat_count: NDArray[np.floating],
    clip_style: NDArray[np.floating],
    clip_beat_count: NDArray[np.floating],
    *,
    beat_weight: float,
) -> Iterator[tuple[int, NDArray[np.floating]]]:
    """Equation 1 for every music segment and clip, in blocks of seconds: (first second, loss (B, N))."""
    block = max(1, int(_BLOCK_BYTES / (8 * len(clip_style))))
    clip_squares = np.sum(clip_style**2, axis=1)
    for start in range(0, len(music_style), block):
        style = music_style[start : start + block]  # (B, D)
        loss = np.sqrt(squared_distances(style, clip_style, b_squares=clip_squares))  # (B, N)
        yield (
            start,
            loss + beat_weight * np.abs(music_beat_count[start : start + block, None] - clip_beat_count),
        )


# Random selection among the clips that suit the music, for varied dances (not in the paper).


Mask = NDArray[np.bool_]

_SUITABLE_SHARE = 0.5  # least share of the candidates


class ClipPriorities:
    """Random numbers by which clips are drawn. They stay the same while a take is continued.

    The clip that begins one second later in a take has the same number one second later in the song. A take
    that is drawn can therefore be danced to its end, even with few candidates.

    Raises `ParameterError` if there are no clips.
    """

    def __init__(self, clip_take: NDArray[np.integer], n_seconds: int, rng: np.random.Generator) -> None:
        if len(clip_take) == 0:
            raise ParameterError("expected clips to draw from, got none: every take is shorter than 8 s")
        n_clips = np.bincount(clip_take)  # of each take
        first_clip = np.cumsum(n_clips) - n_clips
        first_slot = first_clip + n_seconds * np.arange(len(n_clips))
        in_take = np.arange(len(clip_take)) - first_clip[clip_take]
        self._slots = first_slot[clip_take] + in_take + n_seconds - 1  # (N,) in the first second
        self._numbers = rng.random(len(clip_take) + n_seconds * len(n_clips))

    def numbers(self, second: int) -> NDArray[np.float64]:
        """A number from 0 to 1 for each clip (N,)."""
        numbers: NDArray[np.float64] = self._numbers[self._slots - second]
        return numbers


def draw_clips(
    priorities: ClipPriorities,
    n_seconds: int,
    *,
    candidates: int,
    rank: Callable[[int], AnyInts],
    suits: Callable[[int], Mask] | None = None,
) -> NDArray[np.int64]:
    """Clips drawn at random for each second. At least half of them suit it, if there are enough.

    Parameters
    ----------
    priorities : the random numbers of the clips. The clips with the lowest are drawn first
    candidates : int                        K. All clips if there are fewer
    rank : second -> int array (N,)         clips of rank 1 are drawn only if there are too few of rank 0,
                                            and so on
    suits : second -> bool array (N,)       which clips suit the music, by default all of them

    Returns
    -------
    int array (S, min(K, N)), suitable ones first.

    Raises
    ------
    ParameterError   if `candidates` is less than 1
    """
    if candidates < 1:
        raise ParameterError(f"expected at least 1 candidate, got {candidates}")
    chosen = []
    for second in range(n_seconds):
        ranks = rank(second)
        numbers = priorities.numbers(second) + ranks  # (N,)
        k = min(candidates, len(numbers))
        suitable = np.zeros(0, np.int64)
        if suits is not None:
            suitable = np.flatnonzero(suits(second) & (ranks == 0))
            suitable = suitable[np.argsort(numbers[suitable])[: round(_SUITABLE_SHARE * k)]]
            numbers[suitable] = np.inf
        n_others = k - len(suitable)
        others = np.argpartition(numbers, n_others - 1)[:n_others]
        chosen.append(np.concatenate([suitable, others]))
    return np.stack(chosen)
