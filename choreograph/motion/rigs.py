"""Joint names of common rigs mapped to the canonical joints."""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np

from choreograph.core.errors import ParameterError
from choreograph.motion.skeleton import CANONICAL_JOINTS, Skeleton

# Names of a limb's joints, best first. The order of the rows matters if rigs use a word differently.
# "LeftShoulder" is the collar beside a "LeftArm" (Mixamo) but the shoulder beside a "LeftElbow" (Biovision).
# A joint that one row uses is not used by a later one.
_LIMB_NAMES = {
    "knee": ("knee", "lowerleg", "lowleg", "loleg", "shin", "calf", "tibia", "leg"),
    "hip": ("upleg", "upperleg", "thigh", "femur", "hip", "leg"),
    "ankle": ("ankle", "foot"),
    "foot": ("toebase", "toes", "toe", "ball", "forefoot", "foot"),
    "elbow": ("elbow", "forearm", "lowerarm", "lowarm", "loarm", "farm", "radius"),
    "shoulder": ("upperarm", "uparm", "uarm", "humerus", "shldr", "arm", "shoulder"),
    "collar": ("collar", "clavicle", "collarbone", "shoulder"),
    "wrist": ("wrist", "hand"),
    "hand": ("hand", "palm"),
}
_MIDDLE_NAMES = {
    "pelvis": ("pelvis", "hips", "hip"),
    "neck": ("neck", "lowerneck", "necklower"),
    "head": ("head",),
}
_KNOWN_PARTS = frozenset(name for names in (_LIMB_NAMES | _MIDDLE_NAMES).values() for name in names)
REQUIRED = tuple(
    f"{side}_{part}"
    for part in ("hip", "knee", "ankle", "shoulder", "elbow", "wrist")
    for side in ("left", "right")
)
_SIDES = {"left": "left", "l": "left", "right": "right", "r": "right"}
_SUFFIX_WORDS = frozenset(("jnt", "joint", "bone", "bind", "bend"))  # "hips_JNT", DAZ's "lThighBend"
_NOT_BODY_PARTS = frozenset(
    ("ik", "pole", "ctrl", "target", "prop", "weapon")
)  # "ik_foot_l" is an IK control

_MIN_UPRIGHT_COS = 0.9  # cosine of the largest lean of an upright body
_NAMED = 100  # letters of a name that are compared
_FEW, _SHORT = 4, 12  # joints in an error, and letters of their names

# Words of MMD's models, in Japanese and in Roman letters.
_JAPANESE = {
    "つま先": "toe", "爪先": "toe", "足首": "ankle", "手首": "wrist", "ひざ": "knee", "膝": "knee",
    "ひじ": "elbow", "肘": "elbow", "左": "left", "右": "right", "肩": "shoulder", "腕": "arm", "足": "leg",
    "首": "neck", "頭": "head",
}  # fmt: skip
_ROMAJI = {
    "hidari": "left", "migi": "right", "tsumasaki": "toe", "ashikubi": "ankle", "tekubi": "wrist",
    "hiza": "knee", "hiji": "elbow", "kata": "shoulder", "ude": "arm", "ashi": "leg", "kubi": "neck",
    "atama": "head",
}  # fmt: skip
# The longest come first, since "足首" is an ankle and not a leg.
_JAPANESE_WORDS = re.compile("|".join(sorted(_JAPANESE, key=len, reverse=True)))
_WORDS = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+|[^\W\d_a-zA-Z]+")


def joint_roles(skeleton: Skeleton) -> dict[str, int]:
    """The joints of `skeleton` that correspond to the canonical ones, as canonical name -> index.

    They are the `roles` of the skeleton, if it has any, and are otherwise found by name. Prefix, case,
    separators and digits of names are ignored. The rigs of Mixamo, CMU, MotionBuilder, Bandai-Namco, SMPL,
    Xsens, Rokoko, Biovision, Unreal, DAZ, MMD and similar ones are known. Pelvis and spine are found by
    hierarchy instead of by name. The pelvis is the joint where legs and trunk meet, and the spine leads from
    there to the joint where the arms meet. Joints that the rig lacks (a middle spine joint, hands) are left
    out.

    Raises `ParameterError` if hips, knees, ankles, shoulders, elbows or wrists cannot be found.
    """
    if skeleton.roles is not None:
        return dict(skeleton.roles)
    return roles_by_names(skeleton.names, tuple(skeleton.parents.tolist()))


