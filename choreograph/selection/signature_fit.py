"""Selection towards a signature: clips with the motifs that it needs come first."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.motifs.vocabulary import Vocabulary
from choreograph.timebase import CLIP_S

Floats = NDArray[np.float64]


def clip_signature_mismatch(
    vocabulary: Vocabulary,
    signature: Floats,
    clip_take: NDArray[np.integer],
    clip_start_s: Floats,
    *,
    n_words: int,
) -> Floats:
    """Mismatch (N,) of each clip with a signature (K,), for a dance of `n_words` words.

    The mean over the clip's words of (1 - n) / (1 + n), with n the expected count of the word's motif: the
    cost of the word as the first of a dance (`graph.Signature`). From -1, all motifs are frequent, to 1,
    none is expected; 0 for a clip without words. The words are those segmented on the take's own beats.
    """
    expected = n_words * signature[vocabulary.word_motif]  # (W,)
    word_cost = (1.0 - expected) / (1.0 + expected)
    middle_s = (vocabulary.word_start_s + vocabulary.word_end_s) / 2
    mismatch = np.zeros(len(clip_take))
    for take in np.unique(clip_take):
        words = vocabulary.words_of_take(take)
        sums = np.concatenate([[0.0], np.cumsum(word_cost[words])])
        clips = np.flatnonzero(clip_take == take)
        first, last = (
            np.searchsorted(middle_s[words], clip_start_s[clips] + edge_s) for edge_s in (0.0, CLIP_S)
        )
        mismatch[clips] = (sums[last] - sums[first]) / np.maximum(last - first, 1)
    return mismatch
