"""Where other music begins: the instants at which the tempo or the metre of a song changes.

A ramp has none, since its tempo is hardly another a few beats later; nor has a single irregular bar. A
tracker that counts a break at half the tempo makes two.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from choreograph.counts import Counts

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_OTHER_TEMPO_OCTAVES = 0.085  # 6 %; over six beats a ramp from 90 to 140 BPM in 50 s makes up to 5 %
_PERIODS, _FEWEST_PERIODS = 6, 4  # before and after a change of tempo
_BARS, _FEWEST_BARS = 4, 3  # before and after a change of metre
SAME_S = 1.5  # a tracker may go over to another tempo a beat or two late
PLAUSIBLE_METRES = (3, 4)  # other bars are beats lost or added by the tracker, or cut at a splice
_CLEARLY_MOST = 0.75  # of a part's plausible bars


def change_times_s(counts: Counts) -> Floats:
    """The beats (C,), in seconds, from which on the tempo or the metre of a song is another.

    The median of six beat periods changes by more than 6 %, or the metre of four bars to that of the next
    four: see `part_metre`.
    """
    beats = np.union1d(_tempo_changes(counts.times_s), _metre_changes(counts))
    return counts.times_s[beats]


def at_changes(bounds_s: NDArray[np.number], changes_s: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Which bounds (B,) of sections lie at a change (C,) of tempo or metre: within 1.5 s."""
    return np.any(np.abs(np.subtract.outer(bounds_s, changes_s)) <= SAME_S, axis=1)


def part_metre(bar_lengths: Ints, metre: int) -> int:
    """The metre of a part of a song in `metre`, whose whole bars have these lengths (B,) in beats.

    That of the song, unless at least three quarters of two plausible bars or more have another.
    """
    bars = bar_lengths[np.isin(bar_lengths, PLAUSIBLE_METRES)]
    if len(bars) < 2:
        return metre
    commonest = int(np.bincount(bars).argmax())
    return commonest if np.mean(bars == commonest) >= _CLEARLY_MOST else metre


def _tempo_changes(times_s: Floats) -> Ints:
    octaves = np.log2(np.diff(times_s))  # (Q - 1,) of each beat period

    def change(beat: int) -> float:
        """How much the periods differ before and after a beat, in octaves; 0 where that is no other tempo."""
        before, after = octaves[max(0, beat - _PERIODS) : beat], octaves[beat : beat + _PERIODS]
        if min(len(before), len(after)) < _FEWEST_PERIODS:
            return 0.0
        if abs(np.median(after) - np.median(before)) <= _OTHER_TEMPO_OCTAVES:
            return 0.0
        return float(abs(after.mean() - before.mean()))  # greatest where all periods differ

    return _peaks(change, np.arange(len(octaves)))


def _metre_changes(counts: Counts) -> Ints:
    downbeats = np.flatnonzero(counts.numbers == 1)
    lengths = np.diff(downbeats)  # (bars,)

    def change(bar: int) -> float:
        """How clear the two metres before and after a bar are, up to 2; 0 where they are one."""
        before, after = lengths[max(0, bar - _BARS) : bar], lengths[bar : bar + _BARS]
        if min(len(before), len(after)) < _FEWEST_BARS:
            return 0.0
        metres = [part_metre(bars, 0) for bars in (before, after)]
        if 0 in metres or metres[0] == metres[1]:
            return 0.0
        return float(np.mean(before == metres[0]) + np.mean(after == metres[1]))

    return downbeats[_peaks(change, np.arange(len(lengths)))]


def _peaks(height_at: Callable[[int], float], positions: Ints) -> Ints:
    """The highest position of each run of those with a height."""
    height = np.array([height_at(int(position)) for position in positions])
    runs = np.split(positions, np.flatnonzero(np.diff(height > 0)) + 1)
    return np.array([run[height[run].argmax()] for run in runs if len(run) and height[run[0]] > 0], np.int64)
