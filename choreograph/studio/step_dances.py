"""The dances of the steps of a project. They are rendered again from their plans, unless they are kept."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from choreograph.choreography.constraints import parse_ban
from choreograph.choreography.song_analysis import analyse_song
from choreograph.core.cache import Memory
from choreograph.core.numerics import one_thread
from choreograph.core.progress import ProgressReport, substage
from choreograph.library.repertoire import Repertoire
from choreograph.motion.motion import Motion
from choreograph.music.song import Song
from choreograph.music.song_features import SongFeatures
from choreograph.pipeline.dancing import Dance, dance_with
from choreograph.pipeline.figures import danced_figures
from choreograph.plan.joins import take_motions
from choreograph.plan.plan import Plan, PlannedEdit
from choreograph.render.assembly import off_stage
from choreograph.render.rendering import render_planned, with_edit
from choreograph.studio.facts import motion_data
from choreograph.studio.project import Project, Step
from choreograph.studio.settings import Settings

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
