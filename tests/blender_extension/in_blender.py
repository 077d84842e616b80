"""Run by Blender, not by pytest: installs the extension, dances as a user does, and writes down what came.

python in_blender.py -- JOB.json      with what `job_of` in test_in_blender.py says
"""

import json
import random
import sys
import time
from math import radians
from pathlib import Path
from unittest.mock import MagicMock

import bpy
from mathutils import Matrix, Vector

FRAMES_OF_DANCE = 240
LIMBS = ("upper_arm_parent.L", "upper_arm_parent.R", "thigh_parent.L", "thigh_parent.R")
PLACED = Matrix.Translation((2.0, -3.0, 0.5)) @ Matrix.Rotation(radians(40.0), 4, "Z")


def main() -> None:
    job = json.loads(Path(sys.argv[sys.argv.index("--") + 1]).read_text())
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.extensions.package_install_files(
        filepath=job["package"], repo="user_default", enable_on_install=True
    )
    addon = bpy.context.preferences.addons["bl_ext.user_default.choreograph"]
    addon.preferences.program = job["program"]
    armature = MADE.get(job["rig"], imported)(job["character"])
    scene = bpy.context.scene
    scene.render.fps = 30
    scene.frame_start = 11
    things_of_the_user(armature, job["song"])
    settings = scene.choreograph
    settings.armature, settings.duration_s, settings.start_s = armature, 8.0, 1.5
    seen = after_an_error(scene, armature, job["wrong_song"]) if job["is_whole"] else {}
    settings.song = job["song"]
    if job["rig"] == "generated":
        name = armature.name  # undoing makes other objects
        seen["undone"] = undone(name)
        scene, armature = bpy.context.scene, bpy.data.objects[name]
        settings = scene.choreograph
    bpy.ops.choreograph.dance()
    seen["danced"] = state(scene, armature) | {"joints_m": joints_m(scene, armature)}
    if job["rig"] == "generated":
        seen["root"] = with_root_moved(scene, armature)
        armature.data.pop("rig_id")  # as after a link or an append
    unusual(armature)
    armature.matrix_world = PLACED @ armature.matrix_world
    scene.use_preview_range, scene.frame_preview_start, scene.frame_preview_end = True, 41, 130
    settings.pin = settings.takes[0].name
    bpy.ops.choreograph.pin()
    seen["pin"] = settings.pins[0].name
    bpy.ops.choreograph.unpin(index=0)
    bpy.ops.choreograph.again()
    seen["again"] = state(scene, armature) | {"joints_m": joints_m(scene, armature, PLACED.inverted())}
    if job["is_whole"]:
        seen["interface"] = in_the_interface(scene)
    bpy.ops.preferences.addon_disable(module="bl_ext.user_default.choreograph")
    seen["left_registered"] = hasattr(bpy.types.Scene, "choreograph")
    Path(job["seen"]).write_text(json.dumps(seen))


def after_an_error(scene: bpy.types.Scene, armature: bpy.types.Object, wrong_song: str) -> dict:
    """What is said of a song that cannot be read, and what there was before and after."""
    seen = {"before": state(scene, armature)}
    scene.choreograph.song = wrong_song
    try:
        bpy.ops.choreograph.dance()
    except RuntimeError as error:
        seen["error"] = str(error)
    return seen | {"after_error": state(scene, armature)}


def imported(path: str) -> bpy.types.Object:
    bpy.ops.import_scene.gltf(filepath=path)
    return next(each for each in bpy.data.objects if each.type == "ARMATURE")