def roles_by_names(names: tuple[str, ...], parents: tuple[int, ...]) -> dict[str, int]:
    """As `joint_roles`, for names and parents of joints without a skeleton."""
    return dict(_roles(names, parents))


def rest_pose_is_upright(skeleton: Skeleton) -> bool:
    """Whether the rest pose is upright along +Y, as in most rigs. In some, all bones lie along one axis.

    Raises `ParameterError` as `joint_roles` does.
    """
    roles, rest = joint_roles(skeleton), skeleton.rest_pos_m()
    both = [[roles[f"{side}_{part}"] for side in ("left", "right")] for part in ("shoulder", "ankle")]
    upward = rest[both[0]].mean(axis=0) - rest[both[1]].mean(axis=0)
    return bool(upward[1] > _MIN_UPRIGHT_COS * np.linalg.norm(upward))


@lru_cache(maxsize=256)
def _roles(names: tuple[str, ...], parents: tuple[int, ...]) -> Mapping[str, int]:
    parts: dict[tuple[str, str], int] = {}  # (side, part) -> the joint nearest the root
    named = [_side_and_part(name) for name in names]
    counts = Counter(named)
    for joint, part in enumerate(named):
        if part[1] != "palm" or counts[part] == 1:  # Rigify has one below each finger, beside its hand
            parts.setdefault(part, joint)
    roles = _named_limbs(parts)
    missing = [role for role in REQUIRED if role not in roles]
    if missing:
        raise ParameterError(
            f"expected the joint names of a known rig or a standing body, found no "
            f"{', '.join(missing)} among {_some(names)}: name the bones with --map"
        )
    for role in ("neck", "head"):
        found = [parts[("", name)] for name in _MIDDLE_NAMES[role] if ("", name) in parts]
        if found:
            roles[role] = found[0]
    pelvises = [parts[("", name)] for name in _MIDDLE_NAMES["pelvis"] if ("", name) in parts]
    roles |= trunk_roles(parents, roles, pelvises)
    if "head" not in roles:
        roles |= _unnamed_head(names, parents, roles)
    elif "neck" not in roles:
        roles |= _unnamed_neck(parents, roles)
    return {name: roles[name] for name in CANONICAL_JOINTS if name in roles}


def trunk_roles(
    parents: tuple[int, ...], limbs: Mapping[str, int], named_pelvis: Sequence[int] = ()
) -> dict[str, int]:
    """Pelvis and spine by hierarchy, from the joint where legs and trunk meet to that where the arms meet.

    If several joints are named as a pelvis, the one nearest to the first joint is used.
    """
    chest = _common_ancestor(parents, [limbs["left_shoulder"], limbs["right_shoulder"]])
    waist = _common_ancestor(parents, [limbs["left_hip"], limbs["right_hip"], chest])
    above_waist = _path_from_root(parents, waist)
    pelvis = max((joint for joint in named_pelvis if joint in above_waist), default=waist)
    spine = [joint for joint in _path_from_root(parents, chest) if joint > pelvis]
    return {"pelvis": pelvis, **_spine_roles(spine)}


def _unnamed_head(names: Sequence[str], parents: tuple[int, ...], roles: Mapping[str, int]) -> dict[str, int]:
    """Neck and head of a rig that calls them spine, as Rigify does, else the longest chain above the arms.

    The head is the last of the bones that have the name of the chest. Bones of the face are its children.
    """
    arms = [_path_from_root(parents, roles[f"{side}_shoulder"]) for side in ("left", "right")]
    chest = max(set(arms[0]) & set(arms[1]))
    paths = [_path_from_root(parents, joint) for joint in range(len(parents))]
    above = [path[path.index(chest) + 1 :] for path in paths if chest in path[:-1]]
    above = [path for path in above if path[0] not in {*arms[0], *arms[1]}]
    if not above:
        return {}
    spine = _letters(names[chest])
    alike = [path for path in above if all(_letters(names[joint]) == spine for joint in path)]
    chain = max(alike or above, key=len)
    return {"head": chain[-1]} | ({"neck": chain[0]} if len(chain) > 1 else {})


