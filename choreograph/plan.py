"""`Plan`, the list of the parts of takes that are danced, with their times, costs and credits, as JSON."""

from __future__ import annotations

import json
import re
import reprlib
from collections.abc import Iterator
from dataclasses import dataclass, fields, is_dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.files import as_path, read_text
from choreograph.core.progress import counted
from choreograph.plan_parts import (
    AGAIN,
    TOUCH_S,
    Block,
    PlannedEdit,
    PlannedSecond,
    PlannedWord,
    faults_of_edit,
    faults_of_word,
    fields_of_entry,
    overlaid,
    read_edit,
    read_second,
    read_word,
    second_block,
    word_block,
)
from choreograph.settings import DanceConfig

FORMAT = "choreograph-plan"
VERSION = 1
_SETTINGS = ("planner", "blending", "stage", "front", "fps", "seed")  # of a plan, named as in `DanceConfig`
_ENGINE_NAME = re.compile("[a-z][a-z0-9_-]*")  # of an engine that need not be installed
AMPLITUDES = 0.5, 1.5  # the least and the greatest of a plan, which may be edited
SHORTEST_STOP_S = 1.0  # and the least time from one stop to the next


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

    song: str  # name of the song
    duration_s: float  # length of the dance
    start_s: float  # of the danced part in the song file
    repertoire: str  # name of the file of the repertoire
    planner: str  # as in `DanceConfig`, as are blending, seed, fps and weights
    blending: str
    seed: int
    fps: float
    weights: dict[str, float]  # of the costs by name
    music_beats_s: tuple[float, ...]  # beats of the song, in seconds of the dance
    seconds: tuple[PlannedSecond, ...]  # one for each second, or empty for engines that plan words
    engine: str = "graph"  # name of the engine that made the plan
    words: tuple[PlannedWord, ...] = ()  # in order of time
    music_beat_numbers: tuple[int, ...] = ()  # in the bar, 1 on the downbeat, or none if bars are not known
    metre: int = 0  # beats in a bar, or 0 if bars are not known
    opening_s: float = 0.0  # time of the first count. Shortly before it, the dance leaves its first pose
    closing_s: float | None = None  # time from which the last pose is held, or None to dance to the end
    lock_feet: bool = True  # hold planted feet in place when it is rendered
    stage: str = "near"  # on which rotations at transitions keep the dancer, as in `DanceConfig`
    least_cost: float | None = None  # lower bound of the total cost of all paths, if it was asked for
    amplitudes: tuple[float, ...] = ()  # of each second, 1 for the size of the takes, or none if all are 1
    stops_s: tuple[tuple[float, float], ...] = ()  # from when it stands still, until when it moves again
    front: str = "audience"  # to which rotations at transitions bring the dancer back, or "free" for none
    edits: tuple[PlannedEdit, ...] = ()  # changes of parts of the dance, each after those before it

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
