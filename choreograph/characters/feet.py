"""Feet of a character where the dancer's are: on the floor, and standing still as long.

Of other proportions, legs that only point as the dancer's do would slide, float and sink.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from choreograph.motion import rotations as rot
from choreograph.motion.floor import estimate_floor_m, sole_pos_m
from choreograph.motion.kinematics import forward
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import Skeleton, canonical_skeleton

Floats = NDArray[np.float64]

_SHIFT_S = 0.03  # feet are moved more smoothly than heel and ball take turns
_HEADING_S = 0.5  # a stance turns that slowly: hips swing over feet that stand
_FRONT = np.array([0.0, 0.0, 1.0])


def placed_feet(dancer: Motion, figure: Motion) -> tuple[Motion, Floats]:
    """The figure, its hips on the dancer's path scaled by leg length; and how far its feet are to be moved.

    They belong where the dancer's are, scaled: the balls of the feet on the ground, the lowest points of the
    soles in height. Feet of another length against the legs would slide, and on tiptoe float or sink. What is
    common to all frames is not moved by: its height is the hips', its place the stance of the figure's own
    hips. (T, 2, 3) is the rest.
    """
    scale = _leg_m(figure.skeleton) / _leg_m(dancer.skeleton)
    hips = [[skeleton.index(f"{side}_hip") for side in ("left", "right")]
            for skeleton in (dancer.skeleton, figure.skeleton)]  # fmt: skip
    path = scale * dancer.joint_pos_m()[:, hips[0]].mean(axis=1)
    at_origin = figure.joint_pos_m()[:, hips[1]].mean(axis=1)
    placed = replace(figure, root_pos_m=path - at_origin)
    dancers = _sole_pos_m(dancer, _dancers_soles()) - [0.0, estimate_floor_m(sole_pos_m(dancer)), 0.0]
    own = _sole_pos_m(placed, figure.skeleton.tips_m.reshape(2, -1, 3))  # (T, 2, P, 3) heel, ball, …
    shift_m = scale * dancers[:, :, 1] - own[:, :, 1]  # (T, 2, 3)
    shift_m[..., 1] = scale * dancers[..., 1].min(axis=-1) - own[..., 1].min(axis=-1)
    height_m = float(np.median(shift_m[..., 1]))
    shift_m[..., 1] -= height_m
    shift_m -= _stance_m(placed, shift_m)
    shift_m = gaussian_filter1d(shift_m, _SHIFT_S * figure.fps, axis=0, mode="nearest")
    return placed.moved(shift_m=np.array([0.0, height_m, 0.0])), shift_m


def _stance_m(figure: Motion, shift_m: Floats) -> Floats:
    """What shifts (T, 2, 3) on the ground have in common, seen from where the hips look for some time."""
    ahead = rot.rotate(figure.local_quat[:, 0], _FRONT)
    ahead = gaussian_filter1d(ahead, _HEADING_S * figure.fps, axis=0, mode="nearest")
    heading = rot.about_y(np.arctan2(ahead[:, 0], ahead[:, 2]))[:, None]  # (T, 1, 4)
    common_m = np.median(rot.rotate(rot.invert(heading), shift_m), axis=0) * [1.0, 0.0, 1.0]  # (2, 3)
    return rot.rotate(heading, np.broadcast_to(common_m, shift_m.shape))


def _dancers_soles() -> Floats:
    """From the canonical body's ankles to its soles below heel and ball, (2, 2, 3)."""
    body = canonical_skeleton()
    rest = body.rest_pos_m()
    feet = [[rest[body.index(f"{side}_{part}")] for part in ("ankle", "foot")] for side in ("left", "right")]
    return np.stack([sole_offsets_m(ankle, [ankle, ball], ball[1]) for ankle, ball in feet])


def _sole_pos_m(motion: Motion, soles_m: Floats) -> Floats:
    """Points of both soles (T, 2, P, 3); `soles_m` (2, P, 3) are their offsets from the ankles."""
    pos_m, quat = forward(motion.skeleton, motion.root_pos_m, motion.local_quat)  # (T, J, 3), (T, J, 4)
    ankles = [motion.skeleton.index(f"{side}_ankle") for side in ("left", "right")]
    return pos_m[:, ankles, None] + rot.rotate(quat[:, ankles, None], soles_m)


def sole_offsets_m(ankle_m: Floats, points_m: Sequence[Floats], floor_m: float) -> Floats:
    """From an ankle (3,) to the sole below points (3,) of its foot, (P, 3)."""
    return np.stack([point * [1, 0, 1] + [0, floor_m, 0] - ankle_m for point in points_m])


def _leg_m(skeleton: Skeleton) -> float:
    """Mean length of both legs, hip to ankle along the bones."""
    rest = skeleton.rest_pos_m()
    chains = [
        [skeleton.index(f"{side}_{part}") for part in ("hip", "knee", "ankle")] for side in ("left", "right")
    ]
    return float(np.linalg.norm(np.diff(rest[chains], axis=1), axis=-1).sum(axis=-1).mean())
