"""Joining two motions at an instant: a crossfade, or an offset that dies away (inertialisation)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.motion import rotations as rot

Floats = NDArray[np.float64]


def crossfade(a_root: Floats, a_quat: Floats, b_root: Floats, b_quat: Floats) -> tuple[Floats, Floats]:
    """Linear blend from a to b over all their frames: roots (T, 3), rotations (T, J, 4).

    The paper's join (ChoreoGraph, section 3.3).
    """
    weight = (np.arange(len(a_root)) + 0.5) / len(a_root)  # (T,)
    root = a_root * (1 - weight)[:, None] + b_root * weight[:, None]
    return root, rot.slerp(a_quat, b_quat, weight[:, None])


def inertial_offsets(
    a_root: Floats, a_quat: Floats, b_root: Floats, b_quat: Floats, *, fps: float
) -> tuple[Floats, Floats]:
    """What b lacks to meet a, with first and second time derivative: (3, 3) and (3, J, 3).

    The arguments are the three frames around the join, (3, 3) and (3, J, 4); row 0 of a result is
    the offset (metres, rotation vector), row 1 per second, row 2 per second².
    """
    root = a_root - b_root  # (3, 3)
    turn = rot.to_rotvec(rot.multiply(a_quat, rot.invert(b_quat)))  # (3, J, 3)
    return _derivatives(root, fps), _derivatives(turn, fps)


def _derivatives(values: Floats, fps: float) -> Floats:
    before, here, after = values
    return np.stack([here, (after - before) * fps / 2, (after - 2 * here + before) * fps**2])


def fading(offset: Floats, times_s: Floats, length_s: float) -> Floats:
    """The quintic that starts with `offset` (3, ...) and its derivatives and is at rest at zero after
    `length_s`; values (T, ...) at `times_s` (T,) ≥ 0.

    Bollo, Inertialization (GDC 2018), without the clamp on overshoot: both sides of our joins share
    the offset, which halves it.
    """
    d = length_s
    x, v, a = offset
    a = np.zeros_like(a) if d == 0 else a
    # p(0) = x, p'(0) = v, p''(0) = a; p(d) = p'(d) = p''(d) = 0.
    c3 = -(10 * x + 6 * v * d + 1.5 * a * d**2) / d**3
    c4 = (15 * x + 8 * v * d + 1.5 * a * d**2) / d**4
    c5 = -(6 * x + 3 * v * d + 0.5 * a * d**2) / d**5
    t = np.minimum(np.asarray(times_s), d).reshape(-1, *([1] * x.ndim))
    return x + v * t + a * t**2 / 2 + c3 * t**3 + c4 * t**4 + c5 * t**5


def apply_offset(root: Floats, quat: Floats, root_offset: Floats, turn: Floats) -> tuple[Floats, Floats]:
    """Roots (T, 3) shifted by (T, 3) and rotations (T, J, 4) turned by rotation vectors (T, J, 3)."""
    return root + root_offset, rot.multiply(rot.from_rotvec(turn), quat)
