# SPDX-License-Identifier: GPL-3.0-or-later
"""Rigs that Rigify generated: the body is read from their ORG bones, and their FK controls are keyed.

A control moves as its ORG bone, relative to what moves its parent. The control `torso` has the travel of the
dance and the rotation of the hips. The controls `root`, `hips` and `chest`, tweaks and IK controls have no
keys and rest, so that the whole dance can be moved with `root`.
"""

from __future__ import annotations

import re

import bpy
import numpy as np
from mathutils import Matrix

from .errors import DanceError
from .glb import Floats, Skeleton, Tracks
from .keys import PoseKeys, check_free, key

_ORIGINAL, _DEFORMING, _HELPING = "ORG-", "DEF-", "MCH-"
_TORSO, _BY_PLACE = "torso", ("neck", "head")
_WITHOUT_CONTROL = "palm"  # these bones rest in the hand
_SUFFIX = re.compile(r"(?:\.\d{1,5})?(?:[._-][LR])?(?:\.\d{1,5})?$", re.IGNORECASE)
# Custom properties that have a key at the first frame. Limbs follow their FK controls, which rotate with
# the bone above, as neck and head do. The torso follows the root.
_SETTINGS = {
    "IK_FK": 1.0, "FK_limb_follow": 0.0, "neck_follow": 1.0, "head_follow": 1.0, "torso_parent": 1.0,
}  # fmt: skip
_OF_LIMBS = "FK_limb_follow"  # tentacles have IK_FK as well, but not this
_SAME_PLACE, _SAME_TURN_RAD = 1e-3, 0.01
_LEAST_TURN_RAD = 1e-4  # a control without a larger rotation has no keys of it
_SHORTEST_M = 1e-4  # a control without a farther displacement has no keys of its location


def is_generated(armature: bpy.types.Object) -> bool:
    """Whether Rigify generated a rig, by its mark or the prefixes of deforming, original and helper bones."""
    names = armature.data.bones.keys()
    return "rig_id" in armature.data or all(
        any(name.startswith(prefix) for name in names) for prefix in (_ORIGINAL, _DEFORMING, _HELPING)
    )


def original_bones(armature: bpy.types.Object) -> tuple[list[bpy.types.Bone], list[int]]:
    """The ORG bones of the body that deforming bones follow, parents first, and the index of each parent.

    Raises `DanceError` if there are none.
    """
    bones = armature.data.bones
    parts = {
        bone.name.removeprefix(_ORIGINAL)
        for bone in bones
        if bone.name.startswith(_ORIGINAL) and _DEFORMING + bone.name.removeprefix(_ORIGINAL) in bones
    }
    parts = {part for part in parts if not part.lower().startswith(_WITHOUT_CONTROL)}
    above = {part: _part_above(bones[_DEFORMING + part], part, parts) for part in parts}
    paths = {part: _path(part, above) for part in parts}
    roots = [path[0] for path in paths.values()]
    if not roots:
        raise DanceError(
            f"{armature.name}: expected ORG and DEF bones, as Rigify makes them, found none: use its metarig"
        )
    root = max(sorted(set(roots)), key=roots.count)
    body = sorted((len(path), part) for part, path in paths.items() if path[0] == root)
    index = {part: number for number, (_, part) in enumerate(body)}
    parents = [index[above[part]] if above[part] else -1 for part in index]
    return [bones[_ORIGINAL + part] for part in index], parents


def _part_above(bone: bpy.types.Bone, part: str, parts: set[str]) -> str:
    """The part that a deforming bone of another part follows, "" for a root."""
    for parent in bone.parent_recursive:
        for prefix in (_ORIGINAL, _DEFORMING):
            found = parent.name.removeprefix(prefix)
            if parent.name.startswith(prefix) and found in parts and found != part:
                return found
    return ""


def _path(part: str, above: dict[str, str]) -> list[str]:
    """The parts from the root to a part."""
    path = [part]
    while above[path[-1]]:
        path.append(above[path[-1]])
        if len(path) > len(above):
            raise DanceError(
                f"expected bones in a tree, got {_DEFORMING}{part} in a loop: generate the rig again"
            )
    return path[::-1]


def control_keys(armature: bpy.types.Object, skeleton: Skeleton, tracks: Tracks) -> list[PoseKeys]:
    """The keys of the FK controls that a dance of the ORG bones moves.

    Raises `DanceError` if a bone of the dance has no FK control, or the torso cannot be moved.
    """
    bones = armature.data.bones
    controls = _controls(armature, skeleton, tracks)  # name -> ORG bone
    moves = _moves(skeleton, tracks)  # (B, T, 4, 4)
    carried = {name: moves[bone] for bone, name in enumerate(skeleton.names)}
    carried |= {_DEFORMING + name.removeprefix(_ORIGINAL): move for name, move in carried.items()}
    carried |= {name: moves[bone] for name, bone in controls.items()}
    hips = skeleton.parents.index(-1)
    rests = {name: _rest(armature, skeleton, bone, bones[name]) for name, bone in controls.items()}
    rests[_TORSO] = _rest(armature, skeleton, hips, bones[_TORSO])
    carried[_TORSO] = moves[hips]
    pivot = next((name for name in controls if _carrier(bones[name], carried) == _TORSO), None)
    if pivot is not None:
        carried[_TORSO] = _about(moves[hips], rests[pivot][:3, 3], carried[pivot])
    keys = [
        _keys(bones[name], rests[name], carried[name], carried, skeleton.unit_m)
        for name in (_TORSO, *controls)
    ]
    return [each for each in keys if each.places is not None or not _rests(each.quats)]