def metarig(path: str) -> bpy.types.Object:
    """Rigify's human, with a speck of skin on each bone, also written to a file."""
    bpy.ops.preferences.addon_enable(module="rigify")
    bpy.ops.object.armature_human_metarig_add()
    armature = bpy.context.object
    corners = [Vector(corner) * 0.01 for corner in ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1))]
    points = [bone.head_local + corner for bone in armature.data.bones for corner in corners]
    for point in points:
        point.z = max(point.z, 0.0)  # the soles are on the floor
    first = range(0, len(points), 4)
    data = bpy.data.meshes.new("body")
    data.from_pydata(points, [], [(i, i + 1, i + 2) for i in first] + [(i, i + 2, i + 3) for i in first])
    body = bpy.data.objects.new("body", data)
    bpy.context.scene.collection.objects.link(body)
    body.parent = armature
    body.modifiers.new("Armature", "ARMATURE").object = armature
    for i, bone in zip(first, armature.data.bones, strict=True):
        body.vertex_groups.new(name=bone.name).add(range(i, i + 4), 1.0, "REPLACE")
    bpy.ops.export_scene.gltf(filepath=path, export_def_bones=False, export_animations=False)
    return armature


def generated(path: str) -> bpy.types.Object:
    """The rig that Rigify generates from its human, whose deforming bones have the skin."""
    bones = metarig(path)
    (body,) = bones.children
    bpy.ops.pose.rigify_generate()
    rig = next(each for each in bpy.data.objects if each.type == "ARMATURE" and "rig_id" in each.data)
    body.parent, body.modifiers[0].object = rig, rig
    for group in body.vertex_groups:
        group.name = f"DEF-{group.name}"
    bpy.data.objects.remove(bones)
    rig["IK_FK before"] = [rig.pose.bones[name]["IK_FK"] for name in LIMBS]
    return rig


def undone(name: str) -> list[dict]:
    """What there was before a dance on a rig, with it, and after one step back."""
    found = []

    def look() -> None:
        rig = bpy.data.objects[name]
        ik_fk = [rig.pose.bones[limb]["IK_FK"] for limb in LIMBS]
        place = [*rig.pose.bones["torso"].location]
        found.append(state(bpy.context.scene, rig) | {"ik_fk": ik_fk, "torso": place})

    bpy.ops.ed.undo_push(message="before")
    look()
    bpy.ops.choreograph.dance("EXEC_DEFAULT", True)
    bpy.context.scene.frame_set(60)
    look()
    bpy.ops.ed.undo()
    look()
    return found


