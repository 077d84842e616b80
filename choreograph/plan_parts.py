"""The entries of a plan: seconds, words and edits, the blocks that they make up, and how they are read."""

from __future__ import annotations

import reprlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from choreograph.core.arguments import fields_of_json
from choreograph.core.errors import FormatError
from choreograph.core.splines import CubicSpline
from choreograph.core.timebase import NODE_FRAMES, SEGMENT_S
from choreograph.motion.motion import Credits

AGAIN = "make it again with `choreograph dance SONG -o plan.json`"
TOUCH_S = 1e-3  # largest distance between words without a gap

# The entries of a plan.


@dataclass(frozen=True)
class PlannedSecond:
    """One node of the dance."""

    second: int  # of the dance, from 0
    take: str  # name of the take that is danced
    clip: int  # index in the repertoire
    clip_start_s: float  # in the take
    segment_second: int  # the second at which its warped segment was inserted into the graph
    offset: int  # 0 … 3, quarter of that segment
    source_times_s: tuple[float, ...]  # 21 times of the take, at the 20 fps frames and the second's end
    start_s: float  # when it replaces another take, near `second`, or `second` within a take
    transition_s: float  # length of that transition, to each side if inertial, in all if linear
    costs: dict[str, float]  # name -> weighted cost, of the node and of the edge into it
    credits: Credits  # of the take


@dataclass(frozen=True)
class PlannedWord:
    """One motion word of the dance, from beat to beat, at constant speed."""

    start_s: float  # in the dance
    end_s: float  # in the dance
    motif: int  # the planned motif, or 0 where it is not known
    take: str  # empty if a network dances it, or if it is kept from another dance
    source_start_s: float  # in the take
    source_end_s: float  # in the take. In an edit, it may be the start, and the pose is then held
    credits: Credits  # of the take
    pinned: bool = False  # must keep its motif: transitions change its neighbours, not it
    kept: str = ""  # the motion file that this is a part of, if it is one. Source times are then of this file
    mirrored: bool = False  # danced with left and right exchanged

    @property
    def is_held(self) -> bool:
        """Whether the pose at its start is held until its end."""
        return bool(self.take) and self.source_start_s == self.source_end_s


@dataclass(frozen=True)
class PlannedEdit:
    """A later change of a part of the dance. All other parts remain as they are, to the bit.

    Between the start and the end, its words replace what was planned before. The first and the last of them
    lead from and to the dance around it.
    """

    start_s: float  # in the dance
    end_s: float  # in the dance
    request: str  # what was asked for, such as "swap 8-12"
    words: tuple[PlannedWord, ...]  # from the start to the end, without a gap


@dataclass(frozen=True)
class Block:
    """One part of one take, and its time in the dance."""

    start_s: float  # in the dance
    end_s: float  # in the dance
    source_start_s: float  # in the take
    source_end_s: float  # in the take
    planned: PlannedSecond | PlannedWord  # the entry of the plan that it belongs to

    @property
    def kept(self) -> str:
        """The motion file from which it is kept, or empty if it is not kept."""
        return self.planned.kept if isinstance(self.planned, PlannedWord) else ""

    @property
    def mirrored(self) -> bool:
        """Whether it is danced with left and right exchanged."""
        return isinstance(self.planned, PlannedWord) and self.planned.mirrored

    @property
    def source(self) -> str:
        """The take that is danced, or the file from which it is kept, or empty if a network dances."""
        return self.kept or self.planned.take

    def part(self, start_s: float, end_s: float) -> Block:
        """The block from one time of the dance to another, both within it."""
        first_s, last_s = self.source_s(start_s), self.source_s(end_s)
        return replace(self, start_s=start_s, end_s=end_s, source_start_s=first_s, source_end_s=last_s)

    def source_s(self, at_s: float) -> float:
        """The source time at a time of the dance. Beyond the block, the speed at its end continues.

        Beyond a second, it is that with which the second is played.
        """
        if isinstance(self.planned, PlannedWord):
            speed = (self.source_end_s - self.source_start_s) / (self.end_s - self.start_s)
            return self.source_start_s + speed * (at_s - self.start_s)
        times_s, knots = self.planned.source_times_s, np.linspace(0.0, 1.0, NODE_FRAMES + 1)
        since = at_s - self.planned.second
        if 0.0 <= since <= 1.0:
            return float(np.interp(since, knots, times_s))
        return float(CubicSpline(knots, times_s).continued(since))


