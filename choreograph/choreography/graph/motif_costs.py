"""The motifs of nodes, and costs of motifs."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.graph.cost import Cost, CostContext, Goals
from choreograph.choreography.graph.layers import Layer
from choreograph.choreography.graph.segments import ClipTable, Segments
from choreograph.choreography.motif_sequences import MotifGoal
from choreograph.core.kernel_cache import njit
from choreograph.core.numerics import AnyFloats, AnyInts
from choreograph.core.timebase import NET_FPS, SEGMENT_FRAMES, SEGMENT_S
from choreograph.library.vocabulary import dance_bounds_s
from choreograph.music.song_features import SongFeatures

# The motifs of each node.
#
# Words last from music beat to music beat. A word belongs to the second of the song that contains its middle.


MotifsOf = Callable[[NDArray[np.int64], AnyFloats, AnyFloats], NDArray[np.integer]]

NO_MOTIF = -1
_BLOCK_S = 64  # seconds of the song whose spans are in memory at a time, 0.5 MB each


def node_motifs(
    segments: Segments, clips: ClipTable, word_bounds_s: AnyFloats, motifs_of: MotifsOf
) -> NDArray[np.int16]:
    """Motifs of the nodes of all warped segments.

    Parameters
    ----------
    word_bounds_s : float array (Q + 1,)   times where the song's words begin and end, of `song_words_s`
    motifs_of : (take, start_s, stop_s) -> motifs, arrays (M,), as of `library.vocabulary.SpanMotifLookup`

    Returns
    -------
    int array (S, K, 4, W), in order, padded with -1. All nodes of a second have the same number. Where a word
    extends beyond its segment, the time map is extrapolated.
    """
    n_seconds, k = segments.clip.shape
    owner = np.floor((word_bounds_s[1:] + word_bounds_s[:-1]) / 2).astype(np.int64)  # (Q,) second of the song
    words = [np.flatnonzero(owner == second) for second in range(n_seconds + SEGMENT_S - 1)]
    width = max((len(w) for w in words), default=0)
    motifs = np.full((n_seconds, k, SEGMENT_S, width), NO_MOTIF, np.int16)
    for first in range(0, n_seconds, _BLOCK_S):
        requests, takes, starts, stops = [], [], [], []
        for second in range(first, min(first + _BLOCK_S, n_seconds)):
            inside = np.concatenate(words[second : second + SEGMENT_S])
            clip = segments.clip[second]
            bounds = np.stack([word_bounds_s[inside], word_bounds_s[inside + 1]])  # (2, M)
            frames = clips.start_frame[clip, None, None] + _source_frames(
                segments.maps(np.full(k, second), np.arange(k)), bounds - second
            )
            requests.append((second, inside, owner[inside] - second))
            takes.append(np.repeat(clips.take[clip], len(inside)))
            starts.append(frames[:, 0].ravel() / NET_FPS)
            stops.append(frames[:, 1].ravel() / NET_FPS)
        labels = motifs_of(*(np.concatenate(parts) for parts in (takes, starts, stops)))
        stop = 0
        for second, inside, offset in requests:
            start, stop = stop, stop + k * len(inside)
            slot = inside - np.array([words[second + o][0] for o in offset], np.int64)
            motifs[second][:, offset, slot] = labels[start:stop].reshape(k, len(inside))
    return motifs


def _source_frames(maps: NDArray[np.floating], times_s: AnyFloats) -> NDArray[np.float64]:
    """Clip frames (K, ...) of times (...) in a segment by its time maps (K, 81), extrapolated outside."""
    frames = np.asarray(times_s) * NET_FPS
    low = np.clip(np.floor(frames).astype(np.int64), 0, SEGMENT_FRAMES - 1)
    return maps[:, low] + (frames - low) * (maps[:, low + 1] - maps[:, low]).astype(np.float64)


# Costs by which a dance follows a genre: its motif signature and its motif transitions.


_MIN_PROBABILITY = 1e-3  # transitions that never occur cost as much as those that occur once in a thousand


class Signature(Cost):
    """χ² distance of the signature of each part of the dance to its goal's (Rhythm is a Dancer, equation 11).

    The mean over the seconds of a part is the distance of the finished part. With counts c_k of the part so
    far, N words in it and the goal's signature s_k, the distance is Σ_k ½ (c_k - N s_k)² / (c_k + N s_k) / N.
    It is a sum over motifs, so each word costs the change that it makes: from -1 for a missing motif to 1 for
    a motif that is too frequent, times the seconds per word. The counts are those along the path to a node
    (`Danced.motif_counts`), as in equation 5. There, a motif is missing compared with the dance so far, here
    compared with the whole part. The paper has one goal for the whole song. Raise its weight for motifs whose
    shares are nearer to those of the goal.
    """

    default_weight = 3.0
    sentence = "The motifs differ from those that were asked for."
    is_compiled = True
    of_path = True
    min_path_cost = 0.0

    @classmethod
    def for_dance(cls, context: CostContext) -> Signature | None:
        return cls(context.goals, context.song_features) if context.goals else None

    def __init__(self, goals: Goals, song_features: SongFeatures) -> None:
        self._part = _part_at(goals, song_features)
        stops = [*(second for second, _ in goals[1:]), song_features.n_seconds]
        self._step_cost = [
            _signature_steps(goal, words_between(song_features, first, stop), stop - first)
            for (first, goal), stop in zip(goals, stops, strict=True)
        ]

    def among(self, motifs: AnyInts) -> Signature:
        """The cost of layers whose only motifs are these (M,), with their indices there as numbers."""
        cost = copy(self)
        cost._step_cost = [np.ascontiguousarray(steps[motifs]) for steps in self._step_cost]
        return cost

    def node(self, layer: Layer, song_features: SongFeatures) -> AnyFloats | None:
        if layer.second > 0:
            return None
        counts = layer.path.motif_counts[:1].copy()  # one row of all nodes, which cannot be written
        counted: AnyFloats = self._costs(counts, layer)[0]
        return counted

    def edge(self, previous: Layer, next: Layer, song_features: SongFeatures) -> AnyFloats:
        return self._costs(_counts_before(previous, next), next)

    def min_edge_costs(self, previous: Layer, next: Layer, song_features: SongFeatures) -> AnyFloats:
        step_cost = self.step_costs(next.second)
        least = step_cost[np.arange(len(step_cost)), _counts_before(previous, next)].min(axis=0)  # (K,)
        bounds: AnyFloats = np.append(least, 0.0)[next.motifs].sum(axis=1)
        return bounds

    def step_costs(self, second: int) -> NDArray[np.float32]:
        """The costs of one more word of each motif in a second, by the number of its words so far (K, C)."""
        step_cost: NDArray[np.float32] = self._step_cost[self._part[second]]
        return step_cost

    def _costs(self, counts: NDArray[np.integer], layer: Layer) -> NDArray[np.float32]:
        step_cost = self.step_costs(layer.second)
        total: NDArray[np.float32] = _motif_count_costs(step_cost, counts, np.ascontiguousarray(layer.motifs))
        return total


@njit(
    "float32[:,::1](float32[:,::1], int16[:,::1], int16[:,::1])",
    nogil=True,
)
def _motif_count_costs(
    step_cost: NDArray[np.float32], counts: NDArray[np.integer], motifs: NDArray[np.integer]
) -> NDArray[np.float32]:  # pragma: no cover - compiled
    """The `words_cost` of all edges, (P, N) float32.

    `step_cost` is (K, C). `counts` (P, K) are those along the path to each predecessor. `motifs` (N, W) are
    padded with -1.
    """
    n_a, n_b = len(counts), len(motifs)
    repeats, total = repeats_of(motifs), np.zeros((n_a, n_b), np.float32)
    for i in range(n_a):
        for j in range(n_b):
            total[i, j] = words_cost(i, j, counts, motifs, repeats, step_cost)
    return total


@njit()
def repeats_of(motifs: Any) -> Any:  # pragma: no cover - compiled
    """How many earlier words of the same node (N, W) have the same motif as each word."""
    n_nodes, width = motifs.shape
    repeats = np.zeros((n_nodes, width), np.int64)
    for j in range(n_nodes):
        for w in range(width):
            for v in range(w):
                repeats[j, w] += motifs[j, v] == motifs[j, w]
    return repeats


@njit(inline="always")
def words_cost(
    i: int, j: int, counts: Any, motifs: Any, repeats: Any, step_cost: Any
) -> Any:  # pragma: no cover - compiled
    """The formula of `Signature`: the sum over a node's motifs of step_cost[motif, times danced before]."""
    words, most = np.float32(0.0), step_cost.shape[1] - 1
    for w in range(motifs.shape[1]):
        if motifs[j, w] < 0:
            break
        words += step_cost[motifs[j, w], min(counts[i, motifs[j, w]] + repeats[j, w], most)]
    return words


