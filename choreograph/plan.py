"""`Plan`, the list of the parts of takes that are danced, with their times, costs and credits, as JSON."""

from __future__ import annotations

import json
import re
import reprlib
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from choreograph.core.arguments import fields_of_json
from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.files import as_path, read_text
from choreograph.core.progress import counted
from choreograph.core.timebase import NODE_FRAMES, SEGMENT_S
from choreograph.motion.motion import Credits
from choreograph.settings import DanceConfig

FORMAT = "choreograph-plan"
VERSION = 1
_AGAIN = "make it again with `choreograph dance SONG -o plan.json`"
_SETTINGS = ("planner", "blending", "stage", "front", "fps", "seed")  # of a plan, named as in `DanceConfig`
_ENGINE_NAME = re.compile("[a-z][a-z0-9_-]*")  # of an engine that need not be installed
AMPLITUDES = 0.5, 1.5  # the least and the greatest of a plan, which may be edited
SHORTEST_STOP_S = 1.0  # and the least time from one stop to the next
_TOUCH_S = 1e-3  # largest distance between words without a gap


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
    motif: int  # the planned motif, or 0 where a part of another dance is kept
    take: str  # empty if a network dances it, or if it is kept from another dance
    source_start_s: float  # in the take
    source_end_s: float  # in the take
    credits: Credits  # of the take
    pinned: bool = False  # must keep its motif: transitions change its neighbours, not it
    kept: str = ""  # the dance that this is a part of, if it is kept. Source times are then of that dance


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
        """The dance from which it is kept, or empty if it is not kept."""
        return self.planned.kept if isinstance(self.planned, PlannedWord) else ""

    @property
    def source(self) -> str:
        """The take that is danced, or the dance from which it is kept, or empty if a network dances."""
        return self.kept or self.planned.take


@dataclass(frozen=True)
class Plan:
    """The decisions of a whole dance, which `choreograph dance --plan` renders again.

    The graph engine plans seconds, and words only where motifs are pinned or banned. These words replace the
    seconds there. The mixer and the rollout engine plan words only, from start to end without a gap. A part
    that is kept from another dance is also a word, of any length. Engines of other packages plan either kind.

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

    def __repr__(self) -> str:
        kinds = ((self.seconds, "second"), (self.words, "word"))
        parts = ", ".join(counted(len(danced), one) for danced, one in kinds if danced)
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
    def blocks(self) -> tuple[Block, ...]:
        """The parts of the dance in order: the words, and the seconds where there is no word.

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
        blocks = [Block(w.start_s, w.end_s, w.source_start_s, w.source_end_s, w) for w in self.words]
        start_s = np.array([second.start_s for second in self.seconds])
        bounds_s = np.minimum(np.maximum.accumulate([*start_s, self.duration_s]), self.duration_s)
        for second, span_s in zip(self.seconds, pairwise(bounds_s.tolist()), strict=True):
            blocks.extend(_unreplaced_blocks(second, span_s, self.words))
        return tuple(sorted(blocks, key=lambda block: block.start_s))

    @property
    def from_takes(self) -> bool:
        """Whether every block is a piece of a take. False if a network generates the motion."""
        return all(block.planned.take for block in self.blocks)

    @property
    def kept_of(self) -> str:
        """The dance of which parts are kept, or empty if none are."""
        return next((word.kept for word in self.words if word.kept), "")

    @property
    def kept_spans_s(self) -> tuple[tuple[float, float], ...]:
        """The spans kept from another dance, in order. Spans that touch are joined."""
        spans: list[tuple[float, float]] = []
        for word in self.words:
            if word.kept and spans and word.start_s - spans[-1][1] <= _TOUCH_S:
                spans[-1] = (spans[-1][0], word.end_s)
            elif word.kept:
                spans.append((word.start_s, word.end_s))
        return tuple(spans)

    def takes_s(self) -> dict[str, float]:
        """Seconds of the dance by take or kept dance, in order of first appearance."""
        danced: dict[str, float] = {}
        for block in self.blocks:
            danced[block.source] = danced.get(block.source, 0.0) + block.end_s - block.start_s
        return danced

    @property
    def total_cost(self) -> float:
        """Sum of all weighted costs of the seconds. Words have no costs."""
        return sum(sum(second.costs.values()) for second in self.seconds)

    def to_json(self) -> str:
        """The plan as JSON text, as specified in `data_schema/plan.schema.json`."""
        return json.dumps({"format": FORMAT, "version": VERSION, **asdict(self)}, indent=1) + "\n"

    def check(self) -> None:
        """Raise `ParameterError` or `FormatError` unless the plan, edited or not, is as valid as a file's."""
        try:
            text = self.to_json()
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
        for key in ("seconds", "words"):
            if not isinstance(data.get(key), list):
                raise FormatError(f"{name}: expected a list of {key}, got {reprlib.repr(data.get(key))}")
        known = _fields(cls, data, name, except_for=("seconds", "words"))
        seconds = tuple(_second(entry, name, index) for index, entry in enumerate(data["seconds"]))
        words = tuple(_word(entry, f"{name}: word {index}") for index, entry in enumerate(data["words"]))
        plan = cls(**known, seconds=seconds, words=words)
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
        longest_gap_s = np.inf if self.seconds else _TOUCH_S
        done_s = 0.0
        for index, word in enumerate(self.words):
            where = f"word {index}"
            if not -_TOUCH_S <= word.start_s - done_s <= longest_gap_s:
                yield f"{where}: expected it to begin at {done_s:g} s, got {word.start_s:g} s"
            if not word.start_s < word.end_s <= self.duration_s + _TOUCH_S:
                yield (
                    f"{where}: expected an end after its start, {word.start_s:g} s, and within the dance of "
                    f"{self.duration_s:g} s, got {word.end_s:g} s"
                )
            if word.kept:
                yield from self._faults_of_kept(word, where)
            if not (word.take or word.kept) and self.engine in ("graph", "mixer"):
                yield f"{where}: expected a take for the {self.engine} engine to dance, got none"
            if (word.take or word.kept) and not 0 <= word.source_start_s < word.source_end_s:
                yield (
                    f"{where}: expected 0 <= source_start_s < source_end_s, got {word.source_start_s:g} and "
                    f"{word.source_end_s:g}"
                )
            done_s = word.end_s
        if not self.seconds and done_s < self.duration_s - _TOUCH_S:
            yield f"expected words until {self.duration_s:g} s, got words until {done_s:g} s"

    def _faults_of_kept(self, word: PlannedWord, where: str) -> Iterator[str]:
        if word.take:
            yield f"{where}: expected no take where {word.kept} is kept, got {word.take!r}"
        if word.kept != self.kept_of:
            yield f"{where}: expected kept parts of {self.kept_of} only, got {word.kept!r}"
        if abs(word.source_start_s - word.start_s) > _TOUCH_S:
            yield (
                f"{where}: expected {word.kept} kept where it is danced, at {word.start_s:g} s, got its part "
                f"from {word.source_start_s:g} s on"
            )


