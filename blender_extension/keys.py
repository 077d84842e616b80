# SPDX-License-Identifier: GPL-3.0-or-later
"""Keys of pose bones: a new action, and the curves of the location and rotation of bones in it."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Quaternion

from .errors import DanceError
from .glb import Floats

_TYPES = bpy.types.Keyframe.bl_rna.properties["interpolation"].enum_items


@dataclass(frozen=True)
class PoseKeys:
    """The keys of a bone from its rest pose."""

    name: str
    quats: Floats | None  # (T, 4)
    places: Floats | None  # (T, 3) in the units of the armature


def new_action(
    armature: bpy.types.Object, called: str
) -> tuple[bpy.types.Action, bpy.types.ActionChannelbag]:
    """An action for an armature, not yet assigned to it, and the bag of its curves."""
    action = bpy.data.actions.new(called)
    slot = action.slots.new(id_type="OBJECT", name=armature.name)
    return action, action.layers.new("Dance").strips.new(type="KEYFRAME").channelbag(slot, ensure=True)


def check_free(bone: bpy.types.Bone) -> None:
    """Raise `DanceError` if a bone cannot have keys of its location."""
    if (bone.use_connect and bone.parent) or not bone.use_local_location:
        raise DanceError(
            f"expected {bone.name} free to move: in its Relations, clear Connected and set Local Location"
        )


def key_poses(
    bag: bpy.types.ActionChannelbag, armature: bpy.types.Object, keys: list[PoseKeys], frames: Floats
) -> None:
    """Key the rotations of bones, in the mode of rotation of each, and their locations."""
    for keyed in keys:
        pose = armature.pose.bones[keyed.name]
        if keyed.quats is not None:
            channel, values = _rotation(pose, keyed.quats)
            key(bag, pose, pose.path_from_id(channel), values, frames)
        if keyed.places is not None:
            key(bag, pose, pose.path_from_id("location"), keyed.places, frames)


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


def key(
    bag: bpy.types.ActionChannelbag, pose: bpy.types.PoseBone, path: str, values: Floats, frames: Floats
) -> None:
    """Key the property of a pose bone at a path with values (T, C)."""
    group = bag.groups.get(pose.name) or bag.groups.new(pose.name)
    linear = _TYPES["LINEAR"].value
    for index, of_channel in enumerate(values.T):
        curve = bag.fcurves.new(path, index=index)
        curve.group = group
        curve.keyframe_points.add(len(frames))
        curve.keyframe_points.foreach_set("co", np.column_stack([frames, of_channel]).astype("f").ravel())
        curve.keyframe_points.foreach_set("interpolation", np.full(len(frames), linear, np.int32))
        curve.update()


def multiply(a: Floats, b: Floats) -> Floats:
    a_w, a_v, b_w, b_v = a[..., :1], a[..., 1:], b[..., :1], b[..., 1:]
    scalar = a_w * b_w - (a_v * b_v).sum(axis=-1, keepdims=True)
    return np.concatenate([scalar, a_w * b_v + b_w * a_v + np.cross(a_v, b_v)], axis=-1)


def invert(quat: Floats) -> Floats:
    return quat * [1.0, -1.0, -1.0, -1.0]
