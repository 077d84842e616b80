"""Base class of the writers, names of joints in files, rest poses, and programs that dances are for."""

from __future__ import annotations

import re
import unicodedata
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np

from choreograph.core import __version__
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats
from choreograph.motion import rotations as rot
from choreograph.motion.bone_map import joint_roles
from choreograph.motion.cameras import CameraPath
from choreograph.motion.motion import Motion
from choreograph.motion.retargeting import Body, standing_body
from choreograph.motion.skeleton import Skeleton, descendants

GENERATOR = f"choreograph {__version__}"
DANCE_GENERATOR = f"{GENERATOR}: a dance"  # marks files that a new dance may replace


class Writer(ABC):
    """Writes motions in one format. The same motion gives the same bytes."""

    format: ClassVar[str]  # also the suffix of the file, without the dot
    # Of a writer of another package. `formats.BUILTIN` has what the built-in ones hold and use.
    holds: ClassVar[str] = "motion"  # what its files hold, for the help
    uses: ClassVar[tuple[str, ...]] = ()  # options of `Dance.save`, beside `loop`
    is_dance: bool = False  # whether the file is marked as a dance, if the format allows it
    camera: CameraPath | None = None  # that is written with the motion, if the format uses it

    @abstractmethod
    def write(self, motion: Motion, path: Path) -> None:
        """Write `motion` to the new file `path`. The caller handles `OSError`."""

    @classmethod  # noqa: B027
    def check(cls, path: str | Path) -> None:
        """Raise `ParameterError` if a program or package that is needed to write `path` is not installed."""


# Names of joints in files.
#
# Joints with the names of another program are recognised there. Characters that a format cannot store are
# escaped as their bytes in UTF-8, such as "%20", as in URLs, so that different names stay different.


_PLAIN = frozenset("_-.:|")  # beside letters, marks and digits, characters that every reader of BVH accepts
_ESCAPED = re.compile("(?:%[0-9A-F]{2})+")
_NO_NAME = "%"  # stands for the empty name

_LIMBS = ("hip", "knee", "ankle", "foot", "collar", "shoulder", "elbow", "wrist", "hand")
_TRUNK = ("pelvis", "spine1", "spine2", "spine3", "neck", "head")


def _names(trunk: tuple[str, ...], limbs: tuple[str, ...], left: str, right: str) -> Mapping[str, str]:
    """Names by canonical joint. `left` and `right` are patterns for the names of limbs, with {}."""
    names = dict(zip(_TRUNK, trunk, strict=True))
    for side, form in (("left", left), ("right", right)):
        names |= {f"{side}_{part}": form.format(name) for part, name in zip(_LIMBS, limbs, strict=True)}
    return names


NAMES: dict[str, Mapping[str, str]] = {
    "smpl": {},  # the canonical names
    "mixamo": _names(
        ("Hips", "Spine", "Spine1", "Spine2", "Neck", "Head"),
        ("UpLeg", "Leg", "Foot", "ToeBase", "Shoulder", "Arm", "ForeArm", "Hand", "HandMiddle1"),
        "Left{}", "Right{}",
    ),
    "ue": _names(
        ("pelvis", "spine_01", "spine_02", "spine_03", "neck_01", "head"),
        ("thigh", "calf", "foot", "ball", "clavicle", "upperarm", "lowerarm", "hand", "middle_01"),
        "{}_l", "{}_r",
    ),
    "vrm": _names(
        ("hips", "spine", "chest", "upperChest", "neck", "head"),
        ("UpperLeg", "LowerLeg", "Foot", "Toes", "Shoulder", "UpperArm", "LowerArm", "Hand",
         "MiddleProximal"),
        "left{}", "right{}",
    ),
    "humanoid": _names(
        ("Hips", "Spine", "Chest", "UpperChest", "Neck", "Head"),
        ("UpperLeg", "LowerLeg", "Foot", "Toes", "Shoulder", "UpperArm", "LowerArm", "Hand",
         "MiddleProximal"),
        "Left{}", "Right{}",
    ),
    "rigify": _names(
        ("spine", "spine.001", "spine.002", "spine.003", "spine.004", "spine.006"),
        ("thigh", "shin", "foot", "toe", "shoulder", "upper_arm", "forearm", "hand", "f_middle.01"),
        "{}.L", "{}.R",
    ),
}  # fmt: skip


