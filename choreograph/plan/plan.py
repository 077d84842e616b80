"""`Plan`, the list of the parts of takes that are danced, with their times, costs and credits, as JSON."""

from __future__ import annotations

import json
import re
import reprlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from choreograph.core.arguments import fields_of_json
from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.files import as_path, read_text
from choreograph.core.numerics import continued_spline
from choreograph.core.progress import counted
from choreograph.core.timebase import NODE_FRAMES, SEGMENT_S
from choreograph.motion.motion import Credits
from choreograph.settings import DanceConfig

AGAIN = "make it again with `choreograph dance SONG -o plan.json`"
TOUCH_S = 1e-3  # largest distance between words without a gap

# The entries of a plan.


@dataclass(frozen=True)
class PlannedSecond:
    """One node of the dance."""

    second: int
    """Second of the dance, from 0 on."""

    take: str
    """Name of the take that is danced."""

    clip: int
    """Index of the clip in the repertoire."""

    clip_start_s: float
    """Where the clip begins in the take, in seconds."""

    segment_second: int
    """The second at which the warped segment of this node entered the graph."""

    offset: int
    """Which quarter of that segment it is, 0 to 3."""

    source_times_s: tuple[float, ...]
    """21 times of the take in seconds: of the 20 frames of the second at 20 fps, and of its end."""

    start_s: float
    """When it replaces another take, in seconds of the dance, near `second`. Within a take, it is
    `second`."""

    transition_s: float
    """Length of that transition in seconds: to each side if inertial, in all if linear."""

    costs: dict[str, float]
    """Weighted costs of the node and of the edge that leads to it, by name."""

    credits: Credits
    """Credits of the take."""


@dataclass(frozen=True)
class PlannedWord:
    """One motion word of the dance, from beat to beat, at constant speed."""

    start_s: float
    """When it begins, in seconds of the dance."""

    end_s: float
    """When it ends, in seconds of the dance."""

    motif: int
    """Index of the planned motif, or 0 where it is not known."""

    take: str
    """Name of the take, or empty if a network dances it or it is kept from another dance."""

    source_start_s: float
    """Where it begins in the take, in seconds."""

    source_end_s: float
    """Where it ends in the take, in seconds. In an edit, it may be the start, and the pose is then held."""

    credits: Credits
    """Credits of the take."""

    pinned: bool = False
    """Whether it must keep its motif. Transitions then change its neighbours only."""

    kept: str = ""
    """The motion file that it is a part of, or empty. Source times are then times of this file."""

    mirrored: bool = False
    """Whether left and right are exchanged."""

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

    start_s: float
    """When it begins, in seconds of the dance."""

    end_s: float
    """When it ends, in seconds of the dance."""

    request: str
    """What was asked for, such as "swap 8-12"."""

    words: tuple[PlannedWord, ...]
    """What is danced from the start to the end, without a gap."""


@dataclass(frozen=True)
class Block:
    """One part of one take, and its time in the dance."""

    start_s: float
    """When it begins, in seconds of the dance."""

    end_s: float
    """When it ends, in seconds of the dance."""

    source_start_s: float
    """Where it begins in the take, in seconds."""

    source_end_s: float
    """Where it ends in the take, in seconds."""

    planned: PlannedSecond | PlannedWord
    """The entry of the plan that it belongs to."""

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
        return float(continued_spline(knots, np.asarray(times_s), since))


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


# The plan of a whole dance.

FORMAT = "choreograph-plan"
VERSION = 1
_SETTINGS = ("planner", "blending", "stage", "front", "fps", "seed")  # of a plan, named as in `DanceConfig`
_ENGINE_NAME = re.compile("[a-z][a-z0-9_-]*")  # of an engine that need not be installed
AMPLITUDES = 0.5, 1.5  # the least and the greatest of a plan, which may be edited
SHORTEST_STOP_S = 1.0  # and the least time from one stop to the next
LENGTH_SLACK_S = 0.1  # the first and last frames of a take, or of an existing dance, are repeated so long


