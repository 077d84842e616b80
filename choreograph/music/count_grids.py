"""Grids of counts: the steady beats of a song and counts of takes, and micro-timing of accents.

Also the counts at which a dance begins and ends, and the instants at which takes may change.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from choreograph.core.counts import Counts, Figure
from choreograph.core.numerics import Floats
from choreograph.core.timebase import MUSIC_FPS, NET_FPS, SEGMENT_FRAMES
from choreograph.music.beats import onset_strength

# Micro-timing: accents of a take that are close to the count are moved onto it.


MAX_SHIFT_S = 0.05  # largest shift in take and song, beyond which a dance is off the count
_MAX_SHIFT_COUNTS = 0.12  # of a count, the largest shift if counts are close together
_REACH_S = 0.12  # largest distance of a motion beat from its count
_ON_COUNTS = 0.5  # resultant length of the phases, from 0 (anywhere) to 1 (all at one phase)


def accents_lie_on_counts(motion_beats_s: Floats, counts_s: Floats) -> bool:
    """Whether the motion beats (M,) of a take cluster near its counts (Q,), so that it has accents on them.

    This is the case if the resultant length of their phases within the count is 0.5 or more, and their mean
    phase is within an eighth of the count. Ballroom dances reach 0.2 to 0.4. Their dancers pause where the
    technique requires it, and moving these pauses onto the count would look wrong.
    """
    inside = motion_beats_s[(motion_beats_s >= counts_s[0]) & (motion_beats_s <= counts_s[-1])]
    if len(inside) == 0:
        return False
    position = np.interp(inside, counts_s, np.arange(len(counts_s)))
    mean = np.exp(2j * np.pi * position).mean()
    return bool(abs(mean) >= _ON_COUNTS and abs(np.angle(mean)) <= np.pi / 4)


def accent_shifts_s(motion_beats_s: Floats, counts_s: Floats) -> Floats:
    """Delay (Q,) of the accent at each count (Q,) of a take, in seconds of the take.

    It is at most 0.05 s, and 0.12 of a count, to either side. It is 0 at counts without a motion beat (M,)
    within 0.12 s, and everywhere if the accents of the take do not lie on its counts. ChoreoGraph moves
    motion beats onto music beats by DTW alone (section 3.2).
    """
    if len(counts_s) < 2 or not accents_lie_on_counts(motion_beats_s, counts_s):
        return np.zeros(len(counts_s))
    distance_s = motion_beats_s[None, :] - counts_s[:, None]  # (Q, M)
    nearest = np.abs(distance_s).argmin(axis=1)[:, None]
    shift_s = np.take_along_axis(distance_s, nearest, axis=1)[:, 0]
    most_s = min(MAX_SHIFT_S, _MAX_SHIFT_COUNTS * float(np.median(np.diff(counts_s))))
    return np.where(np.abs(shift_s) <= _REACH_S, np.clip(shift_s, -most_s, most_s), 0.0)


# Grids of counts: beats of a song and counts of takes, steady and continued beyond their ends.


FEWEST_COUNTS = 4  # of a song or a take whose counts are used
_STIFFNESS = 20.0  # of the grid, by its third difference, which removes jitter of 10 ms
_MAX_SHIFT_S = 0.03  # largest shift of a beat, also where the tempo changes suddenly
_PADDING = 64  # counts added beyond both ends, at the period there
_EASED = np.linspace(-0.25, 0.25, 5)  # of a period, around a time whose index is the mean
_DANCED_PADDING = 4  # added counts that a time map may use, since a take continues its counts for so long
_INSIDE_FIGURE = 0.6


def steady_times_s(times_s: Floats) -> Floats:
    """Beats or counts (Q,) without the jitter of a tracker, so that their tempo changes smoothly.

    The sum of the squared shifts and of the squared third differences of the times is minimised, with more
    weight on beats that would be shifted by over 0.03 s. None is shifted further.
    """
    n = len(times_s)
    if n < 5:
        return times_s
    taps = np.array([1.0, -3.0, 3.0, -1.0])
    weights = np.ones(n)
    steady = times_s
    for _ in range(4):
        bands = np.zeros((4, n))
        bands[0] = weights
        for i, a in enumerate(taps):
            for j in range(i, 4):
                bands[j - i, i : i + n - 3] += _STIFFNESS * a * taps[j]
        steady = scipy.linalg.solveh_banded(bands, weights * times_s, lower=True)
        far = np.abs(steady - times_s) > _MAX_SHIFT_S
        if not far.any():
            break
        weights[far] *= 20.0
    steady = np.clip(steady, times_s - _MAX_SHIFT_S, times_s + _MAX_SHIFT_S)
    return steady if (np.diff(steady) > 0).all() else times_s


@dataclass(frozen=True, eq=False)
class SongGrid:
    """The grid of a song's beats. Every instant has a beat index, which is fractional between beats."""

    times_s: Floats  # (Q,) steady or eased, padded far beyond both ends of the song
    numbers: NDArray[np.int64]  # (Q,) in the bar, or 0 where bars are not known
    eased: bool = False

    @classmethod
    def of(cls, counts: Counts, duration_s: float, *, eased: bool = False) -> SongGrid | None:
        """The grid of a song's beats, or None if it has too few.

        Counts of unequal lengths are `eased`: the index between them changes its speed gradually. They are
        those of another metre, on the bars of the song.
        """
        if len(counts) < FEWEST_COUNTS:
            return None
        times_s = counts.times_s if eased else steady_times_s(counts.times_s)
        first_s, last_s = _end_periods_s(times_s)
        n_before = 2 + int(np.ceil(times_s[0] / first_s))
        n_after = 2 + int(np.ceil((duration_s + SEGMENT_FRAMES / NET_FPS - times_s[-1]) / last_s))
        return cls(*_padded(counts, times_s, max(2, n_before), max(2, n_after)), eased)

    @cached_property
    def period_s(self) -> Floats:
        """The beat period around each beat, (Q,)."""
        return _periods_s(self.times_s)

    def index_at(self, times_s: Floats) -> Floats:
        """The fractional beat index at each time."""
        index = np.arange(len(self.times_s))
        if not self.eased:
            return np.interp(times_s, self.times_s, index)
        around_s = np.median(np.diff(self.times_s)) * _EASED
        around = [np.interp(times_s + offset_s, self.times_s, index) for offset_s in around_s]
        mean: Floats = np.mean(around, axis=0)
        return mean

    def time_at(self, index: float) -> float:
        """The time of a fractional beat index."""
        return float(np.interp(index, np.arange(len(self.times_s)), self.times_s))


