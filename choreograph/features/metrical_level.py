"""The metrical level of a song's beats: those tracked, every second one, or twice as many.

A tracker cannot know whether a salsa is counted at 84 or at 168: both are in the music. For dancing it is
settled by what the takes can be danced at.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from choreograph.counts import Counts
from choreograph.features.bars import track_bars
from choreograph.features.music_changes import part_metre
from choreograph.features.tempo_path import onset_strength
from choreograph.timebase import MUSIC_FPS, times_to_frames

Floats = NDArray[np.float64]

_CLEARLY_NEARER = 0.4  # octaves
_OTHER_METRE = 0.8  # octaves that bars of another metre than the takes' are worth
_SLOWEST_BPM, _FASTEST_BPM = 40.0, 240.0  # that anybody counts at


def metrical_levels(
    samples: NDArray[np.floating], log_mel: NDArray[np.floating], tracked: Counts
) -> tuple[Counts, ...]:
    """A song's counts as tracked, then at half and at double tempo where that can be counted.

    Bars are tracked anew at each level: of doubled beats `1 2 3 4` become `1 . 3 . 1 . 3 .`, but not in
    threes, where neither two beats of a bar nor six are a bar of their own. Arguments and errors are those
    of `track_bars`.
    """
    if not tracked.has_bars:
        return (tracked,)
    beats_s, bpm = tracked.times_s, tempo_bpm(tracked)
    others = []
    if bpm / 2 >= _SLOWEST_BPM:
        others.append(beats_s[_main_beats(log_mel, tracked) :: 2])
    if bpm * 2 <= _FASTEST_BPM:
        others.append(np.interp(np.arange(2 * len(beats_s) - 1) / 2, np.arange(len(beats_s)), beats_s))
    found = (track_bars(samples, log_mel, times_s) for times_s in others)
    return (tracked, *(counts for counts in found if counts.has_bars))


def _main_beats(log_mel: NDArray[np.floating], tracked: Counts) -> int:
    """0 or 1: which half of the beats to keep. In fours those with 1 and 3, in threes the stronger half."""
    if tracked.metre == 4:
        weight = (tracked.numbers % 2 == 1).astype(np.float64)
    else:
        strength = onset_strength(log_mel)
        frames = np.rint(times_to_frames(tracked.times_s, MUSIC_FPS)).astype(np.int64)
        weight = strength[np.minimum(frames, len(strength) - 1)]
    return int(weight[1::2].mean() > weight[::2].mean())


def choose_level(
    levels: Sequence[Counts], take_tempi_bpm: Mapping[int, Floats], take_weights: Mapping[int, Floats]
) -> Counts:
    """The level at which takes are danced nearest to their own tempo: the first, unless another is clearly
    nearer, by 0.4 octaves.

    `take_tempi_bpm` has by metre the tempi (X,) of the takes in that metre, `take_weights` how much each
    matters. A level in whose metre there is no take is not chosen, save the first: its bars may be heard
    wrongly, so that it still is if takes of other metres would be hurried much at another level.
    """
    distances = [
        _distance_octaves(tempo_bpm(song), take_tempi_bpm[song.metre], take_weights[song.metre])
        if np.sum(take_weights.get(song.metre, 0.0)) > 0
        else np.inf
        for song in levels
    ]
    if np.isinf(distances[0]) and np.isfinite(distances).any():
        tempi_bpm, weights = (
            np.concatenate([of_metre[m] for m in take_weights]) for of_metre in (take_tempi_bpm, take_weights)
        )
        distances[0] = _OTHER_METRE + _distance_octaves(tempo_bpm(levels[0]), tempi_bpm, weights)
    nearest = int(np.argmin(distances))
    return levels[nearest] if distances[nearest] < distances[0] - _CLEARLY_NEARER else levels[0]


def level_at_tempo(
    samples: NDArray[np.floating], log_mel: NDArray[np.floating], tracked: Counts, metre: int, bpm: float
) -> Counts:
    """A song's counts at the level nearest to one tempo in one metre; see `metrical_levels`."""
    levels = metrical_levels(samples, log_mel, tracked)
    return choose_level(levels, {metre: np.array([bpm])}, {metre: np.ones(1)})


def between(counts: Counts, start_s: float, stop_s: float) -> Counts:
    """The counts of a part of a song, at their times in the song; its metre is that of its bars.

    See `features.music_changes.part_metre`.
    """
    inside = (counts.times_s >= start_s) & (counts.times_s < stop_s)
    numbers = counts.numbers[inside]
    metre = part_metre(np.diff(np.flatnonzero(numbers == 1)), counts.metre)
    return replace(counts, times_s=counts.times_s[inside], numbers=numbers, metre=metre)


def joined(parts: Sequence[Counts]) -> Counts:
    """Consecutive parts of a song as one; a beat too close to the part before it is left out."""
    times_s, numbers = [parts[0].times_s], [parts[0].numbers]
    for before, part in pairwise(parts):
        period_s = np.median(np.diff(part.times_s)) if len(part) > 1 else 0.0
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
