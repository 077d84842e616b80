"""Selection towards a signature: clips and takes that hold what is wanted come first."""

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
    """How little of each clip (N,) is wanted in a dance of `n_words` words with a signature (K,).

    From -1 (all of it, more often than a song has room for) to 1 (nothing): of the clip's words, those of
    the take's own beats, the mean of (1 - n) / (1 + n), n being how often the word's motif is expected:
    what the word costs a dance that has nothing yet (`graph.Signature`). 0 for a clip without words.
    """
    expected = n_words * signature[vocabulary.word_motif]  # (W,)
    price = (1.0 - expected) / (1.0 + expected)
    middle_s = (vocabulary.word_start_s + vocabulary.word_end_s) / 2
    misfits = np.zeros(len(clip_take))
    for take in np.unique(clip_take):
        words = vocabulary.words_of_take(take)
        sums = np.concatenate([[0.0], np.cumsum(price[words])])
        clips = np.flatnonzero(clip_take == take)
        first, last = (
            np.searchsorted(middle_s[words], clip_start_s[clips] + edge_s) for edge_s in (0.0, CLIP_S)
        )
        misfits[clips] = (sums[last] - sums[first]) / np.maximum(last - first, 1)
    return misfits
