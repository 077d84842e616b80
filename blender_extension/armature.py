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
from .keys import PoseKeys, check_free, invert, key_poses, multiply, new_action
from .rigify import control_keys, is_generated, key_settings, original_bones

_Y_UP = Matrix(((1, 0, 0, 0), (0, 0, 1, 0), (0, -1, 0, 0), (0, 0, 0, 1)))  # from Blender's Z up
_SAME_SCALE = 1e-3


def skeleton_of(armature: bpy.types.Object, scene: bpy.types.Scene) -> Skeleton:
    """The bones of an armature object at rest. Those of a rig that Rigify generated are its ORG bones.

    Raises `DanceError` if it is in Edit Mode, empty, or scaled unevenly.
    """
    if armature.mode == "EDIT" or not armature.data.bones:
        raise DanceError(f"{armature.name}: expected an armature with bones that is not in Edit Mode")
    scale = armature.matrix_world.to_scale()
    if armature.matrix_world.determinant() <= 0 or max(scale) - min(scale) > _SAME_SCALE * max(scale):
        raise DanceError(
            f"expected one scale in all directions, got {armature.name} scaled by "
            f"{', '.join(f'{factor:g}' for factor in scale)}: apply it (Ctrl A)"
        )
    bones, parents = original_bones(armature) if is_generated(armature) else _all_bones(armature)
    points = _points_of_body(armature, bones, scene)  # (P, 3)
    to_program = _to_program(armature, scene, float(points[:, 2].min()))
    of_armature = to_program @ armature.matrix_world
    world = [_rigid(of_armature @ bone.matrix_local) for bone in bones]
    local = [
        own if parent < 0 else world[parent].inverted() @ own
        for own, parent in zip(world, parents, strict=True)
    ]
    moved = _moved(to_program, points)
    return Skeleton(
        names=tuple(bone.name for bone in bones),
        parents=tuple(parents),
        translations_m=np.array([matrix.translation for matrix in local]),
        quats=np.array([matrix.to_quaternion() for matrix in local]),
        world=np.array(world),
        unit_m=of_armature.median_scale,
        corners_m=np.array([moved.min(axis=0), moved.max(axis=0)]),
    )


def _all_bones(armature: bpy.types.Object) -> tuple[list[bpy.types.Bone], list[int]]:
    """The bones of an armature, and the index of the parent of each, -1 for a root."""
    bones = [*armature.data.bones]
    index = {bone.name: number for number, bone in enumerate(bones)}
    return bones, [index[bone.parent.name] if bone.parent else -1 for bone in bones]


def _points_of_body(
    armature: bpy.types.Object, bones: list[bpy.types.Bone], scene: bpy.types.Scene
) -> Floats:
    """Points (P, 3) in the world of the meshes that the armature deforms, at rest, or else of its bones."""
    points = []
    for mesh in scene.objects:
        if mesh.type == "MESH" and mesh.data.vertices and mesh.find_armature() == armature:
            coordinates = np.empty(3 * len(mesh.data.vertices), np.float32)
            mesh.data.vertices.foreach_get("co", coordinates)
            points.append(_moved(mesh.matrix_world, coordinates.reshape(-1, 3)))
    if not points:
        ends = [end for bone in bones for end in (bone.head_local, bone.tail_local)]
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

    Raises `DanceError` if the bone of the hips cannot be moved, or a generated rig lacks an FK control.
    """
    frames = first_frame + np.arange(tracks.n_frames)
    generated = is_generated(armature)
    keys = (control_keys if generated else _bone_keys)(armature, skeleton, tracks)
    action, bag = new_action(armature, called)
    key_poses(bag, armature, keys, frames)
    if generated:
        key_settings(bag, armature, first_frame)
    return action


def _bone_keys(armature: bpy.types.Object, skeleton: Skeleton, tracks: Tracks) -> list[PoseKeys]:
    """The keys of the bones of the dance."""
    poses = [armature.pose.bones[name] for name in skeleton.names]
    turned, moved = {}, {}
    for bone in tracks.translations_m:
        check_free(poses[bone].bone)
    for bone, quats in tracks.quats.items():
        if not poses[bone].bone.use_inherit_rotation:
            quats = _without_parent(skeleton, tracks, bone)
        turned[bone] = multiply(invert(skeleton.quats[bone]), quats)
    for bone, translations_m in tracks.translations_m.items():
        moved_m = translations_m - skeleton.translations_m[bone]
        back = np.array(Quaternion(skeleton.quats[bone]).to_matrix())
        moved[bone] = moved_m @ back / skeleton.unit_m
    return [PoseKeys(skeleton.names[bone], turned.get(bone), moved.get(bone)) for bone in {**turned, **moved}]


def _without_parent(skeleton: Skeleton, tracks: Tracks, bone: int) -> Floats:
    """Rotations (T, 4) of a bone that does not inherit rotation, as if its parent stayed at rest."""
    parent = skeleton.parents[bone]
    if parent < 0:
        return tracks.quats[bone]
    turned = multiply(_world_quat(skeleton, tracks.quats, parent), tracks.quats[bone])
    return multiply(invert(_world_quat(skeleton, {}, parent)), turned)


def _world_quat(skeleton: Skeleton, quats: dict[int, Floats], bone: int) -> Floats:
    own, parent = quats.get(bone, skeleton.quats[bone]), skeleton.parents[bone]
    return own if parent < 0 else multiply(_world_quat(skeleton, quats, parent), own)


def put_on(armature: bpy.types.Object, action: bpy.types.Action) -> None:
    """Assign an action to an armature, from its rest pose."""
    for pose in armature.pose.bones:
        pose.matrix_basis.identity()
    armature.data.pose_position = "POSE"
    animation = armature.animation_data_create()
    animation.action = action
    animation.action_slot = action.slots[0]


def constrained_bones(armature: bpy.types.Object, action: bpy.types.Action) -> list[str]:
    """Bones with keys in the action and an active constraint, which may hold them."""
    (bag,) = action.layers[0].strips[0].channelbags
    poses = [armature.pose.bones[group.name] for group in bag.groups]
    return [
        pose.name for pose in poses if any(not each.mute and each.influence > 0 for each in pose.constraints)
    ]