def _signature_steps(goal: MotifGoal, n_words: int, n_seconds: int) -> NDArray[np.float32]:
    """The cost of one more word of each motif, by the number of its words so far (K, N + 1)."""
    n_words = max(n_words, 1)
    counts = np.arange(n_words + 2)
    expected = n_words * goal.signature[:, None]  # (K, 1)
    both = counts + expected  # (K, N + 2)
    distance = 0.5 * np.square(counts - expected) / np.where(both > 0, both, 1.0)
    return np.ascontiguousarray(n_seconds / n_words * (np.diff(distance, axis=1) + 0.5), np.float32)


def _counts_before(previous: Layer, next: Layer) -> NDArray[np.integer]:
    """Counts (P, K) of motifs along the paths to `previous`, of the part that `next` is in."""
    return np.zeros_like(previous.path.motif_counts) if next.new_goal else previous.path.motif_counts


class MotifTransition(Cost):
    """-log of the probability that a motif follows the one before it, 1 for one in a thousand or less.

    The sum over a song's seconds is scaled so that its mean is the mean over the song's words. Nodes have the
    costs of transitions between their own words. Edges have that from the last word of the previous second.
    The probabilities are those of the goal at the later word. Raise its weight for motifs that follow each
    other as in the takes.
    """

    default_weight = 0.3
    sentence = "These motifs rarely follow each other in the takes."
    is_compiled = True
    name = "motif_transition"
    min_jump_cost = 0.0

    @classmethod
    def for_dance(cls, context: CostContext) -> MotifTransition | None:
        return cls(context.goals, context.song_features) if context.goals else None

    def __init__(self, goals: Goals, song_features: SongFeatures) -> None:
        self._part = _part_at(goals, song_features)
        n_words = len(song_words_s(song_features)) - 1
        self._cost = [_transition_costs(goal, song_features.n_seconds / n_words) for _, goal in goals]

    def node(self, layer: Layer, song_features: SongFeatures) -> AnyFloats:
        total: AnyFloats = self.costs_at(layer)[layer.motifs[:, :-1], layer.motifs[:, 1:]].sum(axis=1)
        return total

    def edge(self, previous: Layer, next: Layer, song_features: SongFeatures) -> AnyFloats:
        total: AnyFloats = self.costs_at(next)[last_motif(previous)[:, None], first_motif(next)]
        return total

    def min_edge_costs(self, previous: Layer, next: Layer, song_features: SongFeatures) -> AnyFloats:
        least: AnyFloats = self.costs_at(next)[np.unique(last_motif(previous))].min(axis=0)[first_motif(next)]
        return least

    def costs_at(self, layer: Layer) -> NDArray[np.float32]:
        """Costs (K + 1, K + 1) by the last motif and the next, in the second of a layer. -1 is none."""
        of_layer: NDArray[np.float32] = self._cost[self._part[layer.second]]
        return of_layer


