# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel in the sidebar of the 3D view."""

from __future__ import annotations

import bpy

from .operators import progress


class _InSidebar:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Choreograph"


class CHOREOGRAPH_PT_dance(_InSidebar, bpy.types.Panel):
    bl_label = "Choreograph"

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.choreograph
        layout.use_property_split = True
        layout.use_property_decorate = False
        for name in ("song", "armature", "genre", "seed", "start_s", "duration_s"):
            layout.prop(settings, name)
        buttons = layout.row(align=True)
        buttons.operator("choreograph.dance", icon="PLAY")
        buttons.operator("choreograph.again", icon="FILE_REFRESH")
        shown = progress()
        if shown:
            stage, fraction = shown
            layout.progress(factor=fraction, text=f"{stage} (Esc stops)")


class CHOREOGRAPH_PT_pins(_InSidebar, bpy.types.Panel):
    bl_label = "Pins"
    bl_parent_id = "CHOREOGRAPH_PT_dance"

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.choreograph
        row = layout.row(align=True)
        row.prop(settings, "pin", text="")
        row.operator("choreograph.pin", icon="PINNED")
        for index, pin in enumerate(settings.pins):
            row = layout.row()
            row.label(text=pin.name)
            row.operator("choreograph.unpin", text="", icon="X", emboss=False).index = index


class CHOREOGRAPH_PT_sources(_InSidebar, bpy.types.Panel):
    bl_label = "Repertoire and Bones"
    bl_parent_id = "CHOREOGRAPH_PT_dance"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.choreograph
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(settings, "repertoire")
        layout.prop(settings, "bone_map")


_CLASSES = (CHOREOGRAPH_PT_dance, CHOREOGRAPH_PT_pins, CHOREOGRAPH_PT_sources)


def register() -> None:
    for kind in _CLASSES:
        bpy.utils.register_class(kind)


def unregister() -> None:
    for kind in reversed(_CLASSES):
        bpy.utils.unregister_class(kind)
