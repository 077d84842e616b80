"""A dance with its counts and its plan, and the counts of its takes in the time of the dance."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from choreograph.core.counts import NO_COUNTS, Counts
from choreograph.core.numerics import Floats
from choreograph.library.repertoire import Repertoire
from choreograph.motion.motion import Motion
from choreograph.plan.plan import Plan
from choreograph.plan.runs import Run, plan_runs

# The counts and figures of the takes, placed in a dance by the time maps of its plan.


SOURCE = "takes"  # of the counts of a dance
_GRID_S = 1 / 240  # spacing at which time maps are inverted
_OVERLAP_S = 0.05  # a count this close outside a run is danced in the transition
_ROUNDING_S = 1e-3  # a count this close outside the dance is at its end
_SAME_COUNT_S = 0.1  # counts of the two takes of a join that are closer are one
_BORDERS_WITHIN_S = 1.0  # of a transition: farther borders of figures are another count's


def danced_counts(plan: Plan, repertoire: Repertoire) -> Counts:
    """The counts of the takes of a dance, in seconds of the dance.

    Takes without counts contribute none, nor do held poses (before `opening_s`, after `closing_s`). Motion
    from a network has no counts. At a join, where both takes may count the same instant, the
    incoming take's count is kept. The metre is the longest of the takes' bars, the confidence the mean over
    the counts. Raises `RepertoireError` if the plan names a take that the repertoire does not have.
    """
    parts = [(run, _counts_of(run, repertoire)) for run in _runs_of(plan)]
    counted = [(*_placed(run, counts), counts) for run, counts in parts if len(counts)]
    counted = [part for part in counted if len(part[0])]
    if not counted:
        return NO_COUNTS
    times_s = np.concatenate([times for times, _, _ in counted])
    numbers = np.concatenate([numbers for _, numbers, _ in counted])
    confidence = np.concatenate([np.full(len(times), c.confidence) for times, _, c in counted])
    kept = _without_doubles(times_s, [len(times) for times, _, _ in counted]) & _danced(plan, times_s)
    if not kept.any():
        return NO_COUNTS
    return Counts(
        np.clip(times_s[kept], 0.0, plan.duration_s),
        numbers[kept],
        max(c.metre for _, _, c in counted),
        SOURCE,
        float(confidence[kept].mean()),
    )


def counted_share(plan: Plan, repertoire: Repertoire) -> float:
    """Share of the seconds of a dance, 0 … 1, that are from takes with counts."""
    runs = _runs_of(plan)
    counted_s = sum(  # the last second may be planned beyond the end
        min(run.stop_s, plan.duration_s) - run.start_s for run in runs if len(_counts_of(run, repertoire))
    )
    return counted_s / plan.duration_s if runs else 0.0


def figure_borders_s(plan: Plan, repertoire: Repertoire) -> Floats:
    """Borders of figures near transitions, (F,) seconds of the dance, increasing.

    They are the nearest starts and ends of figures of the outgoing and of the incoming take of each
    transition, also those just after the end of the one and before the start of the other.
    """
    borders_s: list[float] = []
    for pair in pairwise(_runs_of(plan)):
        for run in pair:
            figures = repertoire.figures(repertoire.take_index(run.take))
            of_take = {border for figure in figures for border in (figure.start_s, figure.end_s)}
            at_s = pair[1].start_s
            borders_s.extend(_danced_at_s(run, of_take, at_s - _BORDERS_WITHIN_S, at_s + _BORDERS_WITHIN_S))
    return np.unique(borders_s)


def _runs_of(plan: Plan) -> list[Run]:
    return plan_runs(plan) if plan.from_takes else []


def _counts_of(run: Run, repertoire: Repertoire) -> Counts:
    return repertoire.counts(repertoire.take_index(run.take))


def _placed(run: Run, counts: Counts) -> tuple[Floats, NDArray[np.int64]]:
    """Times (N,) in the dance and numbers (N,) of the take's counts in a run, and just outside it."""
    source_s, grid_s = _map_of(run, run.start_s - _OVERLAP_S, run.stop_s + _OVERLAP_S)
    inside = (counts.times_s >= source_s[0]) & (counts.times_s <= source_s[-1])
    return np.interp(counts.times_s[inside], source_s, grid_s), counts.numbers[inside]


def _danced_at_s(run: Run, source_times_s: Iterable[float], from_s: float, to_s: float) -> list[float]:
    """The times of the dance between two at which the run's take is, or would be, at source times."""
    source_s, grid_s = _map_of(run, from_s, to_s)
    wanted = np.array(sorted(source_times_s))
    wanted = wanted[(wanted >= source_s[0]) & (wanted <= source_s[-1])]
    result: list[float] = np.interp(wanted, source_s, grid_s).tolist()
    return result


def _map_of(run: Run, from_s: float, to_s: float) -> tuple[Floats, Floats]:
    """Source times, never decreasing, and their times of the dance, both (G,)."""
    grid_s = np.linspace(from_s, to_s, max(2, round((to_s - from_s) / _GRID_S)) + 1)
    return np.maximum.accumulate(run.source_s(grid_s)), grid_s


def _without_doubles(times_s: Floats, lengths: list[int]) -> NDArray[np.bool_]:
    """Whether to keep each count (N,) of consecutive runs. One that the next run has too is dropped."""
    keep = np.ones(len(times_s), bool)
    for join in np.cumsum(lengths)[:-1]:
        # Counts in the overlap of two runs: later runs take over.
        keep[:join] &= times_s[:join] < times_s[join] - _SAME_COUNT_S
    return keep


def _danced(plan: Plan, times_s: Floats) -> NDArray[np.bool_]:
    """Whether the dance moves at each time: after its opening pose, and up to its closing one."""
    first_s = max(-_ROUNDING_S, plan.opening_s - _OVERLAP_S)
    return (times_s >= first_s) & (
        times_s <= min(plan.duration_s + _ROUNDING_S, plan.danced_until_s + _OVERLAP_S)
    )


# `CountedDance`: a dance to one of the evaluated songs with its counts and its plan, to be measured.


@dataclass(frozen=True, eq=False)
class CountedDance:
    """A dance from the first second of the song: of a variant, a real take, or by an expert."""

    variant: str  # column of the tables
    song: str  # name of the `EvaluatedSong`, or of another song
    motion: Motion
    counts: Counts = NO_COUNTS  # its own, in seconds of the dance
    plan: Plan | None = None
    repertoire: Repertoire | None = None  # that the plan's takes are in
    genre: str = ""  # if it is known

    @classmethod
    def from_plan(
        cls, variant: str, song: str, motion: Motion, plan: Plan, repertoire: Repertoire
    ) -> CountedDance:
        """A dance with the plan from which it was rendered. Its counts are those of its takes."""
        return cls(variant, song, motion, danced_counts(plan, repertoire), plan, repertoire)
