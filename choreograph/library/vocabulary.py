"""The vocabulary of a repertoire: its motifs, the words of its takes and the signatures of its genres."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.core.arguments import check_choice
from choreograph.core.errors import RepertoireError
from choreograph.core.numerics import Floats, Indices
from choreograph.library.motifs import Motifs
from choreograph.library.words import template, transition_matrix

ALL_GENRES = "all"  # the template and transitions of all takes together


class GenreTransitions:
    """The transitions (G, K, K) of a file, by genre. Those of a genre are read when they are first used.

    They are larger than all other arrays of a vocabulary together, and a dance uses those of one genre.
    """

    def __init__(self, read: Callable[[str, slice], Floats], n_genres: int) -> None:
        self._read = read
        self._genres = range(n_genres)
        self._known: dict[int, Floats] = {}

    def __iter__(self) -> Iterator[Floats]:
        return map(self.__getitem__, self._genres)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.array(list(self), dtype)

    def __getitem__(self, genre: int) -> Floats:
        row = self._genres[genre]
        if row not in self._known:
            self._known[row] = self._read("motifs/transitions", slice(row, row + 1))[0]
        return self._known[row]


@dataclass(frozen=True, eq=False)
class Vocabulary:
    """Motifs, words and genres (Rhythm is a Dancer, sections 3.3 and 3.4).

    Words are ordered by take, then by time. Within a take, each begins where the one before it ends.
    """

    motifs: Motifs  # K, the most frequent first where they were found. `words` are indices of those below
    word_take: Indices  # (N,) index of the word's take
    word_start_s: Floats  # (N,) in its take
    word_end_s: Floats  # (N,)
    word_motif: Indices  # (N,)
    genres: tuple[str, ...]  # G names, sorted, and last `ALL_GENRES`
    signatures: Floats  # (G, K) templates
    transitions: Floats | GenreTransitions  # (G, K, K) row i: probabilities of the motif after motif i

    @property
    def n_motifs(self) -> int:
        """Number of motifs K."""
        return len(self.motifs)

    def genre_index(self, genre: str) -> int:
        """Row of a genre. Raises `ParameterError` for an unknown one, with the known genres."""
        check_choice("a genre", genre, self.genres)
        return self.genres.index(genre)

    def words_of_motif(self, motif: int) -> Indices:
        """All words of a motif, (M,), at least one."""
        return np.flatnonzero(self.word_motif == motif)

    def words_of_take(self, take: int) -> Indices:
        """All words of a take in order, (M,), perhaps none."""
        return np.arange(*np.searchsorted(self.word_take, [take, take + 1]))  # words are ordered by take


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
    words = np.split(word_motif, np.searchsorted(word_take, np.arange(1, len(take_genres))))
    danced = [(genre, sequence) for genre, sequence in zip(take_genres, words, strict=True) if len(sequence)]
    genres = (*sorted({genre for genre, _ in danced if genre and genre != ALL_GENRES}), ALL_GENRES)
    dances = [[s for genre, s in danced if name in (genre, ALL_GENRES)] for name in genres]
    k = len(motifs)
    return Vocabulary(
        motifs, word_take, word_start_s, word_end_s, word_motif, genres,
        np.stack([template(of_genre, k) for of_genre in dances]),
        np.stack([transition_matrix(of_genre, k) for of_genre in dances]),
    )  # fmt: skip


# A vocabulary as the arrays of a repertoire file, and back with every property checked.


_TOLERANCE_S = 1e-6  # between the end of a word and the beginning of the next


def motif_arrays(vocabulary: Vocabulary) -> dict[str, NDArray[Any]]:
    """The arrays of `schema.MOTIFS` by path."""
    return {
        "motifs/embeddings": vocabulary.motifs.embeddings,
        "motifs/words": vocabulary.motifs.words,
        "motifs/counts": vocabulary.motifs.counts,
        "motifs/word_take": vocabulary.word_take,
        "motifs/word_start_s": vocabulary.word_start_s,
        "motifs/word_end_s": vocabulary.word_end_s,
        "motifs/word_motif": vocabulary.word_motif,
        "motifs/genres": np.array(vocabulary.genres),
        "motifs/signatures": vocabulary.signatures,
        "motifs/transitions": np.array(
            [vocabulary.transitions[row] for row in range(len(vocabulary.genres))]
        ),
    }


def vocabulary_from(read: Callable[..., NDArray[Any]], n_takes: int) -> Vocabulary:
    """The vocabulary of a file. `read(path)` returns an array of `schema.MOTIFS`, `read(path, rows)` rows.

    Raises `RepertoireError`, without the file name, if the arrays are inconsistent.
    """
    genres = tuple(str(genre) for genre in read("motifs/genres"))
    motifs = Motifs(
        read("motifs/embeddings").astype(np.float32),
        read("motifs/words").astype(np.int64),
        read("motifs/counts").astype(np.int64),
    )
    vocabulary = Vocabulary(
        motifs,
        read("motifs/word_take").astype(np.int64),
        read("motifs/word_start_s"),
        read("motifs/word_end_s"),
        read("motifs/word_motif").astype(np.int64),
        genres,
        read("motifs/signatures"),
        GenreTransitions(read, len(genres)),
    )
    _check_words(vocabulary, n_takes)
    _check_motifs(vocabulary)
    _check_genres(vocabulary)
    return vocabulary


def _check_words(vocabulary: Vocabulary, n_takes: int) -> None:
    take, start_s, end_s = vocabulary.word_take, vocabulary.word_start_s, vocabulary.word_end_s
    _expect(len(take) > 0, "expected motion words, got none")
    _expect(
        bool(take.min() >= 0 and take.max() < n_takes and (np.diff(take) >= 0).all()),
        f"expected motion words of takes 0 to {n_takes - 1} in order, got others or another order",
    )
    follows = np.diff(take) == 0
    _expect(
        bool((start_s >= 0).all() and np.isfinite(end_s).all() and (start_s < end_s).all()),
        "expected every motion word to end after it begins, got one that does not",
    )
    _expect(
        bool((np.abs(start_s[1:] - end_s[:-1])[follows] <= _TOLERANCE_S).all()),
        "expected every motion word to begin where the previous one ends, got a gap or overlap",
    )


def _check_motifs(vocabulary: Vocabulary) -> None:
    motifs, word_motif, k = vocabulary.motifs, vocabulary.word_motif, vocabulary.n_motifs
    _expect(bool(np.isfinite(motifs.embeddings).all()), "expected finite motifs, got nan or infinity")
    _expect(
        bool(word_motif.min() >= 0 and word_motif.max() < k),
        f"expected motion words with motifs 0 to {k - 1}, got others",
    )
    _expect(
        bool(motifs.words.min() >= 0 and motifs.words.max() < len(word_motif)),
        f"expected medoids among {len(word_motif)} motion words, got others",
    )
    _expect(
        bool((np.bincount(word_motif, minlength=k) == motifs.counts).all() and motifs.counts.min() > 0),
        "expected motif counts that match the motion words, got others",
    )


def _check_genres(vocabulary: Vocabulary) -> None:
    genres = vocabulary.genres
    _expect(
        len(set(genres)) == len(genres) and genres[-1:] == (ALL_GENRES,),
        f"expected distinct genres with {ALL_GENRES!r} last, got {', '.join(genres)}",
    )


def _expect(condition: bool, message: str) -> None:
    if not condition:
        raise RepertoireError(message)
