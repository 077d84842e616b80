"""Distances of a vocabulary's takes to their genre's template, in total and over time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from choreograph.motifs.signatures import chi_square_distance, signature
from choreograph.motifs.vocabulary import ALL_GENRES, Vocabulary

Floats = NDArray[np.float64]


def dances_of(vocabulary: Vocabulary, take_genres: Sequence[str], genre: str) -> list[int]:
    """Takes with words of a genre, or of all for `ALL_GENRES`; `take_genres` has one genre per take."""
    danced = np.unique(vocabulary.word_take)
    return [int(take) for take in danced if genre in (ALL_GENRES, take_genres[take])]


def distances_to_template(vocabulary: Vocabulary, genre: str, takes: Sequence[int]) -> Floats:
    """χ² distance of each take's signature to the genre's template, (X,).

    The template is the mean of these signatures, so that a genre's only take is at distance 0. Raises
    `ParameterError` for an unknown genre or a take without words.
    """
    template = vocabulary.signatures[vocabulary.genre_index(genre)]
    dances = [vocabulary.word_motif[vocabulary.words_of_take(take)] for take in takes]
    return np.array([chi_square_distance(signature(d, vocabulary.n_motifs), template) for d in dances])


def distance_over_time(vocabulary: Vocabulary, genre: str, take: int) -> tuple[Floats, Floats]:
    """Seconds danced (N,) and the χ² distance (N,) of the signature so far to the genre's template.

    One value after each of the take's words (Rhythm is a Dancer, Figure 12).
    """
    words = vocabulary.words_of_take(take)
    counts = np.cumsum(np.eye(vocabulary.n_motifs)[vocabulary.word_motif[words]], axis=0)  # (N, K)
    so_far = counts / np.arange(1, len(words) + 1)[:, None]
    seconds = vocabulary.word_end_s[words] - vocabulary.word_start_s[words[:1]]
    return seconds, chi_square_distance(so_far, vocabulary.signatures[vocabulary.genre_index(genre)])
