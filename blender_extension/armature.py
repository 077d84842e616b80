# SPDX-License-Identifier: GPL-3.0-or-later
"""Armatures: reads them as skeletons for the program, and keys the dance.

The origin of the program's world is the place of the armature. Its floor is the lowest point of the body at
rest, and its front is that of the object, so that a character dances where it stands.
"""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Matrix, Quaternion

from .errors import DanceError
from .glb import Floats, Skeleton, Tracks

_Y_UP = Matrix(((1, 0, 0, 0), (0, 0, 1, 0), (0, -1, 0, 0), (0, 0, 0, 1)))  # from Blender's Z up
_SAME_SCALE = 1e-3
_GENERATED_PREFIXES = ("DEF-", "ORG-", "MCH-")


def skeleton_of(armature: bpy.types.Object, scene: bpy.types.Scene) -> Skeleton:
    """The bones of an armature object at rest.

    Raises `DanceError` if it is in Edit Mode, empty, scaled unevenly, or a control rig.
    """
    bones = armature.data.bones
    if armature.mode == "EDIT" or not bones:
        raise DanceError(f"{armature.name}: expected an armature with bones that is not in Edit Mode")
    if _is_generated(armature):
        raise DanceError(
            f"{armature.name}: expected bones that can be moved, got a control rig that Rigify generated, "
            "whose constraints hold them: use its metarig"
        )
    scale = armature.matrix_world.to_scale()
    if armature.matrix_world.determinant() <= 0 or max(scale) - min(scale) > _SAME_SCALE * max(scale):
        raise DanceError(
            f"expected one scale in all directions, got {armature.name} scaled by "
            f"{', '.join(f'{factor:g}' for factor in scale)}: apply it (Ctrl A)"
        )
    points = _points_of_body(armature, scene)  # (P, 3)
    to_program = _to_program(armature, scene, float(points[:, 2].min()))
    of_armature = to_program @ armature.matrix_world
    world = [_rigid(of_armature @ bone.matrix_local) for bone in bones]
    index = {bone.name: number for number, bone in enumerate(bones)}
    parents = tuple(index[bone.parent.name] if bone.parent else -1 for bone in bones)
    local = [
        own if parent < 0 else world[parent].inverted() @ own
        for own, parent in zip(world, parents, strict=True)
    ]
    moved = _moved(to_program, points)
    return Skeleton(
        names=tuple(index),
        parents=parents,
        translations_m=np.array([matrix.translation for matrix in local]),
        quats=np.array([matrix.to_quaternion() for matrix in local]),
        world=np.array(world),
        unit_m=of_armature.median_scale,
        corners_m=np.array([moved.min(axis=0), moved.max(axis=0)]),
    )


def _is_generated(armature: bpy.types.Object) -> bool:
    """Whether Rigify generated a rig, by its mark or the prefixes of deforming, original and helper bones."""
    names = armature.data.bones.keys()
    return "rig_id" in armature.data or all(
        any(name.startswith(prefix) for name in names) for prefix in _GENERATED_PREFIXES
    )


def _points_of_body(armature: bpy.types.Object, scene: bpy.types.Scene) -> Floats:
    """Points (P, 3) in the world of the meshes that the armature deforms, at rest, or else of its bones."""
    points = []
    for mesh in scene.objects:
        if mesh.type == "MESH" and mesh.data.vertices and mesh.find_armature() == armature:
            coordinates = np.empty(3 * len(mesh.data.vertices), np.float32)
            mesh.data.vertices.foreach_get("co", coordinates)
            points.append(_moved(mesh.matrix_world, coordinates.reshape(-1, 3)))
    if not points:
        ends = [end for bone in armature.data.bones for end in (bone.head_local, bone.tail_local)]
        points.append(_moved(armature.matrix_world, np.array(ends)))
    return np.concatenate(points)


def _to_program(armature: bpy.types.Object, scene: bpy.types.Scene, floor: float) -> Matrix:
    """The matrix from the world of Blender to that of the program, in metres with Y up."""
    stands = armature.matrix_world.translation
    turned = Matrix.Rotation(armature.matrix_world.to_euler("XYZ").z, 4, "Z")
    place = Matrix.Translation((stands.x, stands.y, floor)) @ turned
    return _Y_UP @ Matrix.Scale(scene.unit_settings.scale_length, 4) @ place.inverted()


def _moved(matrix: Matrix, points: Floats) -> Floats:
    moving = np.array(matrix)
    return points @ moving[:3, :3].T + moving[:3, 3]


def _rigid(matrix: Matrix) -> Matrix:
    place, turn, _ = matrix.decompose()
    return Matrix.LocRotScale(place, turn, None)


