"""The project of a song: settings, every dance that was made for it, locked parts, and its file.

Dances are steps that can be undone. Steps form a tree. A step either has a whole plan, or adds edits to the
plan of an earlier step. The path leads through the steps that undo and redo visit. Versions may be steps that
the path has left. A project is never changed: each change returns another one.

The size of a project is limited, so that a small file cannot take much memory. Of a larger one, the oldest
steps of the path are left out.

The file of a project is written as a whole after each change, and locked while a studio works with it.
"""

from __future__ import annotations

import base64
import binascii
import json
import os
import re
import reprlib
import zlib
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from shutil import copyfile
from typing import Any, Literal

from choreograph.choreography.scenes import FORMATIONS, parse_schedule
from choreograph.core.arguments import check_choice, check_text, is_number, is_whole, unexpected
from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.files import (
    BUDGETS,
    atomic_path,
    check_target,
    free_names,
    locked_folder,
    read_bytes,
    sha256_of,
    without_garbage_collection,
)
from choreograph.core.settings import changed as changed_settings
from choreograph.pipeline.scene_planning import SceneRequest, dancer_names
from choreograph.plan.plan import Plan, PlannedEdit, faults_of_edit, plan_text, read_edit
from choreograph.plan.scenes import MOST_DANCERS
from choreograph.settings import DanceConfig
from choreograph.studio.refusals import UnknownTypeError

# The settings of a dance, or of several dancers.


ENGINES = ("graph", "mixer", "rollout")
RELATIONS = ("unison", "mirror", "canon:2", "canon:4", "canon:8", "call-and-response", "free")  # for pages
SCENE_SETTINGS = ("dancers", "formation", "relation")  # which leave the dance of the leader as it is
_TEXTS = ("bans", "formation", "relation")
_MOST_TEXTS, _LONGEST_TEXT = 200, 100  # of formations or relations


@dataclass(frozen=True)
class Settings:
    """The settings of a dance that the studio changes, named as in `DanceConfig`, with the requests."""

    engine: str = "graph"
    seed: int = 0
    genre: str | None = None  # that is danced, or None for what suits the song
    dynamics: float = 1.0
    front: str = "audience"
    stage: str = "near"
    weights: Mapping[str, float] = field(default_factory=dict)  # of costs, instead of the defaults
    repertoire: str = ""  # name of the file of the takes that are danced
    bans: tuple[str, ...] = ()  # such as "take:house-01"
    dancers: int = 1
    formation: tuple[str, ...] = ("v",)  # of several dancers: VALUE, or WHEN=VALUE for a part of the song
    relation: tuple[str, ...] = ("unison",)  # as well

    def changed(self, changes: Mapping[str, Any]) -> Settings:
        """The settings with some changed, as JSON states them. `weights` are added to the others.

        A weight of None is the default again. Raises `ParameterError` for a name or value that is not valid.
        """
        known = [one.name for one in fields(Settings)]
        for name in changes:
            if name not in known:
                raise ParameterError(f"expected settings among {', '.join(known)}, got {name[:80]!r}")
        new = dict(changes)
        if "weights" in new:
            if not isinstance(new["weights"], Mapping):
                got = reprlib.repr(new["weights"])
                raise ParameterError(f"expected weights as numbers by name, got {got}")
            weights = {**self.weights, **new["weights"]}
            new["weights"] = {name: weight for name, weight in weights.items() if weight is not None}
        for name in _TEXTS:
            if name in new:
                new[name] = _texts(name, new[name])
        made = replace(self, **new)
        check_choice("engine", made.engine, ENGINES)
        if not (made.genre is None or isinstance(made.genre, str)):
            raise ParameterError(f"expected a genre by name, got {reprlib.repr(made.genre)}")
        check_text("a repertoire by name", made.repertoire)
        if not is_whole(made.dancers) or not 1 <= made.dancers <= MOST_DANCERS:
            raise unexpected(f"1 to {MOST_DANCERS} dancers", made.dancers)
        for entry in parse_schedule("formation", made.formation, "v"):
            check_choice("a formation", entry.value, FORMATIONS)  # and no file, whose name a page would send
        made.scene_request()
        made.config()
        return made

    def config(self) -> DanceConfig:
        """The settings of a dance. Raises `ParameterError` for a value that is not valid."""
        names = ("engine", "seed", "dynamics", "front", "stage", "weights")
        return changed_settings(DanceConfig(), {name: getattr(self, name) for name in names})

    def dance_config(self) -> DanceConfig:
        """The settings of a dance, without weights if the engine has no built-in costs."""
        config = self.config()
        return config if self.engine == "graph" else replace(config, weights={})

    def scene_request(self) -> SceneRequest:
        """The dancers, formations and relations. Raises `ParameterError` if a text is not valid."""
        return SceneRequest.of(dancer_names(self.dancers), self.formation, self.relation)

    def of_dancer(self, index: int) -> Settings:
        """The settings of the dance that a dancer has for itself, in a relation without others."""
        usual = {name: getattr(Settings, name) for name in SCENE_SETTINGS}
        return replace(self, seed=self.seed + index, **usual)

    def to_data(self) -> dict[str, Any]:
        """The settings as JSON. Those of several dancers are left out where they are the defaults."""
        data = asdict(self)
        return {
            name: data[name]
            for name in data
            if name not in SCENE_SETTINGS or data[name] != getattr(Settings, name)
        }


