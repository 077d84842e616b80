"""The metrical level of a song's beats, and the instants at which its tempo or metre changes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from choreograph.core.counts import Counts, time_at
from choreograph.core.numerics import Floats, Indices
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.music._bar_weights import EIGHTHS_WEIGHTS
from choreograph.music.bars import beat_evidence, track_bars

# The instants at which the tempo or the metre of a song changes, as where other music begins.
#
# A ramp has none, since its tempo hardly differs a few beats later. A single irregular bar has none either. A
# tracker that counts a break at half the tempo makes two.


_OTHER_TEMPO_OCTAVES = 0.085  # 6 %. Over six beats a ramp from 90 to 140 BPM in 50 s changes by up to 5 %
_PERIODS, _FEWEST_PERIODS = 6, 4  # before and after a change of tempo
_BARS, _FEWEST_BARS = 4, 3  # before and after a change of metre
SAME_S = 1.5  # a tracker may follow a change of tempo a beat or two late
PLAUSIBLE_METRES = (3, 4)  # other bars have beats lost or added by the tracker, or are cut at a splice
_CLEARLY_MOST = 0.75  # share of a part's plausible bars that determine its metre


def change_times_s(counts: Counts) -> Floats:
    """The beats (C,), in seconds, at which the tempo or the metre of a song changes.

    The tempo changes if the median of six beat periods changes by more than 6 %. The metre changes if that of
    four bars differs from that of the next four (see `part_metre`).
    """
    beats = np.union1d(_tempo_changes(counts.times_s), _metre_changes(counts))
    return counts.times_s[beats]


def at_changes(bounds_s: NDArray[np.number], changes_s: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Which bounds (B,) of sections lie within 1.5 s of a change (C,) of tempo or metre."""
    near: NDArray[np.bool_] = np.any(np.abs(np.subtract.outer(bounds_s, changes_s)) <= SAME_S, axis=1)
    return near


def part_metre(bar_lengths: Indices, metre: int) -> int:
    """The metre of a part of a song in `metre`, whose whole bars have these lengths (B,) in beats.

    It is that of the song, unless there are two plausible bars or more and at least three quarters of them
    have another metre.
    """
    bars = bar_lengths[np.isin(bar_lengths, PLAUSIBLE_METRES)]
    if len(bars) < 2:
        return metre
    commonest = int(np.bincount(bars).argmax())
    return commonest if np.mean(bars == commonest) >= _CLEARLY_MOST else metre


def _tempo_changes(times_s: Floats) -> Indices:
    octaves = np.log2(np.diff(times_s))  # (Q - 1,) of each beat period

    def change(beat: int) -> float:
        """How much the periods differ before and after a beat, in octaves, or 0 if the tempo is the same."""
        before, after = octaves[max(0, beat - _PERIODS) : beat], octaves[beat : beat + _PERIODS]
        if min(len(before), len(after)) < _FEWEST_PERIODS:
            return 0.0
        if abs(np.median(after) - np.median(before)) <= _OTHER_TEMPO_OCTAVES:
            return 0.0
        return float(abs(after.mean() - before.mean()))  # greatest where all periods differ

    return _peaks(change, np.arange(len(octaves)))


def _metre_changes(counts: Counts) -> Indices:
    downbeats = np.flatnonzero(counts.numbers == 1)
    lengths = np.diff(downbeats)  # (bars,)

    def change(bar: int) -> float:
        """The clarity of the two metres before and after a bar, up to 2, or 0 if they are the same."""
        before, after = lengths[max(0, bar - _BARS) : bar], lengths[bar : bar + _BARS]
        if min(len(before), len(after)) < _FEWEST_BARS:
            return 0.0
        metres = [part_metre(bars, 0) for bars in (before, after)]
        if 0 in metres or metres[0] == metres[1]:
            return 0.0
        return float(np.mean(before == metres[0]) + np.mean(after == metres[1]))

    return downbeats[_peaks(change, np.arange(len(lengths)))]


def _peaks(height_at: Callable[[int], float], positions: Indices) -> Indices:
    """The position of the maximum of each run of positions with a height."""
    height = np.array([height_at(int(position)) for position in positions])
    runs = np.split(positions, np.flatnonzero(np.diff(height > 0)) + 1)
    return np.array([run[height[run].argmax()] for run in runs if len(run) and height[run[0]] > 0], np.int64)


