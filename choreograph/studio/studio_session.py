"""A session of the studio: a song, a repertoire and the project, and everything that changes the dance.

It has no part in HTTP. What changes the dance runs in one thread, one after another. A change is first
written to the file of the project, and is then the newest state. If it cannot be written, nothing changes.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from choreograph.choreography.constraints import Keep
from choreograph.choreography.edits import EditRequest, edit_slots
from choreograph.choreography.pieces import PieceRequest
from choreograph.core.errors import ChoreographError, NoPathError, ParameterError
from choreograph.core.numerics import default_numerics, one_thread
from choreograph.core.progress import ProgressReport
from choreograph.library.builtin import STARTER_PATH
from choreograph.library.repertoire import Repertoire, starter_repertoire
from choreograph.music.song import Song, load_song
from choreograph.music.song_features import SongFeatures
from choreograph.pipeline.dancing import Dance, danced_figures
from choreograph.pipeline.editing import Alternative, Editor, alternatives, edit, planned_edit
from choreograph.pipeline.planning import FirstPart
from choreograph.plan.joins import take_motions
from choreograph.plan.plan import PlannedEdit
from choreograph.render.assembly import off_stage
from choreograph.render.rendering import with_edit
from choreograph.studio.dance_json import changed_spans, mannequin_facts, motion_data, whole_facts
from choreograph.studio.project import (
    SCENE_SETTINGS,
    Project,
    ProjectFile,
    Settings,
    Span,
    Step,
    checked_name,
    opened,
    project_path,
)
from choreograph.studio.refusals import ConflictError, NotFoundError
from choreograph.studio.steps import StagedScene, StepDances, StepScenes


@dataclass(frozen=True, eq=False)
class State:
    """What the studio shows, all of one moment."""

    project: Project
    repertoire: Repertoire  # of its settings
    song: Song | None = None
    features: SongFeatures | None = None  # of the song, once there is a dance
    dance: Dance | None = None  # of the current step
    scene: StagedScene | None = None  # around it, if there are several dancers
    changed: tuple[Span, ...] = ()  # by the last change


class StudioSession:
    """The state of the studio. Other threads only read it."""

    def __init__(self, folder: Path, repertoire: Repertoire) -> None:
        self.folder = folder
        self.repertoires = Repertoires(repertoire)
        settings = Settings(repertoire=repertoire.path.name)
        self.state = State(Project("", settings=settings), repertoire)  # replaced as a whole
        self._file: ProjectFile | None = None
        self._dances, self._scenes = StepDances(repertoire), StepScenes()
        self._shown_alternatives = ShownAlternatives()
        self._mannequin: tuple[Repertoire, tuple[str, dict[str, Any]]] | None = None
        self._facts: dict[str, tuple[int, dict[str, Any]]] = {}  # by what they are of, with their step

    @property
    def project(self) -> Project:
        """The newest project."""
        return self.state.project

    @property
    def file(self) -> Path | None:
        """The file of the project, or None without a song."""
        return None if self._file is None else self._file.path

    def close(self) -> None:
        """Release the file of the project."""
        if self._file is not None:
            self._file.close()
            self._file = None

    # Opening a song.

    def open(self, song_path: Path, file_path: Path | None = None) -> None:
        """Lock and read the project of a song, or begin one. The song is read by `load`.

        Raises `ChoreographError` if another process works with the project, and `FormatError` if its file is
        damaged or of another song.
        """
        path = project_path(song_path) if file_path is None else file_path
        folders = {os.path.realpath(path.parent), os.path.dirname(os.path.realpath(path))}
        if os.path.realpath(song_path.parent) not in folders:
            raise ParameterError(f"expected the project beside its song {song_path}, got {path}")
        file, project = opened(path, song_path.name, self._file)
        if file is not self._file:
            self.close()
        if project is None:
            project = Project(song_path.name, settings=self.project.settings)
        self._file, self.folder = file, song_path.parent
        self._forget(project)

    def _forget(self, project: Project) -> None:
        """Begin with a project whose song and dance are not read yet."""
        repertoire = self.repertoires.open(project.settings.repertoire, self.folder)
        self._dances, self._shown_alternatives, self._facts = StepDances(repertoire), ShownAlternatives(), {}
        self.state = State(project, repertoire)

    @default_numerics()
    def load(self, song: Song | None, report: ProgressReport | None, *, with_dance: bool = True) -> None:
        """Read the song of the project, or take it as given, and show its dance. The first one is made.

        Raises as `load_song`, `render` and `dance`.
        """
        if song is None:
            if report is not None:
                report("reading the song", 0, 0)
            song = load_song(self.folder / self.project.song)
        self.state = replace(self.state, song=song)
        self._dances = StepDances(self.state.repertoire, song.duration_s)
        self._scenes = StepScenes(song.duration_s)
        current = self.project.current
        if current is not None:
            dance = self._dance_of(current, report)
            scene = self._scene_of(self.project, current, dance, report)
            features = self._features(current.settings)
            self.state = replace(self.state, dance=dance, scene=scene, features=features)
        elif with_dance:
            self.change_settings(self.project.revision, {}, report)

    # The dance and what is shown of it.

    def _features(self, settings: Settings) -> SongFeatures:
        repertoire = self.repertoires.open(settings.repertoire, self.folder)
        return self._dances.features(settings, self.song(), repertoire)

    def song(self) -> Song:
        """The song of the project. Raises `NotFoundError` if there is none."""
        if self.state.song is None:
            raise NotFoundError("expected a song, got none yet: open one first")
        return self.state.song

    def current(self) -> tuple[Step, Dance]:
        """The current step and its dance. Raises `NotFoundError` if there is none."""
        state = self.state
        step, dance = state.project.current, state.dance
        if step is None or dance is None:
            raise NotFoundError("expected a dance, got none yet: open a song first")
        return step, dance

    def mannequin(self, repertoire: Repertoire | None = None) -> tuple[str, dict[str, Any]]:
        """The mesh of the body of a repertoire, by default the newest, and its facts."""
        repertoire = repertoire or self.state.repertoire
        if self._mannequin is None or self._mannequin[0] is not repertoire:
            self._mannequin = repertoire, mannequin_facts(repertoire)
        return self._mannequin[1]

    def facts(self, slot: str = "") -> dict[str, Any]:
        """The facts of the dance, or of version A or B. Raises `NotFoundError` if there is none."""
        step, dance, scene = self._shown(slot)
        kept = self._facts.get(slot)
        features = self.state.features
        if kept is None or kept[0] != step.number:
            assert features is not None
            motion = self._dances.compressed(step, dance.motion) if scene is None else scene.data
            kept = step.number, whole_facts(dance, features, self.mannequin()[1], motion["facts"])
            self._facts[slot] = kept
        return kept[1]

    def motion_data(self, slot: str = "") -> dict[str, Any]:
        """The compressed motions of the dance, or of version A or B, else `NotFoundError`."""
        step, dance, scene = self._shown(slot)
        return self._dances.compressed(step, dance.motion) if scene is None else scene.data

    def _shown(self, slot: str) -> tuple[Step, Dance, StagedScene | None]:
        """A step, its dance and, for several dancers, the scene around it. Raises as `facts`."""
        if not slot:
            return *self.current(), self.state.scene
        step, dance = self.version(slot)
        return step, dance, self._scene_of(self.project, step, dance, None)

    def version(self, slot: str) -> tuple[Step, Dance]:
        """The step of version A or B, and its dance. Raises `NotFoundError` if there is none."""
        if slot not in self.project.versions:
            raise NotFoundError(f"expected a version that was kept, got {slot[:20]!r}")
        step = self.project.steps[self.project.versions[slot]]
        return step, self._dance_of(step, None)

    def _dance_of(self, step: Step, report: ProgressReport | None) -> Dance:
        repertoire = self.repertoires.open(step.settings.repertoire, self.folder)
        return self._dances.dance(self.project, step, repertoire, self.song(), report)

    def _scene_of(
        self, project: Project, step: Step, dance: Dance, report: ProgressReport | None
    ) -> StagedScene | None:
        """The scene around the dance of a step, if it has one. Raises as `StepScenes.staged`."""
        if step.settings.dancers == 1:
            return None
        repertoire, song = self.repertoires.open(step.settings.repertoire, self.folder), self.song()

        def make(settings: Settings) -> Dance:
            return self._dances.made(settings, song, repertoire, report)

        features, layout = self._features(step.settings), self.mannequin(repertoire)[1]["mesh"]
        return self._scenes.staged(project, step, dance, features, layout, make, report)

    # Changes. Each is written before it is shown.

    def _saved(self, project: Project, **shown: Any) -> None:
        """Write the project, which is then shown. Raises `ChoreographError` if it cannot be written."""
        if self._file is not None:
            self._file.write(project)
        repertoire = self.repertoires.open(project.settings.repertoire, self.folder)
        self.state = replace(self.state, project=project, repertoire=repertoire, **shown)

    def check(self, revision: int) -> None:
        """Raise `ConflictError` unless a revision is the newest."""
        if revision != self.project.revision:
            raise ConflictError(
                f"expected a change of revision {self.project.revision}, got one of {revision}: another page "
                "or a change before it was faster"
            )

    def _with_dance(
        self, request: str, made: Dance, settings: Settings, report: ProgressReport | None, *, edited: bool
    ) -> None:
        before = self.state.dance
        changed = [] if before is None else changed_spans(before.motion, made.motion)
        project = self.project.with_dance(request, made.plan, settings, changed, edited=edited)
        step = project.current
        assert step is not None
        features = self._features(settings)
        scene = self._scene_of(project, step, made, report)
        self._saved(project, dance=made, scene=scene, changed=step.changed, features=features)
        self._dances.keep(step, made.motion)

    @default_numerics()
    def change_settings(
        self,
        revision: int,
        changes: dict[str, Any],
        report: ProgressReport | None = None,
        *,
        keep_locked: bool = True,
        span: Span | None = None,
        first: FirstPart | None = None,
    ) -> None:
        """Change settings and make the dance again, all of it or a span, if there is a song.

        Locked parts are kept.

        A `first` part of a dance of which nothing is kept is shown before all is rendered.

        Raises `ConflictError` for an old revision, `ParameterError` for a setting that is not valid, and as
        `choreograph.dance`.
        """
        self.check(revision)
        song, project = self.state.song, self.project
        settings = project.settings.changed(changes)
        if song is None:
            self._saved(project.with_settings(settings))
            return
        if span is not None and not set(changes).isdisjoint(SCENE_SETTINGS):
            raise ParameterError(
                "expected no part of the dance beside dancers, formation or relation, got one: name it in "
                "the text, such as 8-16=circle"
            )
        if settings.repertoire != project.settings.repertoire:
            keep_locked, span = False, None  # what would be kept has takes of the other repertoire
        repertoire = self.repertoires.open(settings.repertoire, self.folder)
        before = self.state.dance
        if changes and before is not None and set(changes) <= set(SCENE_SETTINGS) and span is None:
            self._with_dance(json.dumps(changes), before, settings, report, edited=True)
            return
        spans = () if before is None else project.kept(keep_locked, span, before.plan.duration_s)
        kept = [Keep(*one) for one in spans]
        again: dict[str, Any] = {"existing": before, "keep": kept} if kept else {"first": first}
        if kept and settings.engine == "rollout":
            raise ParameterError(
                "expected graph or mixer where parts of the dance are kept, got rollout, which generates "
                "whole dances: unlock all, and change the whole dance"
            )
        made = self._dances.made(settings, song, repertoire, report, **again)
        what = json.dumps(changes) if changes else "dance"
        where = "" if span is None else f" {span[0]:g}-{span[1]:g}"
        # A setting of one span is not that of the whole dance.
        kept_settings = settings if span is None else project.settings
        self._with_dance(f"{what}{where}", made, kept_settings, report, edited=bool(kept))

    def edit(
        self,
        revision: int,
        requests: Sequence[EditRequest],
        seed: int = 0,
        report: ProgressReport | None = None,
        *,
        bans: Sequence[str] = (),
    ) -> None:
        """Edit the dance. `bans` are also not danced when it is made again.

        Raises `ConflictError` for an old revision, `ParameterError` if the edit changes a locked part, and as
        `choreograph.edit`.
        """
        self.check(revision)
        _, dance = self.current()
        made = edit(dance, requests, self.state.repertoire, seed=seed, report=report)
        new = made.plan.edits[len(dance.plan.edits) :]
        self.project.check_unlocked(new)
        settings = self.project.settings
        settings = settings.changed({"bans": list(dict.fromkeys((*settings.bans, *bans)))})
        if new:
            request = ", ".join(dict.fromkeys(one.request for one in new))
            self._with_dance(request, made, settings, report, edited=True)
        else:  # what is banned is not danced
            self._saved(self.project.with_settings(settings), changed=())

    def alternatives(
        self, revision: int, span: Span, n: int, report: ProgressReport | None = None
    ) -> list[dict[str, Any]]:
        """What else could be danced in a span, as `ShownAlternatives.found`.

        Raises `ConflictError` for an old revision.
        """
        self.check(revision)
        _, dance = self.current()
        if report is not None:
            report("looking for alternatives", 0, 0)
        return self._shown_alternatives.found(dance, self.state.repertoire, revision, span, n)

    @one_thread()
    def choose(self, revision: int, id: str) -> None:
        """Dance an alternative that was shown.

        Raises `NotFoundError` if there is none of this id, and as `edit`.
        """
        self.check(revision)
        self.current()
        chosen = self._shown_alternatives.chosen(revision, id)
        self._make(chosen.edit, f"{chosen.edit.request}: {chosen.why}")

    @default_numerics()
    @one_thread()
    def pin_part(self, revision: int, span: Span, take: str, source_s: float) -> None:
        """Dance a take in a span, from the count that is nearest to a time of the take on.

        Raises `ConflictError` for an old revision, `RepertoireError` for an unknown take, `NoPathError` if
        the take cannot be danced there, and as `edit`.
        """
        self.check(revision)
        _, dance = self.current()
        self._make(*pinned_part(dance, self.state.repertoire, span, take, source_s))

    def _make(self, one: PlannedEdit, request: str) -> None:
        self.project.check_unlocked([one])
        _, dance = self.current()
        plan = replace(dance.plan, edits=(*dance.plan.edits, one))
        motion = with_edit(dance.motion, plan, one, take_motions(self.state.repertoire))
        figures = danced_figures(plan, self.state.repertoire)
        made = Dance(motion, plan, off_stage(motion, plan.stage), dance.song_path, figures=figures)
        self._with_dance(request, made, self.project.settings, None, edited=True)

    def move(self, revision: int, *, back: bool) -> None:
        """Undo a step, or redo one that was undone. Raises `ParameterError` if there is none."""
        self.check(revision)
        before = self.state.dance
        project = self.project.undone() if back else self.project.redone()
        step = project.current
        assert step is not None
        made = self._dance_of(step, None)
        changed = () if before is None else tuple(changed_spans(before.motion, made.motion))
        scene = self._scene_of(project, step, made, None)
        features = self._features(step.settings)
        self._saved(project, dance=made, scene=scene, changed=changed, features=features)

    def lock(self, revision: int, locks: Sequence[Span]) -> None:
        """Lock these parts, and no others."""
        self.check(revision)
        _, dance = self.current()
        self._saved(self.project.with_locks(locks, dance.plan.duration_s))

    def keep_character(self, name: str, bones: Mapping[str, str]) -> None:
        """Note the character, whose file is beside the project, in the project unless it is noted."""
        if name and (name, dict(bones)) != (self.project.character, dict(self.project.bones)):
            self._saved(self.project.with_character(name, bones))

    def keep_version(self, slot: str) -> None:
        """Keep the dance as version A or B."""
        self.current()
        self._saved(self.project.with_version(slot))


# The repertoires that a studio can dance with.


SUFFIX = ".h5"


class Repertoires:
    """The repertoire of the command line, the built-in one, and those in the folder of the project."""

    def __init__(self, given: Repertoire) -> None:
        self.given = given.path.name
        self._opened = {self.given: given}

    def names(self, folder: Path) -> list[str]:
        """The names of all repertoires, the one of the command line first."""
        beside = sorted(path.name for path in folder.glob(f"*{SUFFIX}") if path.is_file())
        return list(dict.fromkeys([self.given, STARTER_PATH.name, *beside]))

    def open(self, name: str, folder: Path) -> Repertoire:
        """A repertoire by its name, or that of the command line without one.

        Raises `NotFoundError` if there is none of this name, and `RepertoireError` if it is damaged.
        """
        name = name or self.given
        if name not in self._opened:
            self._opened[name] = _opened(name, folder)
        return self._opened[name]


def _opened(name: str, folder: Path) -> Repertoire:
    if name == STARTER_PATH.name:
        return starter_repertoire()
    try:
        path = folder / checked_name(name, [SUFFIX])
    except ChoreographError:
        path = folder
    if not path.is_file():
        raise NotFoundError(
            f"expected the repertoire {name[:80]} in the folder of the project, got no such file: open the "
            "studio with --db"
        )
    return Repertoire.open(path)


# Alternatives to a part of the dance.


_BESIDE_S = 0.5  # of the dance on either side of an alternative
_MOST = 24


@dataclass(frozen=True, eq=False)
class ShownAlternative:
    """An alternative that was shown."""

    revision: int  # of the dance that it changes
    edit: PlannedEdit
    why: str


class ShownAlternatives:
    """The alternatives that were shown last."""

    def __init__(self) -> None:
        self._by_id: dict[str, ShownAlternative] = {}

    def found(
        self, dance: Dance, repertoire: Repertoire, revision: int, span: Span, n: int
    ) -> list[dict[str, Any]]:
        """What else could be danced in a span, with the motion of the span and half a second beside it.

        Raises as `Session.alternatives`.
        """
        if not 1 <= n <= _MOST:
            raise ParameterError(f"expected 1 to {_MOST} alternatives, got {n}")
        found = alternatives(dance, repertoire, span, n)
        self._by_id = {
            f"{revision}-{index}": ShownAlternative(revision, one.dance.plan.edits[-1], one.why)
            for index, one in enumerate(found)
        }
        return [_shown(id, one) for id, one in zip(self._by_id, found, strict=True)]

    def chosen(self, revision: int, id: str) -> ShownAlternative:
        """An alternative that was shown. Raises `NotFoundError` if none of this id is of the revision."""
        chosen = self._by_id.get(id)
        if chosen is None or chosen.revision != revision:
            raise NotFoundError(f"expected an alternative of the dance as it is, got {id[:40]!r}: ask again")
        return chosen


def _shown(id: str, one: Alternative) -> dict[str, Any]:
    """An alternative as the page gets it."""
    motion, fps = one.dance.motion, one.dance.motion.fps
    first = max(0, round((one.start_s - _BESIDE_S) * fps))
    part = motion.sliced(first, min(motion.n_frames, round((one.end_s + _BESIDE_S) * fps)))
    words = one.dance.plan.edits[-1].words
    middle = words[len(words) // 2]
    return {
        "id": id, "start_s": one.start_s, "end_s": one.end_s, "from_s": first / fps,
        "cost": round(one.cost, 4), "costs": one.costs, "why": one.why,
        "take": middle.take, "genre": middle.credits.genre,
        **motion_data(part, small=True),
    }  # fmt: skip


def pinned_part(
    dance: Dance, repertoire: Repertoire, span: Span, take: str, source_s: float
) -> tuple[PlannedEdit, str]:
    """The edit that dances a take in a span, from the count nearest to a time of the take, and its request.

    Raises `RepertoireError` for an unknown take, and `NoPathError` if the take cannot be danced there.
    """
    editor = Editor(dance, repertoire, (), 0)
    wanted = PieceRequest((repertoire.take_index(take),), pinned=True)
    slots, found = editor.pieces(edit_slots(*span, editor.bounds_s), wanted)
    if not found:
        raise NoPathError(f"{take} cannot be danced there on counts, at half to twice its speed")
    best = min(found, key=lambda piece: abs(piece.words[slots.before].source_start_s - source_s))
    request = f"pin {span[0]:g}-{span[1]:g}=take:{take}"
    return planned_edit(best, request), request
