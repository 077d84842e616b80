"""The motif of any stretch of a take, wherever it begins and however long it is."""

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
_LENGTH_STEP = 1.15  # lengths are told apart by a factor
_LENGTHS = 64  # steps from 0.05 s: more than any word needs
_SHORTEST_S = 0.05
_STARTS = 2**21  # a day and more of starts


class SpanMotifLookup:
    """Motifs of stretches of takes, for the graph: there a word is what is danced between two music beats,
    any stretch of a take, and none of the words that the vocabulary cut on the take's own beats.

    Stretches are told apart by 0.05 s and a seventh of their length, and each is embedded when it is first
    asked for: a song asks for a small part of all there are.

    `body_pos_m` gives positions (T, 21, 3) of a take at `fps`; `embed` embeddings (N, D) of words
    (N, 13, 21, 3), as `nets.words.WordNet.embed`.
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
        self._known = np.zeros(0, np.int16)

    def motifs_of(self, take: Indices, start_s: Floats, stop_s: Floats) -> NDArray[np.int16]:
        """Motifs (...) of stretches of takes, all arrays (...); beyond a take's ends it stands still."""
        length_s = np.maximum(np.asarray(stop_s) - start_s, _SHORTEST_S)
        length = np.round(np.log(length_s / _SHORTEST_S) / np.log(_LENGTH_STEP)).astype(np.int64)
        # Of stretches that share a cell the middles agree, whatever their lengths.
        middle = np.maximum((np.asarray(start_s) + stop_s) / 2, 0.0)
        key = np.round(middle / _START_STEP_S).astype(np.int64) * _LENGTHS + np.minimum(length, _LENGTHS - 1)
        key += np.asarray(take, np.int64) * (_STARTS * _LENGTHS)
        wanted, place = np.unique(key, return_inverse=True)
        new = np.setdiff1d(wanted, self._keys, assume_unique=True)
        if len(new):
            keys = np.concatenate([self._keys, new])
            known = np.concatenate([self._known, self._labelled(new)])
            order = np.argsort(keys)
            self._keys, self._known = keys[order], known[order]
        return self._known[np.searchsorted(self._keys, wanted)][place].reshape(key.shape)

    def _labelled(self, keys: Indices) -> NDArray[np.int16]:
        takes, cells = np.divmod(keys, _STARTS * _LENGTHS)
        middle_s = cells // _LENGTHS * _START_STEP_S
        length_s = _SHORTEST_S * _LENGTH_STEP ** (cells % _LENGTHS)
        embedded = [
            self._embed(self._words(int(take), middle_s[takes == take], length_s[takes == take]))
            for take in np.unique(takes)
        ]
        return self._motifs.nearest(np.concatenate(embedded)).astype(np.int16)

    def _words(self, take: int, middle_s: Floats, length_s: Floats) -> Floats:
        """Words (N, 13, 21, 3) around the middles given, from their own place."""
        times_s = middle_s[:, None] + length_s[:, None] * np.linspace(-0.5, 0.5, WORD_FRAMES)  # (N, 13)
        return clips_to_root_frame(poses_at(self._body_pos_m(take), self._fps, times_s))