def _texts(name: str, given: object) -> tuple[str, ...]:
    """A list of texts. Raises `ParameterError` for anything else, and for far too many of them."""
    if not isinstance(given, list | tuple) or not all(isinstance(one, str) for one in given):
        raise ParameterError(f"expected {name} as a list of texts, got {reprlib.repr(given)}")
    is_long = len(given) > _MOST_TEXTS or any(len(one) > _LONGEST_TEXT for one in given)
    if name in SCENE_SETTINGS and is_long:
        raise ParameterError(
            f"expected at most {_MOST_TEXTS} texts of {_LONGEST_TEXT} characters as {name}, got more"
        )
    return tuple(given)


# The steps of a project.


FORMAT = "choreograph-studio"
VERSION = 1
SLOTS = ("A", "B")
SHORTEST_LEFT_S = 0.05  # of a part that is kept or locked. Shorter ones are left out
MOST_SIZE = BUDGETS["project"].unpacked_bytes  # of a project, as `_size_of` counts
MOST_BYTES = BUDGETS["project"].file_bytes
_MOST_PLAN_SIZE = 100_000_000  # of one plan as JSON, only one of which is in memory: three hours of dance
_MOST_PLAN_BYTES = _MOST_PLAN_SIZE // 3
_VALUE_SIZE = 100  # of a comma or bracket of JSON: two of them make up {"a":0}, which takes most memory
_EDIT_SIZE = 8  # of an edit, in each step that has it
_STEP_SIZE = 5000  # of a step, beside its JSON
_PLAN_SHARE = 2  # this part of all plans as JSON is counted, so that reading takes no more than minutes

EditKind = Literal["swap", "vary", "repeat", "hold", "cut", "pin_take", "pin_motif", "ban"]  # of a page

Span = tuple[float, float]  # from one time of the dance to another, in seconds


@dataclass(frozen=True)
class Step:
    """A dance of the project: its plan, and the settings with which it was made."""

    number: int  # unique in the project
    parent: int | None  # number of the step whose plan it edits, or None for a whole plan
    request: str  # what was asked for, such as "swap 8-12"
    settings: Settings
    base: str = field(repr=False)  # the plan without edits, as compressed JSON in base64
    edits: tuple[PlannedEdit, ...]  # of the whole plan
    changed: tuple[Span, ...]  # in which it differs from the step before
    text: str = field(repr=False)  # the step as JSON, without its plan
    size: int = field(repr=False)  # its share of `MOST_SIZE`

    def plan(self) -> Plan:
        """The whole plan."""
        return replace(Plan.from_json(_unpacked(self.base)), edits=self.edits)

    def to_json(self) -> str:
        """The step as JSON text."""
        return self.text if self.parent is not None else f'{self.text[:-1]},"plan":"{self.base}"}}'


@dataclass(frozen=True)
class PackedPlan:
    """A plan without edits, as it is in a project."""

    base: str  # as compressed JSON in base64
    n_bytes: int  # of the JSON

    @classmethod
    def of(cls, plan: Plan) -> PackedPlan:
        """Pack a plan. Raises `ParameterError` if it is too long for a project."""
        text = plan_text(replace(plan, edits=())).encode()
        if _size_of(text) > _MOST_PLAN_SIZE:
            raise ParameterError(
                f"expected a dance that a project can contain, got one of {plan.duration_s / 3600:.1f} hours"
            )
        return cls(base64.b64encode(zlib.compress(text, 6)).decode("ascii"), len(text))


