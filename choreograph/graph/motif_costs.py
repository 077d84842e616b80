"""Costs that steer a dance towards a genre: its motif signature and its motif transitions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from choreograph.features.song_features import SongFeatures
from choreograph.graph.costs import Cost, Floats
from choreograph.graph.layers import Layer
from choreograph.graph.node_motifs import NO_MOTIF
from choreograph.motifs.goals import MotifGoal
from choreograph.motifs.words import dance_bounds_s

_MIN_PROBABILITY = 1e-3  # transitions never seen cost as much as one in a thousand


Goals = Sequence[tuple[int, MotifGoal]]  # (first second, goal) of each part of the song, in order


class Signature(Cost):
    """χ² distance of the signature of each part of the dance to its goal's (Rhythm is a Dancer, equation 11).

    The mean over the seconds of a part is the distance of the finished part. With counts c_k of the part so
    far, N words in it and the goal's signature s_k, the distance is
    Σ_k ½ (c_k - N s_k)² / (c_k + N s_k) / N: a sum over motifs, so that each word costs the change that it
    makes. A word of a missing motif has a negative cost, down to -1; one too many costs up to 1 (times
    seconds per word). The counts are those along the path to a node (`Layer.motif_counts`), as in equation
    5. Unlike there, a motif counts as missing until it has occurred as often as in all of the part. The paper
    has one goal for the whole song.
    """

    def __init__(self, goals: Goals, song_features: SongFeatures) -> None:
        self._part = _part_at(goals, song_features)
        stops = [*(second for second, _ in goals[1:]), song_features.n_seconds]
        self._step_cost = [
            _signature_steps(goal, words_between(song_features, first, stop), stop - first)
            for (first, goal), stop in zip(goals, stops, strict=True)
        ]

    def node(self, layer: Layer, song_features: SongFeatures) -> Floats | None:
        if layer.second > 0:
            return None
        return self._costs(np.zeros((1, len(self._step_cost[0])), np.int16), layer)[0]

    def edge(self, previous: Layer, next: Layer, song_features: SongFeatures) -> Floats:
        return self._costs(_counts_before(previous, next), next)

    def min_edge_costs(self, previous: Layer, next: Layer, song_features: SongFeatures) -> Floats:
        step_cost = self._step_cost[self._part[next.second]]
        least = step_cost[np.arange(len(step_cost)), _counts_before(previous, next)].min(axis=0)  # (K,)
        return np.append(least, 0.0)[next.motifs].sum(axis=1)

    def _costs(self, counts: NDArray[np.integer], layer: Layer) -> NDArray[np.float32]:
        from choreograph.graph._kernels import motif_count_costs

        step_cost = self._step_cost[self._part[layer.second]]
        return motif_count_costs(step_cost, counts, np.ascontiguousarray(layer.motifs))


def _signature_steps(goal: MotifGoal, n_words: int, n_seconds: int) -> NDArray[np.float32]:
    """What one more word of a motif costs after each number of them, (K, N + 1)."""
    n_words = max(n_words, 1)
    counts = np.arange(n_words + 2)
    expected = n_words * goal.signature[:, None]  # (K, 1)
    both = counts + expected  # (K, N + 2)
    distance = 0.5 * np.square(counts - expected) / np.where(both > 0, both, 1.0)
    return np.ascontiguousarray(n_seconds / n_words * (np.diff(distance, axis=1) + 0.5), np.float32)


def _counts_before(previous: Layer, next: Layer) -> NDArray[np.integer]:
    """Counts (P, K) of motifs along the paths to `previous`, of the part that `next` is in."""
    return np.zeros_like(previous.motif_counts) if next.new_goal else previous.motif_counts


class MotifTransition(Cost):
    """-log of the probability that a motif follows the one before it, 1 for one in a thousand or less.

    The sum over a song's seconds is scaled so that its mean is the mean over the song's words. Nodes pay
    for the transitions between their own words, edges for that from the last word of the previous second.
    The probabilities are those of the goal where the later word is danced.
    """

    name = "motif_transition"
    min_jump_cost = 0.0

    def __init__(self, goals: Goals, song_features: SongFeatures) -> None:
        self._part = _part_at(goals, song_features)
        n_words = len(song_words_s(song_features)) - 1
        self._cost = [_transition_costs(goal, song_features.n_seconds / n_words) for _, goal in goals]

    def node(self, layer: Layer, song_features: SongFeatures) -> Floats:
        return self._cost_at(layer)[layer.motifs[:, :-1], layer.motifs[:, 1:]].sum(axis=1)

    def edge(self, previous: Layer, next: Layer, song_features: SongFeatures) -> Floats:
        return self._cost_at(next)[_last_motif(previous)[:, None], _first_motif(next)]

    def min_edge_costs(self, previous: Layer, next: Layer, song_features: SongFeatures) -> Floats:
        return self._cost_at(next)[np.unique(_last_motif(previous))].min(axis=0)[_first_motif(next)]

    def _cost_at(self, layer: Layer) -> NDArray[np.float32]:
        return self._cost[self._part[layer.second]]


def _transition_costs(goal: MotifGoal, scale: float) -> NDArray[np.float32]:
    """Costs (K + 1, K + 1) of a goal's transitions; the extra row and column are for no motif, index -1."""
    cost = np.log(np.clip(goal.transitions, _MIN_PROBABILITY, 1.0)) / np.log(_MIN_PROBABILITY)
    padded = np.zeros((len(cost) + 1, len(cost) + 1), np.float32)
    padded[:-1, :-1] = scale * cost
    return padded


def _part_at(goals: Goals, song_features: SongFeatures) -> NDArray[np.int64]:
    """Index of the goal in each second, (S,)."""
    firsts = [second for second, _ in goals]
    return np.searchsorted(firsts, np.arange(song_features.n_seconds), "right") - 1


MOTIF_COSTS: tuple[type[Cost], ...] = (Signature, MotifTransition)


def song_words_s(song_features: SongFeatures) -> NDArray[np.float64]:
    """Times (Q + 1,) at which the words of a dance to the song begin and end."""
    return dance_bounds_s(song_features.beat_times_s, song_features.duration_s)


def words_between(song_features: SongFeatures, first_second: int, stop_second: int) -> int:
    """How many words of the song have their middle in these seconds, as `node_motifs` gives them to nodes."""
    bounds_s = song_words_s(song_features)
    middles_s = (bounds_s[:-1] + bounds_s[1:]) / 2
    return int(((middles_s >= first_second) & (middles_s < stop_second)).sum())


def _first_motif(layer: Layer) -> NDArray[np.integer]:
    """The first motif of each node, (N,); -1 for a node without words."""
    return layer.motifs[:, 0] if layer.motifs.shape[1] else np.full(layer.n_nodes, NO_MOTIF)


def _last_motif(layer: Layer) -> NDArray[np.integer]:
    """The last motif of each node, (N,); -1 for a node without words."""
    n_words = (layer.motifs != NO_MOTIF).sum(axis=1)
    last = layer.motifs[np.arange(layer.n_nodes), n_words - 1] if layer.motifs.shape[1] else NO_MOTIF
    return np.where(n_words > 0, last, NO_MOTIF)
