"""Renders a plan: assembles its runs, holds the ends, locks the feet, and renders its edits after that."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np

from choreograph.core.arguments import check_function, check_kind, unexpected
from choreograph.core.cache import NO_MEMORY, Memory
from choreograph.core.errors import ParameterError
from choreograph.core.long_songs import memory_returned
from choreograph.core.numerics import Floats, default_numerics
from choreograph.core.progress import StepReport, part
from choreograph.core.timebase import NET_FPS, seconds_to_frames
from choreograph.library.repertoire import Repertoire
from choreograph.motion.contacts import DANCE_SHIFT_S, lock_feet_in_place
from choreograph.motion.motion import Motion
from choreograph.music.count_grids import coming_to_rest_s, setting_off_s
from choreograph.plan.joins import MotionReader, sample_kept_run, take_motions
from choreograph.plan.plan import LENGTH_SLACK_S, Plan, PlannedEdit, PlannedWord, held_spans_s
from choreograph.plan.runs import (
    STOP_EASE_S,
    Run,
    overlay_runs,
    plan_runs,
    runs_of_words,
    with_stops,
    without_holes,
)
from choreograph.render.assembly import Joins, assemble
from choreograph.render.dynamics import (
    Replaced,
    copied,
    hold_ends_in_place,
    hold_stops_in_place,
    scale_in_place,
    scaled_root,
)
from choreograph.render.filled_gaps import fill_gaps, of_length

# Rendering of a plan to its motion.


_STEPS = 100  # of its progress


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
    with memory_returned(plan.duration_s):
        return render_planned(plan, repertoire, existing=existing, report=report)


def render_planned(
    plan: Plan,
    repertoire: Repertoire,
    memory: Memory = NO_MEMORY,
    *,
    existing: Motion | None = None,
    report: StepReport | None = None,
) -> Motion:
    """As `render` of a valid plan, with a memory of this repertoire.

    In the memory are parts of takes and motions of the same steps.
    """
    _check_existing(plan, existing)
    _check_takes(plan, repertoire)
    if existing is not None:
        motion = of_length(existing, max(1, seconds_to_frames(plan.duration_s, plan.fps)))
    else:
        motion = _rendered(plan, repertoire, memory, report)
    read_motion = take_motions(repertoire)
    for edit in plan.edits:
        motion = with_edit(motion, plan, edit, read_motion)
    return motion


def _rendered(plan: Plan, repertoire: Repertoire, memory: Memory, report: StepReport | None) -> Motion:
    """The motion of a plan without its edits."""
    seconds = tuple(replace(second, costs={}) for second in plan.seconds)
    steps = replace(plan, weights={}, seed=0, least_cost=None, seconds=seconds, edits=())

    def made() -> Motion:
        of_runs = part(report, 0, 70, _STEPS)
        motion, joins = _assembled(plan_runs(plan), plan, repertoire, memory, of_runs)
        motion = with_dynamics(motion, joins, plan)
        if report is not None:
            report(_STEPS, _STEPS)
        return motion

    motion = memory.value(made, "rendered", steps)
    return deepcopy(motion) if memory.is_on else motion


def _assembled(
    runs: Sequence[Run], plan: Plan, repertoire: Repertoire, memory: Memory, report: StepReport | None = None
) -> tuple[Motion, Joins]:
    """The first runs of a plan, or all, as one motion."""
    return assemble(
        runs, take_motions(repertoire), fps=plan.fps, duration_s=plan.duration_s, blending=plan.blending,
        stage=plan.stage, to_front=plan.front == "audience", sample=partial(sample_kept_run, memory),
        report=report,
    )  # fmt: skip


# Edits, which are rendered with some of the dance beside them, so that a long dance does not take longer.


_BESIDE_S = 2.0  # of the dance on either side of a part, on which its amplitudes and locked feet depend


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
    runs = without_holes(runs_of_words(window.words), window.duration_s)
    made, joins = assemble(
        with_stops(runs, window.stops_s), read_motion, fps=fps, duration_s=window.duration_s,
        blending=plan.blending, stage=plan.stage, to_front=plan.front == "audience",
    )  # fmt: skip
    held = replace(window, stops_s=(*window.stops_s, *held_spans_s(window.words)))
    filling = of_length(with_dynamics(made, joins, held), end - begin)
    spans = [span for span in ((0, first - begin), (stop - begin, end - begin)) if span[0] < span[1]]
    filled = fill_gaps(motion.sliced(begin, end), filling, spans)
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
        scale_in_place(motion, plan.amplitudes)
    hold()
    if plan.lock_feet:
        lock_feet_at_joins(motion, joins, plan.opening_s, plan.closing_s, contacts)
    return motion


def lock_feet_at_joins(
    motion: Motion,
    joins: Joins,
    opening_s: float = 0.0,
    closing_s: float | None = None,
    contacts: Floats | None = None,
) -> None:
    """Lock the feet of a motion where they touch the floor, or by other `contacts` (T, 4).

    They are locked firmly near joins between the held poses. The arrays of `motion` are changed.
    """
    if contacts is None:
        contacts = _contacts(motion, joins, opening_s, closing_s)
    lock_feet_in_place(motion, contacts, joins.shift_s(motion.n_frames, motion.fps, DANCE_SHIFT_S))


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
    runs = overlay_runs([Run("", 0.0, end_s, knots_s)], runs_of_words(words))
    made, joins = assemble(runs, read, fps=motion.fps, duration_s=end_s, blending="inertial")
    lock_feet_at_joins(made, joins)
    return made


# A part of a dance, which is rendered without the rest.


def render_part(
    plan: Plan, repertoire: Repertoire, memory: Memory, start_s: float, end_s: float
) -> tuple[Motion, float] | None:
    """The motion of a plan from one time to another, and the time of its first frame, or None beyond the end.

    It is that of the whole dance without its edits, except that its floor and the shifts of its feet, which
    are found without the rest, differ by some millimetres.
    """
    runs = plan_runs(plan)
    later = (index for index, run in enumerate(runs) if run.start_s > end_s + 2 * _BESIDE_S)
    motion, joins = _assembled(runs[: next(later, len(runs)) + 1], plan, repertoire, memory)
    fps, n_frames = motion.fps, motion.n_frames
    from_s = _beside_s(plan, start_s)
    begin, first = seconds_to_frames(from_s, fps), seconds_to_frames(start_s, fps)
    stop, end = (min(n_frames, seconds_to_frames(at_s, fps)) for at_s in (end_s, end_s + _BESIDE_S))
    if first >= stop:
        return None
    near = copied(motion.sliced(begin, end))
    window = part_of_plan(plan, from_s, near.duration_s)
    whole_m = scaled_root(motion.root_pos_m, plan.amplitudes, fps)[first]
    shift_m = whole_m - scaled_root(near.root_pos_m, window.amplitudes, fps)[first - begin]
    made = with_dynamics(near, joins.between(begin, end, fps), window).sliced(first - begin, stop - begin)
    moved_m = made.root_pos_m + shift_m * np.array([1.0, 0.0, 1.0])  # on the ground
    return replace(made, root_pos_m=moved_m), first / fps


def _beside_s(plan: Plan, start_s: float) -> int:
    """From when a part needs the dance, a whole second, for the amplitudes. Held poses are not cut."""
    rests_s, _ = coming_to_rest_s(plan.opening_s, plan.danced_until_s)
    held_s = (0.0, setting_off_s(plan.opening_s)[1]), *plan.stops_s, (rests_s, plan.duration_s)
    from_s = start_s - _BESIDE_S
    for begins_s, ends_s in reversed(held_s):
        if begins_s - _BESIDE_S < from_s < ends_s + STOP_EASE_S:
            from_s = begins_s - _BESIDE_S
    return max(0, int(from_s))


def part_of_plan(plan: Plan, from_s: int, duration_s: float) -> Plan:
    """What the dynamics of a part of a plan need: its held poses and amplitudes, from `from_s` on."""
    closing_s = plan.danced_until_s - from_s
    stops_s = [(rests_s - from_s, moves_s - from_s) for rests_s, moves_s in plan.stops_s]
    return replace(
        plan, seconds=(), words=(), edits=(), duration_s=duration_s,
        opening_s=max(0.0, plan.opening_s - from_s),
        closing_s=closing_s if closing_s < duration_s else None,
        stops_s=tuple(span_s for span_s in stops_s if span_s[0] > STOP_EASE_S and span_s[1] < duration_s),
        amplitudes=plan.amplitudes[from_s:],
    )  # fmt: skip