def new_step(
    number: int,
    request: str,
    settings: Settings,
    own: tuple[PlannedEdit, ...],
    changed: Iterable[Span],
    of: Step | PackedPlan,
) -> Step:
    """A step with edits of its own, of a whole plan or of the plan of an earlier step."""
    if isinstance(of, Step):
        parent, edits, size = of.number, of.edits + own, 0
    else:
        parent, edits, size = None, own, 3 * len(of.base) + of.n_bytes // _PLAN_SHARE
    spans = tuple((round(float(a), 6), round(float(b), 6)) for a, b in changed)
    data = {
        "number": number, "parent": parent, "request": request, "settings": settings.to_data(),
        "changed": spans, "edits": [asdict(edit) for edit in own],
    }  # fmt: skip
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    size += _STEP_SIZE + _size_of(text.encode()) + _EDIT_SIZE * len(edits)
    return Step(number, parent, request, settings, of.base, edits, spans, text, size)


def _size_of(data: bytes) -> int:
    """About the bytes of memory that JSON takes while it is read: as bytes, as text, and as values."""
    n_values = sum(map(data.count, (b"[", b"{", b",")))
    width = 1 if data.isascii() else 4  # of each character of a text
    return (1 + 2 * width) * len(data) + _VALUE_SIZE * n_values


