"""Runs: what of which take is played from when to when, without a join."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PchipInterpolator

from choreograph.timebase import NET_FPS

Floats = NDArray[np.float64]

_SAME_INSTANT_S = 2e-3  # pieces whose source times meet this closely need no join


@dataclass(frozen=True, eq=False)
class Run:
    """A piece of the dance that plays on without a join: one take, one continuous time map."""

    take: str
    start_s: float  # in the dance
    stop_s: float
    source_times_s: Floats  # (n + 1,) take instants, evenly spaced from start to stop, both included
    locked: bool = False  # at joins its neighbours give way, so that it stays what it is
    transition_s: float | None = (
        None  # of the join into it, see `TRANSITION_LENGTHS_S`; None: the blending's own
    )

    @property
    def length_s(self) -> float:
        """How long it lasts."""
        return self.stop_s - self.start_s

    def source_s(self, times_s: Floats) -> Floats:
        """Take instants at instants of the dance; beyond the ends at the end's speed."""
        since = np.asarray(times_s, np.float64) - self.start_s
        knots = np.linspace(0.0, self.length_s, len(self.source_times_s))
        inside = CubicSpline(knots, self.source_times_s)
        source = inside(np.clip(since, 0.0, self.length_s))
        source += np.minimum(since, 0.0) * inside(0.0, 1)
        return source + np.maximum(since - self.length_s, 0.0) * inside(self.length_s, 1)

    def cut(self, start_s: float, stop_s: float) -> Run:
        """The part of it between two instants of the dance."""
        source_times_s = self.source_s(_instants(start_s, stop_s))
        return replace(self, start_s=start_s, stop_s=stop_s, source_times_s=source_times_s)


@dataclass(frozen=True)
class TransitionTiming:
    """When a run takes over from the one before, and how fast."""

    start_s: float  # of the dance
    transition_s: float | None = None  # see `Run`


def to_runs(takes: Sequence[str], source_times_s: Sequence[Sequence[float]]) -> list[Run]:
    """Seconds grouped into runs; each second gives its take and 21 source instants."""
    runs: list[Run] = []
    for second, (take, given) in enumerate(zip(takes, source_times_s, strict=True)):
        times = np.asarray(given, np.float64)
        if runs and _plays_on(runs[-1], take, times[0]):
            joined = np.concatenate([runs[-1].source_times_s, times[1:]])
            runs[-1] = Run(take, runs[-1].start_s, second + 1.0, joined)
        else:
            runs.append(Run(take, float(second), second + 1.0, times))
    return runs


def words_to_runs(
    takes: Sequence[str], spans_s: Floats, sources_s: Floats, locked: Sequence[bool]
) -> list[Run]:
    """Words grouped into runs: each has its take, span of the dance (N, 2) and of the take (N, 2).

    A word is played at an even speed; words that follow one another in their take are one run, whose
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
    return Run(take, start_s, stop_s, PchipInterpolator(knots, values)(_instants(start_s, stop_s)), locked)


def overlay_runs(runs: Sequence[Run], instead: Sequence[Run]) -> list[Run]:
    """`runs` with those of `instead` in their place where they overlap; both in order of time."""
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


def with_transitions(runs: Sequence[Run], transitions: Sequence[TransitionTiming]) -> list[Run]:
    """The runs where each takes over from the one before as its join (N,) says, not at its start.

    The one run plays on as long as the other begins later, or the other way round.
    """
    moved = [
        replace(run, transition_s=join.transition_s) for run, join in zip(runs, transitions, strict=True)
    ]
    for index, start_s in enumerate(join.start_s for join in transitions):
        before, after = moved[index - 1], moved[index]
        if index == 0 or start_s == after.start_s or not before.start_s < start_s < after.stop_s:
            continue
        moved[index - 1] = before.cut(before.start_s, start_s)
        moved[index] = after.cut(start_s, after.stop_s)
    return moved


def _plays_on(run: Run, take: str, source_s: float) -> bool:
    return run.take == take and abs(run.source_times_s[-1] - source_s) < _SAME_INSTANT_S


def _instants(start_s: float, stop_s: float) -> Floats:
    """Knots of a time map from start to stop, about as many as at 20 fps."""
    return np.linspace(start_s, stop_s, max(2, round((stop_s - start_s) * NET_FPS)) + 1)
