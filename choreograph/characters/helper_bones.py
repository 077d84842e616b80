"""Bones beside the body's own: twist bones share a limb's roll, IK bones go where hands and feet are.

All other helpers keep their place against their parents, as fingers and faces do.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from choreograph.gltf.rig import Rig
from choreograph.motion import rotations as rot

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
