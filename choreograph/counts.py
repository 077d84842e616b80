"""`Counts`: instants that are counted 1, 2, 3, …, and their number in the bar; `Figure`: named choreography.

A take's counts are where its dancer counts; a song's are its beats. Both are one thing, since dancing on the
count means that the first lie on the second, and count 1 on the downbeat.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from choreograph.arguments import unexpected
from choreograph.errors import ParameterError

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
    doubt: Floats = field(default_factory=lambda: np.zeros(0))

    def __len__(self) -> int:
        return len(self.times_s)

    @property
    def has_bars(self) -> bool:
        """Whether the numbers in the bar are known."""
        return self.metre > 0

    @property
    def downbeat_times_s(self) -> Floats:
        """The instants of count 1, (D,); none if bars are not known."""
        return self.times_s[self.numbers == 1]

    def within(self, start_s: float, end_s: float) -> Counts:
        """The counts of a part, times from its start."""
        inside = (self.times_s >= start_s) & (self.times_s <= end_s)
        doubt = self.doubt[inside] if len(self.doubt) else self.doubt
        return Counts(
            self.times_s[inside] - start_s, self.numbers[inside], self.metre, self.source, self.confidence,
            doubt,
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
