"""Moves arms out of the trunk where a pose, or the delay of an arm, brings them into it."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from choreograph.core.numerics import Floats
from choreograph.motion import rotations as rot
from choreograph.motion.kinematics import forward
from choreograph.motion.skeleton import canonical_skeleton
from content.moves.notation import SIDES

_SKELETON = canonical_skeleton()
_INDEX = {name: i for i, name in enumerate(_SKELETON.names)}
_HALF_WIDTH_M, _HALF_DEPTH_M = 0.140, 0.095  # of the trunk, an upright ellipse
_ARM_M = 0.032  # radius of a forearm
_ROUNDS = 3
_AROUND_S = 0.12  # a correction begins and ends over this time


def clear_trunk(local_quat: Floats, root_pos_m: Floats, fps: float) -> None:
    """Turn the shoulders of local rotations (T, J, 4) such that forearms and hands stay out of the trunk."""
    for _ in range(_ROUNDS):
        pos, quat = forward(_SKELETON, root_pos_m, local_quat)
        for side in SIDES:
            turn = _turn_out(pos, quat, side)  # (T, 3) in the world
            if not turn.any():
                continue
            collar = quat[:, _INDEX[f"{side}_collar"]]
            own = rot.rotate(rot.invert(collar), turn)
            shoulder = _INDEX[f"{side}_shoulder"]
            smooth = rot.from_rotvec(_eased(own, fps))
            local_quat[:, shoulder] = rot.multiply(smooth, local_quat[:, shoulder])


def _turn_out(pos: Floats, quat: Floats, side: str) -> Floats:
    """Rotation vectors (T, 3) about the shoulder that bring the deepest point of the arm to the surface."""
    at = {name: pos[:, index] for name, index in _INDEX.items()}
    shoulder, elbow, wrist, hand = (at[f"{side}_{j}"] for j in ("shoulder", "elbow", "wrist", "hand"))
    chest_top = at["spine3"] + 0.6 * (at["neck"] - at["spine3"])
    parts = ((at["spine2"], chest_top, "spine2"), (at["pelvis"], at["spine2"], "pelvis"))
    best, turn = np.zeros(len(pos)), np.zeros((len(pos), 3))
    for point in (0.5 * (elbow + wrist), wrist, 0.5 * (wrist + hand), hand):
        for low, high, joint in parts:
            depth, out = _depth(point, low, high, quat[:, _INDEX[joint]])
            arm = point - shoulder
            axis = np.cross(arm, out)
            length = np.maximum(np.linalg.norm(axis, axis=-1), 1e-6)
            angle = depth / np.maximum(np.linalg.norm(arm, axis=-1), 0.15)
            deeper = depth > best
            turn[deeper] = (axis / length[:, None] * angle[:, None])[deeper]
            best = np.maximum(best, depth)
    return turn


def _depth(point: Floats, low: Floats, high: Floats, quat: Floats) -> tuple[Floats, Floats]:
    """How deep a point is in a part of the trunk, (T,), 0 if it is outside, and the way out in the world."""
    axis = high - low
    along = np.sum((point - low) * axis, axis=-1) / np.sum(axis * axis, axis=-1)
    own = rot.rotate(rot.invert(quat), point - low - along.clip(0.0, 1.0)[:, None] * axis)
    width, deep = _HALF_WIDTH_M + _ARM_M, _HALF_DEPTH_M + _ARM_M
    size = np.maximum(np.hypot(own[:, 0] / width, own[:, 2] / deep), 1e-3)
    inside = (size < 1.0) & (along > -0.1) & (along < 1.1)
    out = np.stack([own[:, 0] / width**2, np.zeros(len(own)), own[:, 2] / deep**2], axis=-1)
    out /= np.maximum(np.linalg.norm(out, axis=-1), 1e-6)[:, None]
    gap = (1.0 / size - 1.0) * np.hypot(own[:, 0], own[:, 2])
    return np.where(inside, gap, 0.0), rot.rotate(quat, out)


def _eased(vectors: Floats, fps: float) -> Floats:
    """Rotation vectors (T, 3) that begin before they are needed and end after, as large as needed."""
    width = max(1, round(_AROUND_S * fps))
    size = np.linalg.norm(vectors, axis=-1)
    held = gaussian_filter1d(maximum_filter1d(size, 2 * width + 1), 0.5 * width, mode="nearest")
    mean = gaussian_filter1d(vectors, width, axis=0, mode="nearest")
    length = np.linalg.norm(mean, axis=-1)
    return mean / np.maximum(length, 1e-9)[:, None] * held[:, None]