@dataclass(frozen=True)
class Project:
    """All that is kept for a song. See the top of the module."""

    song: str  # name of its file, in the folder of the project
    revision: int = 0  # grows with each change
    steps: Mapping[int, Step] = field(default_factory=dict)  # by number
    path: tuple[int, ...] = ()  # of steps, the first dance first
    at: int = -1  # the place in the path of the current step
    locks: tuple[Span, ...] = ()  # parts that are kept when the dance is made again, in order, apart
    versions: Mapping[str, int] = field(default_factory=dict)  # number of a step by slot
    settings: Settings = field(default_factory=Settings)  # for the next dance
    character: str = ""  # name of its file, in the folder of the project
    bones: Mapping[str, str] = field(default_factory=dict)  # names by canonical joint

    @property
    def current(self) -> Step | None:
        """The step that is shown."""
        return self.steps[self.path[self.at]] if self.path else None

    def root(self, step: Step) -> Step:
        """The step with the whole plan that a step edits."""
        while step.parent is not None:
            step = self.steps[step.parent]
        return step

    @property
    def can_undo(self) -> bool:
        """Whether there is an earlier step."""
        return self.at > 0

    @property
    def can_redo(self) -> bool:
        """Whether a step was undone, and nothing was made since."""
        return self.at < len(self.path) - 1

    @property
    def next_number(self) -> int:
        """A number for the next step."""
        return max(self.steps, default=0) + 1

    def with_dance(
        self, request: str, plan: Plan, settings: Settings, changed: Iterable[Span], *, edited: bool
    ) -> Project:
        """The project with one more step. Steps that were undone are left out.

        With `edited`, the plan is that of the current step with further edits.
        """
        parent = self.current if edited else None
        own = plan.edits if parent is None else plan.edits[len(parent.edits) :]
        of = PackedPlan.of(plan) if parent is None else parent
        step = new_step(self.next_number, request, settings, own, changed, of)
        path = (*self.path[: self.at + 1], step.number)
        made = replace(
            self, steps={**self.steps, step.number: step}, path=path, at=len(path) - 1, settings=settings
        )
        return made._changed()

    def undone(self) -> Project:
        """The project at the step before. Raises `ParameterError` if there is none."""
        if not self.can_undo:
            raise ParameterError("expected a change to undo, got the first dance")
        return self._moved(self.at - 1)

    def redone(self) -> Project:
        """The project at the step after. Raises `ParameterError` if there is none."""
        if not self.can_redo:
            raise ParameterError("expected a change that was undone, got none")
        return self._moved(self.at + 1)

    def _moved(self, at: int) -> Project:
        return replace(self, at=at, settings=self.steps[self.path[at]].settings)._changed()

    def with_locks(self, locks: Iterable[Span], duration_s: float) -> Project:
        """The project with these parts locked. Parts that touch are joined.

        Raises `ParameterError` for a part that is not within the dance.
        """
        return replace(self, locks=joined(locks, duration_s))._changed()

    def kept(self, keep_locked: bool, span: Span | None, duration_s: float) -> tuple[Span, ...]:
        """What is kept when the dance is made again: locked parts, and all outside of the span."""
        kept = list(self.locks) if keep_locked else []
        if span is not None:
            [(start_s, end_s)] = joined([span], duration_s)
            kept += [
                one for one in ((0.0, start_s), (end_s, duration_s)) if one[1] - one[0] > SHORTEST_LEFT_S
            ]
        return joined(kept, duration_s)

    def check_unlocked(self, edits: Iterable[PlannedEdit]) -> None:
        """Raise `ParameterError` if an edit changes what is locked."""
        for one in edits:
            for start_s, end_s in self.locks:
                if one.start_s < end_s - SHORTEST_LEFT_S and one.end_s > start_s + SHORTEST_LEFT_S:
                    raise ParameterError(
                        f"expected an edit outside of what is locked, {start_s:.1f} to {end_s:.1f} s, got "
                        f"one of {one.start_s:.1f} to {one.end_s:.1f} s with its transitions: unlock it, or "
                        "leave two counts"
                    )

    def with_version(self, slot: str) -> Project:
        """The project whose current step is version A or B. Raises `ParameterError` for another slot."""
        if slot not in SLOTS or not self.path:
            raise ParameterError(
                f"expected a dance, and a version among {', '.join(SLOTS)}, got {slot[:20]!r}"
            )
        return replace(self, versions={**self.versions, slot: self.path[self.at]})._changed()

    def with_settings(self, settings: Settings) -> Project:
        """The project with settings for the next dance."""
        return replace(self, settings=settings)._changed()

    def with_character(self, name: str, bones: Mapping[str, str]) -> Project:
        """The project with a character, and names of its bones by canonical joint."""
        return replace(self, character=name, bones=dict(bones))._changed()

    def _changed(self) -> Project:
        """The project with the next revision, without steps that nothing leads to.

        The oldest steps leave its path until it is within `MOST_SIZE`, else it raises `ParameterError`.
        """
        made = replace(self, steps=self._needed(), revision=self.revision + 1)
        while made._size > MOST_SIZE:
            if len(made.path) < 2:
                raise ParameterError(
                    "expected a project that can be read again, got too many edits: roll again"
                )
            path, at = (made.path[1:], made.at - 1) if made.at > 0 else (made.path[:-1], made.at)
            made = replace(made, path=path, at=at)
            made = replace(made, steps=made._needed())
        return made

    def _needed(self) -> dict[int, Step]:
        """The steps of the path and of the versions, and those whose plans they edit."""
        needed: set[int] = set()
        todo = [*self.path, *self.versions.values()]
        while todo:
            number = todo.pop()
            if number not in needed:
                needed.add(number)
                parent = self.steps[number].parent
                todo += [] if parent is None else [parent]
        return {number: step for number, step in self.steps.items() if number in needed}

    @property
    def _size(self) -> int:
        return _size_of(self._head().encode()) + sum(step.size for step in self.steps.values())

    def _head(self) -> str:
        """All but the steps, as JSON text."""
        data = {
            "format": FORMAT, "version": VERSION, "song": self.song,
            "revision": self.revision, "path": self.path, "at": self.at, "locks": self.locks,
            "versions": dict(self.versions), "settings": self.settings.to_data(), "character": self.character,
            "bones": dict(self.bones),
        }  # fmt: skip
        return json.dumps(data, indent=1, allow_nan=False)

    def to_json(self) -> str:
        """The project as JSON text, with a line for each step, as in `data_schema/studio.schema.json`."""
        lines = self._head().removesuffix("\n}")
        steps = ",\n".join(step.to_json() for step in self.steps.values())
        return f'{lines},\n "steps": [\n{steps}\n]\n}}\n'


def joined(spans: Iterable[Span], duration_s: float) -> tuple[Span, ...]:
    """Spans in order of time, those that touch as one. Raises `ParameterError` if one is not in the dance."""
    made: list[Span] = []
    for start_s, end_s in sorted(spans):
        if not (is_number(start_s) and is_number(end_s)) or not 0 <= start_s < end_s <= duration_s + 0.1:
            raise ParameterError(
                f"expected parts within the dance of {duration_s:g} s, got {start_s} to {end_s}"
            )
        end_s = min(float(end_s), duration_s)
        if made and start_s <= made[-1][1]:
            made[-1] = made[-1][0], max(made[-1][1], end_s)
        elif start_s < end_s:
            made.append((float(start_s), end_s))
    return tuple(made)


