"""Goals for a whole dance: its motif signature and its motif transitions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.motifs.signatures import checked_signature
from choreograph.motifs.vocabulary import ALL_GENRES, Vocabulary

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MotifGoal:
    """The target signature, and the probabilities of transitions between motifs."""

    signature: Floats  # (K,)
    transitions: Floats  # (K, K) row i: probabilities of the motif after motif i


def motif_goal(
    vocabulary: Vocabulary, *, genre: str | None = None, signature: Floats | None = None
) -> MotifGoal:
    """The goal of a genre, or of a custom signature (K,) with a genre's transitions.

    Without a genre the transitions are those of all takes. Raises `ParameterError` for an unknown genre, or
    a signature that does not match this vocabulary's motifs or does not sum to 1.
    """
    row = vocabulary.genre_index(ALL_GENRES if genre is None else genre)
    shares = vocabulary.signatures[row] if signature is None else signature
    return MotifGoal(checked_signature(shares, vocabulary.n_motifs), vocabulary.transitions[row])
