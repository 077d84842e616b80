"""Which bone of a rig is which joint: by its name, the user's map, the map of a VRM file, or structure.

`joint_roles` reads the names that programs and data sets give to joints. `find_bones` and `take_bones` find
the bones of rigs with other names by the hierarchy and the positions in a pose.
"""

from __future__ import annotations

import json
import re
import unicodedata
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import chain, combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from choreograph.core.arguments import check_choice, unexpected
from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.files import atomic_path, read_json
from choreograph.core.numerics import Floats
from choreograph.motion.skeleton import CANONICAL_JOINTS, Skeleton

# Roles of joints by their names.


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


# Bones with unknown names, found by the hierarchy and the positions in one pose.
#
# A body stands upright and is nearly symmetric. The legs are the chains that end lowest beside its middle.
# The arms are the chains that begin above the hips and reach farthest from the middle. Of all ways to divide
# a limb at its first joint and its bend, the one with the longest and most equal halves is chosen.


_LOW = 0.18  # of the height: where feet are
_BESIDE = 0.015  # of the height: a bone at this distance from the middle belongs to a side
_FEWEST = 3  # bones of a leg or an arm
_FINGERS = 3  # children: a bone with so many or more is a hand
_ARM = 0.2  # of the height: the least length of an arm
_UNEQUAL = 2.0  # weight of the difference between the halves of an arm, relative to its length
_TURN_RAD = 0.5  # least angle between a foot and its leg
_UPRIGHT = 0.5  # least height of a standing body, relative to its greatest extent


@dataclass(frozen=True, eq=False)
class PosedBones:
    """The bones of a rig and their positions in one pose, Y up, in any unit. There may be several roots."""

    names: tuple[str, ...]  # (B,)
    parents: NDArray[np.int64]  # (B,) -1 for a root. Every parent comes before its children
    pos: Floats  # (B, 3) in the world
    # Ends of bones that are not bones themselves: their bone (E,) and position (E, 3).
    tip_parents: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    tip_pos: Floats = field(default_factory=lambda: np.zeros((0, 3)))

    def turned(self, matrix: Floats) -> PosedBones:
        """The bones in other axes: their positions times a matrix (3, 3)."""
        return replace(self, pos=self.pos @ matrix, tip_pos=self.tip_pos @ matrix)

    @property
    def n_bones(self) -> int:
        """Number of bones B."""
        return len(self.names)

    def children(self, bone: int) -> list[int]:
        """The bones whose parent is `bone`."""
        return np.flatnonzero(self.parents == bone).tolist()

    def path_from_root(self, bone: int) -> list[int]:
        """The bones from a root to `bone`, both included."""
        path = [bone]
        while self.parents[path[-1]] >= 0:
            path.append(int(self.parents[path[-1]]))
        return path[::-1]


def bones_by_structure(rig: PosedBones) -> dict[str, int]:
    """The bones of a rig by canonical name. Raises `ParameterError` unless it has two legs and two arms."""
    pos = rig.pos - np.median(rig.pos, axis=0)  # the median is on the spine, even if one arm is raised
    extents = np.ptp(rig.pos, axis=0)
    height = float(extents[1])
    if height <= 0 or height < _UPRIGHT * extents.max():
        raise _not_a_body()
    best: dict[str, int] = {}
    across = None
    for axis in (np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])):
        found = _limbs(rig, pos @ axis / height, height)
        if len(found) > len(best):
            best, across = found, axis
    if across is None or len(best) < 2 * (_FEWEST + _FEWEST):
        raise _not_a_body()
    bones = _sided(rig, best)
    bones |= trunk_roles(tuple(rig.parents.tolist()), bones)
    return bones | head_by_structure(rig, bones)


def head_by_structure(rig: PosedBones, bones: dict[str, int]) -> dict[str, int]:
    """Neck and head, on the chain from the bone where the arms meet to the highest bone above it."""
    chest = max(
        set(rig.path_from_root(bones["left_shoulder"])) & set(rig.path_from_root(bones["right_shoulder"]))
    )
    arms = {*rig.path_from_root(bones["left_wrist"]), *rig.path_from_root(bones["right_wrist"])}
    above = [
        path[path.index(chest) + 1 :]
        for bone in range(rig.n_bones)
        if chest in (path := rig.path_from_root(bone))
        and bone != chest
        and path[path.index(chest) + 1] not in arms
    ]
    if not above:
        return {}
    longest = max(above, key=lambda path: rig.pos[path[-1], 1])
    # The head has eyes, jaw and hair as children, so it is the first bone without a single child.
    top = next((i for i, bone in enumerate(longest) if len(rig.children(bone)) != 1), len(longest) - 1)
    top = max(top, min(1, len(longest) - 1))
    return {"head": longest[top]} | ({"neck": longest[0]} if top else {})


