"""Hands kept from entering the body: of other proportions, it reaches into itself where no dancer did."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from choreograph.blending.foot_locking import smooth_cover
from choreograph.characters.body_shape import BodyPart, place_in_rest
from choreograph.motion import rotations as rot
from choreograph.motion.inverse_kinematics import move_limb
from choreograph.motion.kinematics import forward, to_local
from choreograph.motion.motion import Motion

Floats = NDArray[np.float64]

_EASE_S = 0.12  # to each side, over which a hand is led out and back
_PASSES = 3  # a hand led out of one part may be in another
_PALM = 0.35  # of the forearm, beyond the wrist: where a hand is thickest
_THICKNESS = 0.08  # of the forearm: half a hand's


def keep_hands_out(figure: Motion, parts: Sequence[BodyPart], front: Floats) -> Motion:
    """The figure with wrists and palms led to the surface of the body where they are inside of it.

    `front` (3,) is where it looks in its rest pose, to which elbows bend. Hands keep their rotation. Where
    they are outside, nothing changes, up to the easing before and after.
    """
    skeleton = figure.skeleton
    pos_m, quat = forward(skeleton, figure.root_pos_m, figure.local_quat)  # (T, J, 3), (T, J, 4)
    rest = skeleton.rest_pos_m()
    ease = max(2, round(_EASE_S * figure.fps))
    moved = False
    for side in ("left", "right"):
        shoulder, elbow, wrist = (skeleton.index(f"{side}_{part}") for part in ("shoulder", "elbow", "wrist"))
        bone = rest[elbow] - rest[shoulder]
        axis = np.cross(bone, front)
        axis = axis / max(float(np.linalg.norm(axis)), 1e-9)
        forearm = rest[wrist] - rest[elbow]
        for _ in range(_PASSES):
            palm = pos_m[:, wrist] + rot.rotate(quat[:, wrist], _PALM * forearm)
            radius = _THICKNESS * float(np.linalg.norm(forearm))
            shift = _way_out([pos_m[:, wrist], palm], parts, pos_m, quat, rest, radius, ease)
            if not shift.any():
                break
            hinge = rot.rotate(quat[:, elbow], axis)
            move_limb(skeleton, (shoulder, elbow, wrist), pos_m, quat, pos_m[:, wrist] + shift, hinge)
            pos_m = forward(skeleton, figure.root_pos_m, to_local(skeleton, quat))[0]
            moved = True
    return replace(figure, local_quat=rot.make_continuous(to_local(skeleton, quat))) if moved else figure


def _way_out(
    points_m: Sequence[Floats],
    parts: Sequence[BodyPart],
    pos_m: Floats,
    quat: Floats,
    rest_m: Floats,
    radius_m: float,
    ease: int,
) -> Floats:
    """The smooth shift (T, 3) that brings points (T, 3) of a hand out of the part they are deepest in."""
    shift = np.zeros((len(pos_m), 3))
    for part in parts:
        at, turned = pos_m[:, part.joint], quat[:, part.joint]
        for point in points_m:
            way = part.way_out_m(place_in_rest(point, at, turned, rest_m[part.joint]), radius_m)
            farther = np.linalg.norm(way, axis=-1) > np.linalg.norm(shift, axis=-1)
            shift[farther] = rot.rotate(turned, way)[farther]
    if not shift.any():
        return shift
    smooth = gaussian_filter1d(shift, ease / 2.0, axis=0, mode="nearest")
    smooth /= np.maximum(np.linalg.norm(smooth, axis=-1, keepdims=True), 1e-12)
    return smooth_cover(np.linalg.norm(shift, axis=-1), ease)[:, None] * smooth
