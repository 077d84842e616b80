"""The project of a song: every dance that was made for it, as steps that can be undone, and locked parts.

Steps form a tree. A step either has a whole plan, or adds edits to the plan of an earlier step. The path
leads through the steps that undo and redo visit. Versions may be steps that the path has left. A project is
never changed: each change returns another one.
"""

from __future__ import annotations

import base64
import binascii
import json
import reprlib
import zlib
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Literal

from choreograph.core.arguments import is_number, is_whole
from choreograph.core.errors import FormatError, ParameterError
from choreograph.plan import Plan, plan_text
from choreograph.plan_parts import PlannedEdit, faults_of_edit, read_edit
from choreograph.studio.settings import Settings

FORMAT = "choreograph-studio"
VERSION = 1
SLOTS = ("A", "B")
SHORTEST_LEFT_S = 0.05  # of a part that is kept or locked. Shorter ones are left out
_MOST_PLAN_BYTES = 1 << 28  # of one plan, when it is not compressed

EditKind = Literal["swap", "vary", "repeat", "hold", "cut", "pin_take", "pin_motif", "ban"]  # of a page

Span = tuple[float, float]  # from one time of the dance to another, in seconds


@dataclass(frozen=True)
class Step:
    """A dance of the project: its plan, and the settings with which it was made."""

    number: int  # unique in the project
    parent: int | None  # number of the step whose plan it edits, or None for a whole plan
    request: str  # what was asked for, such as "swap 8-12"
    settings: Settings
    base: bytes  # the plan without edits, as compressed JSON
    edits: tuple[PlannedEdit, ...]  # of the whole plan
    changed: tuple[Span, ...]  # in which it differs from the step before
    text: str = field(repr=False, default="")  # the step as JSON

    def plan(self) -> Plan:
        """The whole plan."""
        return replace(Plan.from_json(_inflated(self.base)), edits=self.edits)


def new_step(
    number: int, request: str, settings: Settings, plan: Plan, changed: Iterable[Span], parent: Step | None
) -> Step:
    """A step for a plan. With a parent, the plan is that of the parent with further edits."""
    if parent is None:
        base = zlib.compress(plan_text(replace(plan, edits=())).encode(), 6)
        own = plan.edits
    else:
        base, own = parent.base, plan.edits[len(parent.edits) :]
    spans = tuple((round(float(a), 6), round(float(b), 6)) for a, b in changed)
    data: dict[str, Any] = {
        "number": number, "parent": None if parent is None else parent.number, "request": request,
        "settings": settings.to_data(), "changed": spans, "edits": [asdict(edit) for edit in own],
    }  # fmt: skip
    if parent is None:
        data["plan"] = base64.b64encode(base).decode("ascii")
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    return Step(number, data["parent"], request, settings, base, plan.edits, spans, text)


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
        step = new_step(self.next_number, request, settings, plan, changed, parent)
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
        """The project with the next revision, without steps that nothing leads to."""
        needed: set[int] = set()
        todo = [*self.path, *self.versions.values()]
        while todo:
            number = todo.pop()
            if number not in needed:
                needed.add(number)
                parent = self.steps[number].parent
                todo += [] if parent is None else [parent]
        kept = {number: step for number, step in self.steps.items() if number in needed}
        return replace(self, steps=kept, revision=self.revision + 1)

    def to_json(self) -> str:
        """The project as JSON text, with a line for each step, as in `data_schema/studio.schema.json`."""
        head = {
            "format": FORMAT, "version": VERSION, "song": self.song,
            "revision": self.revision, "path": self.path, "at": self.at, "locks": self.locks,
            "versions": dict(self.versions), "settings": self.settings.to_data(), "character": self.character,
            "bones": dict(self.bones),
        }  # fmt: skip
        lines = json.dumps(head, indent=1, allow_nan=False).removesuffix("\n}")
        steps = ",\n".join(step.text for step in self.steps.values())
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


def project_from_json(text: str, name: str) -> Project:
    """Read a project. `FormatError` names what is missing or not valid."""
    try:
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
        said = f"no {error}" if isinstance(error, KeyError) else str(error)
        raise FormatError(f"{name}: expected a project of the studio, got one with a fault: {said}") from None


def _project_of(data: dict[str, Any], name: str) -> Project:
    texts = {key: str(data[key]) for key in ("song", "character")}
    steps: dict[int, Step] = {}
    bases: dict[int, Plan] = {}  # plans without edits, by the number of each step
    for entry in data["steps"]:
        step, base = _step_of(entry, steps, bases, name)
        steps[step.number], bases[step.number] = step, base
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
    entry: dict[str, Any], steps: Mapping[int, Step], bases: Mapping[int, Plan], name: str
) -> tuple[Step, Plan]:
    """A step, and its plan without edits."""
    number, parent = entry["number"], None if entry["parent"] is None else steps[entry["parent"]]
    where = f"{name}: step {number!r:.20}"
    if not is_whole(number) or number in steps:
        raise FormatError(f"{where}: expected a number of its own")
    settings = Settings().changed(entry["settings"])
    own = tuple(read_edit(edit, f"{where}, edit {i}") for i, edit in enumerate(entry["edits"]))
    spans = tuple(_span(span) for span in entry["changed"])
    if parent is None:
        try:
            packed = base64.b64decode(entry["plan"], validate=True)
        except binascii.Error as error:
            raise FormatError(f"{where}: expected a plan in base64, got another text: {error}") from None
        base = Plan.from_json(_inflated(packed, f"{where}: "), name=where)
    else:
        base = bases[parent.number]
    for edit in own:
        for fault in faults_of_edit(edit, base.duration_s):
            raise FormatError(f"{where}: edit {edit.request[:80]}: {fault}")
    plan = replace(base, edits=(*(parent.edits if parent else ()), *own))
    return new_step(int(number), str(entry["request"]), settings, plan, spans, parent), base


def _span(entry: Any) -> Span:
    start_s, end_s = entry
    if not (is_number(start_s) and is_number(end_s)):
        raise ValueError(f"expected a part as two times, got {reprlib.repr(entry)}")
    return float(start_s), float(end_s)


def _inflated(base: bytes, where: str = "") -> str:
    """The text of compressed bytes. Raises `FormatError` if they are damaged or far too long."""
    inflater = zlib.decompressobj()
    try:
        text = inflater.decompress(base, _MOST_PLAN_BYTES).decode()
    except (zlib.error, UnicodeDecodeError) as error:
        raise FormatError(f"{where}expected a compressed plan, got damaged bytes: {error}") from None
    if inflater.unconsumed_tail or not inflater.eof:
        raise FormatError(f"{where}expected a whole plan, got one that is cut off or too long")
    return text