def _periods_s(times_s: Floats) -> Floats:
    """The mean of the periods before and after each of these beats or counts (Q,)."""
    return np.gradient(times_s) if len(times_s) > 1 else np.ones(len(times_s))


def _end_periods_s(times_s: Floats) -> tuple[float, float]:
    """The periods with which counts (Q,) are continued before the first and after the last one."""
    periods_s = np.diff(times_s)
    return float(np.median(periods_s[:8])), float(np.median(periods_s[-8:]))


def _padded(counts: Counts, times: Floats, n_before: int, n_after: int) -> tuple[Floats, NDArray[np.int64]]:
    """Times (Q,) and numbers of counts, continued beyond both ends with the period and the bars there."""
    first_s, last_s = _end_periods_s(times)
    before = times[0] - first_s * np.arange(n_before, 0, -1)
    after = times[-1] + last_s * np.arange(1, n_after + 1)
    metre = max(counts.metre, 1)
    numbers = np.concatenate(
        [
            (counts.numbers[0] - 1 - np.arange(n_before, 0, -1)) % metre + 1,
            counts.numbers,
            (counts.numbers[-1] - 1 + np.arange(1, n_after + 1)) % metre + 1,
        ]
    )
    return np.concatenate([before, times, after]), numbers if counts.has_bars else np.zeros_like(numbers)


