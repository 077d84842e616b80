"""The vocabulary of a repertoire: its motifs, the words of its takes, and the signatures of its genres."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.arguments import check_choice
from choreograph.motifs.clustering import Motifs
from choreograph.motifs.signatures import template, transition_matrix

Indices = NDArray[np.int64]
Floats = NDArray[np.float64]

ALL_GENRES = "all"  # the template and transitions of all takes together


@dataclass(frozen=True, eq=False)
class Vocabulary:
    """Motifs, words and genres (Rhythm is a Dancer, sections 3.3 and 3.4).

    Words are ordered by take, then by time. Within a take, each begins where the one before it ends.
    """

    motifs: Motifs  # K, the most frequent first; `motifs.words` index the words here
    word_take: Indices  # (N,) index of the word's take
    word_start_s: Floats  # (N,) in its take
    word_end_s: Floats  # (N,)
    word_motif: Indices  # (N,)
    genres: tuple[str, ...]  # G names, sorted, and last `ALL_GENRES`
    signatures: Floats  # (G, K) templates
    transitions: Floats  # (G, K, K) row i: probabilities of the motif after motif i

    @property
    def n_motifs(self) -> int:
        """Number of motifs K."""
        return len(self.motifs)

    def genre_index(self, genre: str) -> int:
        """Row of a genre; `ParameterError` for an unknown one, with the known genres."""
        check_choice("a genre", genre, self.genres)
        return self.genres.index(genre)

    def words_of_motif(self, motif: int) -> Indices:
        """All words of a motif, (M,), at least one."""
        return np.flatnonzero(self.word_motif == motif)

    def words_of_take(self, take: int) -> Indices:
        """All words of a take in order, (M,); there may be none."""
        return np.flatnonzero(self.word_take == take)


def make_vocabulary(
    motifs: Motifs,
    word_motif: Indices,
    word_take: Indices,
    word_start_s: Floats,
    word_end_s: Floats,
    take_genres: Sequence[str],
) -> Vocabulary:
    """Templates and transitions of every genre among the takes, and of all takes together.

    `take_genres` holds the genre of every take. Takes without words are ignored, and so are genres that
    have no other takes. Raises `ParameterError` if there is no word.
    """
    words = [word_motif[word_take == take] for take in range(len(take_genres))]
    danced = [(genre, sequence) for genre, sequence in zip(take_genres, words, strict=True) if len(sequence)]
    genres = (*sorted({genre for genre, _ in danced if genre and genre != ALL_GENRES}), ALL_GENRES)
    dances = [[s for genre, s in danced if name in (genre, ALL_GENRES)] for name in genres]
    k = len(motifs)
    return Vocabulary(
        motifs, word_take, word_start_s, word_end_s, word_motif, genres,
        np.stack([template(of_genre, k) for of_genre in dances]),
        np.stack([transition_matrix(of_genre, k) for of_genre in dances]),
    )  # fmt: skip
