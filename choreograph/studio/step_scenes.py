"""The scenes of the steps of a project: several dancers around the dance of the leader."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from choreograph.characters.gltf_character import GltfCharacter
from choreograph.core.cache import Memory
from choreograph.core.counts import Figure
from choreograph.core.numerics import default_numerics
from choreograph.core.progress import ProgressReport
from choreograph.motion.motion import Motion
from choreograph.music.song_features import SongFeatures
from choreograph.pipeline.dancing import Dance
from choreograph.pipeline.scene_planning import (
    PlannedScene,
    SceneRequest,
    plan_scene,
    sizes_of,
)
from choreograph.pipeline.scenes import Scene, planned_requests, scene_of
from choreograph.plan.plan import Plan
from choreograph.studio.facts import motion_data, other_motion_data
from choreograph.studio.project import Project, Step
from choreograph.studio.settings import Settings

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