def _transition_costs(goal: MotifGoal, scale: float) -> NDArray[np.float32]:
    """Costs (K + 1, K + 1) of a goal's transitions. The extra row and column are for no motif, index -1."""
    cost = np.log(np.clip(goal.transitions, _MIN_PROBABILITY, 1.0)) / np.log(_MIN_PROBABILITY)
    padded = np.zeros((len(cost) + 1, len(cost) + 1), np.float32)
    padded[:-1, :-1] = scale * cost
    return padded


def _part_at(goals: Goals, song_features: SongFeatures) -> NDArray[np.int64]:
    """Index of the goal in each second, (S,)."""
    firsts = [second for second, _ in goals]
    return np.searchsorted(firsts, np.arange(song_features.n_seconds), "right") - 1


def song_words_s(song_features: SongFeatures) -> NDArray[np.float64]:
    """Times (Q + 1,) at which the words of a dance to the song begin and end."""
    return dance_bounds_s(song_features.beat_times_s, song_features.duration_s)


def words_between(song_features: SongFeatures, first_second: int, stop_second: int) -> int:
    """How many words of the song have their middle in these seconds, as `node_motifs` gives them to nodes."""
    bounds_s = song_words_s(song_features)
    middles_s = (bounds_s[:-1] + bounds_s[1:]) / 2
    return int(((middles_s >= first_second) & (middles_s < stop_second)).sum())


def first_motif(layer: Layer) -> NDArray[np.integer]:
    """The first motif of each node (N,), -1 without words."""
    return layer.motifs[:, 0] if layer.motifs.shape[1] else np.full(layer.n_nodes, NO_MOTIF)


def last_motif(layer: Layer) -> NDArray[np.integer]:
    """The last motif of each node (N,), -1 without words."""
    n_words = (layer.motifs != NO_MOTIF).sum(axis=1)
    last = layer.motifs[np.arange(layer.n_nodes), n_words - 1] if layer.motifs.shape[1] else NO_MOTIF
    return np.where(n_words > 0, last, NO_MOTIF)
