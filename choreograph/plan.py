"""`Plan`: which second of which take is danced when, what it cost and whose it is; JSON and back."""

from __future__ import annotations

import json
import reprlib
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from choreograph.config import DanceConfig, is_number
from choreograph.errors import FormatError, ParameterError
from choreograph.takes import Credits
from choreograph.timebase import NODE_FRAMES, SEGMENT_S

FORMAT = "choreograph-plan"
VERSION = 1


@dataclass(frozen=True)
class PlannedSecond:
    """One node of the dance."""

    second: int
    take: str
    clip: int  # index in the repertoire
    clip_start_s: float  # in the take
    segment_second: int  # when its warped segment entered the graph
    offset: int  # 0 … 3, quarter of that segment
    source_times_s: tuple[float, ...]  # 21 take instants, at the 20 fps frames and the second's end
    costs: dict[str, float]  # name -> weighted cost, of the node and of the edge into it
    credits: Credits


@dataclass(frozen=True)
class Plan:
    """A whole dance as decisions: render it again with `choreograph dance --plan`."""

    song: str
    duration_s: float
    start_s: float  # of the danced part in the song file
    repertoire: str
    planner: str
    blending: str
    seed: int
    fps: float
    weights: dict[str, float]
    music_beats_s: tuple[float, ...]
    seconds: tuple[PlannedSecond, ...]

    @property
    def total_cost(self) -> float:
        """Sum of all weighted costs."""
        return sum(sum(second.costs.values()) for second in self.seconds)

    def to_json(self) -> str:
        """The plan as JSON text, laid out in `data_schema/plan.schema.json`."""
        return json.dumps({"format": FORMAT, "version": VERSION, **asdict(self)}, indent=1) + "\n"

    @classmethod
    def from_json(cls, text: str, *, name: str = "plan") -> Plan:
        """Read a plan; `FormatError` naming the key that is missing, unknown or of the wrong kind."""
        try:
            data = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise FormatError(f"{name}: expected a plan (JSON), could not parse it: {error}") from error
        if not isinstance(data, dict) or data.get("format") != FORMAT or data.get("version") != VERSION:
            raise FormatError(f"{name}: expected a {FORMAT} of version {VERSION}")
        data = {key: value for key, value in data.items() if key not in ("format", "version")}
        seconds = data.pop("seconds", None)
        if not isinstance(seconds, list):
            raise FormatError(f"{name}: expected a list of seconds, got {reprlib.repr(seconds)}")
        planned = tuple(_second(entry, name, index) for index, entry in enumerate(seconds))
        plan = cls(**_known(cls, data, name, except_for="seconds"), seconds=planned)
        plan._check(name)
        return plan

    @classmethod
    def read(cls, path: str | Path) -> Plan:
        """Read a plan file; `FormatError` if it is missing or not a plan."""
        try:
            text = Path(path).read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise FormatError(f"{path}: expected a plan file, could not read it: {error}") from error
        return cls.from_json(text, name=str(path))

    def _check(self, name: str) -> None:
        if not self.seconds:
            raise FormatError(f"{name}: the plan has no second")
        if not 0 < self.duration_s <= len(self.seconds):
            raise FormatError(f"{name}: {len(self.seconds)} seconds cannot fill {self.duration_s} s")
        if self.start_s < 0:
            raise FormatError(f"{name}: expected a start_s of 0 or more, got {self.start_s}")
        try:
            DanceConfig(planner=self.planner, blending=self.blending, fps=self.fps, seed=self.seed)
        except ParameterError as error:
            raise FormatError(f"{name}: {error}") from error


def _second(entry: Any, name: str, index: int) -> PlannedSecond:
    where = f"{name}: second {index}"
    known = _known(PlannedSecond, entry, where, except_for="credits")
    times = known["source_times_s"]
    if len(times) != NODE_FRAMES + 1 or not (np.diff(times) > 0).all():
        raise FormatError(f"{where} needs {NODE_FRAMES + 1} increasing source_times_s")
    if known["second"] != index:
        raise FormatError(f"{where}: expected seconds 0, 1, 2, … in order, got {known['second']}")
    if known["offset"] >= SEGMENT_S or known["clip_start_s"] < 0:
        raise FormatError(f"{where}: expected an offset below {SEGMENT_S} and a clip_start_s of 0 or more")
    return PlannedSecond(**known, credits=Credits(**_known(Credits, entry.get("credits"), where)))


def _known(kind: type, data: Any, where: str, *, except_for: str = "") -> dict[str, Any]:
    """The fields of dataclass `kind` in `data`, each of its declared type; `FormatError` otherwise."""
    if not isinstance(data, dict):
        raise FormatError(f"{where}: expected {kind.__name__.lower()} by key, got {reprlib.repr(data)}")
    wanted = {f.name: str(f.type) for f in fields(kind)}
    unknown = sorted(set(data) - set(wanted))
    if unknown:
        raise FormatError(f"{where}: unknown key {unknown[0]!r}; known are {', '.join(wanted)}")
    known = {}
    for key, declared in wanted.items():
        if key == except_for:
            continue
        if key not in data:
            raise FormatError(f"{where}: the key {key} is missing")
        value = data[key]
        if not _IS_A[declared](value):
            raise FormatError(f"{where}: {key} is not a {declared}: {reprlib.repr(value)}")
        known[key] = tuple(value) if isinstance(value, list) else value
    return known


# Declared type of a field -> whether a value from JSON is one. Whole numbers here count or index.
_IS_A: dict[str, Callable[[Any], bool]] = {
    "str": lambda v: isinstance(v, str),
    "int": lambda v: is_number(v) and isinstance(v, int) and v >= 0,
    "float": is_number,
    "dict[str, float]": lambda v: isinstance(v, dict) and all(map(is_number, v.values())),
    "tuple[float, ...]": lambda v: isinstance(v, list) and all(map(is_number, v)),
}
