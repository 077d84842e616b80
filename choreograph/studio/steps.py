"""The dances and scenes of the steps of a project, which are rendered again from their plans unless kept.

`StepDances` has the dances of one leader, and `StepScenes` those of several dancers around the leader.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from choreograph.characters.character import GltfCharacter
from choreograph.choreography.constraints import parse_ban
from choreograph.choreography.song_analysis import analyse_song
from choreograph.core.cache import Memory
from choreograph.core.counts import Figure
from choreograph.core.numerics import default_numerics, one_thread
from choreograph.core.progress import ProgressReport, substage
from choreograph.library.repertoire import Repertoire
from choreograph.motion.motion import Motion
from choreograph.music.song import Song
from choreograph.music.song_features import SongFeatures
from choreograph.pipeline.dancing import Dance, dance_with, danced_figures
from choreograph.pipeline.scene_planning import PlannedScene, SceneRequest, plan_scene, sizes_of
from choreograph.pipeline.scenes import Scene, planned_requests, scene_of
from choreograph.plan.joins import take_motions
from choreograph.plan.plan import Plan, PlannedEdit
from choreograph.render.assembly import off_stage
from choreograph.render.rendering import render_planned, with_edit
from choreograph.studio.dance_json import motion_data, other_motion_data
from choreograph.studio.project import Project, Settings, Step

_MEMORY_BYTES = 32_000_000  # of what dances to one song have in common
_MEMORY_BYTES_PER_S = 700_000  # of the song, in addition
_MOTION_BYTES_PER_S = 300_000  # of motions of steps, six of them, so that undo shows at once
_COMPRESSED_BYTES = 1 << 22  # of motions as they are sent


class StepDances:
    """The dances to one song. The motions of those that were used last are kept."""

    def __init__(self, repertoire: Repertoire, duration_s: float = 60.0) -> None:
        """Keep what fits in memory for a song of this length."""
        self._memory_bytes = _MEMORY_BYTES + round(_MEMORY_BYTES_PER_S * duration_s)
        self._memory = repertoire, Memory(self._memory_bytes)
        self._motions = Memory(round(_MOTION_BYTES_PER_S * duration_s))
        self._compressed = Memory(_COMPRESSED_BYTES)

    def memory_of(self, repertoire: Repertoire) -> Memory:
        """What the dances with a repertoire have in common. Only that of the last repertoire is kept."""
        if repertoire is not self._memory[0]:
            self._memory = repertoire, Memory(self._memory_bytes)
        return self._memory[1]

    def features(self, settings: Settings, song: Song, repertoire: Repertoire) -> SongFeatures:
        """The features of the song, which are kept from its analysis for the dance."""
        found, _ = analyse_song(
            song, repertoire, beats=settings.config().beats, genre=settings.genre, keep=True,
            memory=self.memory_of(repertoire),
        )  # fmt: skip
        return found

    def dance(
        self, project: Project, step: Step, repertoire: Repertoire, song: Song, report: ProgressReport | None
    ) -> Dance:
        """The dance of a step, with the takes of the repertoire of its settings."""
        plan = step.plan()
        motion = self._motion(project, step, plan, repertoire, song, report)
        figures = danced_figures(plan, repertoire)
        return Dance(motion, plan, off_stage(motion, plan.stage), song.path, figures=figures)

    def made(
        self,
        settings: Settings,
        song: Song,
        repertoire: Repertoire,
        report: ProgressReport | None,
        **again: Any,
    ) -> Dance:
        """A new dance with these settings, and with arguments for parts that are kept. Raises as `dance`."""
        return dance_with(
            self.memory_of(repertoire), song, repertoire,
            genre=settings.genre, engine=settings.engine, config=settings.dance_config(),
            bans=[parse_ban(ban) for ban in settings.bans], report=report, **again,
        )  # fmt: skip

    def keep(self, step: Step, motion: Motion) -> None:
        """Keep the motion of a step for a while."""
        self._motions.keep(step.number, motion)

    def compressed(self, step: Step, motion: Motion) -> dict[str, Any]:
        """The motion of a step as it is sent to the page."""
        data: dict[str, Any] | None = self._compressed.get(step.number)
        if data is None:
            data = motion_data(motion)
            self._compressed.keep(step.number, data, len(data["motion"]))
        return data

    @one_thread()
    def _motion(
        self,
        project: Project,
        step: Step,
        plan: Plan,
        repertoire: Repertoire,
        song: Song,
        report: ProgressReport | None,
    ) -> Motion:
        """The motion of a step: that of the nearest step before it which is known, with further edits."""
        todo: list[PlannedEdit] = []
        motion: Motion | None = self._motions.get(step.number)
        known = step
        while motion is None and known.parent is not None:
            parent = project.steps[known.parent]
            todo = [*known.edits[len(parent.edits) :], *todo]
            known, motion = parent, self._motions.get(parent.number)
        if motion is None:
            plan.check()
            base = replace(plan, edits=())
            if base.from_takes:
                rendering = substage(report, "rendering")
                motion = render_planned(base, repertoire, self.memory_of(repertoire), report=rendering)
            else:  # a network danced, which makes the same dance again
                motion = self.made(known.settings, song, repertoire, report).motion
            todo = list(step.edits)
        read_motion = take_motions(repertoire)
        for one in todo:
            motion = with_edit(motion, plan, one, read_motion)
        self.keep(step, motion)
        return motion


# Several dancers around the dance of the leader.


_SCENE_BYTES_PER_S = 1_000_000  # of scenes, two of eight dancers


@dataclass(frozen=True, eq=False)
class StagedScene:
    """A scene, and what it was made from."""

    request: SceneRequest
    dances: tuple[tuple[Motion, Plan], ...]  # that of the leader first
    figures: tuple[tuple[Figure, ...], ...]  # of each of them
    asked: tuple[Settings, ...]  # with which each of them was made
    features: SongFeatures
    planned: PlannedScene
    data: dict[str, Any]  # the motions as they are sent to the page

    @property
    def n_bytes(self) -> int:
        """The size of all motions and of what is sent."""
        motions = (*self.planned.motions, *(motion for motion, _ in self.dances))
        texts = (self.data["motion"], *(other["motion"] for other in self.data["others"]))
        return sum(one.root_pos_m.nbytes + one.local_quat.nbytes for one in motions) + sum(map(len, texts))

    @default_numerics()
    def scene(self, song_path: Path | None, character: GltfCharacter | None) -> Scene:
        """The scene as it is written, on a character or on mannequins. Raises as `sizes_of`."""
        planned, characters = self.planned, [] if character is None else [character]
        if characters:
            sizes = sizes_of(len(self.request.names), characters, self.dances[0][0].skeleton)
            planned = plan_scene(self.request, self.dances, self.features, sizes)
        asked = [(one.genre, one.bans, one.dance_config()) for one in self.asked]
        requests = planned_requests(planned.plan.dances, asked)
        plan = replace(planned.plan, requests=requests)
        return scene_of(plan, planned.motions, characters, planned.notes, song_path, self.figures)


class StepScenes:
    """The scenes of dances to one song. Those that were used last are kept."""

    def __init__(self, duration_s: float = 60.0) -> None:
        """Keep what fits in memory for a song of this length."""
        self._scenes = Memory(round(_SCENE_BYTES_PER_S * duration_s))
        self._others: tuple[str, tuple[Dance, ...]] = "", ()  # of free dancers, the last ones

    @default_numerics()
    def staged(
        self,
        project: Project,
        step: Step,
        dance: Dance,
        features: SongFeatures,
        mesh: dict[str, Any],
        make: Callable[[Settings], Dance],
        report: ProgressReport | None,
    ) -> StagedScene:
        """The scene of a step around its dance.

        `mesh` is the layout of the mannequin, and the function `make` makes the dances of free dancers.
        Raises `ParameterError` for a part of the song that the song does not have.
        """
        key = step.number, step.text, step.base  # of a step that could not be saved, the number is used again
        known: StagedScene | None = self._scenes.get(key)
        if known is not None:
            return known
        request = step.settings.scene_request()
        others = tuple(step.settings.of_dancer(index) for index in range(1, request.n_dances))
        asked = (project.root(step).settings, *others)
        made = (dance, *self._danced(others, make))
        dances = tuple((one.motion, one.plan) for one in made)
        sizes = sizes_of(len(request.names), (), dance.motion.skeleton)
        planned = plan_scene(request, dances, features, sizes, report)
        if report is not None:
            report("showing the dancers", 0, 0)
        first, *rest = planned.motions
        data = motion_data(first)
        data["others"] = [other_motion_data(one, i, first, mesh) for i, one in enumerate(rest, start=1)]
        figures = tuple(one.figures for one in made)
        staged = StagedScene(request, dances, figures, asked, features, planned, data)
        self._scenes.keep(key, staged, staged.n_bytes)
        return staged

    def _danced(self, asked: tuple[Settings, ...], make: Callable[[Settings], Dance]) -> tuple[Dance, ...]:
        """The dances of free dancers, which a change of the leader's dance leaves as they are."""
        key = json.dumps([one.to_data() for one in asked])
        if key != self._others[0]:
            self._others = key, tuple(make(one) for one in asked)
        return self._others[1]
