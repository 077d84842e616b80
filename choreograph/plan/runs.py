"""Runs, the parts of takes that a plan plays, each with its time in the dance.

A run is one take with one continuous map from times of the dance to times of the take. Seconds and words of a
plan that follow one another in their take are one run. Between two runs lies a join, where one take gives way
to another: `choreograph.plan.joins` says where the second run is placed, when it begins and how long the
transition takes. In a stop, a run stands still.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import pairwise

import numpy as np
import scipy

from choreograph.core.numerics import Floats, continued_spline
from choreograph.core.timebase import NET_FPS
from choreograph.plan.plan import Plan, PlannedWord

_SAME_INSTANT_S = 2e-3  # largest gap between two parts of a take that need no transition


@dataclass(frozen=True, eq=False)
class Run:
    """A part of the dance that is played without a transition: one take, one continuous time map."""

    take: str
    start_s: float  # in the dance
    stop_s: float
    source_times_s: Floats  # (n + 1,) times of the take, evenly spaced from start to stop, both included
    locked: bool = False  # transitions change its neighbours, not it
    transition_s: float | None = None  # length of the transition into it, or None for the blending's default
    mirrored: bool = False  # left and right are exchanged

    @property
    def length_s(self) -> float:
        """Its length in seconds."""
        return self.stop_s - self.start_s

    def source_s(self, times_s: Floats) -> Floats:
        """Source times at times of the dance. Beyond the ends, the speed stays that of the end."""
        knots = np.linspace(0.0, self.length_s, len(self.source_times_s))
        return continued_spline(knots, self.source_times_s, np.asarray(times_s) - self.start_s)

    def cut(self, start_s: float, stop_s: float) -> Run:
        """The part of the run between two times of the dance."""
        source_times_s = self.source_s(_knots_s(start_s, stop_s))
        return replace(self, start_s=start_s, stop_s=stop_s, source_times_s=source_times_s)


@dataclass(frozen=True)
class TransitionTiming:
    """The time at which a run replaces the one before it, and the length of the transition."""

    start_s: float  # of the dance
    transition_s: float | None = None  # see `Run`


def to_runs(takes: Sequence[str], source_times_s: Sequence[Sequence[float]]) -> list[Run]:
    """Seconds grouped into runs. Each second has its take and 21 source times."""
    runs: list[Run] = []
    for second, (take, given) in enumerate(zip(takes, source_times_s, strict=True)):
        times = np.asarray(given, np.float64)
        before = runs[-1] if runs else None
        if before and before.take == take and abs(before.source_times_s[-1] - times[0]) < _SAME_INSTANT_S:
            longer = np.concatenate([runs[-1].source_times_s, times[1:]])
            runs[-1] = Run(take, runs[-1].start_s, second + 1.0, longer)
        else:
            runs.append(Run(take, float(second), second + 1.0, times))
    return runs


def words_to_runs(
    takes: Sequence[str],
    spans_s: Floats,
    sources_s: Floats,
    locked: Sequence[bool],
    mirrored: Sequence[bool] | None = None,
) -> list[Run]:
    """Words grouped into runs. Each word has its take, its span of the dance (N, 2) and of the take (N, 2).

    A word is played at constant speed. Words that follow one another in their take are one run, whose
    speed changes smoothly from word to word.
    """
    runs: list[Run] = []
    first = 0
    sides = [False] * len(takes) if mirrored is None else mirrored
    for index in range(1, len(takes) + 1):
        goes_on = (
            index < len(takes)
            and takes[index] == takes[index - 1]
            and sides[index] == sides[index - 1]
            and abs(sources_s[index, 0] - sources_s[index - 1, 1]) < _SAME_INSTANT_S
            and abs(spans_s[index, 0] - spans_s[index - 1, 1]) < _SAME_INSTANT_S
        )
        if not goes_on:
            part = slice(first, index)
            run = _word_run(takes[first], spans_s[part], sources_s[part], any(locked[part]))
            runs.append(replace(run, mirrored=True) if sides[first] else run)
            first = index
    return runs


def _word_run(take: str, spans_s: Floats, sources_s: Floats, locked: bool) -> Run:
    start_s, stop_s = float(spans_s[0, 0]), float(spans_s[-1, 1])
    knots, values = (*spans_s[:, 0].tolist(), stop_s), (*sources_s[:, 0].tolist(), float(sources_s[-1, 1]))
    return Run(take, start_s, stop_s, _smooth_times_s(knots, values), locked)


@lru_cache(maxsize=4096)  # the mixer makes the runs of most words six times
def _smooth_times_s(knots: tuple[float, ...], values: tuple[float, ...]) -> Floats:
    """Source times through `values` at the times `knots` of the dance, as of `Run`. They are read-only."""
    times_s: Floats = scipy.interpolate.PchipInterpolator(knots, values)(_knots_s(knots[0], knots[-1]))
    times_s.flags.writeable = False
    return times_s


def overlay_runs(runs: Sequence[Run], instead: Sequence[Run]) -> list[Run]:
    """`runs`, replaced by those of `instead` where they overlap. Both are in order of time."""
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
    """The runs of a dance, each extended at its speed to the middle of a hole beside it, or to an end."""
    borders_s = [0.0, *((before.stop_s + after.start_s) / 2 for before, after in pairwise(runs)), duration_s]
    same = partial(np.allclose, rtol=0.0, atol=_SAME_INSTANT_S)
    return [
        run if same((run.start_s, run.stop_s), span_s) else run.cut(*span_s)
        for run, span_s in zip(runs, pairwise(borders_s), strict=True)
    ]


def with_transitions(runs: Sequence[Run], transitions: Sequence[TransitionTiming]) -> list[Run]:
    """The runs, each starting at the time of its timing (N,).

    The run before it is extended or cut accordingly.
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


