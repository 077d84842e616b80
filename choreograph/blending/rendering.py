"""A plan to its motion: runs sampled from their takes, blended at the plan's transitions, feet locked."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from choreograph.arguments import check_function, unexpected
from choreograph.blending.assembly import assemble
from choreograph.blending.foot_locking import DANCE_SHIFT_S, lock_feet
from choreograph.blending.held_ends import hold_ends
from choreograph.blending.runs import (
    Run,
    TransitionTiming,
    overlay_runs,
    to_runs,
    with_transitions,
    words_to_runs,
)
from choreograph.blending.sampled_runs import MotionReader
from choreograph.errors import ParameterError
from choreograph.motion.motion import Motion
from choreograph.plan import Plan, PlannedWord
from choreograph.progress import StepReport, part
from choreograph.repertoire import Repertoire
from choreograph.timebase import NET_FPS

_STEPS = 100  # of its progress
_LENGTH_SLACK_S = 0.1  # the first and last frames of a take are repeated for that long


def render(plan: Plan, repertoire: Repertoire, *, report: StepReport | None = None) -> Motion:
    """The motion of a plan, exactly as planned; `report` is called with how much is done, of how much.

    Raises `RepertoireError` if the plan names a take that the repertoire does not have, `FormatError` if it
    was edited to no plan, `ParameterError` if it wants a take beyond its end, or holds words without a
    take: a network's, or those kept of another dance.
    """
    if not isinstance(plan, Plan):
        raise unexpected("a Plan", plan, "`Plan.read` reads a file")
    if not isinstance(repertoire, Repertoire):
        raise unexpected("a Repertoire", repertoire, "`Repertoire.open` opens one")
    check_function("report", report)
    plan.check()
    kept = next((word.kept for word in plan.words if word.kept), None)
    if kept is not None:
        raise ParameterError(
            f"expected a plan of takes alone, got one with parts of {kept}, whose motion it does not hold: "
            "dance it again"
        )
    if not plan.from_takes:
        raise ParameterError(
            "expected a plan of takes, got one of the rollout engine, which holds motifs: dance to its song "
            "again"
        )
    indices = {block.planned.take: repertoire.take_index(block.planned.take) for block in plan.planned_blocks}
    for block in plan.planned_blocks:
        length = repertoire.takes[indices[block.planned.take]].duration_s
        if block.source_start_s < -_LENGTH_SLACK_S or block.source_end_s > length + _LENGTH_SLACK_S:
            raise ParameterError(
                f"expected parts of take {block.planned.take!r} within its {length:.2f} s, got "
                f"{block.source_start_s:.2f} to {block.source_end_s:.2f} s at {block.start_s:.2f} s"
            )
    motion, _ = assemble(
        plan_runs(plan),
        motion_reader(repertoire),
        fps=plan.fps,
        duration_s=plan.duration_s,
        blending=plan.blending,
        keep_on_stage=plan.keep_on_stage,
        report=part(report, 0, 70, _STEPS),
    )
    motion = hold_ends(motion, plan.opening_s, plan.closing_s)
    motion = lock_feet(motion, shift_s=DANCE_SHIFT_S) if plan.lock_feet else motion
    if report is not None:
        report(_STEPS, _STEPS)
    return motion


def render_over(motion: Motion, words: Sequence[PlannedWord], repertoire: Repertoire) -> Motion:
    """A generated motion with words of takes, in order of time, in place of what it shows there.

    What follows a word goes on from where the word ends. Feet are locked again. Raises `RepertoireError` if
    the repertoire lacks a word's take.
    """
    read_take, end_s = motion_reader(repertoire), motion.duration_s

    def read(take: str, start_s: float, stop_s: float) -> tuple[Motion, float]:
        return read_take(take, start_s, stop_s) if take else (motion, 0.0)

    for word in words:
        repertoire.take_index(word.take)
    knots_s = np.linspace(0.0, end_s, max(2, round(end_s * NET_FPS)) + 1)
    runs = overlay_runs([Run("", 0.0, end_s, knots_s)], _runs_of_words(words))
    made, _ = assemble(runs, read, fps=motion.fps, duration_s=end_s, blending="inertial")
    return lock_feet(made, shift_s=DANCE_SHIFT_S)


def plan_runs(plan: Plan) -> list[Run]:
    """The runs of a plan: its seconds with their transitions, and its words in place of them."""
    words = _runs_of_words(plan.words)
    seconds = runs_of_seconds(plan)
    firsts = [plan.seconds[round(run.start_s)] for run in seconds]
    timings = [TransitionTiming(first.start_s, first.transition_s) for first in firsts]
    return overlay_runs(with_transitions(seconds, timings), words)


def _runs_of_words(words: Sequence[PlannedWord]) -> list[Run]:
    return words_to_runs(
        [word.take for word in words],
        np.array([(word.start_s, word.end_s) for word in words]),
        np.array([(word.source_start_s, word.source_end_s) for word in words]),
        [word.pinned for word in words],
    )


def runs_of_seconds(plan: Plan) -> list[Run]:
    """The runs of a plan's seconds, each starting on its second, before transitions move it."""
    return to_runs([s.take for s in plan.seconds], [s.source_times_s for s in plan.seconds])


def motion_reader(repertoire: Repertoire) -> MotionReader:
    """Reads parts of the repertoire's takes by name."""
    indices = {take.name: index for index, take in enumerate(repertoire.takes)}
    return lambda take, start_s, stop_s: repertoire.motion(indices[take], start_s, stop_s)
