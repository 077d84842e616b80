"""How near the takes of a vocabulary are to their genre's template, and how they get there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from choreograph.motifs.signatures import chi_square_distance, signature
from choreograph.motifs.vocabulary import ALL_GENRES, Vocabulary

Floats = NDArray[np.float64]


def dances_of(vocabulary: Vocabulary, take_genres: Sequence[str], genre: str) -> list[int]:
    """Takes of a genre that have words; of `ALL_GENRES` all such takes. `take_genres`: one a take."""
    danced = np.unique(vocabulary.word_take)
    return [int(take) for take in danced if genre in (ALL_GENRES, take_genres[take])]


def distances_to_template(vocabulary: Vocabulary, genre: str, takes: Sequence[int]) -> Floats:
    """χ² distance of each take's signature to the genre's template, (X,).

    The template is the mean of such signatures: a genre's only take lies at 0. Raises `ParameterError` for
    an unknown genre or a take without words.
    """
    template = vocabulary.signatures[vocabulary.genre_index(genre)]
    dances = [vocabulary.word_motif[vocabulary.words_of_take(take)] for take in takes]
    return np.array([chi_square_distance(signature(d, vocabulary.n_motifs), template) for d in dances])


def distance_over_time(vocabulary: Vocabulary, genre: str, take: int) -> tuple[Floats, Floats]:
    """Seconds danced (N,), and χ² distance (N,) of a take's signature so far to the genre's template.

    Rhythm is a Dancer, Figure 12; one value after every word.
    """
    words = vocabulary.words_of_take(take)
    counts = np.cumsum(np.eye(vocabulary.n_motifs)[vocabulary.word_motif[words]], axis=0)  # (N, K)
    so_far = counts / np.arange(1, len(words) + 1)[:, None]
    seconds = vocabulary.word_end_s[words] - vocabulary.word_start_s[words[:1]]
    return seconds, chi_square_distance(so_far, vocabulary.signatures[vocabulary.genre_index(genre)])