def _unnamed_neck(parents: tuple[int, ...], roles: dict[str, int]) -> dict[str, int]:
    """The neck of a rig with another name for it: the first joint from the chest towards the head."""
    arms = set(_path_from_root(parents, roles["left_shoulder"]))
    arms |= set(_path_from_root(parents, roles["right_shoulder"]))
    between = [joint for joint in _path_from_root(parents, roles["head"])[:-1] if joint not in arms]
    return {"neck": between[0]} if between and parents[between[0]] in arms else {}


def _letters(name: str) -> str:
    """A joint's name without prefix, digits and separators."""
    return "".join(word for word in _words(name) if not word.isdigit())


def _words(name: str) -> list[str]:
    """The words of a joint's name without its prefix, in lower case. Japanese ones become English."""
    own = unicodedata.normalize("NFKC", name.rsplit(":", 1)[-1][-_NAMED:])
    own = _JAPANESE_WORDS.sub(lambda found: f" {_JAPANESE[found[0]]} ", own)
    return [_ROMAJI.get(word.lower(), word.lower()) for word in _WORDS.findall(own)]


def _side_and_part(name: str) -> tuple[str, str]:
    """Side ("left", "right" or "") and body part ("" if unknown) of a joint name."""
    words = _words(name)
    side = next((_SIDES[word] for word in words if word in _SIDES), "")
    words = [word for word in words if word not in _SIDES and not word.isdigit()]
    while words and words[-1] in _SUFFIX_WORDS:
        words.pop()
    if not _NOT_BODY_PARTS.isdisjoint(words):
        return side, ""
    for start in range(len(words)):  # the longest known ending: "Character1_LeftUpArm" is "uparm"
        part = "".join(words[start:])
        if part in _KNOWN_PARTS:
            return side, part
        for prefix in () if side else _SIDES:  # without a separator: "lfemur", "LEFTARM"
            if part.startswith(prefix) and part.removeprefix(prefix) in _KNOWN_PARTS:
                return _SIDES[prefix], part.removeprefix(prefix)
    return side, ""


def _named_limbs(parts: Mapping[tuple[str, str], int]) -> dict[str, int]:
    roles: dict[str, int] = {}
    for side in ("left", "right"):
        taken: set[int] = set()
        for role, names in _LIMB_NAMES.items():
            found = [parts[side, name] for name in names if (side, name) in parts]
            free = [joint for joint in found if joint not in taken]
            if free:
                roles[f"{side}_{role}"] = free[0]
                taken.add(free[0])
    return roles


def _path_from_root(parents: tuple[int, ...], joint: int) -> list[int]:
    path = [joint]
    while parents[path[-1]] >= 0:
        path.append(parents[path[-1]])
    return path[::-1]


def _common_ancestor(parents: tuple[int, ...], joints: list[int]) -> int:
    """The lowest common ancestor of `joints`, possibly one of them. Raises `ParameterError` without one."""
    first, *others = (_path_from_root(parents, joint) for joint in joints)
    shared = set(first).intersection(*others)
    if not shared:
        raise ParameterError("expected one body, got limbs with different roots")
    return max(shared)


def _some(names: Sequence[str]) -> str:
    """The names of a rig for an error, or the first ones if there are many."""
    more = f" and {len(names) - _FEW} more" if len(names) > _FEW else ""
    return ", ".join(name[:_SHORT] for name in names[:_FEW]) + more


def _spine_roles(spine: list[int]) -> dict[str, int]:
    """Spine joints, from the pelvis up, mapped to the canonical three, or to the lowest and the highest."""
    if not spine:
        return {}
    if len(spine) == 1:
        return {"spine1": spine[0]}
    if len(spine) == 2:
        return {"spine1": spine[0], "spine3": spine[1]}
    return {"spine1": spine[0], "spine2": spine[len(spine) // 2], "spine3": spine[-1]}