@dataclass(frozen=True)
class Plan:
    """The decisions of a whole dance, which `choreograph dance --plan` renders again.

    The graph engine plans seconds, and words only where motifs are pinned or banned. These words replace the
    seconds there. The mixer and the rollout engine plan words only, from start to end without a gap. Engines
    of other packages plan either kind. The plan of a dance that is known only as a motion file is one word,
    which keeps this file. Edits replace parts of all these, one after the other.

    Examples
    --------
    >>> plan = cg.dance(cg.example_songs()["house"], duration_s=8).plan
    >>> plan
    <Plan of a dance to 'house': 8.0 s, graph engine, 8 seconds>
    >>> cg.Plan.from_json(plan.to_json()) == plan
    True
    """

    song: str
    """Name of the song."""

    duration_s: float
    """Length of the dance in seconds."""

    start_s: float
    """Where the danced part begins in the song file, in seconds."""

    repertoire: str
    """Name of the file of the repertoire."""

    planner: str
    """The planner, as in `DanceConfig`."""

    blending: str
    """How takes are joined, as in `DanceConfig`."""

    seed: int
    """The seed, as in `DanceConfig`."""

    fps: float
    """Frames per second of the dance."""

    weights: dict[str, float]
    """Weights of the costs by name."""

    music_beats_s: tuple[float, ...]
    """Beats of the song, in seconds of the dance."""

    seconds: tuple[PlannedSecond, ...]
    """One entry for each second of the dance, or none for engines that plan words."""

    engine: str = "graph"
    """Name of the engine that made the plan."""

    words: tuple[PlannedWord, ...] = ()
    """Motion words in order of time."""

    music_beat_numbers: tuple[int, ...] = ()
    """Number of each beat in its bar, 1 on the downbeat, or none if bars are not known."""

    metre: int = 0
    """Beats in a bar, or 0 if bars are not known."""

    opening_s: float = 0.0
    """Time of the first count, in seconds. Shortly before it, the dance leaves its first pose."""

    closing_s: float | None = None
    """Time from which the last pose is held, in seconds, or None to dance to the end."""

    lock_feet: bool = True
    """Whether feet that touch the floor are kept in place."""

    stage: str = "near"
    """The stage on which rotations at transitions keep the dancer, as in `DanceConfig`."""

    least_cost: float | None = None
    """Lower bound of the total cost of all paths, if it was asked for."""

    amplitudes: tuple[float, ...] = ()
    """Size of the dance in each second, 1 for the size of the takes, or none if all are 1."""

    stops_s: tuple[tuple[float, float], ...] = ()
    """From when the dance stands still to when it moves again, in seconds."""

    front: str = "audience"
    """Where rotations at transitions bring the dancer back to, "audience", or "free" for none."""

    edits: tuple[PlannedEdit, ...] = ()
    """Changes of parts of the dance, each after those before it."""

    def __repr__(self) -> str:
        kinds = ((self.seconds, "second"), (self.words, "word"), (self.edits, "edit"))
        parts = ", ".join(counted(len(planned), one) for planned, one in kinds if planned)
        song = reprlib.repr(self.song)
        return (
            f"<Plan of a dance to {song}: {self.duration_s:.1f} s, {self.engine} engine, {parts or 'empty'}>"
        )

    @property
    def danced_until_s(self) -> float:
        """The time at which the last pose is held, or the end of the dance if none is held."""
        return self.duration_s if self.closing_s is None else self.closing_s

    @property
    def danced_bars_s(self) -> tuple[float, ...]:
        """The beginnings of bars between the held poses, or none if the bars of the song are not known."""
        beats = zip(self.music_beats_s, self.music_beat_numbers, strict=False)  # no numbers without bars
        return tuple(s for s, number in beats if number == 1 and self.opening_s <= s <= self.danced_until_s)

    @property
    def phrase_borders_s(self) -> tuple[float, ...]:
        """Every fourth beginning of a bar after the first, or every sixteenth beat if bars are not known."""
        return self.danced_bars_s[4::4] if self.metre else self.music_beats_s[16::16]

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The parts of the dance in order: edits, words where nothing is edited, and seconds elsewhere.

        The first part includes the held first pose, and the last part the held last pose.
        """
        blocks = self.planned_blocks
        danced = [b for b in blocks if b.end_s > self.opening_s and b.start_s < self.danced_until_s]
        if danced:
            danced[0] = replace(danced[0], start_s=0.0)
            danced[-1] = replace(danced[-1], end_s=self.duration_s)
        return tuple(danced)

    @property
    def planned_blocks(self) -> tuple[Block, ...]:
        """As `blocks`, with the parts planned for the time in which poses are held."""
        blocks: list[Block] = list(self._blocks_without_edits)
        for edit in self.edits:
            blocks = overlaid(blocks, edit.words)
        return tuple(blocks)

    @property
    def _blocks_without_edits(self) -> list[Block]:
        start_s = np.array([second.start_s for second in self.seconds])
        bounds_s = np.minimum(np.maximum.accumulate([*start_s, self.duration_s]), self.duration_s)
        spans_s = pairwise(bounds_s.tolist())
        seconds = [second_block(second, span_s) for second, span_s in zip(self.seconds, spans_s, strict=True)]
        return overlaid(seconds, self.words)

    @property
    def played_blocks(self) -> tuple[Block, ...]:
        """Every part of a take or a file that is read when the plan is rendered, replaced or not."""
        edited = [word_block(word) for edit in self.edits for word in edit.words]
        return (*self._blocks_without_edits, *edited)

    @property
    def from_takes(self) -> bool:
        """Whether every block is a piece of a take. False if a network generates the motion."""
        return all(block.planned.take for block in self.blocks)

    @property
    def kept_of(self) -> str:
        """The motion file that is kept, apart from edits, or empty if none is."""
        return next((word.kept for word in self.words if word.kept), "")

    def takes_s(self) -> dict[str, float]:
        """Seconds of the dance by take or kept file, in order of first appearance."""
        danced: dict[str, float] = {}
        for block in self.blocks:
            danced[block.source] = danced.get(block.source, 0.0) + block.end_s - block.start_s
        return danced

    @property
    def total_cost(self) -> float:
        """Sum of all weighted costs of the seconds, edited or not. Words have no costs."""
        return sum(sum(second.costs.values()) for second in self.seconds)

    def to_json(self) -> str:
        """The plan as JSON text, as specified in `data_schema/plan.schema.json`."""
        return plan_text(self, indent=1) + "\n"

    def check(self) -> None:
        """Raise `ParameterError` or `FormatError` unless the plan, edited or not, is as valid as a file's."""
        try:
            text = plan_text(self)
        except (TypeError, ValueError, RecursionError) as error:
            raise ParameterError(f"expected a plan that JSON can contain, got another: {error}") from None
        self.from_json(text)

    @classmethod
    def from_json(cls, text: str, *, name: str = "plan") -> Plan:
        """Read a plan. `FormatError` names the key that is missing, unknown or of the wrong type."""
        if not isinstance(text, str):
            raise ParameterError(f"expected a plan as text, got {reprlib.repr(text)}")
        try:
            data = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise FormatError(f"{name}: expected a plan (JSON), could not parse it: {error}") from error
        return cls._of_data(_of_this_version(data, name), name)

    @classmethod
    def _of_data(cls, data: dict[str, Any], name: str) -> Plan:
        for key in ("seconds", "words", "edits"):
            if not isinstance(data.get(key), list):
                raise FormatError(f"{name}: expected a list of {key}, got {reprlib.repr(data.get(key))}")
        known = fields_of_entry(cls, data, name, except_for=("seconds", "words", "edits"))
        seconds = tuple(read_second(entry, name, index) for index, entry in enumerate(data["seconds"]))
        words = tuple(read_word(entry, f"{name}: word {index}") for index, entry in enumerate(data["words"]))
        edits = tuple(read_edit(entry, f"{name}: edit {index}") for index, entry in enumerate(data["edits"]))
        plan = cls(**known, seconds=seconds, words=words, edits=edits)
        for fault in plan._faults():
            raise FormatError(f"{name}: {fault}")
        return plan

    @classmethod
    def read(cls, path: str | Path) -> Plan:
        """Read a plan file. Raises `FormatError` if it is missing or not a plan."""
        return cls.from_json(read_text(as_path("a plan", path), "a plan file"), name=str(path))

    def _faults(self) -> Iterator[str]:
        """The faults of the plan, one line each."""
        if self.start_s < 0:
            yield f"expected a start_s of 0 or more, got {self.start_s}"
        if not _ENGINE_NAME.fullmatch(self.engine):
            yield f"expected the name of an engine as engine, got {reprlib.repr(self.engine)}"
        try:
            DanceConfig(**{name: getattr(self, name) for name in _SETTINGS})
        except ParameterError as error:
            yield str(error)
        if self.duration_s <= 0:
            yield f"expected a duration_s above 0, got {self.duration_s}"
        if not 0 <= self.opening_s < self.danced_until_s <= self.duration_s:
            yield (
                "expected 0 <= opening_s < closing_s <= duration_s, got "
                f"{self.opening_s} to {self.danced_until_s}"
            )
        if len(self.music_beat_numbers) not in (0, len(self.music_beats_s)):
            yield (
                f"expected a music_beat_number for each of the {len(self.music_beats_s)} music_beats_s, or "
                f"none, got {len(self.music_beat_numbers)}"
            )
        if self.seconds and self.engine in ("mixer", "rollout"):
            yield f"expected only words of the {self.engine} engine, got {len(self.seconds)} seconds"
        if (self.seconds or self.engine == "graph") and len(self.seconds) < self.duration_s:
            yield f"expected seconds for {self.duration_s} s, got {len(self.seconds)}"
        yield from self._faults_of_dynamics()
        yield from self._faults_of_words()
        yield from self._faults_of_edits()

    def _faults_of_dynamics(self) -> Iterator[str]:
        """Amplitudes out of range or not of every second, and stops that are not in order."""
        least, greatest = AMPLITUDES
        if self.amplitudes and not all(least <= amplitude <= greatest for amplitude in self.amplitudes):
            yield f"expected amplitudes from {least:g} to {greatest:g}, got {reprlib.repr(self.amplitudes)}"
        if self.amplitudes and len(self.amplitudes) < self.duration_s:
            yield f"expected amplitudes for {self.duration_s} s, or none, got {len(self.amplitudes)}"
        times_s = [0.0, *(time_s for span_s in self.stops_s for time_s in span_s), self.duration_s]
        if any(
            after_s - before_s < SHORTEST_STOP_S for before_s, after_s in pairwise(times_s) if self.stops_s
        ):
            yield (
                f"expected stops_s in order, within the dance, and {SHORTEST_STOP_S:g} s or more between "
                f"their times, got {reprlib.repr(self.stops_s)}"
            )

    def _faults_of_words(self) -> Iterator[str]:
        """Words that are not in order, overlap, or leave gaps that no seconds fill."""
        longest_gap_s = np.inf if self.seconds else TOUCH_S
        done_s = 0.0
        for index, word in enumerate(self.words):
            where = f"word {index}"
            if not -TOUCH_S <= word.start_s - done_s <= longest_gap_s:
                yield f"{where}: expected it to begin at {done_s:g} s, got {word.start_s:g} s"
            if word.end_s > self.duration_s + TOUCH_S:
                yield f"{where}: expected an end within {self.duration_s:g} s, got {word.end_s:g} s"
            networks = self.engine not in ("graph", "mixer")
            yield from (f"{where}: {fault}" for fault in faults_of_word(word, networks=networks))
            done_s = word.end_s
        if not self.seconds and done_s < self.duration_s - TOUCH_S:
            yield f"expected words until {self.duration_s:g} s, got words until {done_s:g} s"

    def _faults_of_edits(self) -> Iterator[str]:
        """Faults of edits, and a motion file that is not kept as a whole."""
        for index, edit in enumerate(self.edits):
            yield from (f"edit {index}: {fault}" for fault in faults_of_edit(edit, self.duration_s))
        if self.kept_of and (self.seconds or len(self.words) != 1):
            yield f"expected {self.kept_of} kept as one word, and no seconds, got others beside it"


def plan_text(plan: Plan, *, indent: int | None = None) -> str:
    """A plan as JSON text, in one line unless there is an `indent`. Raises as `json.dumps`."""
    data = {"format": FORMAT, "version": VERSION, **_fields_of(plan)}
    return json.dumps(data, indent=indent, default=_fields_of)


def _fields_of(entry: object) -> dict[str, Any]:
    if not is_dataclass(entry):
        raise TypeError(f"expected an entry of a plan, got {type(entry).__name__}")
    return {field.name: getattr(entry, field.name) for field in fields(entry)}


def _of_this_version(data: Any, name: str) -> dict[str, Any]:
    """The fields of a plan's JSON. Raises `FormatError` if it is not a plan of this version."""
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise FormatError(f"{name}: expected a {FORMAT}, got {reprlib.repr(data)}")
    version = data.get("version")
    if version != VERSION or isinstance(version, bool):
        got = reprlib.repr(version)
        raise FormatError(f"{name}: expected a {FORMAT} of version {VERSION}, got version {got}: {AGAIN}")
    return {key: value for key, value in data.items() if key not in ("format", "version")}