def renamed(motion: Motion, naming: str) -> Motion:
    """The motion with the joint names of another program.

    Raises `ParameterError` for an unknown naming, or a rig whose own names are unknown.
    """
    if naming not in NAMES:
        raise ParameterError(f"expected names among {', '.join(NAMES)}, got {naming!r}")
    if not NAMES[naming]:
        return motion
    role_of = {joint: role for role, joint in joint_roles(motion.skeleton).items()}
    names = tuple(
        NAMES[naming].get(role_of.get(joint, ""), name) for joint, name in enumerate(motion.skeleton.names)
    )
    return replace(motion, skeleton=replace(motion.skeleton, names=names))


def word_of(name: str) -> str:
    """A name as one word without braces, quotes or comments, which readers of BVH need."""
    return "".join(each if _is_plain(each) else _as_bytes(each) for each in name) or _NO_NAME


def name_of_word(word: str) -> str:
    """The name that `word_of` has escaped. Words of other programs are not changed."""
    if word == _NO_NAME:
        return ""
    return _ESCAPED.sub(_unescaped, word)


def text_names(names: Sequence[str]) -> tuple[str, ...]:
    """The names as different texts that can be stored. Other characters are escaped."""
    return distinct([name if _is_text(name) else word_of(name) for name in names], taken=names)


def identifiers(names: Sequence[str]) -> tuple[str, ...]:
    """Different identifiers of ASCII letters, digits and "_" for names, for paths in USD."""
    own = [re.sub(r"[^A-Za-z0-9_]", "_", name) or "_" for name in names]
    return distinct([f"_{name}" if name[0].isdigit() else name for name in own])


def _is_plain(character: str) -> bool:
    return character in _PLAIN or unicodedata.category(character)[0] in "LMN"


def _is_text(name: str) -> bool:
    """Whether a name is not empty, and has no control characters and no lone surrogates."""
    return bool(name) and all(unicodedata.category(each) not in ("Cc", "Cs") for each in name)


def _as_bytes(character: str) -> str:
    return "".join(f"%{byte:02X}" for byte in character.encode("utf-8", "surrogatepass"))


def _unescaped(found: re.Match[str]) -> str:
    try:
        return bytes.fromhex(found[0].replace("%", "")).decode("utf-8", "surrogatepass")
    except UnicodeDecodeError:  # from another program, with another meaning
        return found[0]


def distinct(names: Sequence[str], *, taken: Sequence[str] = (), form: str = "{}_{}") -> tuple[str, ...]:
    """The names, with a number added to those that repeat, so that all differ from each other and `taken`."""
    used, found = set(taken) | set(names), []
    seen: set[str] = set()
    for place, name in enumerate(names):
        own, number = name, place
        while own in seen or (own != name and own in used):
            own, number = form.format(name, number), number + 1
        seen.add(own)
        found.append(own)
    return tuple(found)


# Rest poses.


REST_POSES = {"t": 0.0, "a": np.pi / 4}  # radians that the arms hang below the horizontal


def with_rest_pose(motion: Motion, rest: str) -> Motion:
    """The motion on its skeleton in another rest pose, with the same positions of joints in the world.

    The rest pose stands on the floor at the origin, with the arms in a T or an A. The new world rotation of a
    joint is the old one times the inverse of its rotation from the old rest pose to the new.

    Raises `ParameterError` for an unknown rest pose, or if the joint names are unknown.
    """
    if rest not in REST_POSES:
        raise ParameterError(f"expected a rest pose among {', '.join(REST_POSES)}, got {rest!r}")
    skeleton = motion.skeleton
    body = standing_body(skeleton, motion)
    turns = np.array(body.bind_quat)  # (J, 4)
    for side in ("left", "right"):
        for joint, turn in _arm_turns(skeleton, body, side, REST_POSES[rest]).items():
            turns[joint] = rot.multiply(turn, turns[joint])
    above = np.where(skeleton.parents < 0, 0, skeleton.parents)
    offsets_m = rot.rotate(turns[above], skeleton.offsets_m)
    offsets_m[0] = [0.0, body.bind_pos_m[0, 1] - body.sole_m, 0.0]
    tips_m = rot.rotate(turns[skeleton.tip_parents], skeleton.tips_m)
    local = rot.multiply(rot.multiply(turns[above], motion.local_quat), rot.invert(turns))  # (T, J, 4)
    local[:, 0] = rot.multiply(motion.local_quat[:, 0], rot.invert(turns[0]))
    return replace(
        motion,
        skeleton=replace(skeleton, offsets_m=offsets_m, tips_m=tips_m),
        local_quat=rot.make_continuous(local),
    )


