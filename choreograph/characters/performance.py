"""A dance on a character: its bones turned as the dancer's joints turn, its helper bones with them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from choreograph.characters.feet_and_hands import body_parts, keep_hands_out, placed_feet, sole_offsets_m
from choreograph.core.errors import ParameterError
from choreograph.formats.gltf_rig import Rig, SkinPoints, rotations_of
from choreograph.motion import rotations as rot
from choreograph.motion.body import body_pos_m
from choreograph.motion.contacts import foot_contacts
from choreograph.motion.foot_locking import DANCE_SHIFT_S, lock_feet
from choreograph.motion.kinematics import forward, to_local
from choreograph.motion.motion import Motion
from choreograph.motion.retargeting import retarget
from choreograph.motion.skeleton import CANONICAL_JOINTS, Skeleton, canonical_skeleton

# Bones beside the body's own: twist bones share a limb's roll, IK bones go where hands and feet are.
#
# All other helpers keep their place against their parents, as fingers and faces do.


Floats = NDArray[np.float64]

_TWIST = re.compile(r"twist|roll", re.IGNORECASE)
_IK = re.compile(r"^ik_(foot|hand)_(l|r)$", re.IGNORECASE)  # Unreal's
_IK_ROLES = {"foot": "ankle", "hand": "wrist"}
_SIDES = {"l": "left", "r": "right"}
# Limbs by their bones: in the upper one the roll comes from what is above it, in the lower from its end.
_UPPER = {"shoulder": "elbow", "hip": "knee"}
_LOWER = {"elbow": "wrist", "knee": "ankle"}
LIMB_ENDS = {
    f"{side}_{start}": f"{side}_{end}"
    for side in ("left", "right")
    for start, end in (_UPPER | _LOWER).items()
}


def twist_bones(rig: Rig, bones: Mapping[str, int]) -> dict[int, tuple[str, float]]:
    """Twist bones that hang from a limb: the limb's canonical name, and how far along it they are, 0 to 1."""
    known = set(bones.values())
    found = {}
    for bone, name in enumerate(rig.names):
        if bone in known or not _TWIST.search(name):
            continue
        for role, end in LIMB_ENDS.items():
            if bones.get(role) == rig.parents[bone] and end in bones:
                along = rig.bind_pos_m[bones[end]] - rig.bind_pos_m[bones[role]]
                place = (
                    (rig.bind_pos_m[bone] - rig.bind_pos_m[bones[role]]) @ along / max(along @ along, 1e-12)
                )
                found[bone] = role, float(np.clip(place, 0.0, 1.0))
    return found


def twist_turn(role: str, place: float, along: Floats, above: Floats, own: Floats, below: Floats) -> Floats:
    """World turns (T, 4) of a twist bone from those of its limb's parent, the limb, and what follows it.

    All are turns from the bind pose; `along` (3,) is the limb's direction there. The roll of an upper limb
    against its parent grows along it from nothing, that of a lower limb towards its end.
    """
    if role.split("_")[1] in _UPPER:
        roll, share = rolled(rot.multiply(rot.invert(above), own), along), place - 1.0
    else:
        roll, share = rolled(rot.multiply(rot.invert(own), below), along), place
    return rot.multiply(own, rot.from_rotvec(share * rot.to_rotvec(roll)))


def rolled(quat: Floats, axis: Floats) -> Floats:
    """The part of rotations (T, 4) that turns about an axis (3,)."""
    axis = axis / max(float(np.linalg.norm(axis)), 1e-12)
    part = np.concatenate([quat[:, :1], (quat[:, 1:] @ axis)[:, None] * axis], axis=1)
    return rot.make_continuous(rot.normalize(part))


def ik_bones(rig: Rig, bones: Mapping[str, int]) -> dict[int, int]:
    """IK bones, each with the bone of the hand or foot that it goes with."""
    pairs = {}
    for bone, name in enumerate(rig.names):
        matched = _IK.match(name)
        if matched:
            role = f"{_SIDES[matched[2].lower()]}_{_IK_ROLES[matched[1].lower()]}"
            if role in bones:
                pairs[bone] = bones[role]
    return pairs