def project_from_json(text: str | bytes, name: str) -> Project:
    """Read a project. `FormatError` names what is missing or not valid, and refuses more than `MOST_SIZE`."""
    encoded = text.encode(errors="surrogatepass") if isinstance(text, str) else text
    _check_size(_size_of(encoded), name)
    try:
        with without_garbage_collection():
            data = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise FormatError(f"{name}: expected a project (JSON), could not parse it: {error}") from error
    if not isinstance(data, dict) or data.get("format") != FORMAT or data.get("version") != VERSION:
        raise FormatError(f"{name}: expected a {FORMAT} of version {VERSION}, got {reprlib.repr(data)}")
    try:
        return _project_of(data, name)
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        if isinstance(error, FormatError):
            raise
        said = f"no {reprlib.repr(error.args[0])}" if isinstance(error, KeyError) else str(error)[:200]
        raise FormatError(f"{name}: expected a project of the studio, got one with a fault: {said}") from None


def _check_size(size: int, name: str) -> None:
    if size > MOST_SIZE:
        raise FormatError(
            f"{name}: expected a project that takes at most {MOST_SIZE / 1e6:.0f} MB of memory, got another"
        )


def _project_of(data: dict[str, Any], name: str) -> Project:
    texts = {key: str(data[key]) for key in ("song", "character")}
    steps: dict[int, Step] = {}
    durations_s: dict[int, float] = {}  # of plans, by the number of each step
    size = 0
    for entry in data["steps"]:
        step, duration_s = _step_of(entry, steps, durations_s, name)
        steps[step.number], durations_s[step.number] = step, duration_s
        size += step.size
        _check_size(size, name)
    path, at, revision = tuple(data["path"]), data["at"], data["revision"]
    if not (is_whole(at) and is_whole(revision)):
        raise FormatError(f"{name}: expected a place in its path and a revision, got {at!r}, {revision!r}")
    at, revision = int(at), int(revision)
    versions = {slot: data["versions"][slot] for slot in SLOTS if slot in data["versions"]}
    if not all(number in steps for number in (*path, *versions.values())):
        raise FormatError(f"{name}: expected steps that it contains, got a path through others")
    if not (0 <= at < len(path) or (not path and at == -1)):
        raise FormatError(f"{name}: expected a place in its path, got {at!r}")
    bones = {str(joint): str(bone) for joint, bone in data["bones"].items()}
    settings = Settings().changed(data["settings"])
    locks = joined([_span(entry) for entry in data["locks"]], float("inf"))
    return Project(
        steps=steps, path=path, at=at, revision=revision, versions=versions, settings=settings, bones=bones,
        locks=locks, **texts,
    )  # fmt: skip


def _step_of(
    entry: dict[str, Any], steps: Mapping[int, Step], durations_s: Mapping[int, float], name: str
) -> tuple[Step, float]:
    """A step, and the duration of its plan."""
    number, parent = entry["number"], None if entry["parent"] is None else steps[entry["parent"]]
    where = f"{name}: step {number!r:.20}"
    if not is_whole(number) or number in steps:
        raise FormatError(f"{where}: expected a number of its own")
    settings = Settings().changed(entry["settings"])
    own = tuple(read_edit(edit, f"{where}, edit {i}") for i, edit in enumerate(entry["edits"]))
    spans = tuple(_span(span) for span in entry["changed"])
    of: Step | PackedPlan
    if parent is None:
        text = _unpacked(entry["plan"], f"{where}: ")
        duration_s = Plan.from_json(text, name=where).duration_s
        of = PackedPlan(entry["plan"], len(text))
    else:
        of, duration_s = parent, durations_s[parent.number]
    for edit in own:
        for fault in faults_of_edit(edit, duration_s):
            raise FormatError(f"{where}: edit {edit.request[:80]}: {fault}")
    return new_step(int(number), str(entry["request"]), settings, own, spans, of), duration_s


def _span(entry: Any) -> Span:
    start_s, end_s = entry
    if not (is_number(start_s) and is_number(end_s)):
        raise ValueError(f"expected a part as two times, got {reprlib.repr(entry)}")
    return float(start_s), float(end_s)


