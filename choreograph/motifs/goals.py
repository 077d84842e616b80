"""What a dance should be like as a whole: a signature, and what follows what on the way there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.motifs.signatures import checked_signature
from choreograph.motifs.vocabulary import ALL_GENRES, Vocabulary

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MotifGoal:
    """A signature wanted, and probabilities of steps from motif to motif."""

    signature: Floats  # (K,)
    transitions: Floats  # (K, K) row i: what follows motif i


def motif_goal(
    vocabulary: Vocabulary, *, genre: str | None = None, signature: Floats | None = None
) -> MotifGoal:
    """The goal of dancing a genre, a signature (K,) of one's own, or a signature with a genre's steps.

    Without a genre the steps are those of all takes. Raises `ParameterError` for an unknown genre, or a
    signature that is not of this vocabulary's motifs or does not sum to 1.
    """
    row = vocabulary.genre_index(ALL_GENRES if genre is None else genre)
    shares = vocabulary.signatures[row] if signature is None else signature
    return MotifGoal(checked_signature(shares, vocabulary.n_motifs), vocabulary.transitions[row])
