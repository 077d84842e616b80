"""The seconds of a song in which music returns, and the moments that they return to."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.graph.layers import MIDDLE, Layer, Moments
from choreograph.core.numerics import Floats
from choreograph.core.timebase import NET_FPS
from choreograph.music.count_grids import SongGrid
from choreograph.music.form import Form, Phrase

_VARIED_COUNTS = 4  # at the end of what returns, where other music follows
_VARIED_WEIGHT = 0.5
SAME_FRAMES = 0.25 * NET_FPS  # largest distance of two positions in a take that are the same figure


@dataclass(frozen=True, eq=False)
class PhraseReturns:
    """The seconds of a song in which music returns, each with the moment that its middle returns to.

    A new phrase after one that returns is paired as well, with what followed there before (ABAC: C with the
    first B). A dance should not return there.
    """

    seconds: NDArray[np.int64]  # (R,) increasing
    first_s: Floats  # (R,) the moments, count by count
    is_return: NDArray[np.bool_]  # (R,) or else new music
    weights: Floats  # (R,) 1, and less at the end of what returns
    counts_later: NDArray[np.int64]  # (R,) from the moment to its return

    @classmethod
    def of(cls, form: Form, grid: SongGrid, is_planned: Callable[[float], bool]) -> PhraseReturns:
        """The returns of a song's phrases, by the grid of its beats, among the moments that are planned."""
        pairs: list[_Pair] = []
        labels = form.labels
        for number, phrase in enumerate(form.phrases):
            before = [other for other in range(number) if labels[other] == labels[number]]
            after = [other + 1 for other in range(number - 1) if labels[other] == labels[number - 1]]
            paired: dict[int, _Pair] = {}
            for other in before or after:
                ends = labels[number + 1 : number + 2] != labels[other + 1 : other + 2]
                for pair in _pairs(phrase, form.phrases[other], grid, is_planned, ends=ends):
                    paired.setdefault(pair.second, replace(pair, is_return=bool(before)))
            pairs += [paired[second] for second in sorted(paired)]
        return cls(
            np.array([pair.second for pair in pairs], np.int64),
            np.array([pair.first_s for pair in pairs], np.float64),
            np.array([pair.is_return for pair in pairs], bool),
            np.array([pair.weight for pair in pairs], np.float64),
            np.array([pair.counts_later for pair in pairs], np.int64),
        )

    def first_seconds(self, n_seconds: int) -> NDArray[np.int64]:
        """For every second (S,), the second that it returns to, or itself if its music is new."""
        firsts = np.arange(n_seconds)
        firsts[self.seconds[self.is_return]] = np.floor(self.first_s[self.is_return])
        return firsts

    def shifts(self, n_seconds: int, grid: SongGrid) -> Floats:
        """By how many counts (S,) every second begins later in its phrase than its `first_seconds`."""
        shifts = np.zeros(n_seconds)
        again = self.seconds[self.is_return]
        starts = grid.index_at(again.astype(np.float64))
        firsts = grid.index_at(np.floor(self.first_s[self.is_return]))
        shifts[again] = starts - self.counts_later[self.is_return] - firsts
        return shifts

    def moments(self, n_seconds: int) -> list[Moments]:
        """`Layer.moments` of every second."""
        moments: list[Moments] = [()] * n_seconds
        for number, first_s in enumerate(self.first_s):
            second = int(first_s)
            moments[second] = (*moments[second], (number, float(first_s - second)))
        return moments

    def returning(self, n_seconds: int) -> list[int | None]:
        """`Layer.returns` of every second."""
        returning: list[int | None] = [None] * n_seconds
        for number, second in enumerate(self.seconds):
            returning[second] = number
        return returning


@dataclass(frozen=True)
class _Pair:
    """A second, and the moment of an earlier phrase that its middle is compared with."""

    second: int
    first_s: float
    weight: float
    counts_later: int
    is_return: bool = True


def moments_of(layer: Layer) -> Moments:
    """The moments that a second is, and the one that it returns to."""
    return layer.moments if layer.returns is None else (*layer.moments, (layer.returns, MIDDLE))


def _pairs(
    phrase: Phrase, first: Phrase, grid: SongGrid, is_planned: Callable[[float], bool], *, ends: bool
) -> Iterator[_Pair]:
    """The pairs of a phrase with an earlier one. At its end, other music follows if it `ends`."""
    start, first_start, end = grid.index_at(np.array([phrase.start_s, first.start_s, phrase.end_s]))
    counts_later = round(start - first_start)
    for second in range(max(0, int(phrase.start_s)), int(phrase.end_s) + 1):
        middle_s = second + MIDDLE
        index = float(grid.index_at(np.array([middle_s]))[0])
        first_s = grid.time_at(index - counts_later)
        in_phrase = phrase.start_s <= middle_s < phrase.end_s and first_s < min(first.end_s, second)
        if in_phrase and is_planned(first_s) and is_planned(middle_s):
            weight = _VARIED_WEIGHT if ends and index >= end - _VARIED_COUNTS else 1.0
            yield _Pair(second, first_s, weight, counts_later)
