"""Two-bone IK: analytic inverse kinematics of a leg or an arm, all frames at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.motion import rotations as rot

Floats = NDArray[np.float64]

_SOFT_FROM = 0.98  # of the full length: beyond, the limb extends more and more slowly (soft IK)
_FULL = 0.9995  # of the full length is never exceeded, so the limb never locks straight
_HINT = 0.05  # sine of the bend; a limb straighter than that bends about `hinge_axis`


def two_bone(
    start_m: Floats, middle_m: Floats, end_m: Floats, target_m: Floats, hinge_axis: Floats
) -> tuple[Floats, Floats]:
    """World rotations (..., 4) to apply to upper and lower bone so that the end reaches the target.

    `start_m`, `middle_m`, `end_m`, `target_m` (..., 3): hip, knee, ankle and where the ankle should
    be. The limb keeps its bending direction; while it is straight, `hinge_axis` (..., 3), the world axis
    of a positive bend, decides. A target out of reach is approached softly. A target where the end
    already is leaves the limb unchanged.
    """
    upper, lower = middle_m - start_m, end_m - middle_m
    a, b = _length(upper), _length(lower)
    axis = np.cross(upper, lower) / np.maximum(a * b, 1e-12)[..., None] + _HINT * hinge_axis
    bone = upper / np.maximum(a, 1e-9)[..., None]
    axis = axis - bone * np.sum(axis * bone, axis=-1, keepdims=True)
    axis = axis / np.maximum(_length(axis), 1e-9)[..., None]
    current = np.arctan2(np.sum(np.cross(upper, lower) * axis, axis=-1), np.sum(upper * lower, axis=-1))
    reach = _soft_reach(_length(target_m - start_m), _length(end_m - start_m), a + b)
    reach = np.maximum(reach, np.abs(a - b) + 1e-6)
    cos = (reach**2 - a**2 - b**2) / np.maximum(2.0 * a * b, 1e-12)
    change = np.arccos(np.clip(cos, -1.0, 1.0)) - np.abs(current)
    bend = rot.from_rotvec(axis * (change * np.where(current < 0, -1.0, 1.0))[..., None])
    swing = rot.between(upper + rot.rotate(bend, lower), target_m - start_m)
    return swing, rot.multiply(swing, bend)


def _soft_reach(target: Floats, current: Floats, full: Floats) -> Floats:
    """Start-to-end distance of a limb of length `full`: `target`, softly limited below the full length."""
    hard = np.maximum(_FULL * full, current)
    soft = np.clip(current, _SOFT_FROM * full, hard - 1e-6)
    room = hard - soft
    # Clipped because the exponential underflows.
    beyond = hard - room * np.exp(-np.clip((target - soft) / room, 0.0, 500.0))
    return np.where(target <= soft, target, np.where(target <= current, target, beyond))


def _length(vector: Floats) -> Floats:
    return np.linalg.norm(vector, axis=-1)