def _unreplaced_blocks(
    second: PlannedSecond, span_s: tuple[float, float], words: tuple[PlannedWord, ...]
) -> list[Block]:
    """The parts of a second's span that no word replaces."""
    start_s, end_s = span_s
    covers = [(w.start_s, w.end_s) for w in words if w.end_s > start_s and w.start_s < end_s]
    blocks = []
    for cover in (*covers, (end_s, end_s)):
        if cover[0] > start_s:
            first_s, last_s = _source_s(second, start_s), _source_s(second, cover[0])
            blocks.append(Block(start_s, cover[0], first_s, last_s, second))
        start_s = max(start_s, cover[1])
    return blocks


def _source_s(second: PlannedSecond, at_s: float) -> float:
    """The source time at a time of the dance. Beyond the second, the speed at its end continues."""
    times_s = np.array(second.source_times_s)
    frame = (at_s - second.second) * NODE_FRAMES
    inside = float(np.interp(frame, np.arange(len(times_s)), times_s))
    before, beyond = min(frame, 0.0), max(frame - NODE_FRAMES, 0.0)
    return float(inside + before * (times_s[1] - times_s[0]) + beyond * (times_s[-1] - times_s[-2]))


def _of_this_version(data: Any, name: str) -> dict[str, Any]:
    """The fields of a plan's JSON. Raises `FormatError` if it is not a plan of this version."""
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise FormatError(f"{name}: expected a {FORMAT}, got {reprlib.repr(data)}")
    version = data.get("version")
    if version != VERSION or isinstance(version, bool):
        got = reprlib.repr(version)
        raise FormatError(f"{name}: expected a {FORMAT} of version {VERSION}, got version {got}: {_AGAIN}")
    return {key: value for key, value in data.items() if key not in ("format", "version")}


_fields = partial(fields_of_json, missing=_AGAIN)


def _second(entry: Any, name: str, index: int) -> PlannedSecond:
    where = f"{name}: second {index}"
    known = _fields(PlannedSecond, entry, where, except_for=("credits",))
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
    return PlannedSecond(**known, credits=Credits(**_fields(Credits, entry.get("credits"), where)))


def _word(entry: Any, where: str) -> PlannedWord:
    known = _fields(PlannedWord, entry, where, except_for=("credits",))
    return PlannedWord(**known, credits=Credits(**_fields(Credits, entry.get("credits"), where)))
