"""Edits as the user states them, and the counts of a dance from which and to which they change it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from choreograph.choreography.constraints import Ban, Keep, MotifPin, Span, TakePin, check_times, parse_keep
from choreograph.core.arguments import check_kind, is_whole, unexpected
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats
from choreograph.core.progress import one_line
from choreograph.library.vocabulary import dance_bounds_s
from choreograph.plan.plan import TOUCH_S, Plan

# What can be asked for. Times are in seconds of the dance, and are moved to the nearest counts.


@dataclass(frozen=True, repr=False)
class Swap(Span):
    """Dance something else from one time of an existing dance to another.

    Raises
    ------
    ParameterError   if a time is not a number

    Examples
    --------
    >>> dance = cg.dance(cg.example_songs()["house"], duration_s=8)
    >>> swapped = cg.edit(dance, [cg.Swap(start_s=4.0, end_s=6.0)])
    >>> swapped.plan.edits[0].request
    'swap 4-6'
    """

    def __str__(self) -> str:
        return f"swap {Span.__str__(self)}"


@dataclass(frozen=True, repr=False)
class Vary(Span):
    """Dance something similar from one time of an existing dance to another.

    Raises
    ------
    ParameterError   if a time is not a number

    Examples
    --------
    >>> dance = cg.dance(cg.example_songs()["house"], duration_s=8)
    >>> varied = cg.edit(dance, [cg.Vary(start_s=4.0, end_s=6.0)])
    >>> np.array_equal(varied.motion.root_pos_m[:160], dance.motion.root_pos_m[:160])
    True
    """

    def __str__(self) -> str:
        return f"vary {Span.__str__(self)}"


@dataclass(frozen=True)
class Repeat:
    """Dance a part of an existing dance again at another time, count by count.

    Raises
    ------
    ParameterError   if a time is not a number, or `mirrored` is not True or False

    Examples
    --------
    >>> dance = cg.dance(cg.example_songs()["house"], duration_s=8)
    >>> again = cg.edit(dance, [cg.Repeat(start_s=1.0, end_s=3.0, at_s=5.0, mirrored=True)])
    >>> again.plan.edits[0].words[0].mirrored
    True
    """

    start_s: float
    """When the part that is repeated begins, in seconds of the dance."""

    end_s: float
    """When it ends, in seconds of the dance."""

    at_s: float
    """When it is danced again, in seconds of the dance."""

    mirrored: bool = False
    """Whether left and right are exchanged."""

    __repr__ = one_line

    def __post_init__(self) -> None:
        check_times(self, "start_s", "end_s", "at_s")
        check_kind("mirrored of a Repeat", self.mirrored, bool)

    def __str__(self) -> str:
        mirror = "=mirror" if self.mirrored else ""
        return f"repeat {self.start_s:g}-{self.end_s:g}@{self.at_s:g}{mirror}"


@dataclass(frozen=True, repr=False)
class Hold(Span):
    """Hold the pose at a time of an existing dance until another time. The dancer breathes and sways.

    Raises
    ------
    ParameterError   if a time is not a number

    Examples
    --------
    >>> dance = cg.dance(cg.example_songs()["house"], duration_s=8)
    >>> held = cg.edit(dance, [cg.Hold(start_s=4.0, end_s=6.0)])
    >>> any(word.is_held for word in held.plan.edits[0].words)
    True
    """

    def __str__(self) -> str:
        return f"hold {Span.__str__(self)}"


@dataclass(frozen=True)
class MoveJoin:
    """Let one take give way to the next some counts later in an existing dance, or earlier.

    The take before the join is danced longer, or that after it begins sooner.

    Raises
    ------
    ParameterError   if the time is not a number, or `counts` is 0 or not whole

    Examples
    --------
    >>> dance = cg.dance(cg.example_songs()["house"], duration_s=8)
    >>> str(cg.MoveJoin(at_s=4.0, counts=-1))
    'move join 4 by -1'
    """

    at_s: float
    """A time within a count of the join, in seconds of the dance."""

    counts: int
    """How many counts later. Below 0, it is earlier."""

    __repr__ = one_line

    def __post_init__(self) -> None:
        check_times(self, "at_s")
        if not is_whole(self.counts) or self.counts == 0:
            raise unexpected("counts of a MoveJoin as a whole number that is not 0", self.counts)

    def __str__(self) -> str:
        return f"move join {self.at_s:g} by {self.counts:+d}"


EditRequest = Swap | Vary | Repeat | Hold | MoveJoin | MotifPin | TakePin | Ban


def parse_swap(text: str) -> Swap:
    """The swap of `10-14`. Raises `ParameterError` for other text."""
    span = parse_keep(text, option="--swap")
    return Swap(span.start_s, span.end_s)


def parse_vary(text: str) -> Vary:
    """The variation of `10-14`. Raises `ParameterError` for other text."""
    span = parse_keep(text, option="--vary")
    return Vary(span.start_s, span.end_s)


def parse_repeat(text: str) -> Repeat:
    """The repetition in `10-14@20` or `10-14@20=mirror`. Raises `ParameterError` for other text."""
    parts = re.fullmatch(r"([^@=]+)@([^@=-]+)(=mirror)?", text)
    if parts is None:
        raise ParameterError(
            f"expected --repeat FROM-TO@TIME, such as 10-14@20 or 10-14@20=mirror, got {text!r}"
        )
    span = parse_keep(parts[1], option="--repeat")
    at_s = parse_keep(f"{parts[2]}-{parts[2]}", option="--repeat").start_s
    return Repeat(span.start_s, span.end_s, at_s, parts[3] is not None)


# The counts on which edits begin and end.


_LEAD_S = 0.45  # that the transition from and to the dance around an edit has, if its counts allow it
MOST_LEAD_COUNTS = 2
MOST_COUNTS = 16  # of one piece of a take. Longer edits are made of several


def slot_bounds_s(plan: Plan) -> Floats:
    """The times (N + 1,) of a dance at which an edit may begin or end: its start, its counts and its end."""
    bounds_s = dance_bounds_s(np.array(plan.music_beats_s), plan.duration_s)
    return np.array([0.0, *bounds_s[1:-1], plan.duration_s])


@dataclass(frozen=True)
class EditSlots:
    """The slots of one edit, with those that lead from and to the dance around it."""

    first: int  # of what was asked for
    stop: int  # one after the last
    before: int = 0  # slots that lead to it
    after: int = 0  # slots that lead from it

    @property
    def begin(self) -> int:
        """The first slot that changes."""
        return self.first - self.before

    @property
    def end(self) -> int:
        """One after the last slot that changes."""
        return self.stop + self.after

    def without_leads(self) -> EditSlots:
        """The same without the slots that lead from and to it."""
        return EditSlots(self.first, self.stop)


def edit_slots(start_s: float, end_s: float, bounds_s: Floats, *, outwards: bool = False) -> EditSlots:
    """The slots of an edit from one time to another, both moved to the nearest of `bounds_s` (N + 1,).

    With `outwards`, they are moved to the next before the start and after the end.

    Raises `ParameterError` if the times are not in order or outside of the dance.
    """
    duration_s = float(bounds_s[-1])
    if not 0 <= start_s < end_s <= duration_s + TOUCH_S:
        raise ParameterError(
            f"expected an edit with a start before its end, within the dance of {duration_s:g} s, got "
            f"{Keep(start_s, end_s)}"
        )
    first, stop = (int(np.abs(bounds_s - at_s).argmin()) for at_s in (start_s, end_s))
    if outwards:
        first = int(np.searchsorted(bounds_s, start_s + TOUCH_S, side="right")) - 1
        stop = int(np.searchsorted(bounds_s, end_s - TOUCH_S))
    if stop == first:  # less than a count: the one that it lies in
        first = int(np.searchsorted(bounds_s[1:-1], 0.5 * (start_s + end_s), side="right"))
        stop = first + 1
    before = _lead(bounds_s, first, -1, start_s)
    after = _lead(bounds_s, stop, 1, end_s)
    return EditSlots(first, stop, before, after)


def _lead(bounds_s: Floats, border: int, step: int, asked_s: float) -> int:
    """How many slots beside a border belong to the transition: one, or two short ones, or none at the ends.

    They end at most two counts from the time that was asked for.
    """
    near, far = border + step, border + 2 * step
    if not 0 <= near < len(bounds_s):
        return 0
    count_s = abs(bounds_s[near] - bounds_s[border])
    is_near = 0 <= far < len(bounds_s) and abs(bounds_s[far] - asked_s) <= MOST_LEAD_COUNTS * count_s
    return 2 if count_s < _LEAD_S and is_near else 1


def parts_of(slots: EditSlots, bounds_s: Floats, downbeats_s: Sequence[float]) -> list[EditSlots]:
    """A long edit as several of at most 16 counts, which begin on downbeats where there are any."""
    parts, first = [], slots.first
    bars = [int(np.abs(bounds_s - at_s).argmin()) for at_s in downbeats_s]
    while slots.stop - first > MOST_COUNTS:
        inside = [bar for bar in bars if first + MOST_COUNTS // 2 <= bar <= first + MOST_COUNTS]
        stop = max(inside, default=first + MOST_COUNTS)
        parts.append((first, stop))
        first = stop
    parts.append((first, slots.stop))
    made = []
    for start, stop in parts:
        before = slots.before if start == slots.first else 1
        made.append(EditSlots(start, stop, before, slots.after if stop == slots.stop else 0))
    return made
