"""`Counts`: instants counted 1, 2, 3, …, their numbers in the bar, and their phases; `Figure`."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from choreograph.core.arguments import as_number, unexpected
from choreograph.core.errors import ParameterError
from choreograph.core.progress import one_line

# `Counts`: instants that are counted 1, 2, 3, …, and their number in the bar; `Figure`: named choreography.
#
# A take's counts are where its dancer counts; a song's are its beats. Both are one thing, since dancing on
# the count means that the first lie on the second, and count 1 on the downbeat.


Floats = NDArray[np.float64]

MAX_METRE = 12  # counts in a bar

# Where counts come from, `Counts.source`.
ANNOTATED = "annotation"  # given by hand, beside the take or the song
DATA_SET = "data set"  # given by the data set that the take is from
FROM_MUSIC = "music"  # tracked: a song's beats, or those of the song that the take dances to
FROM_MOTION = "motion"  # read from the motion by a network


@dataclass(frozen=True, eq=False)
class Counts:
    """Counted instants, increasing; none if the times are empty."""

    times_s: Floats  # (Q,) from the first frame of the take, or in the song
    numbers: NDArray[np.int64]  # (Q,) in the bar, 1 on the downbeat; all 0 if bars are not known
    metre: int  # counts in a bar; 0 if bars are not known
    source: str = ""  # see above
    confidence: float = 0.0  # 0 … 1, that times and numbers are right
    # (Q,) where a network read them: 0 if its phases agree with the count, ½ if they say nothing, up to 1
    uncertainty: Floats = field(default_factory=lambda: np.zeros(0))

    __repr__ = one_line

    def __len__(self) -> int:
        return len(self.times_s)

    @property
    def has_bars(self) -> bool:
        """Whether the numbers in the bar are known."""
        return self.metre > 0

    @property
    def downbeat_times_s(self) -> Floats:
        """The instants of count 1, (D,); none if bars are not known."""
        downbeats_s: Floats = self.times_s[self.numbers == 1]
        return downbeats_s

    def within(self, start_s: float, end_s: float) -> Counts:
        """The counts of a part, times from its start."""
        for what, bound_s in (("start", start_s), ("end", end_s)):
            as_number(f"the {what} of a part in seconds", bound_s)
        inside = (self.times_s >= start_s) & (self.times_s <= end_s)
        uncertainty = self.uncertainty[inside] if len(self.uncertainty) else self.uncertainty
        return Counts(
            self.times_s[inside] - start_s, self.numbers[inside], self.metre, self.source, self.confidence,
            uncertainty,
        )  # fmt: skip


@dataclass(frozen=True)
class Figure:
    """A named piece of a take's choreography, a whole number of counts long."""

    name: str
    start_s: float  # from the first frame of the take
    end_s: float
    n_counts: int


NO_COUNTS = Counts(np.zeros(0), np.zeros(0, np.int64), 0)


def make_counts(
    times_s: ArrayLike, numbers: ArrayLike, metre: int, *, source: str = "", confidence: float = 1.0
) -> Counts:
    """Counts, checked.

    Raises `ParameterError` unless times are finite and increasing, there is a number for each, numbers are
    from 1 to `metre` (or all 0 with `metre` 0) and the confidence is from 0 to 1.
    """
    times: Floats = np.asarray(times_s, np.float64)
    given = np.asarray(numbers)
    if times.ndim != 1 or not np.isfinite(times).all() or (np.diff(times) <= 0).any():
        raise ParameterError(f"expected increasing, finite counts (Q,) in seconds, got shape {times.shape}")
    if given.shape != times.shape or not np.equal(given, np.round(given)).all():
        raise unexpected(f"a whole number in the bar for each of {len(times)} counts", given.tolist())
    lowest = 1 if metre else 0
    if not 0 <= metre <= MAX_METRE or ((given < lowest) | (given > metre)).any():
        raise ParameterError(
            f"expected numbers in the bar from 1 to the metre, at most {MAX_METRE}, got a metre of {metre} "
            f"and numbers from {given.min(initial=0)} to {given.max(initial=0)}"
        )
    if not 0 <= confidence <= 1:
        raise ParameterError(f"expected a confidence from 0 to 1, got {confidence}")
    return Counts(times, given.astype(np.int64), int(metre), source, float(confidence))


def bars_of(numbers: ArrayLike) -> NDArray[np.int64]:
    """The bar (Q,) of each count by its number in the bar (Q,): 1 from the first count 1 on, 0 before it."""
    return np.cumsum(np.asarray(numbers, np.int64) == 1)


def numbers_in_bar(n_counts: int, metre: int, *, first: int = 1) -> NDArray[np.int64]:
    """Numbers in the bar (Q,) of consecutive counts, the first of which is `first`."""
    return (np.arange(n_counts) + first - 1) % metre + 1


# Where in the beat and in the bar each instant lies: what a recurrent network dances by.
#
# Continued before the first count and after the last at the tempo there, so that an introduction is counted
# in.


COUNT_PHASE_DIM = 4  # cos and sin of the phase of the beat, then of the bar
_END_PERIODS = 8  # periods whose median continues counts beyond their ends
_BEYOND = 10_000  # periods that counts are continued by


def count_phase(counts: Counts, times_s: NDArray[np.floating]) -> NDArray[np.float32]:
    """Cos and sin of the phases of beat and bar (T, 4) at each time (T,); a phase that is not known is 0, 0.

    A beat's phase is 0 on the count, a bar's on count 1. Two counts are needed to know the phase of the beat,
    two counts 1 for that of the bar.
    """
    phases = np.zeros((len(times_s), 2, 2))
    for column, instants_s in enumerate((counts.times_s, counts.downbeat_times_s)):
        if len(instants_s) > 1:
            angle = 2 * np.pi * index_at(instants_s, times_s)
            phases[:, column] = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return phases.reshape(-1, COUNT_PHASE_DIM).astype(np.float32)


def index_at(instants_s: Floats, times_s: NDArray[np.floating]) -> Floats:
    """The fractional index among two or more increasing instants (Q,) at each time, below 0 before them."""
    index: Floats = np.interp(times_s, *_continued(instants_s))
    return index


def time_at(instants_s: Floats, index: NDArray[np.floating]) -> Floats:
    """The time at each fractional index among two or more increasing instants (Q,): inverse to `index_at`."""
    known_s, indices = _continued(instants_s)
    times_s: Floats = np.interp(index, indices, known_s)
    return times_s


def _continued(instants_s: Floats) -> tuple[Floats, Floats]:
    """Instants and their indices, with one more far before and far after them."""
    n, periods_s = len(instants_s), np.diff(instants_s)
    before_s = instants_s[0] - _BEYOND * np.median(periods_s[:_END_PERIODS])
    after_s = instants_s[-1] + _BEYOND * np.median(periods_s[-_END_PERIODS:])
    indices = np.concatenate([[-float(_BEYOND)], np.arange(n), [n - 1.0 + _BEYOND]])
    return np.concatenate([[before_s], instants_s, [after_s]]), indices
