"""`ScenePlan`: the dances of a scene, who dances which of them when, and the places on the stage, as JSON."""

from __future__ import annotations

import json
import reprlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from choreograph.core.arguments import as_list, fields_of_json, unexpected
from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.files import as_path, read_text
from choreograph.core.numerics import Floats
from choreograph.core.progress import counted
from choreograph.core.settings import changed
from choreograph.motion.motion import Motion
from choreograph.music.song import Song
from choreograph.plan.plan import Plan
from choreograph.settings import DanceConfig

FORMAT = "choreograph-scene"
VERSION = 1
MOST_DANCERS = 32
HEIGHTS = 0.5, 2.0  # the least and the greatest of a dancer, relative to the body of the repertoire
SIZES = 0.0, 1.5  # the least and the greatest of a movement
_AGAIN = "make the scene again with `choreograph scene`"
_TOUCH_S = 1e-3  # parts of a dancer that are no further apart follow one another


@dataclass(frozen=True)
class DancerPart:
    """What a dancer does in a span of the song: one of the dances, from there on or some counts behind."""

    start_s: float
    """When it begins, in seconds of the scene."""

    end_s: float
    """When it ends, in seconds of the scene."""

    dance: int
    """Index of the dance in the scene."""

    delay_counts: int = 0
    """Counts by which the dancer is behind the dance."""

    mirrored: bool = False
    """Whether left and right are exchanged."""

    size: float = 1.0
    """Size of the movement, 1 for that of the dance."""

    held: bool = False
    """Whether the pose at the start is held."""


@dataclass(frozen=True)
class PlannedDancer:
    """One dancer of a scene: the parts that are danced, and the places on the stage."""

    name: str
    """Its name, unique in the scene."""

    height: float
    """Height of the body, relative to that of the repertoire."""

    parts: tuple[DancerPart, ...]
    """What is danced, in order of time, without a gap."""

    times_s: tuple[float, ...]
    """(P,) times in seconds at which the dancer is to be at a place."""

    x_m: tuple[float, ...]
    """(P,) places to the side in metres. +X is the dancers' left."""

    z_m: tuple[float, ...]
    """(P,) places towards the audience in metres."""


@dataclass(frozen=True)
class PlannedRequest:
    """How a dance that a network generates is made again to its song."""

    dance: int
    """Index of the dance in the scene."""

    genre: str | None
    """The genre that was asked for, or None."""

    bans: tuple[str, ...]
    """What was excluded, as on the command line, such as "motif:12"."""

    settings: Mapping[str, Any]
    """Fields of `DanceConfig` other than the defaults, as JSON."""

    @classmethod
    def of(cls, dance: int, genre: str | None, bans: Sequence[str], config: DanceConfig) -> PlannedRequest:
        """The request of a dance that was made with these settings. Songs in them have files."""
        given = {one.name: getattr(config, one.name) for one in fields(DanceConfig)}
        usual = {one.name: getattr(DanceConfig(), one.name) for one in fields(DanceConfig)}
        kept = {name: _as_json(value) for name, value in given.items() if value != usual[name]}
        return cls(dance, genre, tuple(bans), {name: kept[name] for name in kept if name != "cache"})

    def config(self) -> DanceConfig:
        """The settings. Raises `ParameterError` for a name or value that is not valid."""
        return changed(DanceConfig(), self.settings)


def _as_json(value: Any) -> Any:
    """A setting of a dance as JSON. A song is the path of its file."""
    if isinstance(value, Song):
        return str(value.path)
    if isinstance(value, Mapping):
        return {key: float(one) for key, one in value.items()}
    return str(value) if isinstance(value, Path) else value


