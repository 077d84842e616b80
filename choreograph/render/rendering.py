"""Renders a plan: assembles its runs, holds the ends, locks the feet, and renders its edits after that."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import replace
from itertools import pairwise

import numpy as np

from choreograph.core.arguments import check_function, check_kind, unexpected
from choreograph.core.errors import ParameterError
from choreograph.core.free_memory import return_memory
from choreograph.core.numerics import NO_MEMORY, Floats, Memory, default_numerics
from choreograph.core.progress import StepReport, part
from choreograph.core.timebase import NET_FPS, seconds_to_frames
from choreograph.library.repertoire import Repertoire
from choreograph.motion.foot_locking import DANCE_SHIFT_S, lock_feet_in_place
from choreograph.motion.motion import Motion
from choreograph.music.danced_span import coming_to_rest_s, setting_off_s
from choreograph.plan import Plan
from choreograph.plan_parts import PlannedEdit, PlannedWord, held_spans_s
from choreograph.render.assembly import assemble
from choreograph.render.dynamics import STOP_EASE_S, scale_in_place, with_stops
from choreograph.render.filled_gaps import fill_gaps, of_length
from choreograph.render.first_part import FirstPart, part_of_plan
from choreograph.render.held_poses import Replaced, copied, hold_ends_in_place, hold_stops_in_place
from choreograph.render.runs import (
    MotionReader,
    RecentRuns,
    Run,
    RunSampler,
    TransitionTiming,
    overlay_runs,
    sample_run,
    to_runs,
    with_transitions,
    without_holes,
    words_to_runs,
)
from choreograph.render.transitions import Joins

# Rendering of a plan to its motion.


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
    """The motion of a plan, exactly as planned.

    Parameters
    ----------
    plan : the plan of a dance, which may have been edited
    repertoire : with the takes of the plan
    existing : the motion of the file that a plan keeps, if it keeps one. The edits of the plan replace parts
        of it.
    report : called with the number of steps done, and the number of all steps

    Returns
    -------
    Motion   at `plan.fps`, `plan.duration_s` long

    Raises
    ------
    RepertoireError   if a take of the plan is not in the repertoire
    FormatError       if the plan is not valid
    ParameterError    if a part of a take is outside the take, the plan has words that a network dances, or
                      it keeps a motion file that is not given or has another length or skeleton

    References
    ----------
    ChoreoGraph, section 3.3, for `blending="linear"`. The other transitions are ours.

    Examples
    --------
    >>> from dataclasses import replace
    >>> repertoire = cg.starter_repertoire()
    >>> dance = cg.dance(cg.example_songs()["house"], repertoire, duration_s=4)
    >>> edited = replace(dance.plan, blending="linear", lock_feet=False)
    >>> cg.render(edited, repertoire)
    <Motion: 240 frames at 60 fps (4.0 s), 24 joints>
    """
    if not isinstance(plan, Plan):
        raise unexpected("a Plan", plan, "`Plan.read` reads a file")
    if not isinstance(repertoire, Repertoire):
        raise unexpected("a Repertoire", repertoire, "`Repertoire.open` opens one")
    check_function("report", report)
    plan.check()
    return render_planned(plan, repertoire, existing=existing, report=report)


def render_planned(
    plan: Plan,
    repertoire: Repertoire,
    memory: Memory = NO_MEMORY,
    *,
    existing: Motion | None = None,
    report: StepReport | None = None,
    first: FirstPart | None = None,
) -> Motion:
    """As `render` of a valid plan, with a memory of this repertoire.

    In the memory are parts of takes and motions of the same steps. A `first` part is shown before the rest
    is rendered, without edits.
    """
    _check_existing(plan, existing)
    _check_takes(plan, repertoire)
    if existing is not None:
        motion = of_length(existing, max(1, seconds_to_frames(plan.duration_s, plan.fps)))
    else:
        motion = _rendered(plan, repertoire, memory, report, first)
    read_motion = take_motions(repertoire)
    for edit in plan.edits:
        motion = with_edit(motion, plan, edit, read_motion)
    return motion


def _rendered(
    plan: Plan, repertoire: Repertoire, memory: Memory, report: StepReport | None, first: FirstPart | None
) -> Motion:
    """The motion of a plan without its edits."""
    sample = RecentRuns(memory).sample if memory.is_on else sample_run
    seconds = tuple(replace(second, costs={}) for second in plan.seconds)
    steps = replace(plan, weights={}, seed=0, least_cost=None, seconds=seconds, edits=())
    read_motion = take_motions(repertoire)
    shown: list[FirstPart] = []

    def made() -> Motion:
        shown.extend([] if first is None else [first])
        return render_from(read_motion, plan, sample=sample, report=report, first=first)

    motion = memory.value(made, "rendered", steps)
    if first is not None and not shown:
        first.show_rendered(motion)
    return deepcopy(motion) if memory.is_on else motion


def render_from(
    read_motion: MotionReader,
    plan: Plan,
    *,
    sample: RunSampler = sample_run,
    report: StepReport | None = None,
    first: FirstPart | None = None,
) -> Motion:
    """As `render` without edits, for a plan that needs no checks.

    The functions `read_motion` and `sample` read takes and sample runs. A `first` part is shown early.
    """
    runs = plan_runs(plan)
    near = [] if first is None else first.runs_of(runs)

    def assembled(some: Sequence[Run], report: StepReport | None = None) -> tuple[Motion, Joins]:
        return assemble(
            some, read_motion, fps=plan.fps, duration_s=plan.duration_s, blending=plan.blending,
            stage=plan.stage, to_front=plan.front == "audience", sample=sample, report=report,
        )  # fmt: skip

    if first is not None and near:
        first.show(*assembled(near), plan, with_dynamics)
    motion, joins = assembled(runs, part(report, 0, 70, _STEPS))
    return_memory(plan.duration_s)
    if first is not None and not near:
        first.show(motion, joins, plan, with_dynamics)
    motion = with_dynamics(motion, joins, plan)
    if report is not None:
        report(_STEPS, _STEPS)
    return motion


# Edits, which are rendered with some of the dance beside them, so that a long dance does not take longer.


_BESIDE_S = 2.0  # of the dance on either side of an edit


def with_edit(motion: Motion, plan: Plan, edit: PlannedEdit, read_motion: MotionReader) -> Motion:
    """The motion of a dance with one edit. Frames outside of the edit stay as they are, to the bit.

    `plan` is that of the dance, of which the edit may be a part or not.
    """
    fps, n_frames = motion.fps, motion.n_frames
    first, stop = seconds_to_frames(edit.start_s, fps), min(seconds_to_frames(edit.end_s, fps), n_frames)
    from_s = max(0, int(edit.start_s - _BESIDE_S))  # a whole second, for the amplitudes
    begin = min(seconds_to_frames(from_s, fps), first)
    end = min(n_frames, seconds_to_frames(edit.end_s + _BESIDE_S, fps))
    window = _window(plan, edit, from_s, (end - begin) / fps)
    runs = without_holes(_runs_of_words(window.words), window.duration_s)
    made, joins = assemble(
        with_stops(runs, window.stops_s), read_motion, fps=fps, duration_s=window.duration_s,
        blending=plan.blending, stage=plan.stage, to_front=plan.front == "audience",
    )  # fmt: skip
    held = replace(window, stops_s=(*window.stops_s, *held_spans_s(window.words)))
    filling = of_length(with_dynamics(made, joins, held), end - begin)
    stretches = [span for span in ((0, first - begin), (stop - begin, end - begin)) if span[0] < span[1]]
    filled = fill_gaps(motion.sliced(begin, end), filling, stretches)
    root_pos_m, local_quat = motion.root_pos_m.copy(), motion.local_quat.copy()
    root_pos_m[first:stop] = filled.root_pos_m[first - begin : stop - begin]
    local_quat[first:stop] = filled.local_quat[first - begin : stop - begin]
    return replace(motion, root_pos_m=root_pos_m, local_quat=local_quat)


def _window(plan: Plan, edit: PlannedEdit, from_s: int, duration_s: float) -> Plan:
    """The plan of an edit alone, from `from_s` of the dance on. What is pinned keeps its size."""
    words = tuple(
        replace(word, start_s=word.start_s - from_s, end_s=word.end_s - from_s) for word in edit.words
    )
    window = replace(part_of_plan(plan, from_s, duration_s), words=words)
    return replace(window, amplitudes=()) if any(word.pinned for word in words) else window


def render_generated(motion: Motion, plan: Plan) -> Motion:
    """A motion that a network generated, with the stops, held poses and amplitudes of its plan.

    The motion after a stop is that of its time in the song. Feet are locked again if anything but the ends
    changes. The arrays of `motion` are changed, as by `with_dynamics`.
    """
    if not plan.stops_s:
        if not plan.amplitudes:
            hold_ends_in_place(motion, plan.opening_s, plan.closing_s)
            return motion
        return with_dynamics(motion, Joins(np.zeros(0), ()), plan)
    end_s = motion.duration_s
    whole = Run("", 0.0, end_s, np.linspace(0.0, end_s, max(2, round(end_s * NET_FPS)) + 1))
    borders_s = [0.0, *(moves_s - STOP_EASE_S for _, moves_s in plan.stops_s), end_s]
    runs = with_stops([whole.cut(*span_s) for span_s in pairwise(borders_s)], plan.stops_s)
    made, joins = assemble(
        runs, lambda *_, read=motion: (read, 0.0), fps=motion.fps, duration_s=end_s, blending="inertial"
    )
    del motion  # of which an hour has 0.16 GB
    return with_dynamics(made, joins, plan)


def with_dynamics(motion: Motion, joins: Joins, plan: Plan) -> Motion:
    """The motion with the amplitudes and held poses of its plan, and with its feet locked.

    A held pose breathes as much in a soft part of the song as in a loud one. The contacts are those without
    amplitudes, because a smaller step may not leave the floor. The arrays of `motion` are changed, because
    those of a long dance are large.
    """

    def hold() -> list[Replaced]:
        replaced = hold_ends_in_place(motion, plan.opening_s, plan.closing_s)
        return replaced + hold_stops_in_place(motion, plan.stops_s, STOP_EASE_S)

    contacts: Floats | None = None
    if plan.amplitudes:
        if plan.lock_feet:
            replaced = hold()
            contacts = _contacts(motion, joins, plan.opening_s, plan.closing_s)
            for frames in reversed(replaced):
                frames.put_back(motion)
            return_memory(plan.duration_s)
        scale_in_place(motion, plan.amplitudes)
        return_memory(plan.duration_s)
    hold()
    if plan.lock_feet:
        lock_feet_in_place(motion, *_at_joins(motion, joins, plan.opening_s, plan.closing_s, contacts))
    return motion


def lock_feet_at_joins(
    motion: Motion,
    joins: Joins,
    opening_s: float = 0.0,
    closing_s: float | None = None,
    contacts: Floats | None = None,
) -> Motion:
    """The motion with its feet locked where they touch the floor, or by other `contacts` (T, 4).

    They are locked firmly near joins between the held poses.
    """
    locked = copied(motion)
    lock_feet_in_place(locked, *_at_joins(motion, joins, opening_s, closing_s, contacts))
    return locked


def _at_joins(
    motion: Motion, joins: Joins, opening_s: float, closing_s: float | None, contacts: Floats | None
) -> tuple[Floats, Floats]:
    """Contacts (T, 4), unless they are given, and the times (T,) over which shifts of feet come and go."""
    contacts = _contacts(motion, joins, opening_s, closing_s) if contacts is None else contacts
    return contacts, joins.shift_s(motion.n_frames, motion.fps, DANCE_SHIFT_S)


def _contacts(motion: Motion, joins: Joins, opening_s: float, closing_s: float | None) -> Floats:
    """Contacts (T, 4) of a motion with held poses, between which those near joins are of its takes."""
    from_s = setting_off_s(opening_s)[1]
    to_s = motion.duration_s if closing_s is None else coming_to_rest_s(opening_s, closing_s)[0]
    return joins.contacts(motion, from_s, to_s)


def _check_existing(plan: Plan, existing: Motion | None) -> None:
    """Raise `ParameterError` unless the motion file that a plan keeps is given and has its rate."""
    if not plan.kept_of:
        if existing is not None:
            raise ParameterError("expected no existing dance beside a plan that keeps no file, got one")
        return
    if existing is None:
        raise ParameterError(
            f"expected the existing dance {plan.kept_of}, which the plan keeps, got none: give it as "
            "`existing`"
        )
    check_kind("an existing dance", existing, Motion, "`dance.motion` of a Dance")
    if existing.fps != plan.fps or abs(existing.duration_s - plan.duration_s) > LENGTH_SLACK_S:
        raise ParameterError(
            f"expected an existing dance of {plan.duration_s:.1f} s at {plan.fps:g} fps, which the plan "
            f"keeps, got one of {existing.duration_s:.1f} s at {existing.fps:g} fps"
        )


def _check_takes(plan: Plan, repertoire: Repertoire) -> None:
    """Raise unless all parts of a plan that are not kept are inside takes: see `render`."""
    blocks = [block for block in plan.played_blocks if not block.kept]
    if not all(block.planned.take for block in blocks):
        raise ParameterError(
            "expected a plan of takes, got one with parts of the rollout engine, which holds motifs: dance "
            "to its song again"
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
    """A generated motion, parts of which are replaced by words of takes, in order of time.

    The motion after a word continues from where the word ends. Feet are locked again. Raises
    `RepertoireError` if the repertoire lacks a word's take.
    """
    read_take, end_s = take_motions(repertoire), motion.duration_s

    def read(take: str, start_s: float, stop_s: float) -> tuple[Motion, float]:
        return read_take(take, start_s, stop_s) if take else (motion, 0.0)

    for word in words:
        repertoire.take_index(word.take)
    knots_s = np.linspace(0.0, end_s, max(2, round(end_s * NET_FPS)) + 1)
    runs = overlay_runs([Run("", 0.0, end_s, knots_s)], _runs_of_words(words))
    made, joins = assemble(runs, read, fps=motion.fps, duration_s=end_s, blending="inertial")
    return lock_feet_at_joins(made, joins)


def plan_runs(plan: Plan) -> list[Run]:
    """The runs of a plan without edits: seconds with transitions, words in place of them, and stops."""
    runs = overlay_runs(timed_runs_of_seconds(plan), _runs_of_words(plan.words))
    return with_stops(runs, plan.stops_s)


def timed_runs_of_seconds(plan: Plan) -> list[Run]:
    """The runs of a plan's seconds with their transitions."""
    seconds = runs_of_seconds(plan)
    firsts = [plan.seconds[round(run.start_s)] for run in seconds]
    timings = [TransitionTiming(first.start_s, first.transition_s) for first in firsts]
    return with_transitions(seconds, timings)


def _runs_of_words(words: Sequence[PlannedWord]) -> list[Run]:
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


def take_motions(repertoire: Repertoire) -> MotionReader:
    """Reads parts of the repertoire's takes by name, turned so that each take's front is the audience's."""
    indices = {take.name: index for index, take in enumerate(repertoire.takes)}
    fronts_rad = repertoire.clip_motion.fronts_rad

    def read(take: str, start_s: float, stop_s: float) -> tuple[Motion, float]:
        motion, first_s = repertoire.motion(indices[take], start_s, stop_s)
        return motion.moved(yaw_rad=-float(fronts_rad[indices[take]])), first_s

    return read
