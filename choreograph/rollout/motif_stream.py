"""Motifs drawn word by word as a song plays: `motifs.choreography`, on demand (Rhythm is a Dancer, 4.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.arguments import as_index
from choreograph.counts import Counts
from choreograph.motifs.bar_positions import UNKNOWN, bar_positions, possible_motifs, word_positions
from choreograph.motifs.choreography import draw_next_motif
from choreograph.motifs.goals import motif_goal
from choreograph.motifs.words import DEFAULT_WORD_S, dance_bounds_s
from choreograph.repertoire import Repertoire

Floats = NDArray[np.float64]

_LAST_WORDS = 8  # whose median duration words after the last count have


@dataclass(frozen=True)
class StreamedWord:
    """A word of a streamed dance, and the motif asked of the network in it."""

    start_s: float
    end_s: float
    motif: int


class MotifStream:
    """Words from the start of a song on, without end; before and after its counts they go on evenly.

    A motif has a word on the count where its word begins. `need` is how equation 5 is read, as of
    `motifs.choreography.draw_motifs`. Setting `genre` begins its signature anew. Raises `ParameterError` for
    an unknown genre, `RepertoireError` without motifs.
    """

    def __init__(
        self, counts: Counts, repertoire: Repertoire, *, genre: str, seed: int, need: str = "missing"
    ) -> None:
        self._vocabulary = repertoire.vocabulary
        self._need, self._rng = need, np.random.default_rng(seed)
        last_s = counts.times_s[-1] if len(counts) else 0.0
        self._bounds_s = dance_bounds_s(counts.times_s, max(float(last_s), DEFAULT_WORD_S))
        self._last_word_s = float(np.median(np.diff(self._bounds_s)[-_LAST_WORDS:]))
        self._position = bar_positions(self._bounds_s, counts)
        self._word_position = word_positions(self._vocabulary, repertoire.counts)
        self._requested: list[int] = []
        self.words: list[StreamedWord] = []  # begun so far
        self.genre = genre

    @property
    def genre(self) -> str:
        """The genre whose signature and transitions are danced."""
        return self._genre

    @genre.setter
    def genre(self, genre: str) -> None:
        self._goal = motif_goal(self._vocabulary, genre=genre)
        self._genre = genre
        self._danced = np.zeros(self._vocabulary.n_motifs)

    def request(self, motif: int, n_words: int) -> None:
        """Dance a motif in the next words to begin, in place of what was requested for them."""
        self._requested = [as_index("a motif", motif, self._vocabulary.n_motifs)] * n_words

    def begin_word(self) -> StreamedWord:
        """The next word, with its motif requested or drawn."""
        slot = len(self.words)
        motif = self._requested.pop(0) if self._requested else self._drawn(slot)
        self._danced[motif] += 1
        self.words.append(StreamedWord(self._bound_s(slot), self._bound_s(slot + 1), motif))
        return self.words[-1]

    def _drawn(self, slot: int) -> int:
        positions = np.full(2, UNKNOWN)
        here = self._position[slot : slot + 2]
        positions[: len(here)] = here
        every_word = np.arange(len(self._vocabulary.word_motif))
        return draw_next_motif(
            self._danced,
            self._goal.signature,
            self._goal.transitions,
            rng=self._rng,
            previous=self.words[-1].motif if self.words else None,
            possible=possible_motifs(positions, self._word_position, every_word, self._vocabulary),
            need=self._need,
        )

    def _bound_s(self, index: int) -> float:
        beyond = index - (len(self._bounds_s) - 1)
        return float(self._bounds_s[min(index, len(self._bounds_s) - 1)]) + max(0, beyond) * self._last_word_s
