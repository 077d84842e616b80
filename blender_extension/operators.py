# SPDX-License-Identifier: GPL-3.0-or-later
"""The operators of the buttons: Dance, Again, and pins."""

from dataclasses import dataclass
from typing import Self

import bpy
from bpy.props import IntProperty

from .armature import constrained_bones, key_dance, put_on, skeleton_of
from .errors import DanceError
from .glb import Skeleton
from .program import Dance, Request, Run
from .timeline import OURS, lay_out, leave, write_credits

_CHECK_EVERY_S = 0.2
_TAKE, _MOTIF = "take:", "motif:"


@dataclass(frozen=True)
class _Job:
    """A dance that is being made. Objects are stored by name, because they may be deleted meanwhile."""

    run: Run
    request: Request
    skeleton: Skeleton
    scene: str
    armature: str
    first_frame: int

    @classmethod
    def begin(cls, context: bpy.types.Context, seed: int) -> Self:
        scene = context.scene
        armature = scene.choreograph.armature
        request, skeleton = scene.choreograph.request(scene, seed), skeleton_of(armature, scene)
        program = context.preferences.addons[__package__].preferences.program
        run = Run(bpy.path.abspath(program), request, skeleton)
        return cls(run, request, skeleton, scene.name, armature.name, scene.frame_start)

    def finish(self) -> tuple[list[str], list[str]]:
        """Put the dance on the armature and into the scene. Return notes of the program, and held bones."""
        dance = self.run.dance()
        scene, armature = bpy.data.scenes.get(self.scene), bpy.data.objects.get(self.armature)
        if not scene or not armature or not set(self.skeleton.names) <= set(armature.pose.bones.keys()):
            raise DanceError(
                f"expected {self.armature} with all its bones, got another armature: was it changed?"
            )
        action = self._key(armature, dance)
        lay_out(scene, self.request, dance, self.first_frame)
        _remember(scene, self.request, dance)
        return dance.facts["notes"], constrained_bones(armature, action)

    def _key(self, armature: bpy.types.Object, dance: Dance) -> bpy.types.Action:
        name = self.request.song.stem
        action = key_dance(armature, self.skeleton, dance.tracks, self.first_frame, name)
        before = armature.animation_data.action if armature.animation_data else None
        put_on(armature, action)
        if before:
            leave(before)
        action.name = name  # free again if the last dance had it
        action[OURS] = write_credits(f"{name} credits", dance)
        return action


def _remember(scene: bpy.types.Scene, request: Request, dance: Dance) -> None:
    settings = scene.choreograph
    settings.seed = request.seed
    settings.takes.clear()
    for take in dance.facts["takes"]:
        settings.takes.add().name = take["name"]


class _Dances:
    """Runs the program. A script waits for it, and the interface stays usable."""

    bl_options = {"REGISTER", "UNDO"}
    running: Run | None = None  # of all operators
    _timer = None

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        settings = context.scene.choreograph
        return bool(settings.song and settings.armature) and _Dances.running is None

    def seed(self, settings: bpy.types.PropertyGroup) -> int:
        return settings.seed

    def execute(self, context: bpy.types.Context) -> set[str]:
        job = self._begin(context)
        return self._finish(job) if job else {"CANCELLED"}

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        self._job = self._begin(context)
        if self._job is None:
            return {"CANCELLED"}
        _Dances.running = self._job.run
        self._timer = context.window_manager.event_timer_add(_CHECK_EVERY_S, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type == "ESC":
            self.cancel(context)
            self._end(context)
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        _redraw(context)
        if not self._job.run.ended():
            return {"PASS_THROUGH"}
        self._end(context)
        return self._finish(self._job)

    def cancel(self, context: bpy.types.Context) -> None:
        """End the program, also if Blender ends the operator because another file is opened."""
        self._job.run.stop()
        _Dances.running = None

    def _begin(self, context: bpy.types.Context) -> _Job | None:
        try:
            return _Job.begin(context, self.seed(context.scene.choreograph))
        except DanceError as error:
            self.report({"ERROR"}, str(error))
            return None

    def _end(self, context: bpy.types.Context) -> None:
        context.window_manager.event_timer_remove(self._timer)
        _Dances.running = None
        _redraw(context)

    def _finish(self, job: _Job) -> set[str]:
        try:
            notes, held = job.finish()
        except DanceError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        for note in notes:
            self.report({"INFO"}, note)
        if held:
            some = ", ".join(held[:3]) + (" and others" if len(held) > 3 else "")
            self.report({"WARNING"}, f"expected bones without active constraints: mute those of {some}")
        return {"FINISHED"}


def _redraw(context: bpy.types.Context) -> None:
    for area in context.screen.areas:
        if area.type == "VIEW_3D":
            area.tag_redraw()


class CHOREOGRAPH_OT_dance(_Dances, bpy.types.Operator):
    """Animate the armature to the song"""

    bl_idname = "choreograph.dance"
    bl_label = "Dance"


class CHOREOGRAPH_OT_again(_Dances, bpy.types.Operator):
    """Animate the armature to the song with the next seed"""

    bl_idname = "choreograph.again"
    bl_label = "Again"

    def seed(self, settings: bpy.types.PropertyGroup) -> int:
        return settings.seed + 1


class CHOREOGRAPH_OT_pin(bpy.types.Operator):
    """Pin the take to the preview range of the timeline, or to its frame range if there is none"""

    bl_idname = "choreograph.pin"
    bl_label = "Pin to Range"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(context.scene.choreograph.pin)

    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        fps = scene.render.fps / scene.render.fps_base
        first, last = scene.frame_start, scene.frame_end
        if scene.use_preview_range:
            first, last = scene.frame_preview_start, scene.frame_preview_end
        from_s, to_s = ((frame - scene.frame_start) / fps for frame in (first, last + 1))
        if from_s < 0:
            self.report({"ERROR"}, "expected a range that begins after the first frame of the scene")
            return {"CANCELLED"}
        what = scene.choreograph.pin
        if what.startswith(_MOTIF):
            pinned = f"{from_s:.3f}={what}"
        else:
            pinned = f"{from_s:.3f}-{to_s:.3f}={_TAKE}{what.removeprefix(_TAKE)}"
        scene.choreograph.pins.add().name = pinned
        return {"FINISHED"}


class CHOREOGRAPH_OT_unpin(bpy.types.Operator):
    """Remove this pin"""

    bl_idname = "choreograph.unpin"
    bl_label = "Unpin"
    bl_options = {"REGISTER", "UNDO"}

    index: IntProperty(options={"HIDDEN"})

    def execute(self, context: bpy.types.Context) -> set[str]:
        context.scene.choreograph.pins.remove(self.index)
        return {"FINISHED"}


_CLASSES = (CHOREOGRAPH_OT_dance, CHOREOGRAPH_OT_again, CHOREOGRAPH_OT_pin, CHOREOGRAPH_OT_unpin)


def progress() -> tuple[str, float] | None:
    """The stage of the dance that is being made, and the part of it that is done, or None."""
    run = _Dances.running
    return (run.stage, run.fraction) if run else None


def register() -> None:
    for kind in _CLASSES:
        bpy.utils.register_class(kind)


def unregister() -> None:
    if _Dances.running:
        _Dances.running.stop()
        _Dances.running = None
    for kind in reversed(_CLASSES):
        bpy.utils.unregister_class(kind)
