"""Which bone of a rig is which part of the body: by the user's map, a VRM's own word, names, or structure."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from choreograph.arguments import check_choice, unexpected
from choreograph.errors import FormatError, ParameterError
from choreograph.files import atomic_path, read_json
from choreograph.motion.rig_structure import PosedBones, bones_by_structure, head_by_structure
from choreograph.motion.rigs import REQUIRED, roles_by_names, trunk_roles
from choreograph.motion.skeleton import CANONICAL_JOINTS

Floats = NDArray[np.float64]

_MOST_BONES = 1024  # that are looked at in many poses; bodies with faces and hands have some hundreds
_NOTED = ("pelvis", "left_knee", "right_elbow")
# Matrices for row vectors that take Y, Z, -Z, X, -X and -Y to Y, the usual ones first.
_TO_Y_UP = tuple(
    np.array(rows, float)
    for rows in (
        np.eye(3),
        [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
        [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
        [[0, 1, 0], [-1, 0, 0], [0, 0, 1]],
        [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
        [[1, 0, 0], [0, -1, 0], [0, 0, -1]],
    )
)
_VRM_LIMBS = {
    "UpperLeg": "hip", "LowerLeg": "knee", "Foot": "ankle", "Toes": "foot", "Shoulder": "collar",
    "UpperArm": "shoulder", "LowerArm": "elbow", "Hand": "wrist",
}  # fmt: skip
_VRM_TRUNK = {"hips": "pelvis", "spine": "spine1", "neck": "neck", "head": "head"}


def find_bones(
    rig: PosedBones,
    human_bones: Mapping[str, int] | None = None,
    bone_map: Mapping[str, str] | None = None,
) -> dict[str, int]:
    """The bones of a rig by canonical name: hips, knees, ankles, shoulders, elbows and wrists at least.

    `human_bones` are those that a VRM file names itself, `bone_map` the names that the user gives to some.
    Raises `ParameterError` if they cannot be found, or a name of the map is not canonical or not a bone.
    """
    check_bone_map(bone_map)
    given = {role: _named(rig, name) for role, name in (bone_map or {}).items()}
    if set(REQUIRED) <= set(given):
        return trunk_roles(tuple(rig.parents.tolist()), given) | given
    found = _of_vrm(human_bones) if human_bones else _by_names(rig)
    return {role: bone for role, bone in found.items() if bone not in given.values()} | given


def take_bones(
    rig: PosedBones, more_poses: Iterable[PosedBones] = (), bone_map: Mapping[str, str] | None = None
) -> tuple[dict[str, int] | None, str]:
    """The bones of a take's rig by canonical name where their names do not say it, and a note on how.

    A map counts for rigs that have all bones that it names. Names that are unknown are replaced by structure:
    of the rest pose in `rig`, or of another one of `more_poses`, with any axis up. None, and no note, where
    names say it, or nothing does.
    """
    if bone_map and has_bones(rig.names, bone_map):
        found: dict[str, int] = {}
        if not set(REQUIRED) <= set(bone_map):
            found = take_bones(rig, more_poses)[0] or _roles_or_none(rig) or {}
        given = {role: rig.names.index(name) for role, name in bone_map.items()}
        roles = {role: bone for role, bone in found.items() if bone not in given.values()} | given
        missing = [role for role in REQUIRED if role not in roles]
        if missing:
            raise ParameterError(f"expected a map that says which bones are {', '.join(missing)}, got others")
        trunk = trunk_roles(tuple(rig.parents.tolist()), roles)
        taken = set(roles.values())
        roles = {role: bone for role, bone in trunk.items() if bone not in taken} | roles
        return roles, "its bones are those that the map says"
    if _roles_or_none(rig) is not None:
        return None, ""
    for posed in chain((rig,), more_poses) if rig.n_bones <= _MOST_BONES else ():
        for to_y_up in _TO_Y_UP:
            try:
                roles = bones_by_structure(posed.turned(to_y_up))
            except ParameterError:
                continue
            return roles, _structure_note(rig, roles)
    return None, ""


def has_bones(names: Iterable[str], bone_map: Mapping[str, str]) -> bool:
    """Whether all bones that a map names are among the names of a rig."""
    return set(bone_map.values()) <= set(names)


def check_bone_map(bone_map: object) -> None:
    """Raise `ParameterError` unless it is a map of canonical names to names of bones, or None."""
    if not isinstance(bone_map, Mapping | None):
        raise unexpected("a map of bones as canonical name to the rig's name", bone_map)
    for role, name in (bone_map or {}).items():
        check_choice("a map of bones by names", role, CANONICAL_JOINTS)
        if not isinstance(name, str):
            raise unexpected("a name of a bone in the map", name)


def read_bone_map(path: str | Path) -> dict[str, str]:
    """A map of bones from a JSON file: canonical name to the rig's name.

    Raises `FormatError` if it cannot be read, or has another form or unknown canonical names.
    """
    data = read_json(path, "a map of bones")
    if not (isinstance(data, dict) and all(isinstance(name, str) for name in data.values())):
        raise FormatError(f"{path}: expected an object of bones' names by canonical name")
    unknown = set(data) - set(CANONICAL_JOINTS)
    if unknown:
        raise FormatError(f"{path}: expected keys among {', '.join(CANONICAL_JOINTS)}, got {min(unknown)!r}")
    return data


def write_bone_map(path: str | Path, names_of_rig: tuple[str, ...], bones: Mapping[str, int]) -> None:
    """Write the map of a rig, to be edited and read again."""
    names = {role: names_of_rig[bones[role]] for role in CANONICAL_JOINTS if role in bones}
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(names, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def _named(rig: PosedBones, name: str) -> int:
    if name not in rig.names:
        raise unexpected("a bone of the character in the map", name)
    return rig.names.index(name)


def _by_names(rig: PosedBones) -> dict[str, int]:
    """By the names of known rigs, else by structure; neck and head by structure where they have no name."""
    bones = _roles_or_none(rig)
    if bones is None:
        return bones_by_structure(rig)
    _check_one_body(rig, bones)
    return head_by_structure(rig, bones) | bones


def _roles_or_none(rig: PosedBones) -> dict[str, int] | None:
    """The bones by the names of known rigs; None if the names are unknown."""
    try:
        # A root above all, since rigs may have several.
        roles = roles_by_names(("", *rig.names), (-1, *(rig.parents + 1).tolist()))
    except ParameterError:
        return None
    return {role: joint - 1 for role, joint in roles.items() if joint > 0}


def _structure_note(rig: PosedBones, roles: Mapping[str, int]) -> str:
    some = ", ".join(f"{rig.names[roles[role]][:20]} is the {role}" for role in _NOTED)
    return (
        f"the names of its bones are unknown: they were found by structure ({some.replace('_', ' ')}); "
        "--map says which is which"
    )


def _check_one_body(rig: PosedBones, bones: Mapping[str, int]) -> None:
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
