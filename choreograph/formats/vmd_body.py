"""The body of MikuMikuDance's standard models, and its legs, which are moved by the positions of the feet.

The body has the proportions of common models: 20 units of 8 cm tall, with the hips at 11.4 units and arms 38
degrees below the horizontal. A file has no skeleton, so that motions are read and written on this body.
Arrays are in the axes of this program: right-handed, facing +Z. Those of MikuMikuDance have Z reversed.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from choreograph.motion import rotations as rot
from choreograph.motion.hands import finger_quats
from choreograph.motion.skeleton import Skeleton

UNIT_M = 0.08
SIDES = {"left": "左", "right": "右"}
CENTRE = "センター"
LOWER, UPPER = "下半身", "上半身"  # both are children of the centre, and are in the same place
CENTRE_POS_M = np.array([0.0, 8.0, 0.0]) * UNIT_M

_ARM_RAD = np.radians(38.0)
_ALONG_ARM = (float(np.cos(_ARM_RAD)), -float(np.sin(_ARM_RAD)), 0.0)
_UPPER_ARM, _FOREARM, _PALM = 2.9, 2.6, 1.0  # units
# Name, parent, role and rest position in units, Z to the front, of the trunk.
_TRUNK = (
    (LOWER, "", "pelvis", (0.0, 12.4, 0.0)),
    (UPPER, LOWER, "spine1", (0.0, 12.4, 0.0)),
    ("上半身2", UPPER, "spine3", (0.0, 13.9, 0.0)),
    ("首", "上半身2", "neck", (0.0, 16.4, -0.2)),
    ("頭", "首", "head", (0.0, 17.2, 0.0)),
)
# Name, parent, role, and the rest position from that of the parent, of the left limbs. Knees are hinges
# about X, so that a leg is in a plane without X.
_LIMBS = (
    ("足", LOWER, "hip", (0.9, -1.0, 0.0)),
    ("ひざ", "足", "knee", (0.0, -4.9, 0.1)),
    ("足首", "ひざ", "ankle", (0.0, -5.2, -0.35)),
    ("つま先", "足首", "foot", (0.0, -1.3, 1.75)),
    ("肩", "上半身2", "collar", (0.3, 2.0, -0.2)),
    ("腕", "肩", "shoulder", (1.0, -0.2, 0.0)),
    ("ひじ", "腕", "elbow", tuple(_UPPER_ARM * part for part in _ALONG_ARM)),
    ("手首", "ひじ", "wrist", tuple(_FOREARM * part for part in _ALONG_ARM)),
    ("中指１", "手首", "hand", tuple(_PALM * part for part in _ALONG_ARM)),
)
_ABOVE_HEAD = (0.0, 2.8, 0.0)
UNKEYED = ("つま先", "中指１")  # ends of limbs, whose rotations are not in files

# Bones of fingers from the hand to the tip, without their sides. Some models lack the first one of the thumb.
FINGERS = {
    "thumb": ("親指０", "親指１", "親指２"), "index": ("人指１", "人指２", "人指３"),
    "middle": ("中指１", "中指２", "中指３"), "ring": ("薬指１", "薬指２", "薬指３"),
    "pinky": ("小指１", "小指２", "小指３"),
}  # fmt: skip

_X = np.array([1.0, 0.0, 0.0])
_STRAIGHT = 0.02  # sine of the bend of a knee below which its axis is mostly that of the thigh


@lru_cache(maxsize=1)
def standard_body() -> Skeleton:
    """The standard body with Japanese names of joints, in metres."""
    names: list[str] = []
    parents: list[int] = []
    offsets: list[NDArray[np.float64]] = []
    roles: dict[str, int] = {}
    for name, parent, role, pos in _TRUNK:
        above = names.index(parent) if parent else -1
        rest = np.array(pos) - (np.array(_TRUNK[above][3]) if parent else 0.0)
        roles[role] = len(names)
        names.append(name)
        parents.append(above)
        offsets.append(rest)
    for side, mark in SIDES.items():
        for name, parent, role, offset in _LIMBS:
            roles[f"{side}_{role}"] = len(names)
            parents.append(names.index(parent if parent in names else f"{mark}{parent}"))
            names.append(f"{mark}{name}")
            offsets.append(np.array(offset) * (1.0 if side == "left" else -1.0, 1.0, 1.0))
    return Skeleton(
        tuple(names), np.array(parents), UNIT_M * np.array(offsets),
        tip_parents=np.array([roles["head"]]), tips_m=UNIT_M * np.array([_ABOVE_HEAD]), roles=roles,
    )  # fmt: skip


def mirrored(pos: NDArray[np.float64], quat: NDArray[np.float64]) -> tuple[np.ndarray, np.ndarray]:
    """Positions (..., 3) and rotations (..., 4) from the axes of MikuMikuDance to ours, and back."""
    return pos * np.array([1.0, 1.0, -1.0]), quat * np.array([1.0, -1.0, -1.0, 1.0])


def finger_turns(side: str, shares: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Local rotations (T, 4) of the bones of fingers of a hand, by name, for shares (T, S) of its shapes."""
    angle_rad = -_ARM_RAD if side == "left" else _ARM_RAD
    arm = rot.from_rotvec(np.array([0.0, 0.0, angle_rad]))  # from the T pose to that of the body
    quats = finger_quats(side, shares)
    return {
        f"{SIDES[side]}{name}": rot.multiply(arm, rot.multiply(quats[finger][:, segment], rot.invert(arm)))
        for finger, names in FINGERS.items()
        for segment, name in enumerate(names)
    }