@dataclass(frozen=True)
class ScenePlan:
    """The decisions of a scene, which `choreograph scene --plan` renders again.

    Raises `ParameterError` if a field is of another type.

    Examples
    --------
    >>> plan = cg.scene(cg.example_songs()["house"], dancers=2, duration_s=8).plan
    >>> plan
    <ScenePlan: 2 dancers, 1 dance, 8.0 s>
    >>> cg.ScenePlan.from_json(plan.to_json()) == plan
    True
    """

    dances: tuple[Plan, ...]
    """The dances. The first one is that of the leader."""

    dancers: tuple[PlannedDancer, ...]
    """The dancers, the leader first."""

    requests: tuple[PlannedRequest, ...] = ()
    """How dances that a network generates are made again."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "dances", as_list("dances of a scene", self.dances, "Plan", Plan))
        dancers = as_list("dancers of a scene plan", self.dancers, "PlannedDancer", PlannedDancer)
        object.__setattr__(self, "dancers", dancers)
        requests = as_list("requests of a scene plan", self.requests, "PlannedRequest", PlannedRequest)
        object.__setattr__(self, "requests", requests)
        if not self.dances or not self.dancers:
            raise unexpected("a dance and a dancer or more", (self.dances, self.dancers))

    def __repr__(self) -> str:
        dancers, dances = counted(len(self.dancers), "dancer"), counted(len(self.dances), "dance")
        return f"<ScenePlan: {dancers}, {dances}, {self.duration_s:.1f} s>"

    @property
    def duration_s(self) -> float:
        """Length of the scene in seconds."""
        return self.dances[0].duration_s

    def to_json(self) -> str:
        """The plan as JSON text, as specified in `data_schema/scene.schema.json`."""
        data: dict[str, Any] = {
            "format": FORMAT,
            "version": VERSION,
            "dancers": [_entry(dancer) for dancer in self.dancers],
            "dances": [json.loads(plan.to_json()) for plan in self.dances],
        }
        if self.requests:
            data["requests"] = [_entry(request) for request in self.requests]
        return json.dumps(data, indent=1) + "\n"

    @classmethod
    def from_json(cls, text: str, *, name: str = "scene") -> ScenePlan:
        """Read a plan. `FormatError` names the key that is missing, unknown or of the wrong type."""
        if not isinstance(text, str):
            raise ParameterError(f"expected a plan of a scene as text, got {reprlib.repr(text)}")
        try:
            data = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise FormatError(
                f"{name}: expected a plan of a scene (JSON), could not parse it: {error}"
            ) from None
        if not isinstance(data, dict) or data.get("format") != FORMAT or data.get("version") != VERSION:
            raise FormatError(f"{name}: expected a {FORMAT} of version {VERSION}, got {reprlib.repr(data)}")
        if set(data) - {"requests"} != {"format", "version", "dancers", "dances"}:
            raise FormatError(f"{name}: expected the keys dancers and dances, got {', '.join(sorted(data))}")
        for key in ("dancers", "dances"):
            if not isinstance(data[key], list) or not 1 <= len(data[key]) <= MOST_DANCERS:
                raise FormatError(
                    f"{name}: expected 1 to {MOST_DANCERS} {key}, got {reprlib.repr(data[key])}"
                )
        dances = tuple(
            Plan.from_json(json.dumps(entry), name=f"{name}: dance {index}")
            for index, entry in enumerate(data["dances"])
        )
        dancers = tuple(
            _read_dancer(entry, f"{name}: dancer {index}") for index, entry in enumerate(data["dancers"])
        )
        requests = data.get("requests", [])
        if not isinstance(requests, list):
            raise FormatError(f"{name}: expected a list of requests, got {reprlib.repr(requests)}")
        read = (_read_request(entry, f"{name}: request {i}") for i, entry in enumerate(requests))
        plan = cls(dances, dancers, tuple(read))
        for fault in plan._faults():
            raise FormatError(f"{name}: {fault}")
        return plan

    @classmethod
    def read(cls, path: str | Path) -> ScenePlan:
        """Read a plan file. Raises `FormatError` if it is missing or not the plan of a scene."""
        return cls.from_json(read_text(as_path("a plan of a scene", path), "a plan file"), name=str(path))

    def _faults(self) -> Iterator[str]:
        """The faults of the plan, one line each."""
        first = self.dances[0]
        for plan in self.dances[1:]:
            if (plan.duration_s, plan.fps, plan.start_s) != (first.duration_s, first.fps, first.start_s):
                yield "expected dances of one length and rate to one part of a song, got different ones"
        asked = [request.dance for request in self.requests]
        if len(set(asked)) < len(asked) or any(dance >= len(self.dances) for dance in asked):
            yield (
                f"expected a request for one of {counted(len(self.dances), 'dance')} each, got "
                f"{reprlib.repr(asked)}"
            )
        names = [dancer.name for dancer in self.dancers]
        if len(set(names)) < len(names):
            yield f"expected dancers of different names, got {reprlib.repr(names)}"
        for index, dancer in enumerate(self.dancers):
            for fault in self._faults_of(dancer):
                yield f"dancer {index}: {fault}"

    def _faults_of(self, dancer: PlannedDancer) -> Iterator[str]:
        """The faults of one dancer."""
        if not HEIGHTS[0] <= dancer.height <= HEIGHTS[1]:
            yield f"expected a height from {HEIGHTS[0]:g} to {HEIGHTS[1]:g}, got {dancer.height:g}"
        n_places = len(dancer.times_s)
        if not n_places == len(dancer.x_m) == len(dancer.z_m) or not n_places:
            yield f"expected a time, an x and a z of each place, got {n_places} times"
        if any(after <= before for before, after in pairwise((-1.0, *dancer.times_s))):
            yield f"expected increasing times_s of 0 or more, got {reprlib.repr(dancer.times_s)}"
        done_s = 0.0
        for part in dancer.parts:
            if abs(part.start_s - done_s) > _TOUCH_S or part.end_s <= part.start_s:
                yield f"expected a part from {done_s:g} s on, got {part.start_s:g} to {part.end_s:g} s"
            if part.dance >= len(self.dances):
                yield f"expected one of {counted(len(self.dances), 'dance')}, got dance {part.dance}"
            if not SIZES[0] <= part.size <= SIZES[1]:
                yield f"expected a size from {SIZES[0]:g} to {SIZES[1]:g}, got {part.size:g}"
            done_s = part.end_s
        if abs(done_s - self.duration_s) > _TOUCH_S:
            yield f"expected parts until {self.duration_s:g} s, got parts until {done_s:g} s"


def _entry(entry: Any) -> dict[str, Any]:
    """A dancer or one of its parts as JSON data."""
    values = {field.name: getattr(entry, field.name) for field in fields(entry)}
    if "parts" in values:
        values["parts"] = [_entry(part) for part in values["parts"]]
    return values


def _read_dancer(data: Any, where: str) -> PlannedDancer:
    known = fields_of_json(PlannedDancer, data, where, missing=_AGAIN, except_for=("parts",))
    parts = data.get("parts")
    if not isinstance(parts, list) or not parts:
        raise FormatError(f"{where}: expected a list of parts, got {reprlib.repr(parts)}")
    read = (
        fields_of_json(DancerPart, part, f"{where}: part {index}", missing=_AGAIN)
        for index, part in enumerate(parts)
    )
    return PlannedDancer(**known, parts=tuple(DancerPart(**part) for part in read))


def _read_request(data: Any, where: str) -> PlannedRequest:
    except_for = ("genre", "bans", "settings")
    known = fields_of_json(PlannedRequest, data, where, missing=_AGAIN, except_for=except_for)
    genre, bans, settings = (data.get(key) for key in except_for)
    if not (genre is None or isinstance(genre, str)):
        raise FormatError(f"{where}: expected a genre by name or null, got {reprlib.repr(genre)}")
    if not isinstance(bans, list) or not all(isinstance(ban, str) for ban in bans):
        raise FormatError(f"{where}: expected a list of bans, got {reprlib.repr(bans)}")
    if not isinstance(settings, dict):
        raise FormatError(f"{where}: expected settings by name, got {reprlib.repr(settings)}")
    request = PlannedRequest(**known, genre=genre, bans=tuple(bans), settings=settings)
    try:
        request.config()
    except ParameterError as error:
        raise FormatError(f"{where}: {error}") from None
    return request


# The way of a dancer over the stage, from place to place of the plan.


_STANDING_SHARE = 0.04  # of the speed over the ground, while both feet stand
_MOBILE_EASE_S = 0.1  # standard deviation of the Gaussian that smooths whether they do


def ground_shift_m(motion: Motion, contacts: Floats, times_s: Floats, places_m: Floats) -> Floats:
    """The shift (T, 2) on the ground with which the root is at `places_m` (K, 2) at the times (K,).

    Between two times, the shift changes in proportion to how free the feet are, with `contacts` (T, 4).
    """
    frames = np.clip(np.round(times_s * motion.fps).astype(np.int64), 0, motion.n_frames - 1)
    shift_m = places_m - motion.root_pos_m[frames][:, [0, 2]]  # (K, 2)
    way = np.empty((motion.n_frames, 2))
    way[: frames[0]], way[frames[-1] :] = shift_m[0], shift_m[-1]
    free = _freedom(contacts, motion.fps)
    for index, (first, stop) in enumerate(pairwise(frames.tolist())):
        if first == stop:
            continue
        done = np.concatenate([[0.0], np.cumsum(free[first:stop])])
        share = done[:-1] / done[-1]
        eased = share * share * (3.0 - 2.0 * share)
        way[first:stop] = shift_m[index] + eased[:, None] * (shift_m[index + 1] - shift_m[index])
    return way


def _freedom(contacts: Floats, fps: float) -> Floats:
    """How fast a body may be moved over the ground at each frame (T,): slowly while both feet stand."""
    standing = np.maximum(contacts[:, ::2], contacts[:, 1::2])  # (T, 2) of each foot
    free = _STANDING_SHARE + (1.0 - standing[:, 0] * standing[:, 1])
    eased: Floats = scipy.ndimage.gaussian_filter1d(free, _MOBILE_EASE_S * fps, mode="nearest")
    return eased
