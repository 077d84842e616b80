"""The choreography mixer's search: for each slot the word that continues best from the word before.

In Rhythm is a Dancer, section 5.2.5, each word is chosen once, after the one before it (`greedy`). By
default (`exact`) all words are chosen together: the cheapest sequence. The paper compares the first three
poses of a word with the last three of the word before. Here both are compared with what their take does
around the same instant, so that position and velocity are compared at the transition, and a word that
really followed costs nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from choreograph.distances import squared_distances
from choreograph.engines.candidates import Candidates
from choreograph.errors import NoPathError, ParameterError

Floats = NDArray[np.floating]
Indices = NDArray[np.int64]

SEARCHES = ("exact", "greedy")
_REPEAT_COST_M = 0.15  # of the very same word again, in metres of joint distance


def search_words(candidates: Sequence[Candidates], *, search: str = "exact") -> Indices:
    """A word for every slot, (N,): the cheapest sequence.

    Going from one word to the next costs the root mean square distance of their three poses at the
    transition, in metres, and more if it is the same word again.

    Raises `ParameterError` for an unknown search, `NoPathError` naming the slot where every word is
    forbidden.
    """
    if search not in SEARCHES:
        raise ParameterError(f"expected a search among {', '.join(SEARCHES)}, got {search!r}")
    for slot, here in enumerate(candidates):
        if not here.any_left:
            raise NoPathError(f"every word of slot {slot} of the dance is forbidden")
    if not candidates:
        return np.zeros(0, np.int64)
    rows = (_greedy if search == "greedy" else _cheapest)(candidates)
    return np.array([here.words[row] for here, row in zip(candidates, rows, strict=True)])


def _greedy(candidates: Sequence[Candidates]) -> list[int]:
    rows = [int(np.argmin(candidates[0].cost_m))]
    for before, here in pairwise(candidates):
        rows.append(int(np.argmin(_transition_costs_m(before, here)[rows[-1]] + here.cost_m)))
    return rows


def _cheapest(candidates: Sequence[Candidates]) -> list[int]:
    reached = candidates[0].cost_m  # (M,)
    parents: list[Indices] = []
    for before, here in pairwise(candidates):
        paths = reached[:, None] + _transition_costs_m(before, here)  # (M, M')
        parents.append(np.argmin(paths, axis=0))
        reached = paths[parents[-1], np.arange(len(here.words))] + here.cost_m
    rows = [int(np.argmin(reached))]
    for parent in reversed(parents):
        rows.append(int(parent[rows[-1]]))
    return rows[::-1]


def _transition_costs_m(before: Candidates, here: Candidates) -> Floats:
    """Cost of going from each word (M) to each of the next slot (M'), (M, M')."""
    a, b = before.last_m.reshape(len(before.words), -1), here.first_m.reshape(len(here.words), -1)
    n_points = a.shape[1] // 3
    again = before.words[:, None] == here.words
    return np.sqrt(squared_distances(a, b) / n_points) + _REPEAT_COST_M * again
