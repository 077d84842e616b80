# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings: the path of the program in the preferences of the add-on, and the dance in each scene."""

from pathlib import Path

import bpy
from bpy.props import (
    CollectionProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from .program import Request

BUILT_IN_GENRES = (
    "Charleston", "Viennese waltz", "cha-cha", "contemporary", "disco", "funk", "hip-hop", "house", "jive",
    "pop", "rumba", "salsa", "swing", "tango", "waltz",
)  # fmt: skip


class ChoreographPreferences(bpy.types.AddonPreferences):
    bl_idname = __package__

    program: StringProperty(
        name="Program", default="choreograph", subtype="FILE_PATH",
        description="The program choreograph: its path, or its name if it is on the search path",
    )  # fmt: skip

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.prop(self, "program")


class ChoreographMarker(bpy.types.PropertyGroup):
    """A marker of the last dance. `name` is its name."""

    frame: IntProperty()


class ChoreographPin(bpy.types.PropertyGroup):
    """A pin. `name` is its value for `choreograph dance --pin`."""


class ChoreographSettings(bpy.types.PropertyGroup):
    song: StringProperty(name="Song", subtype="FILE_PATH", description="Any audio file")
    armature: PointerProperty(
        name="Armature", type=bpy.types.Object, description="The armature that dances",
        poll=lambda _, candidate: candidate.type == "ARMATURE",
    )  # fmt: skip
    genre: StringProperty(
        name="Genre", description="Genre to follow. Empty: the genre nearest to the song",
        search=lambda self, context, typed: BUILT_IN_GENRES, search_options={"SUGGESTION"},
    )  # fmt: skip
    seed: IntProperty(name="Seed", min=0, description="Another seed gives another dance")
    start_s: FloatProperty(name="Start", min=0.0, description="Second of the song to start at")
    duration_s: FloatProperty(
        name="Duration", min=0.0, description="Seconds to dance. 0: to the end of the song"
    )
    pin: StringProperty(
        name="Pin", description="Take to dance in the range of the timeline, or motif:NUMBER at its start",
        search=lambda self, context, typed: [take.name for take in self.takes], search_options={"SUGGESTION"},
    )  # fmt: skip
    pins: CollectionProperty(type=ChoreographPin)
    repertoire: StringProperty(
        name="Repertoire", subtype="FILE_PATH", description="Repertoire of takes. Empty: the built-in one"
    )
    bone_map: StringProperty(
        name="Bone Map", subtype="FILE_PATH",
        description="Names of bones, if the program does not recognise them",
    )  # fmt: skip
    takes: CollectionProperty(type=bpy.types.PropertyGroup)  # of the last dance, by name
    markers: CollectionProperty(type=ChoreographMarker)

    def request(self, scene: bpy.types.Scene, seed: int) -> Request:
        """The request for a dance. The song begins at a whole frame."""
        fps = scene.render.fps / scene.render.fps_base
        return Request(
            song=Path(_absolute(self.song)), fps=fps, start_s=round(self.start_s * fps) / fps,
            duration_s=self.duration_s, seed=seed, genre=self.genre,
            pins=tuple(pin.name for pin in self.pins),
            repertoire=_absolute(self.repertoire), bone_map=_absolute(self.bone_map),
        )  # fmt: skip


def _absolute(path: str) -> str:
    return bpy.path.abspath(path)


_CLASSES = (ChoreographPreferences, ChoreographMarker, ChoreographPin, ChoreographSettings)


def register() -> None:
    for kind in _CLASSES:
        bpy.utils.register_class(kind)
    bpy.types.Scene.choreograph = PointerProperty(type=ChoreographSettings)


def unregister() -> None:
    del bpy.types.Scene.choreograph
    for kind in reversed(_CLASSES):
        bpy.utils.unregister_class(kind)
