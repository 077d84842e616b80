"""Time maps that lay a take's counts on a song's beats: count k + d of the take on beat k of the song.

A take whose counts are known needs no search for its tempo: one whole number, the shift d, says how it is
danced to the song, and its bars lie on the song's bars for every shift that brings count 1 to a downbeat.
All seconds of a take with one shift are one continuous time map, its track, however many clips it spans.
ChoreoGraph warps every clip by tempo-density instead (section 3.2; `segments`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from choreograph.counts import Counts, Figure
from choreograph.timebase import CLIP_FRAMES, MAX_SLOPE, MIN_SLOPE, NET_FPS, SEGMENT_FRAMES
from choreograph.warping.micro_timing import accent_shifts_s

Floats = NDArray[np.float64]

NO_TRACK = -1
_MIN_COUNTS = 4
_STIFFNESS = 20.0  # of beat times against the third difference of the grid: jitter of 10 ms is evened out,
_MAX_SHIFT_S = 0.03  # but no beat is moved further, however suddenly the tempo changes
_PADDING = 64  # counts beyond both ends, at the period there,
_DANCED_PADDING = 4  # of which a map may use these: that far a take hardly leaves its counts
_MAX_SHIFTS = 9  # tried around the middle of a clip: two bars of four to each side
_INSIDE_FIGURE = 0.6
_ON_BEAT = 1e-9  # of a beat, by which rounding moves one across a border
_SHIFTS_PER_TRACK = 1 << 20  # above the number of counts of any song or take


def steady_times_s(times_s: Floats) -> Floats:
    """Beats or counts (Q,) without the jitter of a tracker: their tempo changes smoothly.

    The least sum of squared shifts and of the squared third differences of the times, with more weight on
    beats that would be shifted by over 0.03 s; none is shifted further.
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
        steady = solveh_banded(bands, weights * times_s, lower=True)
        far = np.abs(steady - times_s) > _MAX_SHIFT_S
        if not far.any():
            break
        weights[far] *= 20.0
    steady = np.clip(steady, times_s - _MAX_SHIFT_S, times_s + _MAX_SHIFT_S)
    return steady if (np.diff(steady) > 0).all() else times_s


@dataclass(frozen=True, eq=False)
class SongGrid:
    """A song's beats as a clock: every instant has a beat index, fractional between beats."""

    times_s: Floats  # (Q,) steady, padded far beyond both ends of the song
    numbers: NDArray[np.int64]  # (Q,) in the bar; 0 where bars are not known

    @classmethod
    def of(cls, counts: Counts, duration_s: float) -> SongGrid | None:
        """The grid of a song's beats; None if it has too few."""
        if len(counts) < _MIN_COUNTS:
            return None
        times_s = steady_times_s(counts.times_s)
        first_s, last_s = _end_periods_s(times_s)
        n_before = 2 + int(np.ceil(times_s[0] / first_s))
        n_after = 2 + int(np.ceil((duration_s + SEGMENT_FRAMES / NET_FPS - times_s[-1]) / last_s))
        return cls(*_padded(counts, max(2, n_before), max(2, n_after)))

    def index_at(self, times_s: Floats) -> Floats:
        """The fractional beat index at each time."""
        return np.interp(times_s, self.times_s, np.arange(len(self.times_s)))

    def time_at(self, index: float) -> float:
        """The time of a fractional beat index."""
        return float(np.interp(index, np.arange(len(self.times_s)), self.times_s))


def _end_periods_s(times_s: Floats) -> tuple[float, float]:
    """The periods at which counts (Q,) are continued before the first and after the last."""
    periods_s = np.diff(times_s)
    return float(np.median(periods_s[:8])), float(np.median(periods_s[-8:]))