def with_root_moved(scene: bpy.types.Scene, rig: bpy.types.Object) -> dict:
    """Heads of the deforming bones in the middle of the dance, before and after a move of the root."""
    scene.frame_set(FRAMES_OF_DANCE // 2)
    moved = Matrix.Translation((1.0, 2.0, 0.5)) @ Matrix.Rotation(radians(70.0), 4, "Z")
    deforming = [bone for bone in rig.pose.bones if bone.name.startswith("DEF-")]
    root = rig.pose.bones["root"]
    expected = [[*(moved @ bone.head)] for bone in deforming]
    root.matrix = moved @ root.matrix
    bpy.context.view_layer.update()
    found = [[*bone.head] for bone in deforming]
    root.matrix_basis.identity()
    keyed = rig.animation_data.action.layers[0].strips[0].channelbags[0].groups.keys()
    return {
        "expected": expected, "found": found,
        "ik_fk": [rig["IK_FK before"].to_list(), [rig.pose.bones[name]["IK_FK"] for name in LIMBS]],
        "keyed": sorted(keyed),
        "held": [name for name in keyed if len(rig.pose.bones[name].constraints)],
    }  # fmt: skip


MADE = {"metarig": metarig, "generated": generated}


def things_of_the_user(armature: bpy.types.Object, song: str) -> None:
    scene = bpy.context.scene
    armature.animation_data_create().action = bpy.data.actions.new("mine")
    scene.timeline_markers.new("mine", frame=20)
    scene.sequence_editor_create().strips.new_sound("mine", song, 1, 1)
    bpy.data.texts.new("mine")
    armature.pose.bones[0].location = 1.0, 2.0, 3.0


def unusual(armature: bpy.types.Object) -> None:
    """Modes of rotation and inheritance that rigs have."""
    if "torso" in armature.pose.bones:
        turned = [bone for bone in armature.pose.bones if "_fk" in bone.name and "MCH" not in bone.name]
    else:
        turned = [bone for bone in armature.pose.bones if bone.parent and bone.children]
    for bone, mode in zip(turned, ("XYZ", "AXIS_ANGLE", "ZXY", "QUATERNION"), strict=False):
        bone.rotation_mode = mode
    for bone in turned[3::4]:
        bone.bone.use_inherit_rotation = False


def in_the_interface(scene: bpy.types.Scene) -> dict:
    """What the modal operator and the panels do, with a stand-in for the window that there is not here."""
    from bl_ext.user_default.choreograph import operators, panel

    class Button(operators._Dances):
        report = MagicMock()

    context = MagicMock(scene=scene, preferences=bpy.context.preferences)
    scene.choreograph.duration_s, scene.choreograph.pin = 2.0, ""
    tick, escape = MagicMock(type="TIMER"), MagicMock(type="ESC")
    stopped, button = Button(), Button()
    answers = [stopped.invoke(context, tick), stopped.modal(context, tick), stopped.modal(context, escape)]
    answers.append(button.invoke(context, tick))
    busy = not Button.poll(context)
    shown = [str(stage) for stage, _ in [operators.progress()]]
    while "PASS_THROUGH" in (answer := button.modal(context, tick)):
        time.sleep(0.05)
        shown.append(operators.progress()[0])
    drawn = MagicMock()
    for name in ("dance", "pins", "sources"):
        getattr(panel, f"CHOREOGRAPH_PT_{name}").draw(MagicMock(layout=drawn), context)
    properties = [
        call.args[1] for call in drawn.mock_calls if call.args and call.args[0] == scene.choreograph
    ]
    return {
        "answers": [*map(list, answers), list(answer)],
        "busy": busy,
        "stages": list(dict.fromkeys(shown)),
        "frame_end": scene.frame_end,
        "drawn": properties,
        "unknown": [name for name in properties if name not in scene.choreograph.bl_rna.properties],
    }


def state(scene: bpy.types.Scene, armature: bpy.types.Object) -> dict:
    """What a dance may change."""
    strips = scene.sequence_editor.strips
    return {
        "action": armature.animation_data.action.name,
        "actions": sorted(action.name for action in bpy.data.actions),
        "strips": sorted((s.name, s.frame_final_start, s.frame_final_end, s.frame_start) for s in strips),
        "sounds": len(bpy.data.sounds),
        "markers": sorted((marker.frame, marker.name) for marker in scene.timeline_markers),
        "texts": {text.name: text.as_string() for text in bpy.data.texts},
        "frames": [scene.frame_start, scene.frame_end],
        "seed": scene.choreograph.seed,
    }


def joints_m(scene: bpy.types.Scene, armature: bpy.types.Object, back: Matrix | None = None) -> dict:
    """Heads of the bones at some frames of the dance, counted from 0; moved by `back`, Y up.

    Of a generated rig at all frames, and of its deforming bones alone, by the names of the metarig. Of a few
    frames also the skin, which shows how bones are rolled.
    """
    frames = sorted(random.Random(0).sample(range(FRAMES_OF_DANCE), 20))
    shown_bones = [*armature.pose.bones]
    if "torso" in armature.pose.bones:
        frames = [*range(FRAMES_OF_DANCE)]
        shown_bones = [bone for bone in shown_bones if bone.name.startswith("DEF-")]
    heads: dict[str, list] = {bone.name.removeprefix("DEF-"): [] for bone in shown_bones}
    skin = []
    to_y_up = Matrix(((1, 0, 0), (0, 0, 1), (0, -1, 0))).to_4x4() @ (back or Matrix())
    (body,) = [each for each in scene.objects if each.type == "MESH" and each.find_armature() == armature]
    for frame in frames:
        scene.frame_set(scene.frame_start + frame)
        for bone in shown_bones:
            heads[bone.name.removeprefix("DEF-")].append([*(to_y_up @ armature.matrix_world @ bone.head)])
        if len(skin) < 3:
            shown = body.evaluated_get(bpy.context.evaluated_depsgraph_get())
            skin.append([[*(to_y_up @ shown.matrix_world @ vertex.co)] for vertex in shown.data.vertices])
    return {"frames": frames, "heads": heads, "skin": skin}


main()