def word_block(word: PlannedWord) -> Block:
    """The block of a word."""
    return Block(word.start_s, word.end_s, word.source_start_s, word.source_end_s, word)


def second_block(second: PlannedSecond, span_s: tuple[float, float]) -> Block:
    """The block of a second that is danced for a span."""
    return Block(*span_s, 0.0, 0.0, second).part(*span_s)


def overlaid(blocks: Sequence[Block], words: Sequence[PlannedWord]) -> list[Block]:
    """The blocks, replaced by words where they overlap. Blocks and words are in order of time."""
    left = [part for block in blocks for part in _unreplaced(block, words)]
    return sorted([*left, *map(word_block, words)], key=lambda block: block.start_s)


def _unreplaced(block: Block, words: Sequence[PlannedWord]) -> Iterator[Block]:
    """The parts of a block that no word replaces."""
    start_s = block.start_s
    covers = [(w.start_s, w.end_s) for w in words if w.end_s > start_s and w.start_s < block.end_s]
    for cover in (*covers, (block.end_s, block.end_s)):
        if cover[0] > start_s:
            yield block.part(start_s, cover[0])
        start_s = max(start_s, cover[1])


JUMP_S = 0.1  # of the time in a take, above which a take does not simply go on


def goes_on(one: Block, after: Block, *, jump_s: float = JUMP_S) -> bool:
    """Whether a block continues the take of the block before it, from less than `jump_s` later or earlier."""
    same = one.source == after.source and one.mirrored == after.mirrored
    return same and abs(after.source_start_s - one.source_end_s) < jump_s


_SHORTEST_PART_S = 0.15  # a part of a take between two others would be one long transition


def words_between(
    blocks: Sequence[Block], start_s: float, end_s: float, cuts_s: Sequence[float] = ()
) -> tuple[PlannedWord, ...]:
    """The part of a dance from one time to another as words, which also end at the times `cuts_s`.

    The blocks are in order, without gaps. Where only the end of a block is left, its neighbour goes on,
    unless both are one part of a take.
    """
    inside = [b for b in blocks if b.end_s > start_s and b.start_s < end_s]
    is_long = [min(b.end_s, end_s) - max(b.start_s, start_s) >= _SHORTEST_PART_S for b in inside]
    joined = [goes_on(*pair, jump_s=TOUCH_S) for pair in pairwise(inside)]
    before, after = [False, *joined], [*joined, False]  # whether a block goes on from or to its neighbour
    long = [
        block
        for i, block in enumerate(inside)
        if is_long[i] or (before[i] and is_long[i - 1]) or (after[i] and is_long[i + 1])
    ]
    danced = long or inside[:1]
    borders_s = [start_s, *(block.start_s for block in danced[1:]), end_s]
    words = []
    for block, first_s, last_s in zip(danced, borders_s, borders_s[1:], strict=False):
        cuts = [c for c in cuts_s if first_s + _SHORTEST_PART_S < c < last_s - _SHORTEST_PART_S]
        words += [_as_word(block, *span_s) for span_s in pairwise([first_s, *cuts, last_s])]
    return tuple(words)


def _as_word(block: Block, start_s: float, end_s: float) -> PlannedWord:
    # A block that goes on for its neighbour plays its own part more slowly. Its take may end there.
    known_s = np.clip([block.source_s(s) for s in (start_s, end_s)], block.source_start_s, block.source_end_s)
    first_s, last_s = np.maximum(known_s, 0.0).round(6).tolist()
    planned = block.planned
    if isinstance(planned, PlannedWord):
        return replace(planned, start_s=start_s, end_s=end_s, source_start_s=first_s, source_end_s=last_s)
    return PlannedWord(start_s, end_s, 0, planned.take, first_s, last_s, planned.credits)


def held_spans_s(words: Sequence[PlannedWord]) -> list[tuple[float, float]]:
    """The times from and until which poses are held, of words in order of time."""
    spans_s: list[tuple[float, float]] = []
    for word in words:
        if not word.is_held:
            continue
        if spans_s and word.start_s - spans_s[-1][1] < TOUCH_S:
            spans_s[-1] = spans_s[-1][0], word.end_s
        else:
            spans_s.append((word.start_s, word.end_s))
    return spans_s


