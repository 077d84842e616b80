"""A script for Blender that converts a .fbx to a .glb or back, with skins and animations.

blender --background --python _in_blender.py -- IN OUT
python _in_blender.py -- IN OUT        with a Python that has the module bpy
"""

import sys

import bpy


def main() -> None:
    """Convert the file IN to the file OUT."""
    source, target = sys.argv[sys.argv.index("--") + 1 :][:2]
    bpy.ops.wm.read_factory_settings(use_empty=True)
    if source.lower().endswith(".fbx"):
        bpy.ops.import_scene.fbx(filepath=source, automatic_bone_orientation=False, ignore_leaf_bones=False)
    else:
        # The rate must be known before keys in seconds become frames.
        bpy.context.scene.render.fps = 60
        bpy.ops.import_scene.gltf(filepath=source, bone_heuristic="BLENDER", disable_bone_shape=True)
    scene = bpy.context.scene
    ranges = [action.frame_range for action in bpy.data.actions]
    if ranges:
        scene.frame_start = int(min(start for start, _ in ranges))
        scene.frame_end = round(max(end for _, end in ranges))
    if target.lower().endswith(".fbx"):
        bpy.ops.export_scene.fbx(
            filepath=target, object_types={"ARMATURE", "MESH", "EMPTY"}, add_leaf_bones=False,
            path_mode="COPY", embed_textures=True, bake_anim=bool(ranges), bake_anim_use_all_bones=True,
            bake_anim_use_nla_strips=False, bake_anim_use_all_actions=False,
            bake_anim_force_startend_keying=True, bake_anim_simplify_factor=0.0,
        )  # fmt: skip
    else:
        bpy.ops.export_scene.gltf(
            filepath=target, export_format="GLB", export_animations=bool(ranges), export_force_sampling=True,
            export_optimize_animation_size=False, export_def_bones=False,
        )  # fmt: skip


main()
