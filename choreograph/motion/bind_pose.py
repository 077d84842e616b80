"""The bind pose of the mannequin: a skeleton that stands upright in any rest pose, and its measures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from choreograph.core.numerics import Floats
from choreograph.motion import rotations as rot
from choreograph.motion.kinematics import forward, to_local
from choreograph.motion.motion import Motion
from choreograph.motion.retargeting import retarget
from choreograph.motion.rigs import joint_roles, rest_pose_is_upright
from choreograph.motion.skeleton import CANONICAL_JOINTS, CANONICAL_PARENTS, Skeleton, canonical_skeleton

UP = np.array([0.0, 1.0, 0.0])

_SHORTEST_BONE_M = 0.01
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
            lying, upright = (_unit(np.array(ends)) for ends in zip(*bones[joint], strict=True))
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


def _unit(vectors: Floats) -> Floats:
    unit: Floats = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return unit


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
        place_m: Floats = self.pos_m[self.roles[role]]
        return place_m

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
