"""`Counts`, the instants at which a dancer counts 1, 2, 3, their phases, and `Figure`, named choreography.

The counts of a take are the instants at which its dancer counts. The counts of a song are its beats. Both
have one type, because a dance is on the count if its counts lie on those of the song, and count 1 on the
downbeat.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from choreograph.core.arguments import as_number, unexpected
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats
from choreograph.core.progress import one_line

MAX_METRE = 12  # counts in a bar

# Values of `Counts.source`.
ANNOTATED = "annotation"  # annotated by hand, beside the take or the song
DATA_SET = "data set"  # annotated in the data set of the take
FROM_MUSIC = "music"  # the tracked beats of a song, or of the song of a take
FROM_MOTION = "motion"  # estimated from the motion by a network


@dataclass(frozen=True, eq=False)
class Counts:
    """The counts of a take or a song, in order.

    Examples
    --------
    >>> counts = cg.Counts(np.array([0.0, 0.5, 1.0, 1.5, 2.0]), np.array([1, 2, 3, 4, 1]), metre=4)
    >>> len(counts), counts.has_bars
    (5, True)
    >>> counts.downbeat_times_s
    array([0., 2.])
    >>> counts.within(1.0, 2.0).numbers
    array([3, 4, 1])
    """

    times_s: Floats
    """(Q,) times of the counts in seconds, increasing, from the first frame of the take or the start of the
    song."""

    numbers: NDArray[np.int64]
    """(Q,) number of each count in its bar, 1 on the downbeat, or all 0 if bars are not known."""

    metre: int
    """Counts in a bar, or 0 if bars are not known."""

    source: str = ""
    """Where they come from: "annotation", "data set", "music" or "motion"."""

    confidence: float = 0.0
    """Probability from 0 to 1 that times and numbers are right."""

    uncertainty: Floats = field(default_factory=lambda: np.zeros(0))
    """(Q,) for counts estimated from motion: 0 if the phases of the network agree with the count, 0.5 if they
    are uninformative, up to 1. Otherwise (0,)."""

    __repr__ = one_line

    def __len__(self) -> int:
        return len(self.times_s)

    @property
    def has_bars(self) -> bool:
        """Whether the numbers in the bar are known."""
        return self.metre > 0

    @property
    def downbeat_times_s(self) -> Floats:
        """Times of count 1, (D,) in seconds, or none if bars are not known."""
        downbeats_s: Floats = self.times_s[self.numbers == 1]
        return downbeats_s

    def within(self, start_s: float, end_s: float) -> Counts:
        """The counts from `start_s` to `end_s`, with times from `start_s`."""
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
    """A named part of the choreography of a take. It lasts a whole number of counts."""

    name: str
    """Its name, such as "natural turn"."""

    start_s: float
    """Where it begins, in seconds from the first frame of the take."""

    end_s: float
    """Where it ends, in seconds from the first frame of the take."""

    n_counts: int
    """Its length in counts."""


NO_COUNTS = Counts(np.zeros(0), np.zeros(0, np.int64), 0)


def make_counts(
    times_s: ArrayLike, numbers: ArrayLike, metre: int, *, source: str = "", confidence: float = 1.0
) -> Counts:
    """Checked counts.

    Raises `ParameterError` unless times (Q,) are finite and increasing, numbers (Q,) are from 1 to `metre`
    (or all 0 with `metre` 0), and the confidence is from 0 to 1.
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
    """The bar (Q,) of each count from its number in the bar (Q,). Bar 1 begins with the first count 1."""
    return np.cumsum(np.asarray(numbers, np.int64) == 1)


def numbers_in_bar(n_counts: int, metre: int, *, first: int = 1) -> NDArray[np.int64]:
    """Numbers in the bar (Q,) of consecutive counts that begin with `first`."""
    return (np.arange(n_counts) + first - 1) % metre + 1


# Positions in the bar. A motion word that begins on count 1 needs a slot on the music's downbeat.


UNKNOWN = 0  # the position of a time that is on no count of a known bar
_WITHIN = 0.15  # of a count's length. A word that is farther from a count is not on it
_MANY = 100  # more than the counts of any bar