# The metrical level of a song's beats: the tracked beats, fewer of them, or twice as many.
#
# Whether a salsa is counted at 84 or at 168 does not follow from the music, since both are in it. For a
# dance, it follows from the tempi of the takes. At every level, count 1 is on a downbeat of the tracked bars.


_CLEARLY_NEARER = 0.4  # octaves
_OTHER_METRE = 0.8  # penalty, in octaves, of bars of another metre than that of the takes
_SLOWEST_BPM, _FASTEST_BPM = 40.0, 240.0  # range of tempi at which dancers count
# The numbers in a bar of each metre that are counted at the slower level. Half of three beats is no whole
# count, so a bar of three has one. Bars of five and seven are counted at their own level only.
_SLOWER = {3: (1,), 4: (1, 3), 6: (1, 4)}
_EIGHTHS_BPM = (140.0, 250.0)  # range of tempi of eighths that are counted as beats
_LEAST_EIGHTHS = 2.0  # log odds. Real waltzes, whose eighths are no beats, have up to 1.2
# The same if count 1 lies between the tracked beats: in about every second 6/8, but in one of twenty waltzes.
_LEAST_EIGHTHS_BETWEEN = _LEAST_EIGHTHS - float(np.log(0.5 / 0.05))
_SURELY_BETWEEN = 0.9  # of the counts 1
DANCED_IN = {6: (6, 3)}  # metres of the takes that fit a bar: two bars of three fit a bar of six


def metrical_levels(
    samples: NDArray[np.floating], log_mel: NDArray[np.floating], tracked: Counts
) -> tuple[Counts, ...]:
    """A song's counts as tracked, then at a slower and at double tempo where that can be counted.

    At the slower level, a bar of four or six has two counts and a bar of three has one. These counts are
    grouped in fours, so that count 1 is the downbeat of every second or fourth bar. The music determines of
    which ones. At double tempo, a bar of four has count 1 on beats 1 and 3. Other bars are not doubled.
    Arguments and errors are those of `track_bars`.
    """
    if not tracked.has_bars or len(tracked) < 2:
        return (tracked,)
    others = (_slower(samples, log_mel, tracked), _doubled(tracked, len(samples) / SAMPLE_RATE_HZ))
    return (tracked, *(counts for counts in others if counts is not None))


def _slower(samples: NDArray[np.floating], log_mel: NDArray[np.floating], tracked: Counts) -> Counts | None:
    """The counts at the slower level, or None if they would be too slow or too few."""
    kept = _SLOWER.get(tracked.metre, ())
    if tempo_bpm(tracked) * len(kept) / tracked.metre < _SLOWEST_BPM:
        return None
    on_one = tracked.numbers == 1
    # Irregular bars keep their count 1. Between a second count and the next count 1 there is a beat.
    chosen = on_one | (np.isin(tracked.numbers, kept) & ~np.append(on_one[1:], False))
    counts = track_bars(samples, log_mel, tracked.times_s[chosen], metres=(4,), may_be_one=on_one[chosen])
    return replace(counts, confidence=tracked.confidence) if counts.has_bars else None


def _doubled(tracked: Counts, duration_s: float) -> Counts | None:
    """The counts at double tempo, or None if they would be too fast or count 1 would lie off the bars."""
    if tracked.metre != 4 or tempo_bpm(tracked) * 2 > _FASTEST_BPM:
        return None
    times_s = _twice_as_many(tracked.times_s)
    numbers = (2 * (tracked.numbers[:, None] - 1) % 4 + np.array([1, 2])).ravel()
    inside = times_s < duration_s
    return replace(tracked, times_s=times_s[inside], numbers=numbers[inside])


def _twice_as_many(times_s: Floats) -> Floats:
    between_s = time_at(times_s, np.arange(len(times_s)) + 0.5)
    return np.stack([times_s, between_s], axis=1).ravel()