def _knots_s(start_s: float, stop_s: float) -> Floats:
    """Knots of a time map from start to stop, about as many as at 20 fps."""
    return np.linspace(start_s, stop_s, max(2, round((stop_s - start_s) * NET_FPS)) + 1)


# Stops: the dance stands still where its song is silent.


STOP_EASE_S = 0.35  # in which a dance comes to rest, and in which it sets off


def with_stops(runs: Sequence[Run], stops_s: Sequence[tuple[float, float]]) -> list[Run]:
    """The runs of a dance, which stands still from and until the times of each stop.

    The run that is danced into a stop comes to rest, and continues after it from the pose in which it rests,
    as much later as the stop is long. Its counts remain on the counts of the song, because a stop lasts whole
    bars. If another run would begin during the stop, that run follows instead, when the dance sets off.
    Stops in a locked run are left out.
    """
    stopped = list(runs)
    for stop_s in stops_s:
        stopped = _with_stop(stopped, *stop_s)
    return stopped


def _with_stop(runs: list[Run], rests_s: float, moves_s: float) -> list[Run]:
    sets_off_s = moves_s - STOP_EASE_S
    before = next((run for run in runs if run.start_s < rests_s <= run.stop_s), None)
    after = next((run for run in runs if run.start_s <= sets_off_s < run.stop_s), None)
    if before is None or after is None or before.locked or after.locked:
        return runs
    if before is after:
        stopped = [_played(before, before.start_s, before.stop_s, rests_s, moves_s, moves_s - rests_s)]
    else:
        coming = _played(before, before.start_s, sets_off_s, rests_s, np.inf)
        going = _played(after, sets_off_s, after.stop_s, -np.inf, moves_s)
        stopped = [coming, replace(going, transition_s=STOP_EASE_S)]
    return [
        *(run for run in runs if run.start_s < before.start_s),
        *stopped,
        *(run for run in runs if run.start_s > after.start_s),
    ]


def _played(
    run: Run, start_s: float, stop_s: float, rests_s: float, moves_s: float, later_s: float = 0.0
) -> Run:
    """The run from a start to a stop, at rest from and until two times, and then `later_s` later."""
    times_s = np.linspace(start_s, stop_s, max(2, round((stop_s - start_s) * NET_FPS)) + 1)
    sets_off_s = moves_s - STOP_EASE_S
    slowing = np.clip((times_s - rests_s) / STOP_EASE_S + 1.0, 0.0, 1.0)
    speeding = np.clip((times_s - sets_off_s) / STOP_EASE_S, 0.0, 1.0)
    coming_s = np.minimum(times_s, rests_s - STOP_EASE_S) + STOP_EASE_S * (slowing - eased_in(slowing))
    going_s = np.maximum(times_s, moves_s) - later_s - STOP_EASE_S * (0.5 - eased_in(speeding))
    played_s = np.where(times_s < sets_off_s, coming_s, going_s)
    return replace(run, start_s=start_s, stop_s=stop_s, source_times_s=run.source_s(played_s))


def eased_in(since: Floats) -> Floats:
    """The distance at a speed that rises smoothly from 0 to 1 as `since` does. It is 0.5 at the end."""
    return since**3 - 0.5 * since**4


# The runs of a plan.


def plan_runs(plan: Plan) -> list[Run]:
    """The runs of a plan without edits: seconds with transitions, words in place of them, and stops."""
    runs = overlay_runs(timed_runs_of_seconds(plan), runs_of_words(plan.words))
    return with_stops(runs, plan.stops_s)


def timed_runs_of_seconds(plan: Plan) -> list[Run]:
    """The runs of a plan's seconds with their transitions."""
    seconds = runs_of_seconds(plan)
    firsts = [plan.seconds[round(run.start_s)] for run in seconds]
    timings = [TransitionTiming(first.start_s, first.transition_s) for first in firsts]
    return with_transitions(seconds, timings)


def runs_of_words(words: Sequence[PlannedWord]) -> list[Run]:
    """The runs of a plan's words: words that follow each other in a take are one run."""
    return words_to_runs(
        [word.take for word in words],
        np.array([(word.start_s, word.end_s) for word in words]),
        np.array([(word.source_start_s, word.source_end_s) for word in words]),
        [word.pinned for word in words],
        [word.mirrored for word in words],
    )


def runs_of_seconds(plan: Plan) -> list[Run]:
    """The runs of a plan's seconds, each starting on its second, before transitions move it."""
    return to_runs([s.take for s in plan.seconds], [s.source_times_s for s in plan.seconds])
