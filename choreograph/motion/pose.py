"""Heading and ground position of a body, and poses relative to them (in the root frame)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.motion import rotations as rot
from choreograph.motion.body import BODY_JOINTS

Floats = NDArray[np.float64]

_PELVIS = BODY_JOINTS.index("pelvis")
_ACROSS = tuple(
    (BODY_JOINTS.index(f"left_{part}"), BODY_JOINTS.index(f"right_{part}")) for part in ("hip", "shoulder")
)


def heading_rad(body_pos_m: Floats) -> Floats:
    """Heading (...) of body positions (..., 21, 3): 0 faces +Z, positive turns towards +X.

    Forward is perpendicular to the mean of hip and shoulder axes, on the ground.
    """
    left, right = (list(side) for side in zip(*_ACROSS, strict=True))
    across = (body_pos_m[..., left, :] - body_pos_m[..., right, :]).sum(axis=-2)  # (..., 3)
    return np.arctan2(-across[..., 2], across[..., 0])  # left is +X when facing +Z


def ground_pos_m(body_pos_m: Floats) -> Floats:
    """Pelvis position projected on the ground, (..., 3) with Y = 0, of body positions (..., 21, 3)."""
    return body_pos_m[..., _PELVIS, :] * np.array([1.0, 0.0, 1.0])


def to_root_frame(body_pos_m: Floats, vectors: Floats | None = None) -> Floats:
    """Poses (..., 21, 3) at heading 0 above the origin; or `vectors` (velocities), if given, only rotated."""
    rotation = rot.about_y(-heading_rad(body_pos_m))[..., None, :]  # (..., 1, 4)
    if vectors is not None:
        return rot.rotate(rotation, vectors)
    return rot.rotate(rotation, body_pos_m - ground_pos_m(body_pos_m)[..., None, :])


def clips_to_root_frame(body_pos_m: Floats) -> Floats:
    """Clips (..., T, 21, 3), each rigidly moved: heading 0 in the middle frame, mean ground position 0.

    Travel and turning within a clip are kept.
    """
    middle = body_pos_m[..., body_pos_m.shape[-3] // 2, :, :]  # (..., 21, 3)
    rotation = rot.about_y(-heading_rad(middle))[..., None, None, :]  # (..., 1, 1, 4)
    mean_ground = ground_pos_m(body_pos_m).mean(axis=-2)[..., None, None, :]  # (..., 1, 1, 3)
    return rot.rotate(rotation, body_pos_m - mean_ground)