# Faults of words and edits in a file, one line each.


def faults_of_word(word: PlannedWord, *, networks: bool, may_hold: bool = False) -> Iterator[str]:
    """The faults of one word. Only `networks` dance without takes, and only edits may hold a pose."""
    if not word.start_s < word.end_s:
        yield f"expected an end after its start, {word.start_s:g} s, got {word.end_s:g} s"
    if word.kept and word.take:
        yield f"expected no take where {word.kept} is kept, got {word.take!r}"
    if not (word.take or word.kept or networks):
        yield "expected a take to dance, got none"
    is_held = may_hold and word.is_held and word.source_start_s >= 0
    if (word.take or word.kept) and not (is_held or 0 <= word.source_start_s < word.source_end_s):
        yield (
            f"expected 0 <= source_start_s < source_end_s, got {word.source_start_s:g} and "
            f"{word.source_end_s:g}"
        )


def faults_of_edit(edit: PlannedEdit, duration_s: float) -> Iterator[str]:
    """The faults of one edit of a dance."""
    if not 0 <= edit.start_s < edit.end_s <= duration_s + TOUCH_S:
        yield (
            f"expected a start before its end, within the dance of {duration_s:g} s, got "
            f"{edit.start_s:g} to {edit.end_s:g} s"
        )
    done_s = edit.start_s
    for word in edit.words:
        if abs(word.start_s - done_s) > TOUCH_S:
            yield f"expected a word from {done_s:g} s on, got one from {word.start_s:g} s on"
        yield from faults_of_word(word, networks=True, may_hold=True)
        if word.kept:
            yield f"expected words of takes, got a part of {word.kept}"
        done_s = word.end_s
    if abs(done_s - edit.end_s) > TOUCH_S:
        yield f"expected words until {edit.end_s:g} s, got words until {done_s:g} s"


# Reading from JSON.


fields_of_entry = partial(fields_of_json, missing=AGAIN)


def read_second(entry: Any, name: str, index: int) -> PlannedSecond:
    """A second from JSON. Raises `FormatError` if it is not valid."""
    where = f"{name}: second {index}"
    known = fields_of_entry(PlannedSecond, entry, where, except_for=("credits",))
    times = known["source_times_s"]
    if len(times) != NODE_FRAMES + 1 or not (np.diff(times) > 0).all():
        raise FormatError(
            f"{where}: expected {NODE_FRAMES + 1} increasing source_times_s, got {reprlib.repr(times)}"
        )
    if known["second"] != index:
        raise FormatError(f"{where}: expected seconds 0, 1, 2, … in order, got {known['second']}")
    if abs(known["start_s"] - index) > 1:
        raise FormatError(f"{where}: expected start_s within a second of {index}, got {known['start_s']}")
    if not 0 < known["transition_s"] <= 1:
        raise FormatError(f"{where}: expected transition_s above 0, at most 1, got {known['transition_s']}")
    if known["offset"] >= SEGMENT_S or known["clip_start_s"] < 0:
        raise FormatError(
            f"{where}: expected an offset below {SEGMENT_S} and a clip_start_s of 0 or more, got "
            f"{known['offset']} and {known['clip_start_s']}"
        )
    return PlannedSecond(**known, credits=_credits(entry, where))


def read_word(entry: Any, where: str) -> PlannedWord:
    """A word from JSON. Raises `FormatError` if a field is not valid."""
    known = fields_of_entry(PlannedWord, entry, where, except_for=("credits",))
    return PlannedWord(**known, credits=_credits(entry, where))


def read_edit(entry: Any, where: str) -> PlannedEdit:
    """An edit from JSON. Raises `FormatError` if a field is not valid."""
    known = fields_of_entry(PlannedEdit, entry, where, except_for=("words",))
    words = entry.get("words")
    if not isinstance(words, list):
        raise FormatError(f"{where}: expected a list of words, got {reprlib.repr(words)}")
    read = tuple(read_word(word, f"{where}, word {number}") for number, word in enumerate(words))
    return PlannedEdit(**known, words=read)


def _credits(entry: Any, where: str) -> Credits:
    return Credits(**fields_of_entry(Credits, entry.get("credits"), where))