def _padded(counts: Counts, n_before: int, n_after: int) -> tuple[Floats, NDArray[np.int64]]:
    """Steady times and numbers, continued beyond both ends at the period and in the bars there."""
    times = steady_times_s(counts.times_s)
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
    """The counts of all takes of a repertoire, end to end, padded beyond both ends of each take."""

    def __init__(
        self,
        counts: Sequence[Counts],
        figures: Sequence[Sequence[Figure]],
        motion_beats_s: Sequence[Floats] | None = None,
    ) -> None:
        """The grids of takes by their counts, figures and motion beats, for micro-timing."""
        self.counted = np.array([len(take) >= _MIN_COUNTS for take in counts], bool)  # (takes,)
        parts = [
            _padded(take, _PADDING, _PADDING) if known else (np.zeros(1), np.zeros(1, np.int64))
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
        # How much later than each count its accent is; none is known without motion beats.
        self.accent_shift_s = np.zeros(len(self.times_s))
        if motion_beats_s is not None:
            for take in np.flatnonzero(self.counted).tolist():
                known = slice(self.start[take] + _PADDING, self.start[take] + lengths[take] - _PADDING)
                self.accent_shift_s[known] = accent_shifts_s(motion_beats_s[take], self.times_s[known])

    def count_s(self, take: NDArray[np.integer], index: Floats) -> Floats:
        """Times in their takes (K, T) at fractional count indices (K, T)."""
        low, since = self._row_below(take, index)
        return self.times_s[low] + since * (self.times_s[low + 1] - self.times_s[low])

    def source_s(self, take: NDArray[np.integer], index: Floats) -> Floats:
        """Times in their takes (K, T) danced at fractional count indices (K, T), with accents on counts."""
        low, since = self._row_below(take, index)
        eased = since**2 * (3.0 - 2.0 * since)  # so that no count makes a corner in the shift
        shift_s = self.accent_shift_s
        return self.count_s(take, index) + shift_s[low] + eased * (shift_s[low + 1] - shift_s[low])

    def _row_below(self, take: NDArray[np.integer], index: Floats) -> tuple[NDArray[np.int64], Floats]:
        """Rows (K, T) of the counts before fractional indices (K, T), and how far beyond them, 0 … 1."""
        last = (self.start + self.n_counts - 1)[take][:, None]
        row = np.clip(index + self.start[take][:, None], self.start[take][:, None], last - 1e-9)
        low = np.minimum(row.astype(np.int64), last - 1)
        return low, row - low

    def index_at(self, take: NDArray[np.integer], times_s: Floats) -> Floats:
        """Fractional count indices (N,) of times (N,) in their takes."""
        index = np.empty(len(take))
        for one in np.unique(take):
            rows = slice(self.start[one], self.start[one] + self.n_counts[one])
            here = take == one
            index[here] = np.interp(times_s[here], self.times_s[rows], np.arange(self.n_counts[one]))
        return index

    def reaches(self, take: NDArray[np.integer], index: Floats) -> NDArray[np.bool_]:
        """Whether spans of count indices (K, 2) are counted, but for a few counts beyond the known ones."""
        first, last = _PADDING - _DANCED_PADDING, (self.n_counts - 1 - _PADDING + _DANCED_PADDING)[take]
        return (index[:, 0] >= first) & (index[:, 1] <= last)

    def number_at(self, take: NDArray[np.integer], index: NDArray[np.int64]) -> NDArray[np.int64]:
        """Numbers in the bar of counts by index (K, Q)."""
        return self.numbers[self._row(take, index)]

    def phrase_penalty_at(self, take: NDArray[np.integer], index: NDArray[np.int64]) -> Floats:
        """How ill-timed it is to leave or enter a take at counts (K, Q): see `_phrase_penalty`."""
        return self.phrase_penalty[self._row(take, index)]

    def _row(self, take: NDArray[np.integer], index: NDArray[np.int64]) -> NDArray[np.int64]:
        return self.start[take][:, None] + np.clip(index, 0, (self.n_counts - 1)[take][:, None])


def _phrase_penalty(times_s: Floats, numbers: NDArray[np.int64], figures: Sequence[Figure]) -> Floats:
    """How ill-timed it is to leave or enter a take at each of its counts (Q,).

    0 at the border of a figure, or of a bar where no figures are known; 0.6 on count 1 inside a figure; 1
    elsewhere, and on all counts if neither is known.
    """
    on_bar = numbers == 1
    if not figures:
        return np.where(on_bar, 0.0, 1.0)
    borders_s = np.array([time_s for figure in figures for time_s in (figure.start_s, figure.end_s)])
    on_border = np.zeros(len(times_s), bool)
    on_border[np.abs(times_s[:, None] - borders_s).argmin(axis=0)] = True
    return np.where(on_border, 0.0, np.where(on_bar, _INSIDE_FIGURE, 1.0))


@dataclass(frozen=True, eq=False)
class CountMaps:
    """Time maps of one second's candidates; K' of the K have one."""

    candidates: NDArray[np.int64]  # (K',) which of the candidates
    time_maps: Floats  # (K', 81) clip frames at the 80 output frames and the end
    track: NDArray[np.int64]  # (K',) one number for each take and shift
    off_bar: Floats  # (K', 4) share of each quarter's beats whose number is not the take's
    phrase_penalty: Floats  # (K', 5) of the quarters' borders: see `TakeGrids.phrase_penalty_at`


@dataclass(frozen=True, eq=False)
class CountedClips:
    """The clips of a repertoire, and what is needed to lay them on a song's beats."""

    take: NDArray[np.integer]  # (N,)
    start_s: Floats  # (N,) in their takes
    middle_index: Floats  # (N,) fractional count index of the start of their middle 4 s
    takes: TakeGrids
    song: SongGrid
    join_times_s: Floats  # (S + 5,) where takes may change, around every second of the song

    @classmethod
    def of(
        cls,
        take: NDArray[np.integer],
        start_frame: NDArray[np.integer],
        takes: TakeGrids,
        song: SongGrid,
        join_times_s: Floats,
    ) -> CountedClips:
        """Clips by their takes (N,) and first frames (N,) at 20 fps."""
        start_s = start_frame / NET_FPS
        middle_s = start_s + (CLIP_FRAMES - SEGMENT_FRAMES) / 2 / NET_FPS
        return cls(take, start_s, takes.index_at(take, middle_s), takes, song, join_times_s)


def count_time_maps(second: int, clip: NDArray[np.integer], clips: CountedClips) -> CountMaps:
    """Lay clips (K,) of counted takes on the beats of the 4 s from `second`.

    Of the shifts that keep the 4 s inside the clip and its tempo in [0.5, 2], each clip gets the one with the
    most numbers in the bar as in the song, and of those the nearest to its middle 4 s, which its style vector
    describes. Clips of takes without counts, and those for which no shift remains, get no map; nor do those
    of a part of a take that nobody counted, but for 4 counts beyond the part that is.
    """
    takes, song = clips.takes, clips.song
    candidates = np.flatnonzero(takes.counted[clips.take[clip]])
    counted = clip[candidates]  # (K',)
    take, start_s, wanted = clips.take[counted], clips.start_s[counted], clips.middle_index[counted]
    index = song.index_at(second + np.arange(SEGMENT_FRAMES + 1) / NET_FPS)  # (81,)
    beats = np.arange(*np.ceil(index[[0, -1]] - _ON_BEAT).astype(int))  # (Q,) inside the 4 s
    nearest = np.round(wanted - index[0])  # (K',)
    best = np.full(len(counted), np.inf)
    shift = np.zeros(len(counted), np.int64)
    for step in range(-_MAX_SHIFTS + 1, _MAX_SHIFTS):
        tried = (nearest + step).astype(np.int64)
        ends = index[[0, -1]] + tried[:, None]  # (K', 2)
        ends_s = takes.source_s(take, ends) - start_s[:, None]
        inside = (ends_s[:, 0] >= 0) & (ends_s[:, 1] <= (CLIP_FRAMES - 1) / NET_FPS)
        inside &= takes.reaches(take, ends)
        off_bar = _off_bar(song, takes, take, beats, tried).mean(axis=1) if len(beats) else 0.0
        # A bar that fits is worth more than any distance from the middle.
        cost = np.where(inside, 100.0 * off_bar + np.abs(tried + index[0] - wanted), np.inf)
        better = cost < best
        best[better], shift[better] = cost[better], tried[better]
    laid = index + shift[:, None]  # (K', 81)
    maps = (takes.source_s(take, laid) - start_s[:, None]) * NET_FPS
    # The limits are those of the tempo: an accent may be hurried or awaited a little beyond them.
    slopes = np.diff(takes.count_s(take, laid), axis=1) * NET_FPS
    fits = np.isfinite(best) & (slopes.min(axis=1) >= MIN_SLOPE) & (slopes.max(axis=1) <= MAX_SLOPE)
    off_bar = _per_quarter(_off_bar(song, takes, take, beats, shift), beats, index)
    track = take.astype(np.int64) * _SHIFTS_PER_TRACK + shift + _SHIFTS_PER_TRACK // 2
    joins = np.round(song.index_at(clips.join_times_s[second : second + 5])).astype(np.int64)  # (5,)
    phrase_penalty = takes.phrase_penalty_at(take, joins + shift[:, None])
    return CountMaps(candidates[fits], maps[fits], track[fits], off_bar[fits], phrase_penalty[fits])


def _off_bar(
    song: SongGrid,
    takes: TakeGrids,
    take: NDArray[np.integer],
    beats: NDArray[np.int64],
    shift: NDArray[np.int64],
) -> Floats:
    """1 where the number of a beat is not that of the take's count on it, (K', Q); 0 where one is unknown."""
    numbers = takes.number_at(take, beats + shift[:, None])
    wanted = song.numbers[beats]
    return ((numbers != wanted) & (numbers > 0) & (wanted > 0)).astype(np.float64)


def _per_quarter(off_bar: Floats, beats: NDArray[np.int64], index: Floats) -> Floats:
    """Means (K', 4) over the beats of each quarter of the segment; 0 in a quarter without beats."""
    borders = np.searchsorted(beats, index[:: SEGMENT_FRAMES // 4] - _ON_BEAT)  # (5,)
    means = np.zeros((len(off_bar), 4))
    for quarter, (low, high) in enumerate(pairwise(borders)):
        if high > low:
            means[:, quarter] = off_bar[:, low:high].mean(axis=1)
    return means