def key_dance(
    armature: bpy.types.Object, skeleton: Skeleton, tracks: Tracks, first_frame: int, called: str
) -> bpy.types.Action:
    """A new action with a key at each frame of the dance. It is not yet assigned to the armature.

    Raises `DanceError` if the bone of the hips cannot be moved.
    """
    poses = [armature.pose.bones[name] for name in skeleton.names]
    for bone in tracks.translations_m:
        _check_free(poses[bone].bone)
    action = bpy.data.actions.new(called)
    slot = action.slots.new(id_type="OBJECT", name=armature.name)
    bag = action.layers.new("Dance").strips.new(type="KEYFRAME").channelbag(slot, ensure=True)
    frames = first_frame + np.arange(tracks.n_frames)
    for bone, quats in tracks.quats.items():
        if not poses[bone].bone.use_inherit_rotation:
            quats = _without_parent(skeleton, tracks, bone)
        turned = _multiply(_invert(skeleton.quats[bone]), quats)
        _key(bag, poses[bone], *_rotation(poses[bone], turned), frames)
    for bone, translations_m in tracks.translations_m.items():
        moved_m = translations_m - skeleton.translations_m[bone]
        back = np.array(Quaternion(skeleton.quats[bone]).to_matrix())
        _key(bag, poses[bone], "location", moved_m @ back / skeleton.unit_m, frames)
    return action


def _check_free(bone: bpy.types.Bone) -> None:
    if (bone.use_connect and bone.parent) or not bone.use_local_location:
        raise DanceError(
            f"expected {bone.name} free to move: in its Relations, clear Connected and set Local Location"
        )


def _without_parent(skeleton: Skeleton, tracks: Tracks, bone: int) -> Floats:
    """Rotations (T, 4) of a bone that does not inherit rotation, as if its parent stayed at rest."""
    parent = skeleton.parents[bone]
    if parent < 0:
        return tracks.quats[bone]
    turned = _multiply(_world_quat(skeleton, tracks.quats, parent), tracks.quats[bone])
    return _multiply(_invert(_world_quat(skeleton, {}, parent)), turned)


def _world_quat(skeleton: Skeleton, quats: dict[int, Floats], bone: int) -> Floats:
    own, parent = quats.get(bone, skeleton.quats[bone]), skeleton.parents[bone]
    return own if parent < 0 else _multiply(_world_quat(skeleton, quats, parent), own)


def _multiply(a: Floats, b: Floats) -> Floats:
    a_w, a_v, b_w, b_v = a[..., :1], a[..., 1:], b[..., :1], b[..., 1:]
    scalar = a_w * b_w - (a_v * b_v).sum(axis=-1, keepdims=True)
    return np.concatenate([scalar, a_w * b_v + b_w * a_v + np.cross(a_v, b_v)], axis=-1)


def _invert(quat: Floats) -> Floats:
    return quat * [1.0, -1.0, -1.0, -1.0]


def _rotation(pose: bpy.types.PoseBone, quats: Floats) -> tuple[str, Floats]:
    """The property of the rotation mode of a pose bone, and its values (T, C)."""
    if pose.rotation_mode == "QUATERNION":
        return "rotation_quaternion", quats
    turns = [Quaternion(quat) for quat in quats.tolist()]
    if pose.rotation_mode == "AXIS_ANGLE":
        return "rotation_axis_angle", np.array([(turn.angle, *turn.axis) for turn in turns])
    angles = [turns[0].to_euler(pose.rotation_mode)]
    for turn in turns[1:]:
        angles.append(turn.to_euler(pose.rotation_mode, angles[-1]))
    return "rotation_euler", np.array(angles)


def _key(
    bag: bpy.types.ActionChannelbag, pose: bpy.types.PoseBone, channel: str, values: Floats, frames: Floats
) -> None:
    """Key a property of a pose bone with values (T, C)."""
    group = bag.groups.get(pose.name) or bag.groups.new(pose.name)
    linear = bpy.types.Keyframe.bl_rna.properties["interpolation"].enum_items["LINEAR"].value
    for index, of_channel in enumerate(values.T):
        curve = bag.fcurves.new(pose.path_from_id(channel), index=index)
        curve.group = group
        curve.keyframe_points.add(len(frames))
        curve.keyframe_points.foreach_set("co", np.column_stack([frames, of_channel]).astype("f").ravel())
        curve.keyframe_points.foreach_set("interpolation", np.full(len(frames), linear, np.int32))
        curve.update()


def put_on(armature: bpy.types.Object, action: bpy.types.Action) -> None:
    """Assign an action to an armature, from its rest pose."""
    for pose in armature.pose.bones:
        pose.matrix_basis.identity()
    armature.data.pose_position = "POSE"
    animation = armature.animation_data_create()
    animation.action = action
    animation.action_slot = action.slots[0]


def constrained_bones(armature: bpy.types.Object, skeleton: Skeleton, tracks: Tracks) -> list[str]:
    """Animated bones with an active constraint, which may hold them."""
    poses = [armature.pose.bones[skeleton.names[bone]] for bone in tracks.quats]
    return [
        pose.name for pose in poses if any(not each.mute and each.influence > 0 for each in pose.constraints)
    ]
