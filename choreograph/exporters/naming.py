"""Names of joints in files: those of other programs, and any name so that every reader reads it back.

A motion with the names of another program is mapped there without a click. A name that a format cannot hold
is escaped: bytes of UTF-8 as "%20", as in URLs, so that two names never become one.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import replace

from choreograph.errors import ParameterError
from choreograph.motion.motion import Motion
from choreograph.motion.rigs import joint_roles

_PLAIN = frozenset("_-.:|")  # beside letters, marks and digits, what every reader of BVH takes
_ESCAPED = re.compile("(?:%[0-9A-F]{2})+")
_NO_NAME = "%"  # which no escaped name is

_LIMBS = ("hip", "knee", "ankle", "foot", "collar", "shoulder", "elbow", "wrist", "hand")
_TRUNK = ("pelvis", "spine1", "spine2", "spine3", "neck", "head")


def _names(trunk: tuple[str, ...], limbs: tuple[str, ...], left: str, right: str) -> Mapping[str, str]:
    """Names by canonical joint; `left` and `right` say how a limb's name is made, with {}."""
    names = dict(zip(_TRUNK, trunk, strict=True))
    for side, form in (("left", left), ("right", right)):
        names |= {f"{side}_{part}": form.format(name) for part, name in zip(_LIMBS, limbs, strict=True)}
    return names


NAMES: dict[str, Mapping[str, str]] = {
    "smpl": {},  # as they are here
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
    "rigify": _names(
        ("spine", "spine.001", "spine.002", "spine.003", "spine.004", "spine.006"),
        ("thigh", "shin", "foot", "toe", "shoulder", "upper_arm", "forearm", "hand", "f_middle.01"),
        "{}.L", "{}.R",
    ),
}  # fmt: skip


def renamed(motion: Motion, naming: str) -> Motion:
    """The motion with the joints of its body named as another program names them.

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
    """A name as one word without braces, quotes or comments, as BVH needs it: readers split its lines."""
    return "".join(each if _is_plain(each) else _as_bytes(each) for each in name) or _NO_NAME


def name_of_word(word: str) -> str:
    """The name that `word_of` wrote as a word; words of other programs are as they are."""
    if word == _NO_NAME:
        return ""
    return _ESCAPED.sub(_unescaped, word)


def text_names(names: Sequence[str]) -> tuple[str, ...]:
    """The names as different texts that can be stored: those with characters that cannot are escaped."""
    return _distinct([name if _is_text(name) else word_of(name) for name in names], taken=names)


def identifiers(names: Sequence[str]) -> tuple[str, ...]:
    """Different identifiers of ASCII letters, digits and "_" for names, as paths in USD have them."""
    own = [re.sub(r"[^A-Za-z0-9_]", "_", name) or "_" for name in names]
    return _distinct([f"_{name}" if name[0].isdigit() else name for name in own])


def _is_plain(character: str) -> bool:
    return character in _PLAIN or unicodedata.category(character)[0] in "LMN"


def _is_text(name: str) -> bool:
    """Whether a name has no control characters, no half of a surrogate pair, and is not empty."""
    return bool(name) and all(unicodedata.category(each) not in ("Cc", "Cs") for each in name)


def _as_bytes(character: str) -> str:
    return "".join(f"%{byte:02X}" for byte in character.encode("utf-8", "surrogatepass"))


def _unescaped(found: re.Match[str]) -> str:
    try:
        return bytes.fromhex(found[0].replace("%", "")).decode("utf-8", "surrogatepass")
    except UnicodeDecodeError:  # of another program, which means something else by it
        return found[0]


def _distinct(names: Sequence[str], taken: Sequence[str] = ()) -> tuple[str, ...]:
    """The names, those that repeat with a number that none has."""
    used, found = set(taken) | set(names), []
    seen: set[str] = set()
    for place, name in enumerate(names):
        own, number = name, place
        while own in seen or (own != name and own in used):
            own, number = f"{name}_{number}", number + 1
        seen.add(own)
        found.append(own)
    return tuple(found)
