"""Edits that dance what is danced already at other times: repetitions, held poses and moved joins."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from choreograph.choreography.edits import Hold, MoveJoin, Repeat, edit_slots
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats
from choreograph.core.timebase import MAX_SLOPE, MIN_SLOPE
from choreograph.library.repertoire import Repertoire
from choreograph.motion.motion import Credits
from choreograph.plan.plan import TOUCH_S, Block, Plan, PlannedEdit, PlannedWord, goes_on, words_between

_NEAR_COUNTS = 1.0  # of a join, at most, from where it is asked for
_TEMPO_S = 2.0  # of a take beside a join, whose mean speed the take keeps


def repetition(one: Repeat, plan: Plan, bounds_s: Floats) -> PlannedEdit:
    """The edit that dances a part again, count by count, on slots with `bounds_s` (N + 1,).

    Raises `ParameterError` if it does not fit into the dance, or for a part whose takes are not known.
    """
    source = edit_slots(one.start_s, one.end_s, bounds_s)
    n = source.stop - source.first
    first = int(np.abs(bounds_s - one.at_s).argmin())
    if not 0 <= one.at_s < plan.duration_s or first + n >= len(bounds_s):
        raise ParameterError(
            f"expected {one} to end within the dance of {plan.duration_s:g} s, got {n} counts from "
            f"{one.at_s:g} s on"
        )
    target = edit_slots(float(bounds_s[first]), float(bounds_s[first + n]), bounds_s)
    before, after = min(source.before, target.before), min(source.after, target.after)
    begin, end = source.first - before, source.stop + after
    from_s = bounds_s[begin : end + 1]
    words = words_between(plan.planned_blocks, float(from_s[0]), float(from_s[-1]), from_s.tolist())
    to_s = bounds_s[target.first - before : target.stop + after + 1]
    return _edit([_moved(word, from_s, to_s, mirrored=one.mirrored) for word in words], one)


def hold(one: Hold, plan: Plan, bounds_s: Floats) -> PlannedEdit:
    """The edit that holds the pose at the start of a part until its end, between slots with `bounds_s`.

    The dance comes to rest in the counts before it, and sets off as it was after it. Raises as `repetition`.
    """
    slots = edit_slots(one.start_s, one.end_s, bounds_s)
    begin_s, start_s, stop_s, end_s = bounds_s[[slots.begin, slots.first, slots.stop, slots.end]].tolist()
    before = _danced(plan, begin_s, start_s, bounds_s)
    after = _danced(plan, stop_s, end_s, bounds_s)
    last = before[-1] if before else _danced(plan, start_s, stop_s, bounds_s)[0]
    pose_s = last.source_end_s if before else last.source_start_s
    held = replace(
        last, start_s=start_s, end_s=stop_s, motif=0, source_start_s=pose_s, source_end_s=pose_s, pinned=False
    )
    return _edit([*before, held, *after], one)


def joins_s(plan: Plan) -> list[float]:
    """The times at which one take gives way to another, or to another part of itself."""
    return [after.start_s for one, after in pairwise(plan.blocks) if not goes_on(one, after)]


def moved_join(one: MoveJoin, plan: Plan, bounds_s: Floats, repertoire: Repertoire) -> PlannedEdit:
    """The edit that moves a join by counts, to one of `bounds_s` (N + 1,).

    Raises `ParameterError` if there is no join within a count of its time, if the next join or the end of a
    take is too near, or for takes that are not known.
    """
    known_s = joins_s(plan)
    at_s = min(known_s, key=lambda join_s: abs(join_s - one.at_s), default=np.inf)
    count_s = float(np.median(np.diff(bounds_s)))
    if abs(at_s - one.at_s) > _NEAR_COUNTS * count_s:
        said = f"got one at {at_s:.2f} s" if known_s else "got one take without joins"
        raise ParameterError(f"expected a join of takes within a count of {one.at_s:.2f} s, {said}")
    slot = int(np.abs(bounds_s - at_s).argmin()) + one.counts
    lowest_s = max((join_s for join_s in known_s if join_s < at_s), default=0.0)
    highest_s = min((join_s for join_s in known_s if join_s > at_s), default=plan.duration_s)
    to_s = float(bounds_s[slot]) if 0 < slot < len(bounds_s) - 1 else np.inf
    if not lowest_s + TOUCH_S < to_s < highest_s - TOUCH_S:
        raise ParameterError(
            f"expected the join at {at_s:.2f} s to stay between those beside it, at {lowest_s:.2f} and "
            f"{highest_s:.2f} s, got {one.counts:+d} counts"
        )
    first_s, last_s = min(at_s, to_s), max(at_s, to_s)
    slots = edit_slots(first_s, last_s, bounds_s, outwards=True)
    begin_s, end_s = bounds_s[[slots.begin, slots.end]].tolist()
    longer = _longer(plan, at_s, to_s, bounds_s, repertoire)
    before, after = _danced(plan, begin_s, first_s, bounds_s), _danced(plan, last_s, end_s, bounds_s)
    return _edit([*before, *longer, *after], one)


def _longer(
    plan: Plan, at_s: float, to_s: float, bounds_s: Floats, repertoire: Repertoire
) -> list[PlannedWord]:
    """The take before the join at `at_s`, danced on until `to_s`, or the one after it, danced from there."""
    blocks = plan.blocks
    index = next(i for i, block in enumerate(blocks) if block.start_s == at_s)
    later = to_s > at_s
    here = blocks[index - 1] if later else blocks[index]
    speed = _speed(blocks, index - 1 if later else index, -1 if later else 1)
    take = here.planned.take
    border_s = here.source_end_s if later else here.source_start_s
    times_s = np.array([min(at_s, to_s), *_inside(bounds_s, at_s, to_s), max(at_s, to_s)])
    source_s = border_s + speed * (times_s - at_s)
    length_s = repertoire.takes[repertoire.take_index(take)].duration_s if take else 0.0
    if source_s[0] < 0 or source_s[-1] > length_s:
        known_s = (length_s - border_s if later else border_s) / speed
        raise ParameterError(
            f"expected a join that moves by at most {max(known_s, 0.0):.1f} s, since {take or 'the take'} "
            f"{'ends' if later else 'begins'} there, got {abs(to_s - at_s):.1f} s"
        )
    credits: Credits = here.planned.credits
    spans = zip(pairwise(times_s.round(6).tolist()), pairwise(source_s.round(6).tolist()), strict=True)
    return [
        PlannedWord(*span_s, 0, take, *part_s, credits, mirrored=here.mirrored) for span_s, part_s in spans
    ]


def _speed(blocks: tuple[Block, ...], index: int, step: int) -> float:
    """The mean speed of a take on one side of a join: of the block there, and of those that it continues."""
    dance_s = source_s = 0.0
    here = index
    while dance_s < _TEMPO_S:
        dance_s += blocks[here].end_s - blocks[here].start_s
        source_s += blocks[here].source_end_s - blocks[here].source_start_s
        there = here + step
        if not 0 <= there < len(blocks) or not goes_on(blocks[min(here, there)], blocks[max(here, there)]):
            break
        here = there
    return float(np.clip(source_s / dance_s, MIN_SLOPE, MAX_SLOPE))


def _inside(bounds_s: Floats, one_s: float, other_s: float) -> list[float]:
    """The counts between two times, apart from those at the times themselves."""
    low_s, high_s = min(one_s, other_s), max(one_s, other_s)
    near_s = 0.25 * float(np.median(np.diff(bounds_s)))
    found: list[float] = bounds_s[(bounds_s > low_s + near_s) & (bounds_s < high_s - near_s)].tolist()
    return found


def _danced(plan: Plan, start_s: float, end_s: float, bounds_s: Floats) -> list[PlannedWord]:
    """What is danced between two times, count by count, or nothing if they are the same."""
    if end_s - start_s < TOUCH_S:
        return []
    return list(words_between(plan.planned_blocks, start_s, end_s, bounds_s.tolist()))


def _edit(words: list[PlannedWord], one: Repeat | Hold | MoveJoin) -> PlannedEdit:
    if not all(word.take for word in words):
        raise ParameterError(f"expected {one} of takes, got a part whose takes are not known")
    return PlannedEdit(words[0].start_s, words[-1].end_s, str(one), tuple(words))


def _moved(word: PlannedWord, from_s: Floats, to_s: Floats, *, mirrored: bool) -> PlannedWord:
    """A word at other counts of the dance, (N,) instead of (N,), or its mirror image there."""
    start_s, end_s = np.interp([word.start_s, word.end_s], from_s, to_s).round(6).tolist()
    return replace(word, start_s=start_s, end_s=end_s, mirrored=word.mirrored != mirrored)
