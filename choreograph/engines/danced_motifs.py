"""Which motif each word of a rendered motion shows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.motifs.words import segment_words
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion
from choreograph.repertoire import Repertoire
from choreograph.timebase import WORD_FPS


def danced_motifs(motion: Motion, bounds_s: NDArray[np.float64], repertoire: Repertoire) -> NDArray[np.int64]:
    """The motif of each word (N,) of a motion segmented at `bounds_s` (N + 1,), as a repertoire's own are.

    -1 for a word too short to have one.
    """
    body = body_pos_m(motion.resampled(WORD_FPS))
    inside = np.clip(bounds_s, 0.0, (len(body) - 1) / WORD_FPS)
    words = segment_words(body, WORD_FPS, inside)
    motifs = np.full(len(bounds_s) - 1, -1, np.int64)
    if len(words):
        slots = np.searchsorted(bounds_s, (words.start_s + words.end_s) / 2, side="right") - 1
        embedded = repertoire.word_net().embed(words.body_pos_m)
        motifs[slots] = repertoire.vocabulary.motifs.nearest(embedded)
    return motifs