class TakeGrids:
    """The counts of all takes of a repertoire, concatenated, with counts added beyond the ends of takes."""

    def __init__(
        self,
        counts: Sequence[Counts],
        figures: Sequence[Sequence[Figure]],
        motion_beats_s: Sequence[Floats] | None = None,
    ) -> None:
        """The grids of takes by their counts, figures and motion beats, for micro-timing."""
        self.counted = np.array([len(take) >= FEWEST_COUNTS for take in counts], bool)  # (takes,)
        parts = [
            _padded(take, steady_times_s(take.times_s), _PADDING, _PADDING)
            if known
            else (np.zeros(1), np.zeros(1, np.int64))
            for take, known in zip(counts, self.counted, strict=True)
        ]
        lengths = np.array([len(times) for times, _ in parts], np.int64)
        self.start = np.cumsum(lengths) - lengths  # (takes,) row of each take's first padded count
        self.n_counts = lengths
        self.times_s = np.concatenate([times for times, _ in parts])
        self.numbers = np.concatenate([numbers for _, numbers in parts])
        self.phrase_penalty = np.concatenate(
            [_phrase_penalty(*part, named) for part, named in zip(parts, figures, strict=True)]
        )
        self.period_s = np.concatenate([_periods_s(times) for times, _ in parts])
        # How much later than each count its accent is, or 0 without motion beats.
        self.accent_shift_s = np.zeros(len(self.times_s))
        if motion_beats_s is not None:
            for take in np.flatnonzero(self.counted).tolist():
                known = slice(self.start[take] + _PADDING, self.start[take] + lengths[take] - _PADDING)
                self.accent_shift_s[known] = accent_shifts_s(motion_beats_s[take], self.times_s[known])

    def among(self, takes: NDArray[np.integer], n_takes: int) -> TakeGrids:
        """The grids of takes that have other numbers (M,) among `n_takes`. The others have no counts."""
        every = copy(self)
        every.counted, every.start = np.zeros(n_takes, bool), np.zeros(n_takes, np.int64)
        every.n_counts = np.ones(n_takes, np.int64)
        every.counted[takes], every.start[takes], every.n_counts[takes] = (
            self.counted,
            self.start,
            self.n_counts,
        )
        return every

    def count_s(self, take: NDArray[np.integer], index: Floats) -> Floats:
        """Times in their takes (K, T) at fractional count indices (K, T)."""
        last = (self.start + self.n_counts - 1)[take][:, None]
        row = np.clip(index + self.start[take][:, None], self.start[take][:, None], last - 1e-9)
        low = np.minimum(row.astype(np.int64), last - 1)
        times_s: Floats = self.times_s[low] + (row - low) * (self.times_s[low + 1] - self.times_s[low])
        return times_s

    def accents_at(self, take: NDArray[np.integer], index: NDArray[np.int64]) -> tuple[Floats, Floats]:
        """Delays of the accents at counts by index (K, Q), and periods of these counts, in seconds."""
        row = self._row(take, index)
        return self.accent_shift_s[row], self.period_s[row]

    def index_at(self, take: NDArray[np.integer], times_s: Floats) -> Floats:
        """Fractional count indices (N,) of times (N,) in their takes."""
        index = np.empty(len(take))
        order = np.argsort(take, kind="stable")
        ones, firsts = np.unique(take[order], return_index=True)
        for one, here in zip(ones.tolist(), np.split(order, firsts[1:]), strict=True):
            rows = slice(self.start[one], self.start[one] + self.n_counts[one])
            index[here] = np.interp(times_s[here], self.times_s[rows], np.arange(self.n_counts[one]))
        return index

    def reaches(self, take: NDArray[np.integer], index: Floats) -> NDArray[np.bool_]:
        """Whether spans of count indices (K, 2) are counted, with a few counts beyond the known ones."""
        first, last = _PADDING - _DANCED_PADDING, (self.n_counts - 1 - _PADDING + _DANCED_PADDING)[take]
        inside: NDArray[np.bool_] = (index[:, 0] >= first) & (index[:, 1] <= last)
        return inside

    def number_at(self, take: NDArray[np.integer], index: NDArray[np.int64]) -> NDArray[np.int64]:
        """Numbers in the bar of counts by index (K, Q)."""
        return self.numbers[self._row(take, index)]

    def phrase_penalty_at(self, take: NDArray[np.integer], index: NDArray[np.int64]) -> Floats:
        """Penalty of leaving or entering a take at counts (K, Q): see `_phrase_penalty`."""
        return self.phrase_penalty[self._row(take, index)]

    def _row(self, take: NDArray[np.integer], index: NDArray[np.int64]) -> NDArray[np.int64]:
        rows: NDArray[np.int64] = self.start[take][:, None] + np.clip(
            index, 0, (self.n_counts - 1)[take][:, None]
        )
        return rows


def _phrase_penalty(times_s: Floats, numbers: NDArray[np.int64], figures: Sequence[Figure]) -> Floats:
    """Penalty, 0 to 1, of leaving or entering a take at each of its counts (Q,).

    It is 0 at the border of a figure, or of a bar where no figures are known. It is 0.6 on count 1 inside a
    figure. It is 1 elsewhere, and on all counts if neither is known.
    """
    on_bar = numbers == 1
    if not figures:
        return np.where(on_bar, 0.0, 1.0)
    borders_s = np.array([time_s for figure in figures for time_s in (figure.start_s, figure.end_s)])
    on_border = np.zeros(len(times_s), bool)
    on_border[np.abs(times_s[:, None] - borders_s).argmin(axis=0)] = True
    return np.where(on_border, 0.0, np.where(on_bar, _INSIDE_FIGURE, 1.0))


# The part of a song that is danced, and the instants at which takes may change.

