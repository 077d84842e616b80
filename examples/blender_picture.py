"""Render a body that dances in Blender with the extension. examples/blender.webp was made with this script.

Run, with the extension installed:
blender --background --python examples/blender_picture.py -- BODY.glb SONG OUT.webp [SAMPLES]
BODY.glb is any character, for example one that `choreograph dance SONG -o BODY.glb` writes.
"""

import sys
from math import radians

import bpy

BARS, APART_M, START_S, SIZE = (2, 3, 4, 5), 1.45, 8.0, (960, 400)


def main(body: str, song: str, out: str, samples: str = "64") -> None:
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.preferences.addon_enable(module="bl_ext.user_default.choreograph")
    bpy.ops.import_scene.gltf(filepath=body)
    scene = bpy.context.scene
    scene.choreograph.armature = next(each for each in scene.objects if each.type == "ARMATURE")
    scene.choreograph.song, scene.choreograph.genre = song, "disco"
    scene.choreograph.start_s, scene.choreograph.duration_s = START_S, 12.0
    bpy.ops.choreograph.dance()
    frames = [m.frame for m in scene.timeline_markers for bar in BARS if f"bar {bar}" in m.name.split(", ")]
    stand_in_a_row(scene, frames)
    light_and_look(scene)
    scene.render.engine, scene.cycles.samples = "CYCLES", int(samples)
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.image_settings.file_format = "WEBP"
    scene.render.image_settings.quality, scene.render.filepath = 80, out
    bpy.ops.render.render(write_still=True)


def stand_in_a_row(scene: bpy.types.Scene, frames: list[int]) -> None:
    """A still of the body at each frame, side by side. The body itself is hidden."""
    (body,) = [each for each in scene.objects if each.type == "MESH" and each.find_armature()]
    for place, frame in enumerate(frames):
        scene.frame_set(frame)
        evaluated = body.evaluated_get(bpy.context.evaluated_depsgraph_get())
        still = bpy.data.objects.new(f"frame {frame}", bpy.data.meshes.new_from_object(evaluated))
        still.matrix_world = evaluated.matrix_world
        hips = scene.choreograph.armature.pose.bones[0].head
        still.location.x += APART_M * (place - (len(frames) - 1) / 2) - hips.x
        still.location.y -= hips.y
        scene.collection.objects.link(still)
    body.hide_render = True


def light_and_look(scene: bpy.types.Scene) -> None:
    bpy.ops.mesh.primitive_plane_add(size=60)
    bpy.ops.object.light_add(type="SUN", rotation=(radians(40), radians(-15), radians(20)))
    bpy.context.object.data.energy, bpy.context.object.data.angle = 2.5, radians(8)
    scene.world = bpy.data.worlds.new("sky")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = 0.4, 0.47, 0.55, 1.0
    bpy.ops.object.camera_add(location=(0.0, -8.6, 1.5), rotation=(radians(86), 0.0, 0.0))
    scene.camera = bpy.context.object
    scene.camera.data.lens = 50


main(*sys.argv[sys.argv.index("--") + 1 :])
