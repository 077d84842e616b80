"""The choreography mixer: for each motif the word of its cluster that goes on best from the word before.

Rhythm is a Dancer, section 5.2.5, where each word is chosen once, after the one before it (`greedy`); by
default all words are chosen together, the cheapest way through them all. There the first three poses of a
word are compared with the last three of the one before; here both with what their take does around the
same instant, so that position and velocity are compared at the join, and a word that really followed fits
without any difference.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import NoPathError, ParameterError

Floats = NDArray[np.floating]
Indices = NDArray[np.int64]

SEARCHES = ("exact", "greedy")
_AGAIN_M = 0.15  # what the very same word again costs, in metres of joint distance


@dataclass(frozen=True, eq=False)
class Candidates:
    """The words that may be danced in one place of the dance, M of them."""

    words: Indices  # (M,) indices in the vocabulary
    price_m: Floats  # (M,) of the word itself, in metres of joint distance; inf forbids
    first_m: Floats  # (M, 3, 21, 3) the poses around its start, from their own place
    last_m: Floats  # (M, 3, 21, 3) those around its end

    def without(self, word: int) -> Candidates:
        """The same, with one word forbidden."""
        return self.without_any(np.array([word]))

    def without_any(self, words: Indices) -> Candidates:
        """The same, with some words forbidden."""
        return replace(self, price_m=np.where(np.isin(self.words, words), np.inf, self.price_m))

    def preferring(self, word: int, by_m: float) -> Candidates:
        """The same, with all words but one dearer."""
        return replace(self, price_m=self.price_m + by_m * (self.words != word))


def search_words(candidates: Sequence[Candidates], *, search: str = "exact") -> Indices:
    """A word for every place, (N,): those that cost the least in all.

    Going from one word to the next costs the root mean square distance of their three poses at the join,
    metres, and more if it is the same word again.

    Raises `ParameterError` for an unknown search, `NoPathError` naming the place where every word is
    forbidden.
    """
    if search not in SEARCHES:
        raise ParameterError(f"expected a search among {', '.join(SEARCHES)}, got {search!r}")
    for slot, here in enumerate(candidates):
        if not np.isfinite(here.price_m).any():
            raise NoPathError(f"every word of place {slot} of the dance is forbidden")
    if not candidates:
        return np.zeros(0, np.int64)
    rows = (_greedy if search == "greedy" else _cheapest)(candidates)
    return np.array([here.words[row] for here, row in zip(candidates, rows, strict=True)])


def _greedy(candidates: Sequence[Candidates]) -> list[int]:
    rows = [int(np.argmin(candidates[0].price_m))]
    for before, here in pairwise(candidates):
        rows.append(int(np.argmin(_joins_m(before, here)[rows[-1]] + here.price_m)))
    return rows


def _cheapest(candidates: Sequence[Candidates]) -> list[int]:
    reached = candidates[0].price_m  # (M,)
    parents: list[Indices] = []
    for before, here in pairwise(candidates):
        ways = reached[:, None] + _joins_m(before, here)  # (M, M')
        parents.append(np.argmin(ways, axis=0))
        reached = ways[parents[-1], np.arange(len(here.words))] + here.price_m
    rows = [int(np.argmin(reached))]
    for parent in reversed(parents):
        rows.append(int(parent[rows[-1]]))
    return rows[::-1]


def _joins_m(before: Candidates, here: Candidates) -> Floats:
    """What it costs to go from each word (M) to each of the next place (M'), (M, M')."""
    a, b = before.last_m.reshape(len(before.words), -1), here.first_m.reshape(len(here.words), -1)
    squares = np.sum(a**2, axis=1)[:, None] + np.sum(b**2, axis=1) - 2.0 * a @ b.T
    n_points = a.shape[1] // 3
    again = before.words[:, None] == here.words
    return np.sqrt(np.maximum(squares, 0.0) / n_points) + _AGAIN_M * again
