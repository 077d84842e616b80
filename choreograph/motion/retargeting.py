"""Retargeting of a motion to another skeleton, and the pose in which a skeleton stands.

`retarget` works by the directions of bones, for any rest poses and proportions. `standing_body` gives a
skeleton of any rest pose in its bind pose, upright, with the measures that the mannequin and writers need.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import scipy

from choreograph.core.numerics import Floats
from choreograph.motion import rotations as rot
from choreograph.motion.bone_map import joint_roles, rest_pose_is_upright
from choreograph.motion.contacts import estimate_floor_m, sole_pos_m
from choreograph.motion.kinematics import forward, to_local
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import CANONICAL_JOINTS, CANONICAL_PARENTS, Skeleton, canonical_skeleton

_SHORTEST_BONE_M = 0.01  # shorter bones have no reliable direction, and no body is so small
_TRUNK = ("spine1", "spine2", "spine3", "neck", "head")
_NEUTRAL_RAD = 0.8  # largest bend of a joint in a rest pose, and largest mean turn in a motion
_LEVEL = 0.5  # least share of a foot's length, ankle to ball, that is level when it stands flat
_BENT = 0.1  # mean sine of the bend of knee or elbow above which its axis is reliable


def retarget(motion: Motion, target: Skeleton) -> Motion:
    """The motion on `target`, for rigs whose rest poses and proportions differ.

    The world rotation of each joint is that of the source joint times a constant offset, which is estimated
    from the motion. The offset aligns the rest-pose bones of the target with the mean bone directions of the
    source in the frame of the joint. For a joint with a single bone, this leaves the twist open. It is
    determined by the bend axes of knees and elbows. Elsewhere the mean twist relative to the parent is set to
    zero. Single bones are then pointed exactly in the direction of the source.

    Spine, neck and head rotate with those of the source where its rest pose is straight, because necks lean
    forward in one rig and are upright in another, so that the direction of the gaze does not follow from
    bones. Feet rotate with those of the source if both rest poses stand, because the height of the ankle over
    the sole differs between rigs.

    The path of the hips is scaled by leg length. If the target's rest pose is upright, its soles are known
    and are put on Y = 0. If the source's rest pose is upright too, the soles get the height that the source's
    soles have over its floor most of the time. On a skeleton that only differs in the order of its joints,
    the motion does not change.

    Raises `ParameterError` if the joint names of either skeleton are unknown.
    """
    order = motion.skeleton.order_of(target)
    if order is not None:
        return replace(motion, skeleton=target, local_quat=motion.local_quat[:, order])
    source_roles, target_roles = joint_roles(motion.skeleton), joint_roles(target)
    pos, quat = forward(motion.skeleton, motion.root_pos_m, motion.local_quat)  # (T, J, 3), (T, J, 4)
    bones = _bones(target, source_roles, target_roles)
    hinges = _hinge_axes(pos, source_roles, target, target_roles)
    trunk = _neutral_trunk(motion.skeleton, source_roles, quat, target, target_roles)
    turning = _feet(motion.skeleton, source_roles, quat, target, target_roles)
    spine: dict[int, tuple[tuple[int | None, int], float]] = {}
    trunk_turn = rot.IDENTITY
    if trunk is not None:
        trunk_turn = trunk.turn
        turning = dict.fromkeys(trunk.joints, trunk_turn) | turning
        spine = _spread_spine(source_roles, target_roles)
    world = np.empty((motion.n_frames, target.n_joints, 4))
    source_of = {target_roles[role]: source_roles[role] for role in target_roles if role in source_roles}
    for joint in range(target.n_joints):
        parent = (
            world[:, target.parents[joint]] if joint else np.broadcast_to(rot.IDENTITY, (motion.n_frames, 4))
        )
        if joint in spine:
            (below, above), share = spine[joint]
            upper = rot.multiply(quat[:, above], trunk_turn)
            lower = (
                world[:, target_roles["pelvis"]]
                if below is None
                else rot.multiply(quat[:, below], trunk_turn)
            )
            world[:, joint] = rot.slerp(lower, upper, share)
            continue
        if joint not in source_of:
            world[:, joint] = parent
            continue
        source = source_of[joint]
        if joint in turning:
            world[:, joint] = rot.multiply(quat[:, source], turning[joint])
            continue
        pairs = [
            (pos[:, bone.source_end] - pos[:, source], bone.rest_m) for bone in bones if bone.joint == joint
        ]
        pairs = [pair for pair in pairs if np.linalg.norm(pair[0], axis=-1).mean() > _SHORTEST_BONE_M]
        world[:, joint] = _target_rotation(quat[:, source], parent, pairs, hinges.get(joint))
    local = rot.make_continuous(to_local(target, world))
    root_pos_m = _root_pos_m(pos, source_roles, target, target_roles, local)
    retargeted = Motion(target, root_pos_m, local, motion.fps)
    if not rest_pose_is_upright(target):
        return retargeted
    floor_m = estimate_floor_m(sole_pos_m(retargeted))
    if rest_pose_is_upright(motion.skeleton):  # longer feet would sink on tiptoe
        scale = _leg_m(target.rest_pos_m()[None], target_roles) / _leg_m(pos, source_roles)
        sole_m, own_m = (sole_pos_m(each)[..., 1].min(axis=1) for each in (motion, retargeted))  # (T,)
        floor_m = float(np.median(own_m - scale * (sole_m - estimate_floor_m(sole_pos_m(motion)))))
    return retargeted.moved(shift_m=np.array([0.0, -floor_m, 0.0]))


@dataclass(frozen=True)
class _Bone:
    """A bone from a joint of the target to its next descendant that both rigs have."""

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


@dataclass(frozen=True)
class _Trunk:
    """Joints of the target that rotate with those of the source, and the rotation between their axes."""

    joints: set[int]
    turn: Floats  # (4,)


def _neutral_trunk(
    skeleton: Skeleton, roles: dict[str, int], quat: Floats, target: Skeleton, target_roles: dict[str, int]
) -> _Trunk | None:
    """Spine, neck and head of the target, with pelvis and collars if both rest poses are upright.

    None if a rest pose is bent there, or if the axes of the source differ from joint to joint. The neutral
    pose is then unknown.
    """
    chain = [role for role in _TRUNK if role in roles and role in target_roles]
    if not {"spine1", "neck"} <= set(chain):
        return None
    target_axes, axes = (_trunk_axes(*rig, chain) for rig in ((target, target_roles), (skeleton, roles)))
    if target_axes is None or axes is None:
        return None
    if not all(_is_neutral(quat, roles[lower], roles[upper]) for lower, upper in pairwise(chain)):
        return None
    trunk = set(chain)
    if rest_pose_is_upright(skeleton) and rest_pose_is_upright(target):
        chest = [role for role in chain if role.startswith("spine")][-1]
        beside = {"pelvis": "spine1", "left_collar": chest, "right_collar": chest}
        trunk |= {
            role
            for role, next_to in beside.items()
            if role in roles and role in target_roles and _is_neutral(quat, roles[next_to], roles[role])
        }
    turn = _alignment(target_axes, axes, weights=[np.inf, 1.0])
    return _Trunk({target_roles[role] for role in trunk}, turn)


def _trunk_axes(skeleton: Skeleton, roles: dict[str, int], chain: list[str]) -> list[Floats] | None:
    """Up and left (3,) of the trunk in the rest pose, or None if it is bent or has no width."""
    rest = skeleton.rest_pos_m()
    bones = np.diff(rest[[roles[role] for role in chain]], axis=0)
    across = "collar" if {"left_collar", "right_collar"} <= roles.keys() else "shoulder"
    up = _unit(rest[roles["neck"]] - rest[roles["spine1"]])
    left = rest[roles[f"left_{across}"]] - rest[roles[f"right_{across}"]]
    left = left - up * (left @ up)
    bent = bones @ up < np.cos(_NEUTRAL_RAD) * np.linalg.norm(bones, axis=-1) - _SHORTEST_BONE_M
    if bent.any() or np.linalg.norm(left) < _SHORTEST_BONE_M:
        return None
    return [up, _unit(left)]


def _is_neutral(quat: Floats, first: int, second: int) -> bool:
    """Whether two joints have on average the same rotation, as in the rest pose."""
    relative = rot.multiply(rot.invert(quat[:, first]), quat[:, second])
    return bool(np.linalg.norm(rot.to_rotvec(_mean_rotation(relative))) < _NEUTRAL_RAD)


def _spread_spine(
    source_roles: dict[str, int], target_roles: dict[str, int]
) -> dict[int, tuple[tuple[int | None, int], float]]:
    """For each spine joint of the target, the two source joints that it lies between, and its place there.

    None is the pelvis. Both spines reach from it to the joint where the arms meet.
    """
    own, others = (
        [roles[role] for role in _TRUNK[:3] if role in roles] for roles in (target_roles, source_roles)
    )
    spread: dict[int, tuple[tuple[int | None, int], float]] = {}
    if len(own) != len(others) and 1 in (len(own), len(others)):
        for place, joint in enumerate(own, start=1):
            height = place * len(others) / len(own)
            above = int(np.ceil(height)) - 1
            spread[joint] = (others[above - 1] if above else None, others[above]), height - above
    return spread


def _feet(
    skeleton: Skeleton, roles: dict[str, int], quat: Floats, target: Skeleton, target_roles: dict[str, int]
) -> dict[int, Floats]:
    """Ankles and balls of the target's feet, each with the rotation (4,) from the source's world rotations.

    A foot is left out if it does not stand in both rest poses, or if its joints have rotations there that
    they do not have in the motion.
    """
    turning: dict[int, Floats] = {}
    if not (rest_pose_is_upright(skeleton) and rest_pose_is_upright(target)):
        return turning
    for side in ("left", "right"):
        ankle, ball = f"{side}_ankle", f"{side}_foot"
        headings = [_heading_of_foot(s, r, side) for s, r in ((target, target_roles), (skeleton, roles))]
        up = rot.rotate(quat[:, roles[ankle]], np.array([0.0, 1.0, 0.0])).mean(axis=0)
        neutral = up[1] > np.cos(_NEUTRAL_RAD)
        if ball in roles:
            neutral &= _is_neutral(quat, roles[ankle], roles[ball])
        if neutral and np.isfinite(headings).all():
            turn = rot.about_y(headings[1] - headings[0])
            turning |= {target_roles[name]: turn for name in (ankle, ball) if name in target_roles}
    return turning


def _heading_of_foot(skeleton: Skeleton, roles: dict[str, int], side: str) -> float:
    """Direction of a foot in the rest pose, radians from +Z about Y. Without toes, it is that of the hips.

    It is nan for a foot that does not stand there.
    """
    rest = skeleton.rest_pos_m()
    if f"{side}_foot" in roles:
        ahead = rest[roles[f"{side}_foot"]] - rest[roles[f"{side}_ankle"]]
        if np.hypot(ahead[0], ahead[2]) <= _LEVEL * np.linalg.norm(ahead):
            return float("nan")
    else:
        ahead = np.cross(rest[roles["left_hip"]] - rest[roles["right_hip"]], np.array([0.0, 1.0, 0.0]))
    return float(np.arctan2(ahead[0], ahead[2]))


def _hinge_axes(
    pos: Floats, source_roles: dict[str, int], target: Skeleton, target_roles: dict[str, int]
) -> dict[int, tuple[Floats, Floats]]:
    """For each target joint, the bend axis of its knee or elbow.

    The axis is given in the world of the source (T, 3), with the sine of the bend as its length, and in the
    rest pose of the target (3,), as if it stood.
    """
    rest = target.rest_pos_m()
    left = rest[target_roles["left_hip"]] - rest[target_roles["right_hip"]]
    shoulders = (rest[target_roles["left_shoulder"]] + rest[target_roles["right_shoulder"]]) / 2
    front = np.cross(left, shoulders - rest[target_roles["pelvis"]])
    hinges = {}
    for upper, middle, lower in (("hip", "knee", "ankle"), ("shoulder", "elbow", "wrist")):
        for side in ("left", "right"):
            start, joint, end = (source_roles[f"{side}_{part}"] for part in (upper, middle, lower))
            axis = np.cross(
                _unit(pos[:, joint] - pos[:, start]), _unit(pos[:, end] - pos[:, joint])
            )  # (T, 3)
            bone = rest[target_roles[f"{side}_{middle}"]] - rest[target_roles[f"{side}_{upper}"]]
            rest_axis = left if upper == "hip" else np.cross(bone, front)  # knees bend back, elbows forward
            if np.linalg.norm(axis, axis=-1).mean() > _BENT and np.linalg.norm(rest_axis) > 0:
                hinges[target_roles[f"{side}_{upper}"]] = hinges[target_roles[f"{side}_{middle}"]] = (
                    axis,
                    _unit(rest_axis),
                )
    return hinges


def _target_rotation(
    quat: Floats, parent: Floats, pairs: list[tuple[Floats, Floats]], hinge: tuple[Floats, Floats] | None
) -> Floats:
    """World rotations (T, 4) of a target joint from the source joint's `quat` (T, 4) and its bones.

    `pairs` holds for each bone the source's in the world (T, 3) and the target's in its rest pose (3,).
    """
    if not pairs:  # the end of a limb, of which only the mean rotation relative to its parent is known
        return rot.multiply(quat, _mean_rotation(rot.multiply(rot.invert(quat), parent)))
    to_joint = rot.invert(quat)
    mean = [
        _unit(rot.rotate(to_joint, world).mean(axis=0)) for world, _ in pairs
    ]  # (3,) in the joint's frame
    rest = [_unit(bone) for _, bone in pairs]
    if len(pairs) > 1:
        return rot.multiply(quat, _alignment(rest, mean))
    if hinge is not None:
        axis = rot.rotate(to_joint, hinge[0]).mean(axis=0)
        offset = _alignment([*rest, hinge[1]], [*mean, _unit(axis)], weights=[np.inf, 1.0])
    else:
        swing = rot.between(rest[0], mean[0])
        local = _mean_rotation(rot.multiply(rot.invert(parent), rot.multiply(quat, swing)))
        twist = rot.normalize(np.append(local[0], rest[0] * (local[1:] @ rest[0])))
        offset = rot.multiply(swing, rot.invert(twist))
    world = rot.multiply(quat, offset)  # (T, 4)
    return rot.multiply(rot.between(rot.rotate(world, rest[0]), pairs[0][0]), world)


def _root_pos_m(
    pos: Floats, source_roles: dict[str, int], target: Skeleton, target_roles: dict[str, int], local: Floats
) -> Floats:
    """Root positions (T, 3) that put the middle of the hips at that of the source, scaled by leg length."""
    rest = target.rest_pos_m()[None]
    scale = _leg_m(rest, target_roles) / _leg_m(pos, source_roles)
    at_origin = forward(target, np.zeros((len(pos), 3)), local)[0]
    return scale * _hip_middle(pos, source_roles) - _hip_middle(at_origin, target_roles)


def _hip_middle(pos: Floats, roles: dict[str, int]) -> Floats:
    return (pos[:, roles["left_hip"]] + pos[:, roles["right_hip"]]) / 2


def _leg_m(pos: Floats, roles: dict[str, int]) -> float:
    """Mean length of both legs, hip to ankle along the bones."""
    chain = [[roles[f"{side}_{part}"] for part in ("hip", "knee", "ankle")] for side in ("left", "right")]
    return float(np.linalg.norm(np.diff(pos[:, chain], axis=2), axis=-1).sum(axis=-1).mean())


def leg_length_m(skeleton: Skeleton) -> float:
    """Mean length of both legs of a skeleton, hip to ankle along the bones. Raises as `joint_roles`."""
    return _leg_m(skeleton.rest_pos_m()[None], joint_roles(skeleton))


def _unit(vector: Floats) -> Floats:
    return vector / np.maximum(np.linalg.norm(vector, axis=-1, keepdims=True), 1e-12)


def _mean_rotation(quat: Floats) -> Floats:
    """Mean rotation (4,) of rotations (T, 4)."""
    return (
        scipy.spatial.transform.Rotation.from_quat(quat, scalar_first=True).mean().as_quat(scalar_first=True)
    )


def _alignment(source: list[Floats], target: list[Floats], weights: list[float] | None = None) -> Floats:
    """The rotation (4,) that best aligns directions `source` with `target`."""
    rotation, _ = scipy.spatial.transform.Rotation.align_vectors(
        np.array(target), np.array(source), weights=weights
    )
    return rotation.as_quat(scalar_first=True)


# The bind pose of the mannequin: a skeleton that stands upright in any rest pose, and its measures.


UP = np.array([0.0, 1.0, 0.0])

_NO_LENGTH_M = 1e-3
# Of the 1.70 m body of the tables: hip to ankle, and height of the hips to height of the shoulders.
_LEG_M, _TRUNK_M = 0.785, 0.525
_SPREAD = 0.2  # least sine between two bones of a joint that determine its rotation
_STANDING_PERCENT, _MOST_PITCH_RAD = 90.0, 0.7
_SAMPLES = 200  # frames of a motion from which the rotations of its rig's joints are estimated


def bind_pose(skeleton: Skeleton, motion: Motion | None) -> tuple[Floats, Floats]:
    """World positions (J, 3) and rotations (J, 4) of the joints, standing upright.

    This is the rest pose if that stands. If not (all bones along one axis), each joint gets the rotation
    that the canonical body has in its rest pose. The rotations between the two rigs are estimated from
    `motion`. Without a motion, they are estimated from the directions of the bones, which leaves the twist
    open. Joint names must be those of a known rig.
    """
    if rest_pose_is_upright(skeleton):
        return skeleton.rest_pos_m(), np.tile(rot.IDENTITY, (skeleton.n_joints, 1))
    turns = _turns_from_bones(skeleton) if motion is None else _turns_from_motion(motion)
    local = to_local(skeleton, turns)
    return forward(skeleton, np.zeros(3), local)


def _turns_from_motion(motion: Motion) -> Floats:
    skeleton, canonical = motion.skeleton, canonical_skeleton()
    step = max(1, motion.n_frames // _SAMPLES)
    few = Motion(skeleton, motion.root_pos_m[::step], motion.local_quat[::step], motion.fps / step)
    twin = retarget(few, canonical)
    _, quat = forward(skeleton, few.root_pos_m, few.local_quat)  # (T, J, 4)
    _, twin_quat = forward(canonical, twin.root_pos_m, twin.local_quat)
    roles = {joint: CANONICAL_JOINTS.index(role) for role, joint in joint_roles(skeleton).items()}
    turns = np.tile(rot.IDENTITY, (skeleton.n_joints, 1))
    for joint in range(skeleton.n_joints):
        if joint in roles:
            # With world rotation R of the joint and S of its retargeted twin, the bind rotation is S⁻¹ R.
            relative = rot.multiply(rot.invert(twin_quat[:, roles[joint]]), quat[:, joint])
            mean = scipy.spatial.transform.Rotation.from_quat(relative, scalar_first=True).mean()
            turns[joint] = mean.as_quat(scalar_first=True)
        elif joint:
            turns[joint] = turns[skeleton.parents[joint]]
    known = joint_roles(skeleton)
    for side in ("left", "right"):
        feet = [known[role] for role in (f"{side}_ankle", f"{side}_foot") if role in known]
        turns[feet] = rot.multiply(_flat_foot(turns[feet[0]], quat[:, feet[0]]), turns[feet])
    return turns


def _flat_foot(turn: Floats, quat: Floats) -> Floats:
    """The pitch (4,) that a foot needs in the bind pose for its sole to be level when it stands.

    Rigs differ in the height of the ankle over the ball of the foot, so the pitch does not follow from the
    bone between them. The toes of a standing foot have their greatest pitch, except in a few steps onto the
    heel.
    """
    ahead = rot.rotate(rot.multiply(quat, rot.invert(turn)), np.array([0.0, 0.0, 1.0]))  # (T, 3)
    pitch_rad = np.arcsin(np.clip(np.percentile(ahead[:, 1], _STANDING_PERCENT), -1.0, 1.0))
    return rot.from_rotvec(np.array([-np.clip(pitch_rad, -_MOST_PITCH_RAD, _MOST_PITCH_RAD), 0.0, 0.0]))


def _turns_from_bones(skeleton: Skeleton) -> Floats:
    roles, rest = joint_roles(skeleton), skeleton.rest_pos_m()
    standing = canonical_skeleton().rest_pos_m()
    bones: dict[int, list[tuple[Floats, Floats]]] = {}
    for role, joint in roles.items():
        index = CANONICAL_JOINTS.index(role)
        above = CANONICAL_PARENTS[index]
        while above >= 0 and CANONICAL_JOINTS[above] not in roles:
            above = CANONICAL_PARENTS[above]
        if above < 0:
            continue
        parent = roles[CANONICAL_JOINTS[above]]
        bone = rest[joint] - rest[parent]
        if np.linalg.norm(bone) > _SHORTEST_BONE_M:
            bones.setdefault(parent, []).append((bone, standing[index] - standing[above]))
    turns = np.tile(rot.IDENTITY, (skeleton.n_joints, 1))
    for joint in range(skeleton.n_joints):
        if joint in bones:
            ends = np.swapaxes(bones[joint], 0, 1)  # (2, N, 3)
            lying, upright = ends / np.linalg.norm(ends, axis=-1, keepdims=True)
            if np.linalg.matrix_rank(lying, tol=_SPREAD) < 2:  # only the most upright bone is informative
                main = int(np.argmax(np.abs(upright[:, 1])))
                turns[joint] = rot.between(lying[main], upright[main])
            else:
                turns[joint] = scipy.spatial.transform.Rotation.align_vectors(upright, lying)[0].as_quat(
                    scalar_first=True
                )
        elif joint:
            turns[joint] = turns[skeleton.parents[joint]]
    return turns


@dataclass(frozen=True, eq=False)
class Body:
    """A skeleton standing in its bind pose, with the measures that the mesh pieces need."""

    bind_pos_m: Floats  # (J, 3)
    bind_quat: Floats  # (J, 4) rotations relative to the rest pose
    pos_m: Floats  # (J, 3) with a small length for zero-length bones, so that all have directions
    roles: dict[str, int]  # canonical role -> joint
    spine: tuple[int, ...]  # joints from the pelvis up to where the arms meet
    front: Floats  # (3,) unit, level
    scale: float  # body height over 1.70 m
    sole_m: float  # height of the floor

    def place(self, role: str) -> Floats:
        """Position (3,) of the joint of a role, metres."""
        return self.pos_m[self.roles[role]]

    def middle(self, part: str) -> Floats:
        """Midpoint (3,) of the left and the right joint of a part, metres."""
        return (self.place(f"left_{part}") + self.place(f"right_{part}")) / 2

    def half_span(self, part: str) -> float:
        """Half the distance between the left and the right joint of a part, metres."""
        return float(np.linalg.norm(self.place(f"left_{part}") - self.place(f"right_{part}"))) / 2

    def neck_base(self) -> Floats:
        """Base of the neck (3,), metres: its joint, or a point above the middle of the shoulders."""
        if "neck" in self.roles:
            return self.place("neck")
        return self.middle("shoulder") + 0.05 * self.scale * UP

    def head_place(self) -> Floats:
        """Base of the skull (3,), metres: the head joint, or a neck's length above the neck."""
        if "head" in self.roles:
            return self.place("head")
        return self.neck_base() + 0.09 * self.scale * UP

    def head_joint(self) -> int:
        """The joint that the skull moves with."""
        return self.roles.get("head", self.roles.get("neck", self.spine[-1]))


