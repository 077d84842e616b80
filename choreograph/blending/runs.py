"""Runs: which part of which take is played from when to when, without a transition."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PchipInterpolator

from choreograph.timebase import NET_FPS

Floats = NDArray[np.float64]

_SAME_INSTANT_S = 2e-3  # parts of a take that meet this closely need no transition


@dataclass(frozen=True, eq=False)
class Run:
    """A part of the dance that is played without a transition: one take, one continuous time map."""

    take: str
    start_s: float  # in the dance
    stop_s: float
    source_times_s: Floats  # (n + 1,) times of the take, evenly spaced from start to stop, both included
    locked: bool = False  # transitions change its neighbours, not it
    transition_s: float | None = None  # length of the transition into it; None: the blending's default

    @property
    def length_s(self) -> float:
        """Its length in seconds."""
        return self.stop_s - self.start_s

    def source_s(self, times_s: Floats) -> Floats:
        """Source times at times of the dance; beyond the ends at the speed of the end."""
        since = np.asarray(times_s, np.float64) - self.start_s
        knots = np.linspace(0.0, self.length_s, len(self.source_times_s))
        inside = CubicSpline(knots, self.source_times_s)
        source = inside(np.clip(since, 0.0, self.length_s))
        source += np.minimum(since, 0.0) * inside(0.0, 1)
        return source + np.maximum(since - self.length_s, 0.0) * inside(self.length_s, 1)

    def cut(self, start_s: float, stop_s: float) -> Run:
        """The part of the run between two times of the dance."""
        source_times_s = self.source_s(_knots_s(start_s, stop_s))
        return replace(self, start_s=start_s, stop_s=stop_s, source_times_s=source_times_s)


@dataclass(frozen=True)
class TransitionTiming:
    """When a run takes over from the one before, and how long the transition takes."""

    start_s: float  # of the dance
    transition_s: float | None = None  # see `Run`


def to_runs(takes: Sequence[str], source_times_s: Sequence[Sequence[float]]) -> list[Run]:
    """Seconds grouped into runs; each second gives its take and 21 source times."""
    runs: list[Run] = []
    for second, (take, given) in enumerate(zip(takes, source_times_s, strict=True)):
        times = np.asarray(given, np.float64)
        if runs and _continues(runs[-1], take, times[0]):
            longer = np.concatenate([runs[-1].source_times_s, times[1:]])
            runs[-1] = Run(take, runs[-1].start_s, second + 1.0, longer)
        else:
            runs.append(Run(take, float(second), second + 1.0, times))
    return runs


def words_to_runs(
    takes: Sequence[str], spans_s: Floats, sources_s: Floats, locked: Sequence[bool]
) -> list[Run]:
    """Words grouped into runs: each has its take, its span of the dance (N, 2) and of the take (N, 2).

    A word is played at constant speed. Words that follow one another in their take are one run, whose
    speed changes smoothly from word to word.
    """
    runs: list[Run] = []
    first = 0
    for index in range(1, len(takes) + 1):
        goes_on = (
            index < len(takes)
            and takes[index] == takes[index - 1]
            and abs(sources_s[index, 0] - sources_s[index - 1, 1]) < _SAME_INSTANT_S
            and abs(spans_s[index, 0] - spans_s[index - 1, 1]) < _SAME_INSTANT_S
        )
        if not goes_on:
            part = slice(first, index)
            runs.append(_word_run(takes[first], spans_s[part], sources_s[part], any(locked[part])))
            first = index
    return runs


def _word_run(take: str, spans_s: Floats, sources_s: Floats, locked: bool) -> Run:
    start_s, stop_s = float(spans_s[0, 0]), float(spans_s[-1, 1])
    knots, values = np.append(spans_s[:, 0], stop_s), np.append(sources_s[:, 0], sources_s[-1, 1])
    return Run(take, start_s, stop_s, PchipInterpolator(knots, values)(_knots_s(start_s, stop_s)), locked)


def overlay_runs(runs: Sequence[Run], instead: Sequence[Run]) -> list[Run]:
    """`runs` with those of `instead` in place of them where they overlap; both in order of time."""
    left: list[Run] = []
    for run in runs:
        start_s = run.start_s
        for cover in instead:
            if cover.stop_s <= start_s or cover.start_s >= run.stop_s:
                continue
            if cover.start_s - start_s > _SAME_INSTANT_S:
                left.append(run.cut(start_s, cover.start_s))
            start_s = max(start_s, cover.stop_s)
        if run.stop_s - start_s > _SAME_INSTANT_S:
            left.append(run if start_s == run.start_s else run.cut(start_s, run.stop_s))
    return sorted([*left, *instead], key=lambda run: run.start_s)


def without_holes(runs: Sequence[Run], duration_s: float) -> list[Run]:
    """The runs of a dance, each going on at its speed to the middle of a hole beside it, or to an end."""
    borders_s = [0.0, *((before.stop_s + after.start_s) / 2 for before, after in pairwise(runs)), duration_s]
    return [
        run if _covers(run, *span_s) else run.cut(*span_s)
        for run, span_s in zip(runs, pairwise(borders_s), strict=True)
    ]


def _covers(run: Run, start_s: float, stop_s: float) -> bool:
    return abs(run.start_s - start_s) < _SAME_INSTANT_S and abs(run.stop_s - stop_s) < _SAME_INSTANT_S


def with_transitions(runs: Sequence[Run], transitions: Sequence[TransitionTiming]) -> list[Run]:
    """The runs, each taking over from the one before as its timing (N,) says instead of at its start.

    Where a run starts later, the one before plays on; where it starts earlier, the one before ends earlier.
    """
    moved = [
        replace(run, transition_s=timing.transition_s) for run, timing in zip(runs, transitions, strict=True)
    ]
    for index, start_s in enumerate(timing.start_s for timing in transitions):
        before, after = moved[index - 1], moved[index]
        if index == 0 or start_s == after.start_s or not before.start_s < start_s < after.stop_s:
            continue
        moved[index - 1] = before.cut(before.start_s, start_s)
        moved[index] = after.cut(start_s, after.stop_s)
    return moved


def _continues(run: Run, take: str, source_s: float) -> bool:
    return run.take == take and abs(run.source_times_s[-1] - source_s) < _SAME_INSTANT_S


def _knots_s(start_s: float, stop_s: float) -> Floats:
    """Knots of a time map from start to stop, about as many as at 20 fps."""
    return np.linspace(start_s, stop_s, max(2, round((stop_s - start_s) * NET_FPS)) + 1)