# A dance on a character: its bones turned as the dancer's joints turn, its hips carried, its feet planted.
#
# The character's bind pose and the canonical body's rest pose are compared bone by bone, so that an A pose,
# another roll of a bone, or a figure that looks elsewhere in its file makes no difference. Trunk, neck and
# head turn as the dancer's do and keep the figure's own posture; arms and legs point where the dancer's
# point.


_SPINE = ("pelvis", "spine1", "spine2", "spine3")
_BALL_AHEAD, _TIP_AHEAD = 0.166, 0.27  # of the leg: from the ankle to the ball and the tip of a foot
_UP = np.array([0.0, 1.0, 0.0])
_FRONT = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Performance:
    """What a character's bones do: local rotations, and translations of those that travel."""

    fps: float
    n_frames: int
    local_quat: dict[int, Floats]  # bone -> (T, 4), for bones that the dance turns
    translation: dict[int, Floats]  # bone -> (T, 3), in its parent's units
    motion: Motion  # the dance on the figure's bones, in the world, with canonical names where they are known


def perform(
    motion: Motion, rig: Rig, bones: Mapping[str, int], skin: SkinPoints | None = None
) -> Performance:
    """The motion on a rig whose bones are known by canonical name; hands stay out of its `skin`.

    Raises `ParameterError` if hips, legs or arms are among the names that `bones` lacks.
    """
    canonical = canonical_skeleton()
    dancer = motion if motion.skeleton.same_as(canonical) else retarget(motion, canonical)
    skeleton, bone_of_joint = figure_skeleton(rig, bones)
    facing = _facing(rig, bones)
    _, world = forward(canonical, dancer.root_pos_m, dancer.local_quat)  # (T, 24, 4)
    turned = _turned(world, skeleton, facing)
    figure, shift_m = placed_feet(
        dancer, Motion(skeleton, np.zeros_like(dancer.root_pos_m), turned, dancer.fps)
    )
    contacts = foot_contacts(body_pos_m(dancer), dancer.fps)
    figure = lock_feet(figure, contacts, shift_s=DANCE_SHIFT_S, feet_shift_m=shift_m)
    if skin is not None:
        front = rot.rotate(facing, _FRONT)
        figure = keep_hands_out(figure, body_parts(skeleton, bone_of_joint, skin, front), front)
    joint_of = {bone: joint for joint, bone in enumerate(bone_of_joint)}
    return _on_bones(_with_twist(figure, rig, bones, joint_of), rig, bones, joint_of)


def figure_skeleton(rig: Rig, bones: Mapping[str, int]) -> tuple[Skeleton, list[int]]:
    """The rig from its pelvis down as a skeleton whose rest pose is the bind pose, all rotations identity.

    Joints that are known have their canonical names. Also the bone of each joint.
    """
    order, parents, offsets = rig.below(bones["pelvis"])
    outside = [name for name, bone in bones.items() if bone not in order]
    if outside:
        raise ParameterError(f"expected all of the body below the pelvis, got {', '.join(outside)} elsewhere")
    joint_of = {bone: joint for joint, bone in enumerate(order)}
    role_of = {bone: role for role, bone in bones.items()}
    names = tuple(role_of.get(bone, f"#{bone}") for bone in order)
    tip_parents, tips = _soles(rig, bones, joint_of)
    return Skeleton(names, parents, offsets, tip_parents, tips), order


def _soles(
    rig: Rig, bones: Mapping[str, int], joint_of: Mapping[int, int]
) -> tuple[NDArray[np.int64], Floats]:
    """End sites at the sole below heel and ball of both feet: their joints (E,) and offsets (E, 3).

    And below the tip of feet that cannot bend there.
    """
    bends = {"left_foot", "right_foot"} <= bones.keys()
    parents, tips = [], []
    for side in ("left", "right"):
        ankle = bones[f"{side}_ankle"]
        ankle_m = rig.bind_pos_m[ankle]
        if bends:
            points_m = [ankle_m, rig.bind_pos_m[bones[f"{side}_foot"]]]
        else:
            along_m = _leg_m(rig, bones, side) * rot.rotate(_facing(rig, bones), _FRONT)
            points_m = [ankle_m + share * along_m for share in (0.0, _BALL_AHEAD, _TIP_AHEAD)]
        parents += [joint_of[ankle]] * len(points_m)
        tips.append(sole_offsets_m(ankle_m, points_m, rig.floor_m))
    return np.array(parents), np.concatenate(tips)