def with_eighths(samples: NDArray[np.floating], log_mel: NDArray[np.floating], tracked: Counts) -> Counts:
    """The counts of 6/8 and 7/8 on every eighth if they are tracked on every second one.

    A bar of 6/8 is tracked as three beats then, and two bars of 7/8 as seven. Whether the eighths are the
    beats follows from what repeats after two, three and more of them. Less evidence is needed for bars of
    six whose count 1 lies between the tracked beats. Arguments and errors are those of `track_bars`.
    """
    metre = {3: 6, 7: 7}.get(tracked.metre)
    if metre is None or not _EIGHTHS_BPM[0] <= 2 * tempo_bpm(tracked) <= _EIGHTHS_BPM[1]:
        return tracked
    times_s = _twice_as_many(tracked.times_s)
    times_s = times_s[times_s < len(samples) / SAMPLE_RATE_HZ]
    _, repeats = beat_evidence(samples, log_mel, times_s)
    log_odds = repeats.mean(axis=0) @ EIGHTHS_WEIGHTS[:-1] + EIGHTHS_WEIGHTS[-1]
    if log_odds < (_LEAST_EIGHTHS_BETWEEN if metre == 6 else _LEAST_EIGHTHS):
        return tracked
    counts = track_bars(samples, log_mel, times_s)
    between = np.mean(np.flatnonzero(counts.numbers == 1) % 2) if counts.has_bars else 0.0
    are_beats = log_odds >= _LEAST_EIGHTHS or between >= _SURELY_BETWEEN
    return counts if counts.metre == metre and are_beats else tracked


def choose_level(
    levels: Sequence[Counts], take_tempi_bpm: Mapping[int, Floats], take_weights: Mapping[int, Floats]
) -> Counts:
    """The level at which takes are danced nearest to their own tempo.

    It is the first level, unless another one is nearer by 0.4 octaves. `take_tempi_bpm` has by metre the
    tempi (X,) of the takes in that metre, and `take_weights` their weights. A level in whose metre there is
    no take is not chosen, except the first one. Its bars may be wrong, so it is chosen even without takes in
    its metre if takes of other metres would be danced much too fast at another level.
    """
    distances = []
    for song in levels:
        metres = [metre for metre in DANCED_IN.get(song.metre, (song.metre,)) if metre in take_weights]
        tempi_bpm, weights = _of_metres(metres, take_tempi_bpm), _of_metres(metres, take_weights)
        distances.append(_distance_octaves(tempo_bpm(song), tempi_bpm, weights) if weights.sum() else np.inf)
    if np.isinf(distances[0]) and np.isfinite(distances).any():
        tempi_bpm, weights = (_of_metres(take_weights, values) for values in (take_tempi_bpm, take_weights))
        distances[0] = _OTHER_METRE + _distance_octaves(tempo_bpm(levels[0]), tempi_bpm, weights)
    nearest = int(np.argmin(distances))
    return levels[nearest] if distances[nearest] < distances[0] - _CLEARLY_NEARER else levels[0]


def _of_metres(metres: Iterable[int], by_metre: Mapping[int, Floats]) -> Floats:
    return np.concatenate([np.zeros(0), *(by_metre[metre] for metre in metres)])


def level_at_tempo(
    samples: NDArray[np.floating], log_mel: NDArray[np.floating], tracked: Counts, metre: int, bpm: float
) -> Counts:
    """A song's counts at the level nearest to a tempo in a metre. See `metrical_levels`."""
    levels = metrical_levels(samples, log_mel, tracked)
    return choose_level(levels, {metre: np.array([bpm])}, {metre: np.ones(1)})


def between(counts: Counts, start_s: float, stop_s: float) -> Counts:
    """The counts of a part of a song, at their times in the song. Its metre is that of its bars.

    See `music.metrical_level.part_metre`.
    """
    inside = (counts.times_s >= start_s) & (counts.times_s < stop_s)
    numbers = counts.numbers[inside]
    metre = part_metre(np.diff(np.flatnonzero(numbers == 1)), counts.metre)
    return replace(counts, times_s=counts.times_s[inside], numbers=numbers, metre=metre)


def joined(parts: Sequence[Counts]) -> Counts:
    """The counts of consecutive parts of a song. A beat too close to the part before it is left out."""
    times_s, numbers = [parts[0].times_s], [parts[0].numbers]
    for before, part in pairwise(parts):
        period_s = min((60.0 / tempo_bpm(p) for p in (before, part) if len(p) > 1), default=0.0)
        kept = part.times_s > (before.times_s[-1] + 0.6 * period_s if len(before) else -np.inf)
        times_s.append(part.times_s[kept])
        numbers.append(part.numbers[kept])
    longest = max(parts, key=len)
    confidence = min(part.confidence for part in parts)
    return Counts(np.concatenate(times_s), np.concatenate(numbers), longest.metre, longest.source, confidence)


def tempo_bpm(counts: Counts) -> float:
    """Median tempo of two counts or more."""
    return float(60.0 / np.median(np.diff(counts.times_s)))


def _distance_octaves(bpm: float, tempi_bpm: Floats, weights: Floats) -> float:
    return float(np.average(np.abs(np.log2(bpm / tempi_bpm)), weights=weights))
