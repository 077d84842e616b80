"""Costs that steer a dance towards a genre: how often each motif comes, and what follows what."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.features.song_features import SongFeatures
from choreograph.graph.costs import Cost, Floats
from choreograph.graph.layers import Layer
from choreograph.graph.node_motifs import NO_MOTIF
from choreograph.motifs.goals import MotifGoal
from choreograph.motifs.words import dance_bounds_s

_RAREST = 1e-3  # a step that no dance has is as dear as one in a thousand


class Signature(Cost):
    """How far the dance's signature is from the one wanted: χ² distance, equation 11 of Rhythm is a Dancer.

    The mean over all seconds is the finished dance's distance. A second pays what its words change: with
    counts c_k of the dance so far, N the song's words and s_k the signature wanted, the distance is
    Σ_k ½ (c_k - N s_k)² / (c_k + N s_k) / N, a sum over motifs, so that each word pays its own step. One
    of a motif still missing pays less than nothing, down to -1; one too many up to 1 (times seconds by
    words). The counts are those of the way that leads to a node (`Layer.danced`), as in equation 5, but
    with the whole song in view: a motif is missing until it has come as often as the song has room for.
    """

    def __init__(self, goal: MotifGoal, song_features: SongFeatures) -> None:
        self.goal = goal
        n_words = len(song_words_s(song_features)) - 1
        counts = np.arange(n_words + 2)
        expected = n_words * goal.signature[:, None]  # (K, 1)
        both = counts + expected  # (K, N + 2)
        distance = 0.5 * np.square(counts - expected) / np.where(both > 0, both, 1.0)
        scale = song_features.n_seconds / n_words
        self._step = np.ascontiguousarray(scale * (np.diff(distance, axis=1) + 0.5), np.float32)

    def node(self, layer: Layer, song_features: SongFeatures) -> Floats | None:
        if layer.second > 0:
            return None
        return self._prices(np.zeros((1, len(self._step)), np.int16), layer)[0]

    def edge(self, previous: Layer, next: Layer, song_features: SongFeatures) -> Floats:
        return self._prices(previous.danced, next)

    def least_edges(self, previous: Layer, next: Layer, song_features: SongFeatures) -> Floats:
        motif = np.arange(len(self._step))
        prices = self._step[motif, previous.danced].min(axis=0)  # (K,)
        return np.append(prices, 0.0)[next.motifs].sum(axis=1)

    def _prices(self, danced: NDArray[np.integer], layer: Layer) -> NDArray[np.float32]:
        from choreograph.graph._kernels import prices_after

        return prices_after(self._step, danced, np.ascontiguousarray(layer.motifs))


class MotifTransition(Cost):
    """-log of the probability that a motif follows the one before it, scaled to 1 for one in a thousand
    or less: the mean over a song's words, as its seconds pay it.

    Words within a second are paid by its node, the step from the last one before by the edge.
    """

    name = "motif_transition"
    least_jump = 0.0

    def __init__(self, goal: MotifGoal, song_features: SongFeatures) -> None:
        n_words = len(song_words_s(song_features)) - 1
        price = np.log(np.clip(goal.transitions, _RAREST, 1.0)) / np.log(_RAREST)
        # One row and column more, for no motif: index -1.
        self._price = np.zeros((len(price) + 1, len(price) + 1), np.float32)
        self._price[:-1, :-1] = price * (song_features.n_seconds / n_words)

    def node(self, layer: Layer, song_features: SongFeatures) -> Floats:
        return self._price[layer.motifs[:, :-1], layer.motifs[:, 1:]].sum(axis=1)

    def edge(self, previous: Layer, next: Layer, song_features: SongFeatures) -> Floats:
        return self._price[_last_motif(previous)[:, None], _first_motif(next)]

    def least_edges(self, previous: Layer, next: Layer, song_features: SongFeatures) -> Floats:
        return self._price[np.unique(_last_motif(previous))].min(axis=0)[_first_motif(next)]


MOTIF_COSTS: tuple[type[Cost], ...] = (Signature, MotifTransition)


def song_words_s(song_features: SongFeatures) -> NDArray[np.float64]:
    """Instants (Q + 1,) at which the words of a dance to a song begin and end."""
    return dance_bounds_s(song_features.beat_times_s, song_features.duration_s)


def _first_motif(layer: Layer) -> NDArray[np.integer]:
    """The first motif of each node, (N,); -1 for a node without words."""
    return layer.motifs[:, 0] if layer.motifs.shape[1] else np.full(layer.n_nodes, NO_MOTIF)


def _last_motif(layer: Layer) -> NDArray[np.integer]:
    """The last motif of each node, (N,); -1 for a node without words."""
    n_words = (layer.motifs != NO_MOTIF).sum(axis=1)
    last = layer.motifs[np.arange(layer.n_nodes), n_words - 1] if layer.motifs.shape[1] else NO_MOTIF
    return np.where(n_words > 0, last, NO_MOTIF)