def _arm_turns(skeleton: Skeleton, body: Body, side: str, below_rad: float) -> dict[int, Floats]:
    """World rotations (4,) by joint that stretch an arm of the standing body sideways and down."""
    outwards = body.place(f"{side}_shoulder") - body.place(
        f"{'right' if side == 'left' else 'left'}_shoulder"
    )
    outwards = outwards * np.array([1.0, 0.0, 1.0]) / np.hypot(outwards[0], outwards[2])
    along = np.cos(below_rad) * outwards - np.array([0.0, np.sin(below_rad), 0.0])
    turns: dict[int, Floats] = {}
    for start, end in (("shoulder", "elbow"), ("elbow", "wrist")):
        bone = body.place(f"{side}_{end}") - body.place(f"{side}_{start}")
        turn = rot.between(bone / np.linalg.norm(bone), along)
        first = body.roles[f"{side}_{start}"]
        turns |= dict.fromkeys(descendants(skeleton.parents, first), turn)
    return turns


# Programs that a dance is written for: bones, rest pose, root motion, names of clips, marks of loops.
#
# Unreal's mannequin has a bone "root" on the floor, whose child is the pelvis, and stands in an A pose. Root
# motion is that of this bone. Godot's humanoid profile and Unity's humanoid have the same names, in a T pose.
# Godot loops a clip whose name ends in "-loop". Avatars of VRChat dance in place. MikuMikuDance reads VMD.


TargetName = Literal["unreal", "unity", "vrchat", "blender", "mmd", "godot"]
_LOOP_GAP_M = 0.001  # greatest distance of a joint between the ends of a loop
_UNUSUAL = re.compile(r"[^A-Za-z0-9]+")


@dataclass(frozen=True)
class Target:
    """What a program expects of a GLB."""

    naming: str  # a key of `writer.NAMES`
    rest: Literal["t", "a"]
    root: str = ""  # name of the bone that carries the path on the floor, or "" for the hips
    in_place: bool = False  # whether the hips stay above the place where they begin
    loop_mark: str = "_loop"  # at the end of the name of a clip that loops


TARGETS: dict[TargetName, Target] = {
    "unreal": Target("ue", "a", root="root"),
    "unity": Target("humanoid", "t"),
    "vrchat": Target("humanoid", "t", in_place=True),
    "blender": Target("rigify", "t"),
    "mmd": Target("smpl", "a"),
    "godot": Target("humanoid", "t", root="Root", loop_mark="-loop"),
}


def check_target_format(name: str, path: str | Path) -> None:
    """Raise `ParameterError` for an unknown program, or a file that it does not read."""
    if name not in TARGETS:
        raise ParameterError(f"expected a program among {', '.join(TARGETS)}, got {name!r}")
    if not reads(name, path):
        wanted = _suffix(name)
        raise ParameterError(f"expected a file {wanted} for {name}, got {path}: use -o NAME{wanted}")


def reads(name: str, path: str | Path) -> bool:
    """Whether a file has the format that is written for a program."""
    return Path(path).suffix.lower() == _suffix(name)


def _suffix(name: str) -> str:
    return ".vmd" if name == "mmd" else ".glb"


def prepared(motion: Motion, target: Target) -> Motion:
    """The motion with the names, the rest pose and the place that a program expects.

    Raises `ParameterError` for a rig whose joint names are unknown.
    """
    return placed(renamed(with_rest_pose(motion, target.rest), target.naming), target)


def placed(motion: Motion, target: Target) -> Motion:
    """The motion, with the hips above the origin if the program expects it in place."""
    if not target.in_place:
        return motion
    root_pos_m = motion.root_pos_m.copy()  # (T, 3)
    root_pos_m[:, [0, 2]] = 0.0
    return replace(motion, root_pos_m=root_pos_m)


def clip_name(song: str, target: Target, *, loops: bool) -> str:
    """The name of a clip: letters and digits of the song's name, and the mark of a loop."""
    return f"{_words(song)}{target.loop_mark if loops else ''}"


def _words(name: str) -> str:
    return _UNUSUAL.sub("_", name).strip("_") or "dance"


def is_loop(motion: Motion) -> bool:
    """Whether a motion ends where it begins, in the same pose."""
    ends_m = [motion.sliced(frame, frame + 1).joint_pos_m()[0] for frame in (0, motion.n_frames - 1)]
    return motion.n_frames > 1 and bool(np.linalg.norm(ends_m[1] - ends_m[0], axis=-1).max() < _LOOP_GAP_M)


def named_clips(motions: Iterable[tuple[str, Motion]], target: Target | None = None) -> dict[str, Motion]:
    """The motions by the names of their clips, which all differ, with the mark of those that loop."""
    given = list(motions)
    mark = Target.loop_mark if target is None else target.loop_mark
    names = distinct([_words(name) for name, _ in given])
    return {
        f"{name}{mark if is_loop(motion) else ''}": motion
        for name, (_, motion) in zip(names, given, strict=True)
    }
