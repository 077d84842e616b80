"""The words of a repertoire as the mixer compares them: poses at their borders, and their motif margin."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from choreograph.distances import squared_distances
from choreograph.motifs.vocabulary import Vocabulary
from choreograph.motifs.words import poses_at
from choreograph.motion.pose import clips_to_root_frame
from choreograph.repertoire import Repertoire
from choreograph.timebase import NET_FPS, WORD_FRAMES
from choreograph.warping.micro_timing import accent_shifts_s

Floats = NDArray[np.floating]
Indices = NDArray[np.int64]

AROUND_S = np.array([-1.0, 0.0, 1.0]) / NET_FPS  # the three poses that a transition is judged by


class WordBank:
    """Reads words from the takes' positions, (T, 21, 3) at 20 fps, and embeds each when first needed.

    Words are danced from and to `bounds_s` (W, 2) of their takes; by default where they were cut.
    """

    def __init__(
        self,
        vocabulary: Vocabulary,
        body_pos_m: Callable[[int], Floats],
        embed: Callable[[Floats], NDArray[np.float32]],
        bounds_s: Floats | None = None,
    ) -> None:
        self.vocabulary = vocabulary
        cut_s = np.stack([vocabulary.word_start_s, vocabulary.word_end_s], axis=1)
        self.bounds_s = cut_s if bounds_s is None else bounds_s
        self._body_pos_m = body_pos_m
        self._embed = embed
        self._margin_m = np.full(len(vocabulary.word_motif), np.nan)

    def borders_m(self, words: Indices, lengths_s: float) -> tuple[Floats, Floats]:
        """The three poses around the start and the end of words (M,), each (M, 3, 21, 3), in the root frame.

        They are a twentieth of a second apart in the dance, where the words last `lengths_s`.
        """
        bounds_s = self.bounds_s[words]  # (M, 2)
        speed = np.diff(bounds_s, axis=1) / lengths_s  # (M, 1)
        poses = self._poses_m(words, bounds_s[..., None] + speed[..., None] * AROUND_S)
        poses = clips_to_root_frame(poses)  # (M, 2, 3, 21, 3)
        return poses[:, 0], poses[:, 1]

    def motif_margin_m(self, words: Indices) -> Floats:
        """How much nearer each word (M,) is to its motif than to the next; negative if it is not."""
        new = np.unique(words[np.isnan(self._margin_m[words])])
        if len(new):
            self._margin_m[new] = self._measured_margin_m(new)
        return self._margin_m[words]

    def _measured_margin_m(self, words: Indices) -> Floats:
        v = self.vocabulary
        share = np.linspace(0.0, 1.0, WORD_FRAMES)
        length_s = v.word_end_s[words] - v.word_start_s[words]
        poses = self._poses_m(words, v.word_start_s[words, None] + length_s[:, None] * share)
        embedded = self._embed(clips_to_root_frame(poses)).astype(np.float64)  # (M, D)
        medoids = v.motifs.embeddings.astype(np.float64)  # (K, D)
        distance = np.sqrt(squared_distances(embedded, medoids))  # (M, K)
        rows, own = np.arange(len(words)), v.word_motif[words]
        to_own = distance[rows, own]
        distance[rows, own] = np.inf
        return np.minimum(distance.min(axis=1), 1.0) - to_own  # with one motif alone the next is a metre away

    def _poses_m(self, words: Indices, times_s: Floats) -> NDArray[np.float64]:
        """Poses (M, ..., 21, 3) of the words' takes at times (M, ...)."""
        poses = np.empty((*times_s.shape, 21, 3))
        takes = self.vocabulary.word_take[words]
        for take in np.unique(takes):
            poses[takes == take] = poses_at(self._body_pos_m(int(take)), NET_FPS, times_s[takes == take])
        return poses


def accented_bounds_s(repertoire: Repertoire) -> Floats:
    """From when to when (W, 2) of its take each word is danced, so that its accents fall on the beat (ours).

    Words are cut on counts. Where a take has its accents just beside them, words begin and end there instead,
    as far off as the graph engine's time maps put them (`warping.micro_timing`).
    """
    v = repertoire.vocabulary
    bounds_s = np.stack([v.word_start_s, v.word_end_s], axis=1).astype(np.float64)
    for take in np.unique(v.word_take):
        counts_s = repertoire.counts(int(take)).times_s
        if len(counts_s) < 2:
            continue
        shifts_s = accent_shifts_s(repertoire.motion_beats_s(int(take)), counts_s)
        own = v.word_take == take
        bounds_s[own] += np.interp(bounds_s[own], counts_s, shifts_s, left=0.0, right=0.0)
    return bounds_s
