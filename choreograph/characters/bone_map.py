"""Which bone of a rig is which part of the body: by a VRM's own word, by names, or by structure."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from choreograph.characters.rig import Rig
from choreograph.characters.structure import bones_by_structure, head_by_structure
from choreograph.errors import ParameterError
from choreograph.motion.rigs import joint_roles
from choreograph.motion.skeleton import Skeleton

REQUIRED = tuple(
    f"{side}_{part}"
    for side in ("left", "right")
    for part in ("hip", "knee", "ankle", "shoulder", "elbow", "wrist")
)
_VRM_LIMBS = {
    "UpperLeg": "hip", "LowerLeg": "knee", "Foot": "ankle", "Toes": "foot", "Shoulder": "collar",
    "UpperArm": "shoulder", "LowerArm": "elbow", "Hand": "wrist",
}  # fmt: skip
_VRM_TRUNK = {"hips": "pelvis", "spine": "spine1", "neck": "neck", "head": "head"}


def find_bones(rig: Rig, human_bones: Mapping[str, int] | None = None) -> dict[str, int]:
    """The bones of a rig by canonical name: hips, knees, ankles, shoulders, elbows and wrists at least.

    `human_bones` are those that a VRM file names itself. Raises `ParameterError` if they cannot be found.
    """
    if human_bones:
        return _of_vrm(human_bones)
    # A root above all, since rigs may have several.
    names = ("", *_distinct(rig.names))
    parents = np.concatenate([[-1], rig.parents + 1])
    try:
        roles = joint_roles(Skeleton(names, parents, np.zeros((len(names), 3))))
    except ParameterError:
        return bones_by_structure(rig)
    bones = {role: joint - 1 for role, joint in roles.items() if joint > 0}
    return head_by_structure(rig, bones) | bones


def _of_vrm(human_bones: Mapping[str, int]) -> dict[str, int]:
    bones = {role: human_bones[name] for name, role in _VRM_TRUNK.items() if name in human_bones}
    chest = [human_bones[name] for name in ("chest", "upperChest") if name in human_bones]
    bones |= dict(zip(("spine3",) if len(chest) == 1 else ("spine2", "spine3"), chest, strict=False))
    for side in ("left", "right"):
        for name, part in _VRM_LIMBS.items():
            if f"{side}{name}" in human_bones:
                bones[f"{side}_{part}"] = human_bones[f"{side}{name}"]
    missing = [name for name in (*REQUIRED, "pelvis") if name not in bones]
    if missing:
        raise ParameterError(f"expected a humanoid VRM, its own list of bones lacks {', '.join(missing)}")
    return bones


def _distinct(names: tuple[str, ...]) -> list[str]:
    """The names, those that repeat with a number."""
    seen: dict[str, int] = {}
    distinct = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        distinct.append(name if seen[name] == 1 else f"{name} #{seen[name]}")
    return distinct
