"""The pose a figure's mesh is made in: the skeleton standing, whatever its rest pose."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from choreograph.motion import rotations as rot
from choreograph.motion.kinematics import forward, to_local
from choreograph.motion.motion import Motion
from choreograph.motion.retarget import retarget
from choreograph.motion.rigs import joint_roles, rest_stands
from choreograph.motion.skeleton import CANONICAL_JOINTS, CANONICAL_PARENTS, Skeleton, canonical_skeleton

Floats = NDArray[np.float64]

_SHORTEST_BONE_M = 0.01
_SAMPLES = 200  # frames of a motion that tell how its rig's joints are turned


def bind_pose(skeleton: Skeleton, motion: Motion | None) -> tuple[Floats, Floats]:
    """Places (J, 3) and world rotations (J, 4) of the joints, standing upright.

    The rest pose if that stands. If not (all bones along one axis), each joint is turned as the
    canonical body's is in its rest pose; how the two compare is read off `motion`, or, without one,
    off the bones' directions alone, which leaves their twist open. Names must be a known rig's.
    """
    if rest_stands(skeleton):
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
            # A joint turned R in the world while its twin is turned S: it was S⁻¹ R when S was identity.
            relative = rot.multiply(rot.invert(twin_quat[:, roles[joint]]), quat[:, joint])
            mean = Rotation.from_quat(relative, scalar_first=True).mean()
            turns[joint] = mean.as_quat(scalar_first=True)
        elif joint:
            turns[joint] = turns[skeleton.parents[joint]]
    return turns


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
            turns[joint] = Rotation.align_vectors(upright, lying)[0].as_quat(scalar_first=True)
        elif joint:
            turns[joint] = turns[skeleton.parents[joint]]
    return turns


def _unit(vectors: Floats) -> Floats:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