def _unpacked(base: str, where: str = "") -> str:
    """The JSON of a plan. Raises `FormatError` if it is damaged or far too long."""
    inflater = zlib.decompressobj()
    try:
        data = inflater.decompress(base64.b64decode(base, validate=True), _MOST_PLAN_BYTES)
        if inflater.unconsumed_tail or not inflater.eof or _size_of(data) > _MOST_PLAN_SIZE:
            raise FormatError(f"{where}expected a whole plan, got one that is cut off or too long")
        return data.decode()
    except binascii.Error as error:
        raise FormatError(f"{where}expected a plan in base64, got another text: {error}") from None
    except (zlib.error, UnicodeDecodeError) as error:
        raise FormatError(f"{where}expected a compressed plan, got damaged bytes: {error}") from None


# The file of a project.


SUFFIX = ".studio.json"
_LONGEST_NAME_BYTES = 160
_NOT_IN_NAMES = re.compile(
    r'[\x00-\x1f\x7f-\x9f\u2028\u2029/\\:*?"<>|]|^\.|\.$|^\s|\s$'
    r"|^(con|prn|aux|nul|com\d|lpt\d)(\.|$)",  # devices on Windows
    re.IGNORECASE,
)


class ProjectFile:
    """The file of one project, which no other process can use until `close`.

    If its path is a link, the file is the one that the link leads to, and the link stays as it is.
    """

    def __init__(self, path: Path) -> None:
        """Lock the file. Raises `ChoreographError` if another process works with it."""
        self.path = path
        self.real = check_target(os.path.realpath(path))
        self._open = ExitStack()
        lock = self.real.with_name(f".{self.real.name}.lock")
        self._open.enter_context(locked_folder(lock, doing=f"works on {path.name} in the studio"))

    def read(self) -> Project | None:
        """The project in the file, or None if there is no file. Raises `FormatError` if it is damaged."""
        if not os.path.lexists(self.real):
            return None
        data = read_bytes(self.real, "a project of the studio", max_bytes=MOST_BYTES)
        return project_from_json(data, self.path.name)

    def write(self, project: Project) -> None:
        """Replace the file. Raises `ChoreographError` if it cannot be written. The old one is then kept."""
        with (
            atomic_path(self.real) as temporary,
            open(temporary, "w", encoding="utf-8", newline="\n") as file,
        ):
            file.write(project.to_json())
            file.flush()
            os.fsync(file.fileno())

    def close(self) -> None:
        """Let other processes work with the file."""
        self._open.close()


def opened(path: Path, song: str, already: ProjectFile | None) -> tuple[ProjectFile, Project | None]:
    """The locked file of a project, and the project of this song in it, or None if there is no file yet.

    `already` is the file that is open. Raises as `ProjectFile`, and `FormatError` if the file is damaged or
    of another song.
    """
    is_open = already is not None and already.real == Path(os.path.realpath(path))
    file = already if is_open and already is not None else ProjectFile(path)
    try:
        project = file.read()
        if project is not None and project.song != song:
            raise FormatError(f"{path}: expected a project of {song}, got one of {project.song!r}")
    except FormatError:
        if not is_open:
            file.close()
        raise
    return file, project


def project_path(song: Path) -> Path:
    """The project file of a song, beside it."""
    return song.with_name(f"{song.stem}{SUFFIX}")


# Files that pages send. Their names are names in the folder of the project, and never paths.


def checked_name(name: str, suffixes: Iterable[str]) -> str:
    """The name of a file that a page has sent.

    Raises `ParameterError` for a path or a name that is not usable on all systems, and `UnknownTypeError` for
    another suffix.
    """
    if not name or _NOT_IN_NAMES.search(name) or len(name.encode(errors="replace")) > _LONGEST_NAME_BYTES:
        raise ParameterError(f"expected a plain name of a file, got {name[:80]!r}")
    known = tuple(suffixes)
    if not name.lower().endswith(known):
        raise UnknownTypeError(f"expected a file among {', '.join(known)}, got {name[:80]!r}")
    return name


def placed(sent: Path, folder: Path, is_taken: Callable[[Path], bool] = lambda path: False) -> Path:
    """Move a file into a folder, under a free name beside other files of its name. Returns its path.

    A file of the same content is used instead, and a free name must not be taken for another reason.
    Raises `ChoreographError` if it cannot be written.
    """
    checksum = sha256_of(sent)

    def is_other(path: Path) -> bool:
        if not os.path.lexists(path):
            return is_taken(path)
        return not (path.is_file() and sha256_of(path) == checksum)

    [target] = free_names([folder / sent.name], is_other)
    if not target.exists():
        with atomic_path(target) as temporary:
            copyfile(sent, temporary)
    sent.unlink()
    return target