def standing_body(skeleton: Skeleton, motion: Motion | None) -> Body:
    """The body of a known rig in its bind pose. `motion` is used for rigs whose rest pose does not stand.

    Raises `ParameterError` if the joint names are not a known rig's.
    """
    roles = joint_roles(skeleton)
    bind_pos_m, quat = bind_pose(skeleton, motion)
    pos_m = _drawn_out(bind_pos_m, roles)
    spine = [roles.get("spine3", roles.get("spine1", roles["pelvis"]))]
    while spine[-1] not in (roles["pelvis"], 0):
        spine.append(int(skeleton.parents[spine[-1]]))
    lefts, rights = ([roles[f"{side}_{part}"] for part in ("hip", "shoulder")] for side in ("left", "right"))
    front = np.cross((pos_m[lefts] - pos_m[rights]).sum(axis=0), UP)
    breadth = float(np.linalg.norm(front))
    return Body(
        bind_pos_m,
        quat,
        pos_m,
        roles,
        tuple(spine[::-1]),
        front / breadth if breadth > _NO_LENGTH_M else np.array([0.0, 0.0, 1.0]),
        max(_scale(pos_m, roles), _SHORTEST_BONE_M),
        _sole_m(skeleton, roles, bind_pos_m, quat),
    )


def _drawn_out(pos_m: Floats, roles: dict[str, int]) -> Floats:
    """The positions (J, 3), with a millimetre along the canonical body's bone for each zero-length bone."""
    places, standing = np.array(pos_m), canonical_skeleton().offsets_m
    for role, joint in roles.items():
        index = CANONICAL_JOINTS.index(role)
        above = CANONICAL_JOINTS[CANONICAL_PARENTS[index]] if index else ""
        if above in roles and np.linalg.norm(pos_m[joint] - pos_m[roles[above]]) < _NO_LENGTH_M:
            direction = standing[index] / np.linalg.norm(standing[index])
            places[joint] = places[roles[above]] + _NO_LENGTH_M * direction
    return places


