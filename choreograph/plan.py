"""`Plan`: which second of which take is danced when, what it cost and whose it is; JSON and back."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from choreograph.errors import FormatError
from choreograph.takes import Credits
from choreograph.timebase import NODE_FRAMES

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
        except ValueError as error:
            raise FormatError(f"{name}: expected a plan (JSON), could not parse it: {error}") from error
        if not isinstance(data, dict) or data.get("format") != FORMAT or data.get("version") != VERSION:
            raise FormatError(f"{name}: expected a {FORMAT} of version {VERSION}")
        data = {key: value for key, value in data.items() if key not in ("format", "version")}
        try:
            seconds = tuple(_second(entry, name) for entry in data.pop("seconds"))
            data["music_beats_s"] = tuple(float(beat) for beat in data["music_beats_s"])
            plan = cls(**data, seconds=seconds)
            plan._check(name)
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            if isinstance(error, FormatError):
                raise
            raise FormatError(f"{name}: not a plan: {type(error).__name__} {error}") from error
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
        if [entry.second for entry in self.seconds] != list(range(len(self.seconds))):
            raise FormatError(f"{name}: expected seconds 0, 1, 2, … in order")
        if not (np.isfinite(self.duration_s) and 0 < self.duration_s <= len(self.seconds)):
            raise FormatError(f"{name}: {len(self.seconds)} seconds cannot fill {self.duration_s} s")
        if not (np.isfinite(self.fps) and self.fps > 0):
            raise FormatError(f"{name}: expected a positive fps, got {self.fps}")


def _second(entry: dict[str, Any], name: str) -> PlannedSecond:
    times = tuple(float(time) for time in entry["source_times_s"])
    if len(times) != NODE_FRAMES + 1 or not np.isfinite(times).all() or not (np.diff(times) > 0).all():
        raise FormatError(
            f"{name}: second {entry.get('second')} needs {NODE_FRAMES + 1} increasing source_times_s"
        )
    return PlannedSecond(**{**entry, "source_times_s": times, "credits": Credits(**entry["credits"])})
