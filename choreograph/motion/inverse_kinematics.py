"""Two bones and a target: analytic inverse kinematics of a leg or an arm, all frames at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.motion import rotations as rot

Floats = NDArray[np.float64]

_SOFT_FROM = 0.98  # of the full length: from here on the limb stretches more and more slowly
_FULL = 0.9995  # of the full length is never exceeded, so the middle joint never locks
_HINT = 0.05  # a limb straighter than this (sine of its bend) bends about the hinge's own axis


def two_bone(
    start_m: Floats, middle_m: Floats, end_m: Floats, target_m: Floats, hinge_axis: Floats
) -> tuple[Floats, Floats]:
    """World turns (..., 4) to apply to the upper and the lower bone so that the end reaches the target.

    `start_m`, `middle_m`, `end_m`, `target_m` (..., 3): hip, knee, ankle and where the ankle should
    be. The limb keeps bending the way it bends; `hinge_axis` (..., 3), the world axis of a positive
    bend, decides while it is straight. A target out of reach is approached softly. A target where the
    end already is leaves the limb as it is.
    """
    upper, lower = middle_m - start_m, end_m - middle_m
    a, b = _length(upper), _length(lower)
    axis = np.cross(upper, lower) / np.maximum(a * b, 1e-12)[..., None] + _HINT * hinge_axis
    bone = upper / np.maximum(a, 1e-9)[..., None]
    axis = axis - bone * np.sum(axis * bone, axis=-1, keepdims=True)
    axis = axis / np.maximum(_length(axis), 1e-9)[..., None]
    now = np.arctan2(np.sum(np.cross(upper, lower) * axis, axis=-1), np.sum(upper * lower, axis=-1))
    reach = _soft_reach(_length(target_m - start_m), _length(end_m - start_m), a + b)
    reach = np.maximum(reach, np.abs(a - b) + 1e-6)
    cos = (reach**2 - a**2 - b**2) / np.maximum(2.0 * a * b, 1e-12)
    change = np.arccos(np.clip(cos, -1.0, 1.0)) - np.abs(now)
    bend = rot.from_rotvec(axis * (change * np.where(now < 0, -1.0, 1.0))[..., None])
    swing = rot.between(upper + rot.rotate(bend, lower), target_m - start_m)
    return swing, rot.multiply(swing, bend)


def _soft_reach(wanted: Floats, now: Floats, full: Floats) -> Floats:
    """Distance that a limb of length `full` goes to: `wanted`, bent softly below the full length."""
    hard = np.maximum(_FULL * full, now)
    soft = np.clip(now, _SOFT_FROM * full, hard - 1e-6)
    room = hard - soft
    # Beyond some hundred nothing is left of the exponential, and numbers underflow.
    beyond = hard - room * np.exp(-np.clip((wanted - soft) / room, 0.0, 500.0))
    return np.where(wanted <= soft, wanted, np.where(wanted <= now, wanted, beyond))


def _length(vector: Floats) -> Floats:
    return np.linalg.norm(vector, axis=-1)