def _scale(pos_m: Floats, roles: dict[str, int]) -> float:
    """Size of the body relative to the tables' 1.70 m: the mean of legs and trunk."""
    chains = [[roles[f"{side}_{part}"] for part in ("hip", "knee", "ankle")] for side in ("left", "right")]
    leg_m = np.linalg.norm(np.diff(pos_m[chains], axis=1), axis=-1).sum(axis=-1).mean()
    hips, shoulders = (
        pos_m[[roles[f"left_{part}"], roles[f"right_{part}"]]].mean(axis=0) for part in ("hip", "shoulder")
    )
    return float(leg_m / _LEG_M + np.linalg.norm(shoulders - hips) / _TRUNK_M) / 2


def _sole_m(skeleton: Skeleton, roles: dict[str, int], pos_m: Floats, quat: Floats) -> float:
    """Height of the floor under the bind pose: the lowest point of the skeleton's feet."""
    owners = [
        roles[f"{side}_{part}"]
        for side in ("left", "right")
        for part in ("ankle", "foot")
        if f"{side}_{part}" in roles
    ]
    heights = list(pos_m[owners, 1])
    for owner, tip in zip(skeleton.tip_parents, skeleton.tips_m, strict=True):
        if owner in owners:
            heights.append(pos_m[owner, 1] + rot.rotate(quat[owner], tip)[1])
    return float(min(heights))
