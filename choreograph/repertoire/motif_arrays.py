"""A vocabulary as the arrays of a repertoire file, and back with every property checked."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import RepertoireError
from choreograph.motifs.clustering import Motifs
from choreograph.motifs.signatures import SUM_TOLERANCE
from choreograph.motifs.vocabulary import ALL_GENRES, Vocabulary

_TOLERANCE_S = 1e-6  # between the end of a word and the beginning of the next


def motif_arrays(vocabulary: Vocabulary) -> dict[str, NDArray]:
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
        "motifs/transitions": vocabulary.transitions,
    }


def vocabulary_from(read: Callable[[str], NDArray], n_takes: int) -> Vocabulary:
    """The vocabulary of a file; `read(path)` returns an array of `schema.MOTIFS`.

    Raises `RepertoireError`, without the file name, if the arrays are inconsistent.
    """
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
        tuple(str(genre) for genre in read("motifs/genres")),
        read("motifs/signatures"),
        read("motifs/transitions"),
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
    for shares in (vocabulary.signatures, vocabulary.transitions):
        _expect(
            bool((shares >= 0).all() and (np.abs(shares.sum(axis=-1) - 1.0) <= SUM_TOLERANCE).all()),
            "expected signatures and transitions that sum to 1, got others",
        )


def _expect(condition: bool, message: str) -> None:
    if not condition:
        raise RepertoireError(message)