def _limbs(rig: PosedBones, beside: Floats, height: float) -> dict[str, int]:
    """Legs and arms with sides "+" and "-" of the axis along which `beside` (B,) is measured."""
    limbs: dict[str, int] = {}
    ends = sorted(set(range(rig.n_bones)) - set(rig.parents.tolist()))
    floor = rig.pos[:, 1].min()
    for side, sign in (("+", 1.0), ("-", -1.0)):
        chains = [_side_chain(rig, end, sign * beside) for end in ends]
        chains = [chain for chain in chains if len(chain) >= _FEWEST]
        low = [c for c in chains if rig.pos[c[-1], 1] < floor + _LOW * height]
        if not low:
            continue
        leg = max(low, key=lambda c: (rig.pos[c[0], 1], len(c)))
        hip_height = rig.pos[leg[0], 1]
        high = [c for c in chains if rig.pos[c[0], 1] > hip_height + 0.1 * height]
        if not high:
            continue
        arm = max(high, key=lambda c: np.linalg.norm(rig.pos[c[-1]] - rig.pos[c[0]]))
        limbs |= {f"{side}{part}": bone for part, bone in _leg_parts(rig, leg, floor, height).items()}
        limbs |= {f"{side}{part}": bone for part, bone in _arm_parts(rig, arm, height).items()}
    return limbs


def _side_chain(rig: PosedBones, end: int, beside: Floats) -> list[int]:
    """The bones from the last one in the middle, which is not included, to an end on one side."""
    chain, bone = [], end
    while bone >= 0 and beside[bone] >= _BESIDE:
        chain.append(bone)
        bone = int(rig.parents[bone])
    return chain[::-1]


def _leg_parts(rig: PosedBones, chain: list[int], floor: float, height: float) -> dict[str, int]:
    """Hip, knee, ankle and ball of the foot along a leg, which turns to the front at the ankle."""
    heights = rig.pos[chain, 1] - floor
    low = [i for i in range(2, len(chain)) if heights[i] < _LOW * height] or [len(chain) - 1]
    ankle = max(low, key=lambda i: _turn_rad(rig, chain, i))
    if _turn_rad(rig, chain, ankle) < _TURN_RAD:
        ankle = low[-1]
    halves = _halved(rig, chain, ankle, least=0.0)
    if halves is None:
        return {}
    parts = {"hip": chain[halves[0]], "knee": chain[halves[1]], "ankle": chain[ankle]}
    return parts | ({"foot": chain[ankle + 1]} if ankle + 1 < len(chain) else {})


def _arm_parts(rig: PosedBones, chain: list[int], height: float) -> dict[str, int]:
    """Collar, shoulder, elbow and wrist along an arm."""
    hand = next((i for i, bone in enumerate(chain) if len(rig.children(bone)) >= _FINGERS), len(chain) - 1)
    halves = _halved(rig, chain, hand, least=_ARM * height)
    if halves is None:
        return {}
    first, second = halves
    parts = {"shoulder": chain[first], "elbow": chain[second], "wrist": chain[hand]}
    return parts | ({"collar": chain[first - 1]} if first else {})


def _turn_rad(rig: PosedBones, chain: list[int], at: int) -> float:
    """The angle between the bones that meet at bone `at` of a chain, or 0 at its end."""
    if at + 1 >= len(chain):
        return 0.0
    before, after = np.diff(rig.pos[chain[at - 1 : at + 2]], axis=0)
    lengths = np.linalg.norm(before) * np.linalg.norm(after)
    return float(np.arccos(np.clip(before @ after / lengths, -1.0, 1.0))) if lengths > 0 else 0.0


def _halved(rig: PosedBones, chain: list[int], end: int, *, least: float) -> tuple[int, int] | None:
    """The first joint and the bend of a limb that ends at a given bone of a chain.

    The limb should be long and have equal halves. None if every choice is shorter than `least`.
    """
    best, found = -np.inf, None
    for first, second in combinations(range(end), 2):
        upper, lower = np.linalg.norm(
            np.diff(rig.pos[[chain[at] for at in (first, second, end)]], axis=0), axis=1
        )
        score = float(upper + lower - _UNEQUAL * abs(upper - lower))
        if score > best and upper + lower > least:
            best, found = score, (first, second)
    return found