def bend_leg(
    thigh_quat: NDArray[np.float64], hip_pos_m: NDArray[np.float64], target_pos_m: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """World rotations (T, 4) of the thigh and local ones of the knee that put the ankle on a target (T, 3).

    The knee bends about the X axis of the thigh. The thigh turns from `thigh_quat` (T, 4) as little as
    possible. A leg that does not reach the target points at it.
    """
    thigh, shin = _leg_bones()
    lengths = np.linalg.norm(thigh), np.linalg.norm(shin)
    to_target = target_pos_m - hip_pos_m  # (T, 3)
    reach = np.linalg.norm(to_target, axis=-1).clip(abs(lengths[0] - lengths[1]), sum(lengths))  # (T,)
    cosine = (reach**2 - lengths[0] ** 2 - lengths[1] ** 2) / (2.0 * lengths[0] * lengths[1])
    angle = np.arccos(cosine.clip(-1.0, 1.0)) - _angle_about(_X, thigh, shin)  # (T,)
    knee = rot.from_rotvec(angle[:, None] * _X)
    leg = rot.rotate(thigh_quat, thigh + rot.rotate(knee, shin))  # (T, 3) from hip to ankle
    turn = rot.between(_unit(leg), _unit(to_target))
    return rot.multiply(turn, thigh_quat), knee


def hinged_thigh(
    thigh_quat: NDArray[np.float64], knee_m: NDArray[np.float64], ankle_m: NDArray[np.float64]
) -> NDArray[np.float64]:
    """World rotations (T, 4) of the thigh, twisted so that its X axis is the axis in which the knee bends.

    `knee_m` and `ankle_m` (T, 3) are the bones in the world. An axis cannot be seen in a straight leg, which
    keeps that of `thigh_quat` (T, 4).
    """
    along = _unit(knee_m)
    thigh = _leg_bones()[0]
    aligned = rot.multiply(
        rot.between(rot.rotate(thigh_quat, np.broadcast_to(_unit(thigh), along.shape)), along), thigh_quat
    )
    axis = rot.rotate(aligned, np.broadcast_to(_X, along.shape))  # (T, 3)
    bend = np.cross(along, _unit(ankle_m))
    sine = np.maximum(np.linalg.norm(bend, axis=-1, keepdims=True), 1e-12)
    forward = ((bend * axis).sum(axis=-1, keepdims=True) / sine).clip(0.0, 1.0)  # 0: the knee bends back
    angle = _angle_about(along, axis, _STRAIGHT * axis + forward * bend)
    return rot.multiply(rot.from_rotvec(angle[:, None] * along), aligned)


def _leg_bones() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Thigh and shin (3,) of both legs in the rest pose, in metres."""
    body = standard_body()
    return body.offsets_m[body.index("左ひざ")], body.offsets_m[body.index("左足首")]


def _angle_about(
    axis: NDArray[np.float64], first: NDArray[np.float64], second: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Angles (...) in radians from `first` to `second` (..., 3) about `axis`, to which both are normal."""
    angle: NDArray[np.float64] = np.arctan2(
        (np.cross(first, second) * axis).sum(axis=-1), (first * second).sum(axis=-1)
    )
    return angle


def _unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    unit: NDArray[np.float64] = vector / np.maximum(np.linalg.norm(vector, axis=-1, keepdims=True), 1e-12)
    return unit
