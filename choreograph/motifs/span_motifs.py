"""The motif of any span of a take."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from choreograph.motifs.clustering import Motifs
from choreograph.motifs.words import poses_at
from choreograph.motion.pose import clips_to_root_frame
from choreograph.timebase import WORD_FRAMES

Floats = NDArray[np.floating]
Indices = NDArray[np.int64]

_START_STEP_S = 0.05
_LENGTH_STEP = 1.15  # factor between length bins
_LENGTHS = 64  # length bins from 0.05 s on: more than any word needs
_MIN_LENGTH_S = 0.05
_STARTS = 2**21  # start bins: more than a day


class SpanMotifLookup:
    """Motifs of spans of takes, for the graph.

    In the graph a word is the motion between two music beats. That may be any span of a take, not only the
    words that the vocabulary segmented on the take's own beats. Spans are quantised, to 0.05 s in time and
    15 % in length, and embedded on first use: a song needs a small part of all spans.

    `body_pos_m` gives positions (T, 21, 3) of a take at `fps`; `embed` gives embeddings (N, D) of words
    (N, 13, 21, 3), as `nets.words.model.WordNet.embed` does.
    """

    def __init__(
        self,
        body_pos_m: Callable[[int], Floats],
        fps: float,
        embed: Callable[[Floats], NDArray[np.float32]],
        motifs: Motifs,
    ) -> None:
        self._body_pos_m = body_pos_m
        self._fps = fps
        self._embed = embed
        self._motifs = motifs
        self._keys = np.zeros(0, np.int64)  # sorted
        self._cached = np.zeros(0, np.int16)

    def motifs_of(self, take: Indices, start_s: Floats, stop_s: Floats) -> NDArray[np.int16]:
        """Motifs (...) of spans, all arrays (...); beyond its ends a take holds its first or last pose."""
        length_s = np.maximum(np.asarray(stop_s) - start_s, _MIN_LENGTH_S)
        length = np.round(np.log(length_s / _MIN_LENGTH_S) / np.log(_LENGTH_STEP)).astype(np.int64)
        # Bins are of the middle, not the start: it does not move when the length is quantised.
        middle = np.maximum((np.asarray(start_s) + stop_s) / 2, 0.0)
        key = np.round(middle / _START_STEP_S).astype(np.int64) * _LENGTHS + np.minimum(length, _LENGTHS - 1)
        key += np.asarray(take, np.int64) * (_STARTS * _LENGTHS)
        unique, inverse = np.unique(key, return_inverse=True)
        new = np.setdiff1d(unique, self._keys, assume_unique=True)
        if len(new):
            keys = np.concatenate([self._keys, new])
            cached = np.concatenate([self._cached, self._motifs_of_keys(new)])
            order = np.argsort(keys)
            self._keys, self._cached = keys[order], cached[order]
        return self._cached[np.searchsorted(self._keys, unique)][inverse].reshape(key.shape)

    def _motifs_of_keys(self, keys: Indices) -> NDArray[np.int16]:
        takes, bins = np.divmod(keys, _STARTS * _LENGTHS)
        middle_s = bins // _LENGTHS * _START_STEP_S
        length_s = _MIN_LENGTH_S * _LENGTH_STEP ** (bins % _LENGTHS)
        # Keys are sorted, so words stay in their order. All takes' words are embedded together.
        words = [
            self._words(int(take), middle_s[takes == take], length_s[takes == take])
            for take in np.unique(takes)
        ]
        return self._motifs.nearest(self._embed(np.concatenate(words))).astype(np.int16)

    def _words(self, take: int, middle_s: Floats, length_s: Floats) -> Floats:
        """Words (N, 13, 21, 3) around the given middles, in their root frames."""
        times_s = middle_s[:, None] + length_s[:, None] * np.linspace(-0.5, 0.5, WORD_FRAMES)  # (N, 13)
        return clips_to_root_frame(poses_at(self._body_pos_m(take), self._fps, times_s))