def _sided(rig: PosedBones, limbs: dict[str, int]) -> dict[str, int]:
    """The limbs with sides "left" and "right", which follow from feet that point to the front."""
    pos = rig.pos
    ahead = np.zeros(3)
    for side in "+-":
        ankle, toe = limbs[f"{side}ankle"], limbs.get(f"{side}foot")
        ends = rig.tip_pos[rig.tip_parents == ankle] if toe is None else pos[[toe]]
        ahead += (ends - pos[ankle]).sum(axis=0) * [1.0, 0.0, 1.0]
    if np.linalg.norm(ahead) < 1e-6:
        raise ParameterError(
            "expected feet that point to the front, to tell left from right: name the bones with --map"
        )
    left = np.cross([0.0, 1.0, 0.0], ahead)
    plus_is_left = left @ (pos[limbs["+hip"]] - pos[limbs["-hip"]]) > 0
    names = {"+": "left", "-": "right"} if plus_is_left else {"+": "right", "-": "left"}
    return {f"{names[key[0]]}_{key[1:]}": bone for key, bone in limbs.items()}


def _not_a_body() -> ParameterError:
    return ParameterError(
        "expected a body with two legs and two arms, found none by the names of its bones or by its "
        "structure: name the bones with --map"
    )


# The bones of a rig by part of the body: by the user's map, the map of a VRM file, names, or structure.


_MOST_BONES = 1024  # that are compared in many poses. Bodies with faces and hands have some hundreds
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
    """The bones of a rig by canonical name, at least hips, knees, ankles, shoulders, elbows and wrists.

    `human_bones` is the map in a VRM file. `bone_map` is the user's map, which may contain only some bones.
    Raises `ParameterError` if a part is not found, or if the map has a name that is not canonical or not a
    bone.
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
    """The bones of a take's rig by canonical name if their own names are unknown, and a note on how.

    The map is used for rigs that have all bones in it. Otherwise, bones with unknown names are found by
    structure, in the rest pose of `rig` or in one of `more_poses`, with any axis up. Returns None and no note
    if the names are known, or if the bones are not found.
    """
    if bone_map and has_bones(rig.names, bone_map):
        found: dict[str, int] = {}
        if not set(REQUIRED) <= set(bone_map):
            found = take_bones(rig, more_poses)[0] or _roles_or_none(rig) or {}
        given = {role: rig.names.index(name) for role, name in bone_map.items()}
        roles = {role: bone for role, bone in found.items() if bone not in given.values()} | given
        missing = [role for role in REQUIRED if role not in roles]
        if missing:
            raise ParameterError(f"expected a map that names the bones {', '.join(missing)}, got others")
        trunk = trunk_roles(tuple(rig.parents.tolist()), roles)
        taken = set(roles.values())
        roles = {role: bone for role, bone in trunk.items() if bone not in taken} | roles
        return roles, "its bones are those of the map"
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
    """Whether a rig has all bones of a map."""
    return set(bone_map.values()) <= set(names)


def check_bone_map(bone_map: object) -> None:
    """Raise `ParameterError` unless given a map of canonical names to names of bones, or None."""
    if not isinstance(bone_map, Mapping | None):
        raise unexpected("a map of bones as canonical name to the rig's name", bone_map)
    for role, name in (bone_map or {}).items():
        check_choice("a map of bones by names", role, CANONICAL_JOINTS)
        if not isinstance(name, str):
            raise unexpected("a name of a bone in the map", name)


def read_bone_map(path: str | Path) -> dict[str, str]:
    """A map of bones from a JSON file, from canonical name to the rig's name.

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
    """By the names of known rigs, else by structure. Unnamed necks and heads are found by structure."""
    bones = _roles_or_none(rig)
    if bones is None:
        return bones_by_structure(rig)
    _check_one_body(rig, bones)
    return head_by_structure(rig, bones) | bones


def _roles_or_none(rig: PosedBones) -> dict[str, int] | None:
    """The bones by the names of known rigs, or None if the names are unknown."""
    try:
        # A common root is added, since rigs may have several.
        roles = roles_by_names(("", *rig.names), (-1, *(rig.parents + 1).tolist()))
    except ParameterError:
        return None
    return {role: joint - 1 for role, joint in roles.items() if joint > 0}


def _structure_note(rig: PosedBones, roles: Mapping[str, int]) -> str:
    some = ", ".join(f"{rig.names[roles[role]][:20]} is the {role}" for role in _NOTED)
    return (
        f"the names of its bones are unknown: they were found by structure ({some.replace('_', ' ')}), "
        "use --map to name them"
    )


def _check_one_body(rig: PosedBones, bones: Mapping[str, int]) -> None:
    """Raise `ParameterError` if limbs have different roots, as those of two characters do."""
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
        raise ParameterError(
            f"expected a humanoid VRM, got one whose list of bones lacks {', '.join(missing)}"
        )
    return bones
