"""Names of the canonical joints in other programs: a motion with these is mapped there without a click."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from choreograph.errors import ParameterError
from choreograph.motion.motion import Motion
from choreograph.motion.rigs import joint_roles

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