def _leg_m(rig: Rig, bones: Mapping[str, int], side: str) -> float:
    """Length of a leg along its bones in the bind pose."""
    hip, knee, ankle = (rig.bind_pos_m[bones[f"{side}_{part}"]] for part in ("hip", "knee", "ankle"))
    return float(np.linalg.norm(knee - hip) + np.linalg.norm(ankle - knee))


def _facing(rig: Rig, bones: Mapping[str, int]) -> Floats:
    """The turn about Y (4,) from +Z to where the figure looks in its bind pose."""
    left = rig.bind_pos_m[bones["left_hip"]] - rig.bind_pos_m[bones["right_hip"]]
    front = np.cross(left, _UP)
    if np.linalg.norm(front) < 1e-9:
        raise ParameterError("expected a character with hips side by side in its bind pose, got none")
    return rot.about_y(np.arctan2(front[0], front[2]))


def _alignments(skeleton: Skeleton, facing: Floats) -> Floats:
    """The rotations (J, 4) that turn the canonical rest pose into the figure's, joint by joint.

    Joints of trunk and feet are only turned to where the figure looks; those of arms and legs are also swung
    from the canonical bone's direction to the figure's, beginning with what their parent was swung by.
    """
    canonical, rest = canonical_skeleton(), skeleton.rest_pos_m()
    canonical_rest = canonical.rest_pos_m()
    aligned = np.tile(facing, (skeleton.n_joints, 1))
    for joint, name in enumerate(skeleton.names):
        if LIMB_ENDS.get(name) in skeleton.names:
            start, end = CANONICAL_JOINTS.index(name), CANONICAL_JOINTS.index(LIMB_ENDS[name])
            own = rest[skeleton.index(LIMB_ENDS[name])] - rest[joint]
            before = aligned[_known_parent(skeleton, joint)] if name.endswith(("knee", "elbow")) else facing
            bone = rot.rotate(before, canonical_rest[end] - canonical_rest[start])
            aligned[joint] = rot.multiply(rot.between(bone, own), before)
        elif name.endswith(("wrist", "hand")):
            aligned[joint] = aligned[_known_parent(skeleton, joint)]
        elif name.endswith(("ankle", "_foot")):
            aligned[joint] = rot.multiply(_toe_out(skeleton, name.split("_")[0], facing), facing)
    return aligned


def _toe_out(skeleton: Skeleton, side: str, facing: Floats) -> Floats:
    """The turn about Y (4,) from where the figure looks to where a foot of it points."""
    rest = skeleton.rest_pos_m()
    if f"{side}_foot" not in skeleton.names:
        return rot.IDENTITY
    foot = rest[skeleton.index(f"{side}_foot")] - rest[skeleton.index(f"{side}_ankle")]
    foot = rot.rotate(rot.invert(facing), foot)
    return rot.about_y(np.arctan2(foot[0], foot[2]))


def _known_parent(skeleton: Skeleton, joint: int) -> int:
    """The nearest ancestor that has a canonical name, or the root."""
    parent = int(skeleton.parents[joint])
    while parent > 0 and skeleton.names[parent] not in CANONICAL_JOINTS:
        parent = int(skeleton.parents[parent])
    return parent


def _turned(world: Floats, skeleton: Skeleton, facing: Floats) -> Floats:
    """Local rotations (T, J, 4) of the figure's joints from world rotations (T, 24, 4) of the dancer's."""
    back = rot.invert(_alignments(skeleton, facing))
    turned = np.empty((len(world), skeleton.n_joints, 4))
    spine = _spine_heights(skeleton)
    for joint, name in enumerate(skeleton.names):
        if joint in spine:
            low = min(int(spine[joint]), len(_SPINE) - 2)
            ends = [world[:, CANONICAL_JOINTS.index(part)] for part in _SPINE[low : low + 2]]
            source = rot.slerp(ends[0], ends[1], spine[joint] - low)
        elif name in CANONICAL_JOINTS:
            source = world[:, CANONICAL_JOINTS.index(name)]
        else:
            turned[:, joint] = turned[:, skeleton.parents[joint]]
            continue
        turned[:, joint] = rot.multiply(source, back[joint])
    return rot.make_continuous(to_local(skeleton, turned))