_PICK_UP_S = 0.5  # danced at full speed before the first count, which prepares it
_EASE_IN_S = 0.4  # from the first held pose to full speed, before that
_EASE_OUT_S = 0.3  # from full speed to the last held pose, before the last count
_SETTLE_S = 0.08  # the same after the last count
REACH_S = 0.5  # largest distance of a change of takes from its second
FIRST_HOLD_S = 0.7  # least time before the first count, in which the dance sets off and prepares it
LAST_HOLD_S = 0.3  # least time for which the last pose is held
_STRONG = 0.3  # of the song's usual strength at beats. Weaker ones do not start or end a dance
_GOES_ON = 0.6  # of it, from which beats after the last strong downbeat are danced, too
_SOUNDING = 0.1  # of the strength of its strongest beats. Weaker ones do not enter the usual strength
_BAR_OF = 4  # beats that must be strong, on average, where the dance starts
_NEAR_FRAMES = 3  # 50 ms, within which an onset counts as on the beat


def dance_span_s(counts: Counts, log_mel: NDArray[np.floating], duration_s: float) -> tuple[float, float]:
    """The times of the first and the last count of a song that are danced, in seconds.

    They are strong beats. A dance begins with the first one, as a pick-up if it is not on a downbeat. It ends
    on the last downbeat, or later if the song goes on at its usual strength, as in an excerpt. At least 0.7 s
    at the beginning and 0.3 s at the end remain, in which the dance sets off and holds its last pose. An
    introduction or an ending without beats is not danced. A song without beats is danced from 0 to its end.
    """
    beats = np.flatnonzero((counts.times_s >= FIRST_HOLD_S) & (counts.times_s <= duration_s - LAST_HOLD_S))
    if len(beats) < 2 * _BAR_OF:
        return 0.0, duration_s
    strength = _strength_at(counts.times_s[beats], log_mel)
    usual = float(np.median(strength[strength >= _SOUNDING * np.percentile(strength, 95)]))
    enough = _STRONG * usual
    # Mean of a beat and the three before it. One loud beat does not make up for three silent ones.
    ahead = np.convolve(np.minimum(strength, usual), np.ones(_BAR_OF) / _BAR_OF)
    starts = np.flatnonzero((ahead[_BAR_OF - 1 : len(beats)] >= enough) & (strength[: 1 - _BAR_OF] >= enough))
    ends = np.flatnonzero(strength >= enough)
    first = starts[0] if len(starts) else 0
    closes = ends[(counts.numbers[beats[ends]] == 1) | (strength[ends] >= _GOES_ON * usual)]
    last = closes[-1] if len(closes) else ends[-1]
    if last - first < _BAR_OF:
        return 0.0, duration_s
    return float(counts.times_s[beats[first]]), float(counts.times_s[beats[last]])


def setting_off_s(opening_s: float) -> tuple[float, float]:
    """From when to when a dance goes from its first held pose to full speed: 0.4 s, and 0.5 s early.

    With less time before the first count, it sets off at the start of the song.
    """
    ease_s = min(_EASE_IN_S, opening_s)
    stop_s = opening_s - min(_PICK_UP_S, opening_s - ease_s)
    return stop_s - ease_s, stop_s


def coming_to_rest_s(opening_s: float, closing_s: float) -> tuple[float, float]:
    """The span from full speed to the last held pose: 0.38 s, but not before `opening_s`."""
    return max(opening_s, closing_s - _EASE_OUT_S), closing_s + _SETTLE_S


def held_times_s(opening_s: float, closing_s: float) -> tuple[float, float]:
    """The times whose poses are held before the first and after the last count, half-way through an ease."""
    first, last = setting_off_s(opening_s), coming_to_rest_s(opening_s, closing_s)
    return 0.5 * sum(first), 0.5 * sum(last)


def _strength_at(times_s: Floats, log_mel: NDArray[np.floating]) -> Floats:
    """Greatest onset strength within 50 ms of each time, (Q,)."""
    strength = onset_strength(log_mel)
    frames = np.round(times_s * MUSIC_FPS).astype(np.int64)[:, None]
    near = frames + np.arange(-_NEAR_FRAMES, _NEAR_FRAMES + 1)
    strongest: Floats = strength[np.clip(near, 0, len(strength) - 1)].max(axis=1)
    return strongest


def join_times_s(counts: Counts, n_borders: int) -> Floats:
    """The instants (B,) near seconds 0 … B - 1 at which takes may change.

    It is the downbeat within half a second, else the nearest beat, else the second itself. No two seconds
    share an instant.
    """
    seconds = np.arange(n_borders, dtype=np.float64)
    joins = seconds.copy()
    for instants in (counts.times_s, counts.downbeat_times_s):  # downbeats replace beats
        border = np.round(instants).astype(np.int64)
        for second in np.unique(border[(border >= 0) & (border < n_borders)]):
            near = instants[border == second]
            joins[second] = near[np.argmin(np.abs(near - second))]
    return joins
