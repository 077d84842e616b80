"""Which bone of a rig is which part of the body: by a VRM's own word, by names, or by structure."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from choreograph.arguments import check_choice, unexpected
from choreograph.characters.structure import bones_by_structure, head_by_structure
from choreograph.errors import FormatError, ParameterError
from choreograph.files import atomic_path, read_json
from choreograph.gltf.rig import Rig, distinct
from choreograph.motion.rigs import joint_roles, trunk_roles
from choreograph.motion.skeleton import CANONICAL_JOINTS, Skeleton

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


def find_bones(
    rig: Rig, human_bones: Mapping[str, int] | None = None, bone_map: Mapping[str, str] | None = None
) -> dict[str, int]:
    """The bones of a rig by canonical name: hips, knees, ankles, shoulders, elbows and wrists at least.

    `human_bones` are those that a VRM file names itself, `bone_map` the names that the user gives to some.
    Raises `ParameterError` if they cannot be found, or a name of the map is not canonical or not a bone.
    """
    if not isinstance(bone_map, Mapping | None):
        raise unexpected("a map of bones as canonical name to the character's name", bone_map)
    for role in bone_map or {}:
        check_choice("a map of bones by names", role, CANONICAL_JOINTS)
    given = {role: _named(rig, name) for role, name in (bone_map or {}).items()}
    if set(REQUIRED) <= set(given):
        return trunk_roles(tuple(rig.parents.tolist()), given) | given
    found = _of_vrm(human_bones) if human_bones else _by_names(rig)
    return {role: bone for role, bone in found.items() if bone not in given.values()} | given


def read_bone_map(path: str | Path) -> dict[str, str]:
    """A map of bones from a JSON file: canonical name to the character's name.

    Raises `FormatError` if it cannot be read, or has another form or unknown canonical names.
    """
    data = read_json(path, "a map of bones")
    if not (isinstance(data, dict) and all(isinstance(name, str) for name in data.values())):
        raise FormatError(f"{path}: expected an object of bones' names by canonical name")
    unknown = sorted(set(data) - set(CANONICAL_JOINTS))
    if unknown:
        raise FormatError(f"{path}: expected keys among {', '.join(CANONICAL_JOINTS)}, got {unknown[0]!r}")
    return data


def write_bone_map(path: str | Path, rig: Rig, bones: Mapping[str, int]) -> None:
    """Write the map of a rig, to be edited and read again."""
    names = {role: rig.names[bones[role]] for role in CANONICAL_JOINTS if role in bones}
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(names, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def _named(rig: Rig, name: str) -> int:
    if not isinstance(name, str) or name not in rig.names:
        raise unexpected("a bone of the character in the map", name)
    return rig.names.index(name)


def _by_names(rig: Rig) -> dict[str, int]:
    """By the names of known rigs, else by structure; neck and head by structure where they have no name."""
    # A root above all, since rigs may have several.
    names = distinct(("", *rig.names))
    parents = np.concatenate([[-1], rig.parents + 1])
    try:
        roles = joint_roles(Skeleton(names, parents, np.zeros((len(names), 3))))
    except ParameterError:
        return bones_by_structure(rig)
    bones = {role: joint - 1 for role, joint in roles.items() if joint > 0}
    _check_one_body(rig, bones)
    return head_by_structure(rig, bones) | bones


def _check_one_body(rig: Rig, bones: Mapping[str, int]) -> None:
    """Raise `ParameterError` if limbs hang under different roots, as those of two characters do."""
    roots = {rig.path_from_root(bones[role])[0] for role in REQUIRED}
    repeated = [name for name in {rig.names[bones[role]] for role in REQUIRED} if rig.names.count(name) > 1]
    if len(roots) > 1 or repeated:
        raise ParameterError(
            "expected one character, got two armatures or bones of one name: export one of them, or use --map"
        )


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