def _spine_heights(skeleton: Skeleton) -> dict[int, float]:
    """The joints from above the pelvis to where the arms meet, spread over the dancer's three: 0 … 3."""
    path = [skeleton.index("left_shoulder")]
    while path[-1]:
        path.append(int(skeleton.parents[path[-1]]))
    other = {skeleton.index("right_shoulder")}
    joint = skeleton.index("right_shoulder")
    while joint:
        joint = int(skeleton.parents[joint])
        other.add(joint)
    trunk = [joint for joint in path[::-1] if joint in other and joint]
    return {joint: 3.0 * (i + 1) / len(trunk) for i, joint in enumerate(trunk)}


def _with_twist(figure: Motion, rig: Rig, bones: Mapping[str, int], joint_of: Mapping[int, int]) -> Motion:
    """The figure with the roll of its limbs shared by their twist bones."""
    skeleton = figure.skeleton
    _, turned = forward(skeleton, figure.root_pos_m, figure.local_quat)  # (T, J, 4)
    for bone, (role, place) in twist_bones(rig, bones).items():
        joint, end = skeleton.index(role), skeleton.index(LIMB_ENDS[role])
        along = rig.bind_pos_m[bones[LIMB_ENDS[role]]] - rig.bind_pos_m[bones[role]]
        above = turned[:, skeleton.parents[joint]]
        turned[:, joint_of[bone]] = twist_turn(role, place, along, above, turned[:, joint], turned[:, end])
    return replace(figure, local_quat=rot.make_continuous(to_local(skeleton, turned)))


def _on_bones(figure: Motion, rig: Rig, bones: Mapping[str, int], joint_of: Mapping[int, int]) -> Performance:
    """The figure's motion as local transforms of the rig's bones."""
    pos_m, turned = forward(figure.skeleton, figure.root_pos_m, figure.local_quat)  # (T, J, 3), (T, J, 4)
    world = rot.multiply(turned, rig.bind_quat[list(joint_of)])  # (T, J, 4)
    rest = rig.rest_world()
    pelvis = bones["pelvis"]
    local: dict[int, Floats] = {}
    for bone, joint in joint_of.items():
        parent = int(rig.parents[bone])
        over = world[:, joint_of[parent]] if parent in joint_of else _rotation_above(rest, parent)
        local[bone] = rot.make_continuous(rot.multiply(rot.invert(over), world[:, joint]))
    translation = {pelvis: _in_space_of(rest, int(rig.parents[pelvis]), pos_m[:, 0])}
    for bone, goal in ik_bones(rig, bones).items():
        parent, joint = int(rig.parents[bone]), joint_of[goal]
        if bone in joint_of or parent in joint_of:
            continue
        own = rot.multiply(turned[:, joint], rig.bind_quat[bone])
        local[bone] = rot.make_continuous(rot.multiply(rot.invert(_rotation_above(rest, parent)), own))
        offset = rot.rotate(turned[:, joint], rig.bind_pos_m[bone] - rig.bind_pos_m[goal])
        translation[bone] = _in_space_of(rest, parent, pos_m[:, joint] + offset)
    return Performance(figure.fps, figure.n_frames, local, translation, figure)


def _rotation_above(rest: Floats, parent: int) -> Floats:
    """World rotation (1, 4) of a bone that the dance does not turn; of none, the identity."""
    return rotations_of(rest[parent])[None] if parent >= 0 else rot.IDENTITY[None]


def _in_space_of(rest: Floats, parent: int, pos_m: Floats) -> Floats:
    """World positions (T, 3) in the space of a bone that the dance does not move."""
    if parent < 0:
        return pos_m
    inverse = np.linalg.inv(rest[parent])
    return pos_m @ inverse[:3, :3].T + inverse[:3, 3]
