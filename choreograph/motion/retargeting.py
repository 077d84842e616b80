"""The same dance on another body: rotations carried over, bone directions kept, whatever the rest poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from choreograph.motion import rotations as rot
from choreograph.motion.floor import estimate_floor_m, sole_pos_m
from choreograph.motion.kinematics import forward, to_local
from choreograph.motion.motion import Motion
from choreograph.motion.rigs import joint_roles, rest_pose_is_upright
from choreograph.motion.skeleton import Skeleton

Floats = NDArray[np.float64]

_SHORTEST_BONE_M = 0.01  # a shorter one has no direction to speak of
_BENT = 0.1  # mean sine of a knee's or elbow's bend from which on its axis is known


def share_skeleton(motions: Sequence[Motion]) -> bool:
    """Whether all motions are on one skeleton, so that none needs retargeting."""
    return all(motion.skeleton.same_as(motions[0].skeleton) for motion in motions[1:])


def retarget(motion: Motion, target: Skeleton) -> Motion:
    """The motion on `target`, for rigs whose rest poses and proportions differ.

    Each joint's world rotation is the source's times a constant turn, which is measured on the
    motion: it takes the target's bones, in its rest pose, to where the source's bones are on average
    in the source's joint. What that leaves open, the turn about a single bone, is settled by the axes
    of knees and elbows, elsewhere by having no twist against the parent on average. Bones that are
    alone on their joint are then pointed exactly where the source's point. The hips' path scales with
    the legs, and the soles stand at Y = 0 if the target's rest pose stands, which tells where they are.

    Raises `ParameterError` if the joint names of either skeleton are unknown.
    """
    source_roles, target_roles = joint_roles(motion.skeleton), joint_roles(target)
    pos, quat = forward(motion.skeleton, motion.root_pos_m, motion.local_quat)  # (T, J, 3), (T, J, 4)
    bones = _bones(target, source_roles, target_roles)
    hinges = _hinges(pos, source_roles, target, target_roles)
    world = np.empty((motion.n_frames, target.n_joints, 4))
    played = {target_roles[role]: source_roles[role] for role in target_roles if role in source_roles}
    for joint in range(target.n_joints):
        parent = (
            world[:, target.parents[joint]] if joint else np.broadcast_to(rot.IDENTITY, (motion.n_frames, 4))
        )
        if joint not in played:
            world[:, joint] = parent
            continue
        source = played[joint]
        pairs = [
            (pos[:, bone.source_end] - pos[:, source], bone.rest_m) for bone in bones if bone.joint == joint
        ]
        pairs = [pair for pair in pairs if np.linalg.norm(pair[0], axis=-1).mean() > _SHORTEST_BONE_M]
        world[:, joint] = _carried(quat[:, source], parent, pairs, hinges.get(joint))
    local = rot.make_continuous(to_local(target, world))
    moved = Motion(target, _root(pos, source_roles, target, target_roles, local), local, motion.fps)
    if not rest_pose_is_upright(target):
        return moved
    return moved.moved(shift_m=np.array([0.0, -estimate_floor_m(sole_pos_m(moved)), 0.0]))


@dataclass(frozen=True)
class _Bone:
    """From a joint of the target to the next below it that both rigs have."""

    joint: int  # of the target
    source_end: int  # joint of the source
    rest_m: Floats  # (3,) in the target's rest pose


def _bones(target: Skeleton, source_roles: dict[str, int], target_roles: dict[str, int]) -> list[_Bone]:
    rest = target.rest_pos_m()  # (J, 3)
    shared = {joint: role for role, joint in target_roles.items() if role in source_roles}
    bones = []
    for joint, role in shared.items():
        parent = int(target.parents[joint])
        while parent >= 0 and parent not in shared:
            parent = int(target.parents[parent])
        length = rest[joint] - rest[parent]
        if parent >= 0 and np.linalg.norm(length) > _SHORTEST_BONE_M:
            bones.append(_Bone(parent, source_roles[role], length))
    return bones


def _hinges(
    pos: Floats, source_roles: dict[str, int], target: Skeleton, target_roles: dict[str, int]
) -> dict[int, tuple[Floats, Floats]]:
    """Per target joint, the axis its knee or elbow bends about: (T, 3) in the source's world, not unit
    but as long as the bend's sine, and (3,) in the target's rest pose, read as standing."""
    rest = target.rest_pos_m()
    left = rest[target_roles["left_hip"]] - rest[target_roles["right_hip"]]
    shoulders = (rest[target_roles["left_shoulder"]] + rest[target_roles["right_shoulder"]]) / 2
    front = np.cross(left, shoulders - rest[target_roles["pelvis"]])
    hinges = {}
    for upper, middle, lower in (("hip", "knee", "ankle"), ("shoulder", "elbow", "wrist")):
        for side in ("left", "right"):
            start, bend, end = (source_roles[f"{side}_{part}"] for part in (upper, middle, lower))
            axis = np.cross(_unit(pos[:, bend] - pos[:, start]), _unit(pos[:, end] - pos[:, bend]))  # (T, 3)
            arm = rest[target_roles[f"{side}_{middle}"]] - rest[target_roles[f"{side}_{upper}"]]
            rest_axis = left if upper == "hip" else np.cross(arm, front)  # knees bend back, elbows forward
            if np.linalg.norm(axis, axis=-1).mean() > _BENT and np.linalg.norm(rest_axis) > 0:
                hinges[target_roles[f"{side}_{upper}"]] = hinges[target_roles[f"{side}_{middle}"]] = (
                    axis,
                    _unit(rest_axis),
                )
    return hinges


def _carried(
    quat: Floats, parent: Floats, pairs: list[tuple[Floats, Floats]], hinge: tuple[Floats, Floats] | None
) -> Floats:
    """World rotations (T, 4) of a target joint from the source joint's `quat` (T, 4) and its bones.

    `pairs`: a bone in the world (T, 3) and in the target's rest pose (3,), for each bone.
    """
    if not pairs:  # the end of a limb: nothing says how it is turned but its average against its parent
        return rot.multiply(quat, _mean(rot.multiply(rot.invert(quat), parent)))
    inward = rot.invert(quat)
    seen = [_unit(rot.rotate(inward, world).mean(axis=0)) for world, _ in pairs]  # (3,) each, in the joint
    rest = [_unit(bone) for _, bone in pairs]
    if len(pairs) > 1:
        turn = _aligned(rest, seen)
        return rot.multiply(quat, turn)
    if hinge is not None:
        axis = rot.rotate(inward, hinge[0]).mean(axis=0)
        turn = _aligned([*rest, hinge[1]], [*seen, _unit(axis)], weights=[np.inf, 1.0])
    else:
        turn = rot.between(rest[0], seen[0])
        turned = _mean(rot.multiply(rot.invert(parent), rot.multiply(quat, turn)))
        twist = rot.normalize(np.append(turned[0], rest[0] * (turned[1:] @ rest[0])))
        turn = rot.multiply(turn, rot.invert(twist))
    world = rot.multiply(quat, turn)  # (T, 4)
    return rot.multiply(rot.between(rot.rotate(world, rest[0]), pairs[0][0]), world)


def _root(
    pos: Floats, source_roles: dict[str, int], target: Skeleton, target_roles: dict[str, int], local: Floats
) -> Floats:
    """Root positions (T, 3) that put the middle of the hips where the source's is, scaled by the legs."""
    rest = target.rest_pos_m()[None]
    scale = _leg_m(rest, target_roles) / _leg_m(pos, source_roles)
    still = forward(target, np.zeros((len(pos), 3)), local)[0]
    return scale * _hip_middle(pos, source_roles) - _hip_middle(still, target_roles)


def _hip_middle(pos: Floats, roles: dict[str, int]) -> Floats:
    return (pos[:, roles["left_hip"]] + pos[:, roles["right_hip"]]) / 2


def _leg_m(pos: Floats, roles: dict[str, int]) -> float:
    """Mean length of both legs, hip to ankle along the bones."""
    chain = [[roles[f"{side}_{part}"] for part in ("hip", "knee", "ankle")] for side in ("left", "right")]
    return float(np.linalg.norm(np.diff(pos[:, chain], axis=2), axis=-1).sum(axis=-1).mean())


def _unit(vector: Floats) -> Floats:
    return vector / np.maximum(np.linalg.norm(vector, axis=-1, keepdims=True), 1e-12)


def _mean(quat: Floats) -> Floats:
    """Mean rotation (4,) of rotations (T, 4)."""
    return Rotation.from_quat(quat, scalar_first=True).mean().as_quat(scalar_first=True)


def _aligned(source: list[Floats], target: list[Floats], weights: list[float] | None = None) -> Floats:
    """The turn (4,) that takes directions `source` nearest to `target`."""
    turn, _ = Rotation.align_vectors(np.array(target), np.array(source), weights=weights)
    return turn.as_quat(scalar_first=True)