def _controls(armature: bpy.types.Object, skeleton: Skeleton, tracks: Tracks) -> dict[str, int]:
    """The ORG bone of each FK control that the dance needs."""
    bones = armature.data.bones
    if _TORSO not in bones:
        raise DanceError(f"{armature.name}: expected the control {_TORSO}, found none: use its metarig")
    found = {}
    for bone, quats in tracks.quats.items():
        name = skeleton.names[bone]
        control = _control(bones, bones[name])
        if control:
            found[control] = bone
        elif np.abs((quats * skeleton.quats[bone]).sum(axis=-1)).min() < np.cos(_SAME_TURN_RAD / 2):
            raise DanceError(
                f"{armature.name}: expected an FK control for {name}, found none: "
                "switch FK Controls on in the metarig and generate the rig again, or use the metarig"
            )
    return found


def _control(bones: bpy.types.ArmatureBones, original: bpy.types.Bone) -> str:
    """The name of the FK control of an ORG bone, "" without one."""
    part = original.name.removeprefix(_ORIGINAL)
    base = part[: _SUFFIX.search(part).start()]
    for name in (f"{base}_fk{part[len(base) :]}", part):
        if name in bones:
            return name
    for name in _BY_PLACE:
        if name in bones:
            apart = (bones[name].head_local - original.head_local).length
            if apart < _SAME_PLACE * bones[name].length:
                return name
    return ""


def _moves(skeleton: Skeleton, tracks: Tracks) -> list[Floats]:
    """The matrices (T, 4, 4) of each bone from its rest pose to the dance, in the world."""
    worlds: list[Floats] = []
    for bone, parent in enumerate(skeleton.parents):
        quats = tracks.quats.get(bone, skeleton.quats[bone][None])
        places_m = tracks.translations_m.get(bone, skeleton.translations_m[bone][None])
        own = np.tile(np.eye(4), (tracks.n_frames, 1, 1))
        own[:, :3, :3], own[:, :3, 3] = _rotations(quats), places_m
        worlds.append(own if parent < 0 else worlds[parent] @ own)
    return [world @ np.linalg.inv(rest) for world, rest in zip(worlds, skeleton.world, strict=True)]


def _rotations(quats: Floats) -> Floats:
    """Rotation matrices (T, 3, 3) of quaternions (T, 4)."""
    w, x, y, z = (quats / np.linalg.norm(quats, axis=-1, keepdims=True)).T
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return np.moveaxis(np.array(rows), -1, 0)


def _rest(armature: bpy.types.Object, skeleton: Skeleton, bone: int, control: bpy.types.Bone) -> Floats:
    """The rest pose (4, 4) of a control in the world of the program, from that of an ORG bone."""
    original = armature.data.bones[skeleton.names[bone]]
    offset = np.array(original.matrix_local.inverted() @ control.matrix_local)
    offset[:3, 3] *= skeleton.unit_m
    return skeleton.world[bone] @ offset


def _carrier(bone: bpy.types.Bone, carried: dict[str, Floats]) -> str:
    """The nearest bone above whose motion is known. The root, which rests, is ""."""
    return next((parent.name for parent in bone.parent_recursive if parent.name in carried), "")


def _about(turned: Floats, point_m: Floats, followed: Floats) -> Floats:
    """Matrices (T, 4, 4) with the rotation of `turned` that move a point as `followed` does."""
    moves = turned.copy()
    goal_m = followed[:, :3, :3] @ point_m + followed[:, :3, 3]
    moves[:, :3, 3] = goal_m - turned[:, :3, :3] @ point_m
    return moves


def _keys(
    control: bpy.types.Bone, rest: Floats, move: Floats, carried: dict[str, Floats], unit_m: float
) -> PoseKeys:
    above = carried.get(_carrier(control, carried), np.eye(4)[None])
    if not control.use_inherit_rotation:
        above = _about(np.eye(4)[None].repeat(len(above), axis=0), rest[:3, 3], above)
    basis = np.linalg.inv(rest) @ np.linalg.inv(above) @ move @ rest  # (T, 4, 4)
    moved_m = basis[:, :3, 3]
    quats = np.array([[*Matrix(matrix).to_quaternion()] for matrix in basis[:, :3, :3].tolist()])
    if control.name != _TORSO and np.linalg.norm(moved_m, axis=-1).max() < _SHORTEST_M:
        return PoseKeys(control.name, _continuous(quats), None)
    check_free(control)
    return PoseKeys(control.name, _continuous(quats), moved_m / unit_m)


def _rests(quats: Floats) -> bool:
    """Whether rotations (T, 4) are none in all frames, as of controls of a face."""
    return bool(np.abs(quats[:, 0]).min() > np.cos(_LEAST_TURN_RAD / 2))


def _continuous(quats: Floats) -> Floats:
    """The same rotations (T, 4), each with the sign that is nearer to the one before."""
    flips = np.where((quats[1:] * quats[:-1]).sum(axis=-1) < 0.0, -1.0, 1.0)
    return quats * np.concatenate([[1.0], np.cumprod(flips)])[:, None]


def key_settings(bag: bpy.types.ActionChannelbag, armature: bpy.types.Object, frame: int) -> None:
    """Key at a frame the properties that let the body follow its FK controls."""
    for pose in armature.pose.bones:
        for name, value in _SETTINGS.items():
            if name in pose and (name != "IK_FK" or _OF_LIMBS in pose):
                key(bag, pose, f'{pose.path_from_id()}["{name}"]', np.array([[value]]), np.array([frame]))
