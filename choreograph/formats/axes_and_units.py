"""Infers the up axis and the length unit of a file from the body in it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.numerics import Floats
from choreograph.motion import rotations as rot
from choreograph.motion.bone_map import joint_roles
from choreograph.motion.skeleton import Skeleton

_BODY_HEIGHT_M = 1.70
# The first unit in `_UNITS_M` that gives a height in this range is chosen.
_PLAUSIBLE_HEIGHT_M = (1.0, 2.3)
_UNITS_M = {
    "metres": 1.0,
    "centimetres": 0.01,
    "millimetres": 0.001,
    "decimetres": 0.1,
    "inches": 0.0254,
    "CMU units (0.45 of an inch)": 0.0254 / 0.45,
    "feet": 0.3048,
}
_READ_AS, _NO_UNIT = "read as ", "matches no known unit"
_SMALLEST = 1e-6  # height in any unit
_LEG_OF_HEIGHT = 0.46  # hip to ankle over body height, average adult

_HALF = float(np.sqrt(0.5))
# The rotation that takes each axis to +Y.
_TO_Y_UP = {
    "+X": np.array([_HALF, 0.0, 0.0, _HALF]),
    "-X": np.array([_HALF, 0.0, 0.0, -_HALF]),
    "-Y": np.array([0.0, 1.0, 0.0, 0.0]),
    "+Z": np.array([_HALF, -_HALF, 0.0, 0.0]),
    "-Z": np.array([_HALF, _HALF, 0.0, 0.0]),
}
Z_UP_TO_Y_UP = _TO_Y_UP["+Z"]
UP_AXIS_MARGIN = 1.5  # by which another axis must exceed Y to be up, because dancers also lie down


def known_roles(skeleton: Skeleton) -> dict[str, int]:
    """The roles of the joints, empty if the joint names of the rig are unknown."""
    try:
        return joint_roles(skeleton)
    except ParameterError:
        return {}


def unit_m(skeleton: Skeleton, pos: NDArray[np.floating]) -> tuple[float, str]:
    """Metres per unit of the file, inferred from the height of the body, and a note.

    `pos` (T, J, 3) are joint positions in the unit of the file. Raises `FormatError` if the body has no size.
    """
    height = body_height(skeleton, pos)
    for name, metres in _UNITS_M.items():
        if _PLAUSIBLE_HEIGHT_M[0] <= height * metres <= _PLAUSIBLE_HEIGHT_M[1]:
            return metres, f"{_READ_AS}{name}, which makes the body {height * metres:.2f} m tall"
    metres = _BODY_HEIGHT_M / height
    return metres, f"a body {height:.4g} units tall {_NO_UNIT}: scaled to {_BODY_HEIGHT_M:.2f} m"


def unit_in_notes(notes: Iterable[str]) -> str:
    """The unit in the note of `unit_m`, "" if there is no such note."""
    for note in notes:
        unit = note.removeprefix(_READ_AS).partition(",")[0]
        if unit in _UNITS_M:
            return unit
        if _NO_UNIT in note:
            return "unknown"
    return ""


def body_height(skeleton: Skeleton, pos: NDArray[np.floating]) -> float:
    """The height of a body with joints at `pos` (T, J, 3), in the same unit.

    It is estimated from the length of the legs, so that no pose needs to be upright. If the joint names are
    unknown, it is the largest extent of the body. Raises `FormatError` if the body has no size.
    """
    roles = known_roles(skeleton)
    if roles:
        legs = [
            np.linalg.norm(
                pos[:, roles[f"{side}_{upper}"]] - pos[:, roles[f"{side}_{lower}"]], axis=-1
            ).mean()
            for side in ("left", "right")
            for upper, lower in (("hip", "knee"), ("knee", "ankle"))
        ]
        height = float(sum(legs)) / 2 / _LEG_OF_HEIGHT
    else:
        height = float(np.ptp(pos, axis=1).max())
    if height < _SMALLEST:
        raise FormatError("all joints are in the same place: the skeleton has no bone lengths")
    return height


def rotation_to_y_up(skeleton: Skeleton, pos: NDArray[np.floating]) -> tuple[Floats, str]:
    """The rotation (4,) that makes +Y the up axis, and a note. Identity and "" if +Y is up already.

    Up is the axis along which the shoulders are above the ankles in `pos` (T, J, 3), averaged over frames.
    """
    roles = known_roles(skeleton)
    if not roles:
        return rot.IDENTITY, ""
    rotation, name = rotation_from_upward(upward(roles, pos))
    if not name:
        return rotation, ""
    return rotation, f"rotated from {name} up to +Y up: the shoulders are above the feet along {name}"


def upward(roles: Mapping[str, int], pos: NDArray[np.floating]) -> Floats:
    """The mean vector (3,) from the ankles to the shoulders of `pos` (T, J, 3)."""
    joints = [[roles[f"{side}_{part}"] for side in ("left", "right")] for part in ("shoulder", "ankle")]
    shoulders, ankles = pos[:, joints].mean(axis=(0, 2))
    return np.asarray(shoulders - ankles, np.float64)


def rotation_from_upward(upward: Floats) -> tuple[Floats, str]:
    """The rotation (4,) of the axis nearest to `upward` (3,) to +Y, and that axis, "" if it is +Y."""
    axis = int(np.argmax(np.abs(upward)))
    name = f"{'+' if upward[axis] > 0 else '-'}{'XYZ'[axis]}"
    if name == "+Y" or (axis != 1 and abs(upward[axis]) < UP_AXIS_MARGIN * abs(upward[1])):
        return rot.IDENTITY, ""
    return _TO_Y_UP[name], name


def to_rotated_axes(rotation: Floats, vectors: Floats, quats: Floats) -> tuple[Floats, Floats]:
    """Vectors (..., 3) and rotations (..., 4) in axes that are rotated by `rotation` (4,)."""
    return rot.rotate(rotation, vectors), rot.multiply(rot.multiply(rotation, quats), rot.invert(rotation))
