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
    return motifs_of_embeddings(danced_embeddings(motion, bounds_s, repertoire), repertoire)


def danced_embeddings(
    motion: Motion, bounds_s: NDArray[np.float64], repertoire: Repertoire
) -> NDArray[np.float32]:
    """The embedding of each word (N, D) of a motion segmented at `bounds_s` (N + 1,); nan if too short."""
    body = body_pos_m(motion.resampled(WORD_FPS))
    inside = np.clip(bounds_s, 0.0, (len(body) - 1) / WORD_FPS)
    words = segment_words(body, WORD_FPS, inside)
    medoids = repertoire.vocabulary.motifs.embeddings  # (K, D)
    embeddings = np.full((len(bounds_s) - 1, medoids.shape[1]), np.nan, np.float32)
    if len(words):
        slots = np.searchsorted(bounds_s, (words.start_s + words.end_s) / 2, side="right") - 1
        embeddings[slots] = repertoire.word_net().embed(words.body_pos_m)
    return embeddings


def motifs_of_embeddings(embeddings: NDArray[np.float32], repertoire: Repertoire) -> NDArray[np.int64]:
    """The motif (N,) nearest to each embedding (N, D); -1 for nan."""
    motifs = np.full(len(embeddings), -1, np.int64)
    known = ~np.isnan(embeddings[:, 0])
    if known.any():
        motifs[known] = repertoire.vocabulary.motifs.nearest(embeddings[known])
    return motifs
