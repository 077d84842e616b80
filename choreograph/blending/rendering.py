"""A plan to its motion: runs sampled from their takes, blended at the plan's transitions, feet locked."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from choreograph.arguments import check_function, check_kind, unexpected
from choreograph.blending.assembly import assemble
from choreograph.blending.filled_gaps import fill_gaps, of_length, stretch_frames
from choreograph.blending.foot_locking import DANCE_SHIFT_S, lock_feet
from choreograph.blending.held_ends import hold_ends
from choreograph.blending.runs import (
    Run,
    TransitionTiming,
    overlay_runs,
    to_runs,
    with_transitions,
    without_holes,
    words_to_runs,
)
from choreograph.blending.sampled_runs import MotionReader
from choreograph.errors import ParameterError
from choreograph.motion.motion import Motion
from choreograph.numerics import default_numerics
from choreograph.plan import Plan, PlannedWord
from choreograph.progress import StepReport, part
from choreograph.repertoire import Repertoire
from choreograph.timebase import NET_FPS

_STEPS = 100  # of its progress
LENGTH_SLACK_S = 0.1  # the first and last frames of a take, or of an existing dance, are repeated so long


@default_numerics()
def render(
    plan: Plan,
    repertoire: Repertoire,
    *,
    existing: Motion | None = None,
    report: StepReport | None = None,
) -> Motion:
    """The motion of a plan, exactly as planned; `report` is called with how much is done, of how much.

    `existing` is the dance of which a plan keeps parts: these are as they are there, and the rest is led from
    and to them (`filled_gaps`).

    Raises `RepertoireError` if the plan names a take that the repertoire does not have, `FormatError` if it
    was edited to no plan, `ParameterError` if it wants a take beyond its end, holds words that a network
    dances, or keeps parts of a dance that is not given, or of another length or skeleton.
    """
    if not isinstance(plan, Plan):
        raise unexpected("a Plan", plan, "`Plan.read` reads a file")
    if not isinstance(repertoire, Repertoire):
        raise unexpected("a Repertoire", repertoire, "`Repertoire.open` opens one")
    check_function("report", report)
    plan.check()
    _check_existing(plan, existing)
    _check_takes(plan, repertoire)
    runs = plan_runs(plan)
    motion, _ = assemble(
        without_holes(runs, plan.duration_s) if plan.kept_of and not plan.seconds else runs,
        motion_reader(repertoire),
        fps=plan.fps,
        duration_s=plan.duration_s,
        blending=plan.blending,
        keep_on_stage=plan.keep_on_stage,
        report=part(report, 0, 70, _STEPS),
    )
    motion = hold_ends(motion, plan.opening_s, plan.closing_s)
    motion = lock_feet(motion, shift_s=DANCE_SHIFT_S) if plan.lock_feet else motion
    if existing is not None:
        stretches = stretch_frames(plan.kept_spans_s, motion.fps, motion.n_frames)
        motion = fill_gaps(of_length(existing, motion.n_frames), motion, stretches)
    if report is not None:
        report(_STEPS, _STEPS)
    return motion


def _check_existing(plan: Plan, existing: Motion | None) -> None:
    """Raise `ParameterError` unless the dance that a plan keeps parts of is given, and its rate is right."""
    if not plan.kept_of:
        if existing is not None:
            raise ParameterError(
                "expected no existing dance beside a plan that keeps no part of one, got one"
            )
        return
    if existing is None:
        raise ParameterError(
            f"expected the existing dance {plan.kept_of}, of which the plan keeps parts, got none: give it "
            "as `existing`"
        )
    check_kind("an existing dance", existing, Motion, "`dance.motion` of a Dance")
    if existing.fps != plan.fps or abs(existing.duration_s - plan.duration_s) > LENGTH_SLACK_S:
        raise ParameterError(
            f"expected an existing dance of {plan.duration_s:.1f} s at {plan.fps:g} fps, of which the plan "
            f"keeps parts, got one of {existing.duration_s:.1f} s at {existing.fps:g} fps"
        )


def _check_takes(plan: Plan, repertoire: Repertoire) -> None:
    """Raise unless all that a plan does not keep is in a take: see `render`."""
    blocks = [block for block in plan.planned_blocks if not block.kept]
    if not all(block.planned.take for block in blocks):
        raise ParameterError(
            "expected a plan of takes, got one of the rollout engine, which holds motifs: dance to its song "
            "again"
        )
    indices = {block.planned.take: repertoire.take_index(block.planned.take) for block in blocks}
    for block in blocks:
        length = repertoire.takes[indices[block.planned.take]].duration_s
        if block.source_start_s < -LENGTH_SLACK_S or block.source_end_s > length + LENGTH_SLACK_S:
            raise ParameterError(
                f"expected parts of take {block.planned.take!r} within its {length:.2f} s, got "
                f"{block.source_start_s:.2f} to {block.source_end_s:.2f} s at {block.start_s:.2f} s"
            )


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
    """The runs of a plan: its seconds with their transitions, and its words in place of them.

    Where another dance is kept there are those of the seconds, or none.
    """
    words = _runs_of_words([word for word in plan.words if not word.kept])
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
