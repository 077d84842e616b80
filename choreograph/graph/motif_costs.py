"""Costs that steer a dance towards a genre: its motif signature and its motif transitions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.features.song_features import SongFeatures
from choreograph.graph.costs import Cost, Floats
from choreograph.graph.layers import Layer
from choreograph.graph.node_motifs import NO_MOTIF
from choreograph.motifs.goals import MotifGoal
from choreograph.motifs.words import dance_bounds_s

_MIN_PROBABILITY = 1e-3  # transitions never seen cost as much as one in a thousand


class Signature(Cost):
    """χ² distance of the dance's signature to the goal's (Rhythm is a Dancer, equation 11).

    The mean over all seconds is the distance of the finished dance. With counts c_k of the dance so far, N
    words in the song and the goal's signature s_k, the distance is Σ_k ½ (c_k - N s_k)² / (c_k + N s_k) / N:
    a sum over motifs, so that each word costs the change that it makes. A word of a missing motif has a
    negative cost, down to -1; one too many costs up to 1 (times seconds per word). The counts are those
    along the path to a node (`Layer.motif_counts`), as in equation 5. Unlike there, a motif counts as
    missing until it has occurred as often as in the whole song of the goal.
    """

    def __init__(self, goal: MotifGoal, song_features: SongFeatures) -> None:
        self.goal = goal
        n_words = len(song_words_s(song_features)) - 1
        counts = np.arange(n_words + 2)
        expected = n_words * goal.signature[:, None]  # (K, 1)
        both = counts + expected  # (K, N + 2)
        distance = 0.5 * np.square(counts - expected) / np.where(both > 0, both, 1.0)
        scale = song_features.n_seconds / n_words
        self._step_cost = np.ascontiguousarray(scale * (np.diff(distance, axis=1) + 0.5), np.float32)

    def node(self, layer: Layer, song_features: SongFeatures) -> Floats | None:
        if layer.second > 0:
            return None
        return self._costs(np.zeros((1, len(self._step_cost)), np.int16), layer)[0]

    def edge(self, previous: Layer, next: Layer, song_features: SongFeatures) -> Floats:
        return self._costs(previous.motif_counts, next)

    def min_edge_costs(self, previous: Layer, next: Layer, song_features: SongFeatures) -> Floats:
        motif = np.arange(len(self._step_cost))
        least = self._step_cost[motif, previous.motif_counts].min(axis=0)  # (K,)
        return np.append(least, 0.0)[next.motifs].sum(axis=1)

    def _costs(self, counts: NDArray[np.integer], layer: Layer) -> NDArray[np.float32]:
        from choreograph.graph._kernels import motif_count_costs

        return motif_count_costs(self._step_cost, counts, np.ascontiguousarray(layer.motifs))


class MotifTransition(Cost):
    """-log of the probability that a motif follows the one before it, 1 for one in a thousand or less.

    The sum over a song's seconds is scaled so that its mean is the mean over the song's words. Nodes pay
    for the transitions between their own words, edges for that from the last word of the previous second.
    """

    name = "motif_transition"
    min_jump_cost = 0.0

    def __init__(self, goal: MotifGoal, song_features: SongFeatures) -> None:
        n_words = len(song_words_s(song_features)) - 1
        cost = np.log(np.clip(goal.transitions, _MIN_PROBABILITY, 1.0)) / np.log(_MIN_PROBABILITY)
        # The extra row and column are for no motif, index -1.
        self._cost = np.zeros((len(cost) + 1, len(cost) + 1), np.float32)
        self._cost[:-1, :-1] = cost * (song_features.n_seconds / n_words)

    def node(self, layer: Layer, song_features: SongFeatures) -> Floats:
        return self._cost[layer.motifs[:, :-1], layer.motifs[:, 1:]].sum(axis=1)

    def edge(self, previous: Layer, next: Layer, song_features: SongFeatures) -> Floats:
        return self._cost[_last_motif(previous)[:, None], _first_motif(next)]

    def min_edge_costs(self, previous: Layer, next: Layer, song_features: SongFeatures) -> Floats:
        return self._cost[np.unique(_last_motif(previous))].min(axis=0)[_first_motif(next)]


MOTIF_COSTS: tuple[type[Cost], ...] = (Signature, MotifTransition)


def song_words_s(song_features: SongFeatures) -> NDArray[np.float64]:
    """Times (Q + 1,) at which the words of a dance to the song begin and end."""
    return dance_bounds_s(song_features.beat_times_s, song_features.duration_s)


def _first_motif(layer: Layer) -> NDArray[np.integer]:
    """The first motif of each node, (N,); -1 for a node without words."""
    return layer.motifs[:, 0] if layer.motifs.shape[1] else np.full(layer.n_nodes, NO_MOTIF)


def _last_motif(layer: Layer) -> NDArray[np.integer]:
    """The last motif of each node, (N,); -1 for a node without words."""
    n_words = (layer.motifs != NO_MOTIF).sum(axis=1)
    last = layer.motifs[np.arange(layer.n_nodes), n_words - 1] if layer.motifs.shape[1] else NO_MOTIF
    return np.where(n_words > 0, last, NO_MOTIF)
