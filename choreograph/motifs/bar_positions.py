"""Where in the bar motion words begin: what a word on count 1 needs is a slot on the music's downbeat."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from choreograph.counts import Counts, bars_of
from choreograph.motifs.vocabulary import Vocabulary

Indices = NDArray[np.int64]

UNKNOWN = 0
_WITHIN = 0.15  # of a count's length: farther from a count, a word is not on it
_MANY = 100  # more than the counts of any bar


def bar_positions(times_s: NDArray[np.floating], counts: Counts) -> Indices:
    """Position (N,) of the count at each time, 100 × the counts in its bar + its number; `UNKNOWN` between.

    A bar that the counts do not hold in full is of the counts' metre. So a 3 of a waltz is no 3 of four.
    """
    found = np.full(len(times_s), UNKNOWN, np.int64)
    if not counts.has_bars or len(counts) < 2:
        return found
    bar = bars_of(counts.numbers)  # (Q,)
    length = np.full(bar.max() + 1, counts.metre)
    for whole in range(1, int(bar.max())):
        length[whole] = np.sum(bar == whole)
    position = _MANY * length[bar] + counts.numbers  # (Q,)
    nearest = np.abs(counts.times_s - np.asarray(times_s)[:, None]).argmin(axis=1)  # (N,)
    period_s = np.gradient(counts.times_s)[nearest]
    on_count = np.abs(counts.times_s[nearest] - times_s) < _WITHIN * period_s
    found[on_count] = position[nearest[on_count]]
    return found


def word_positions(vocabulary: Vocabulary, counts_of: Callable[[int], Counts]) -> Indices:
    """Position in the bar on which every word begins, (N,); `counts_of` gives a take's counts."""
    positions = np.full(len(vocabulary.word_take), UNKNOWN, np.int64)
    for take in np.unique(vocabulary.word_take):
        words = vocabulary.words_of_take(int(take))
        positions[words] = bar_positions(vocabulary.word_start_s[words], counts_of(int(take)))
    return positions


def words_on_count(wanted: int, word_position: Indices, words: Indices) -> NDArray[np.bool_]:
    """Which of the words (M,) begin on a position in the bar; all where it is not known, or known of no word.

    `word_position` (W,) is that of all words, `wanted` that of a slot of the dance.
    """
    known = wanted != UNKNOWN and bool((word_position != UNKNOWN).any())
    return word_position[words] == wanted if known else np.ones(len(words), bool)


def possible_motifs(
    slot_position: Indices, word_position: Indices, words: Indices, vocabulary: Vocabulary
) -> NDArray[np.bool_]:
    """Motifs (N, K) that have one of the words (M,) on the count of each slot (N,)."""
    possible = np.zeros((len(slot_position), vocabulary.n_motifs), bool)
    for slot, wanted in enumerate(slot_position):
        possible[slot, vocabulary.word_motif[words[words_on_count(wanted, word_position, words)]]] = True
    return possible
