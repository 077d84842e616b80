"""`BeatClock`, the beats of music that is still playing, continued into the seconds that come."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from choreograph.core.counts import FROM_MUSIC, NO_COUNTS, Counts
from choreograph.core.numerics import Floats

CORRECTION_BEATS = (
    2.0  # in which an error of the phase is corrected, by a tempo up to a quarter faster or slower
)


@dataclass(frozen=True)
class BeatClock:
    """Beats as positions: beat i is where the position is i. The position is continuous and increases.

    Between the start and the time when the correction ends, the position runs at one rate, and from then on
    at the tempo. Before the start it is continued backwards at the tempo.
    """

    start_s: float  # in the stream
    start_beat: float  # the position there
    steady_s: float  # when a correction of the phase ends, after the start
    steady_beat: float  # the position there
    period_s: float  # between two beats
    metre: int = 0  # beats in a bar, or 0 if bars are not known
    first_number: int = 0  # number in the bar of beat 0, from 0 to metre - 1
    generation: int = 0  # another one has other beats, and not only corrected ones

    @classmethod
    def steady(cls, time_s: float, beat: float, period_s: float, generation: int) -> BeatClock:
        """A clock with a position at a time, without a correction."""
        return cls(time_s, beat, time_s + period_s, beat + 1.0, period_s, generation=generation)

    def beat_at(self, times_s: ArrayLike) -> Floats:
        """The positions at times (...) of the stream."""
        times = np.asarray(times_s, np.float64)
        before = self.start_beat + (times - self.start_s) / self.period_s
        after = self.steady_beat + (times - self.steady_s) / self.period_s
        share = (times - self.start_s) / (self.steady_s - self.start_s)
        between = self.start_beat + share * (self.steady_beat - self.start_beat)
        beats: Floats = np.where(share < 0, before, np.where(share > 1, after, between))
        return beats

    def time_at(self, beats: ArrayLike) -> Floats:
        """The times in the stream at positions (...): inverse of `beat_at`."""
        given = np.asarray(beats, np.float64)
        before = self.start_s + (given - self.start_beat) * self.period_s
        after = self.steady_s + (given - self.steady_beat) * self.period_s
        share = (given - self.start_beat) / (self.steady_beat - self.start_beat)
        between = self.start_s + share * (self.steady_s - self.start_s)
        times: Floats = np.where(share < 0, before, np.where(share > 1, after, between))
        return times

    def number_of(self, beats: ArrayLike) -> np.ndarray:
        """The numbers in the bar, from 1, of whole positions (...), or 0 if bars are not known."""
        index = np.asarray(beats, np.int64)
        return (index + self.first_number) % self.metre + 1 if self.metre else np.zeros_like(index)

    def counts(self, from_s: float, to_s: float) -> Counts:
        """The beats from one time of the stream to another, with times from the first one."""
        first, last = np.ceil(self.beat_at(from_s) - 1e-9), np.floor(self.beat_at(to_s) + 1e-9)
        if last < first:
            return NO_COUNTS
        index = np.arange(int(first), int(last) + 1)
        return Counts(
            np.clip(self.time_at(index) - from_s, 0.0, to_s - from_s), self.number_of(index), self.metre,
            FROM_MUSIC,
        )  # fmt: skip

    def followed(self, time_s: float, error_beats: float, period_s: float) -> BeatClock:
        """This clock from a time on, with an error of its phase there corrected, at another tempo.

        The error is what must be added to the position, at most half a beat.
        """
        beat = float(self.beat_at(time_s))
        corrected = beat + CORRECTION_BEATS + error_beats
        return BeatClock(
            time_s, beat, time_s + CORRECTION_BEATS * period_s, corrected, period_s, self.metre,
            self.first_number, self.generation,
        )  # fmt: skip