def bar_positions(times_s: NDArray[np.floating], counts: Counts) -> NDArray[np.int64]:
    """Position (N,) of the count at each time, 100 × the counts in its bar + its number.

    Count 3 of a waltz therefore differs from count 3 of a bar of four. A bar that is not complete has the
    metre of the counts. Between counts, the position is `UNKNOWN`.
    """
    found = np.full(len(times_s), UNKNOWN, np.int64)
    if not counts.has_bars or len(counts) < 2:
        return found
    bar = bars_of(counts.numbers)  # (Q,)
    length = np.bincount(bar)
    length[[0, -1]] = counts.metre
    position = _MANY * length[bar] + counts.numbers  # (Q,)
    after = np.searchsorted(counts.times_s, times_s).clip(1, len(counts) - 1)  # (N,)
    is_before = np.abs(counts.times_s[after - 1] - times_s) <= np.abs(counts.times_s[after] - times_s)
    nearest = np.where(is_before, after - 1, after)  # (N,)
    period_s = np.gradient(counts.times_s)[nearest]
    on_count = np.abs(counts.times_s[nearest] - times_s) < _WITHIN * period_s
    found[on_count] = position[nearest[on_count]]
    return found


def count_numbers(positions: NDArray[np.int64]) -> NDArray[np.int64]:
    """The number of the count (N,) at each position in the bar, 0 if it is not known."""
    return positions % _MANY


# Phases in the beat and in the bar, an input of the rollout network.
#
# Counts are continued before the first and after the last one at the tempo there.


COUNT_PHASE_DIM = 4  # cos and sin of the phase of the beat, then of the bar
_END_PERIODS = 8  # the median of so many periods continues the counts
_BEYOND = 10_000  # periods by which counts are continued
_USUAL_S = 0.5  # a count of a song without beats


def count_phase(counts: Counts, times_s: NDArray[np.floating]) -> NDArray[np.float32]:
    """Cos and sin of the phases of beat and bar (T, 4) at each time (T,).

    The phase of the beat is 0 on the count, that of the bar on count 1. A phase is (0, 0) if there are fewer
    than two counts, or two counts 1.
    """
    phases = np.zeros((len(times_s), 2, 2))
    for column, instants_s in enumerate((counts.times_s, counts.downbeat_times_s)):
        if len(instants_s) > 1:
            angle = 2 * np.pi * index_at(instants_s, times_s)
            phases[:, column] = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return phases.reshape(-1, COUNT_PHASE_DIM).astype(np.float32)


def index_at(instants_s: Floats, times_s: NDArray[np.floating]) -> Floats:
    """The fractional index of each time in two or more increasing instants (Q,), below 0 before them."""
    index: Floats = np.interp(times_s, *_continued(instants_s))
    return index


def time_at(instants_s: Floats, index: NDArray[np.floating]) -> Floats:
    """The time at each fractional index in two or more increasing instants (Q,): inverse of `index_at`."""
    known_s, indices = _continued(instants_s)
    times_s: Floats = np.interp(index, indices, known_s)
    return times_s


def counts_later_s(beats_s: ArrayLike, times_s: ArrayLike, n: float) -> Floats:
    """The times `n` counts after times (...), or before them if `n` is negative.

    Beyond the beats (Q,) of a song, counts go on evenly. Without two beats, a count lasts half a second.
    """
    beats = np.asarray(beats_s, np.float64)
    if len(beats) < 2:
        beats = np.array([0.0, _USUAL_S])
    return time_at(beats, index_at(beats, np.asarray(times_s, np.float64)) + n)


def _continued(instants_s: Floats) -> tuple[Floats, Floats]:
    """Instants and their indices, extended by one far before and one far after them."""
    n, periods_s = len(instants_s), np.diff(instants_s)
    before_s = instants_s[0] - _BEYOND * np.median(periods_s[:_END_PERIODS])
    after_s = instants_s[-1] + _BEYOND * np.median(periods_s[-_END_PERIODS:])
    indices = np.concatenate([[-float(_BEYOND)], np.arange(n), [n - 1.0 + _BEYOND]])
    return np.concatenate([[before_s], instants_s, [after_s]]), indices
