"""Mesh of the mannequin's trunk, neck and head: profiles lofted along the spine.

The tables are in metres on a 1.70 m body; `Body.scale` scales them to the actual one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from choreograph.mannequin._bind_pose import UP, Body
from choreograph.mannequin._lofting import (
    Floats,
    Piece,
    Rings,
    ellipsoid,
    frames_along,
    loft,
    shares,
    smooth_rows,
    smoothstep,
)

# Half width, depth to the front and to the back; first column: 0 at the hips' height, 1 at the shoulders'.
_TRUNK = np.array([
    (-0.13, 0.070, 0.060, 0.066), (-0.07, 0.122, 0.078, 0.096), (0.02, 0.152, 0.090, 0.112),
    (0.10, 0.159, 0.092, 0.112), (0.22, 0.150, 0.088, 0.096), (0.36, 0.124, 0.083, 0.078),
    (0.47, 0.117, 0.083, 0.073), (0.58, 0.125, 0.092, 0.080), (0.72, 0.144, 0.107, 0.094),
    (0.84, 0.160, 0.108, 0.100), (0.93, 0.172, 0.094, 0.096), (1.00, 0.184, 0.077, 0.087),
    (1.05, 0.188, 0.064, 0.075), (1.075, 0.168, 0.058, 0.069), (1.095, 0.124, 0.053, 0.063),
    (1.12, 0.082, 0.049, 0.058), (1.15, 0.057, 0.046, 0.054),
])  # fmt: skip
_WAIST, _NECKLINE = 0.40, 1.09  # on the same scale: border of the clothes, and their upper end
_COLLAR_FROM = 0.76  # on the same scale: the chest below does not follow the collar bones
# First column: 0 under the chin, 1 the crown.
_HEAD = np.array([
    (0.00, 0.026, 0.072, 0.015), (0.07, 0.042, 0.085, 0.040), (0.20, 0.056, 0.090, 0.064),
    (0.35, 0.065, 0.091, 0.086), (0.50, 0.071, 0.092, 0.100), (0.65, 0.074, 0.091, 0.105),
    (0.80, 0.068, 0.080, 0.096), (0.90, 0.055, 0.062, 0.077), (0.97, 0.032, 0.036, 0.045),
])  # fmt: skip
_HEAD_HEIGHT_M = 0.225
_CHIN_BELOW_HEAD_M = 0.035
_SKULL_BEHIND_HEAD_M = 0.004


def trunk(body: Body, torso: int, pelvis: int, skin: int) -> Piece:
    """From the crotch over the shoulders to the base of the neck, bending with spine and collar bones."""
    at = np.unique(
        np.concatenate(
            [np.linspace(_TRUNK[0, 0], 0.88, 13), np.linspace(0.93, 1.03, 4), np.linspace(1.05, 1.15, 5)]
        )
    )
    at = np.unique(np.append(at, [_WAIST, _NECKLINE]))
    low, high = body.middle("hip"), body.middle("shoulder")
    centres = low + at[:, None] * (high - low)
    radii = smooth_rows(_TRUNK, at) * body.scale
    hips = np.clip(body.half_span("hip") / (0.085 * body.scale), 0.75, 1.2)
    shoulders = np.clip(body.half_span("shoulder") / (0.17 * body.scale), 0.7, 1.3)
    # The whole trunk gets wider with the joints, but less than they do; the neck does not.
    wider = np.interp(at, [0.2, 0.8, 1.0, 1.15], [hips, shoulders, shoulders, 1.0]) - 1
    radii[:, 0] *= 1 + np.interp(at, [0.2, 0.8, 0.95], [0.6, 0.6, 1.0]) * wider
    across, ahead = frames_along(np.tile(high - low, (len(at), 1)), body.front)
    limit = low + _COLLAR_FROM * (high - low)
    joints, weights = bending(body.pos_m[list(body.spine)], body.spine, centres, limit)
    parts = np.where(at[:-1] < _WAIST - 1e-9, pelvis, np.where(at[:-1] < _NECKLINE - 1e-9, torso, skin))
    rings = Rings(centres, across, ahead, radii, joints, weights)
    piece = loft(
        rings, parts, sides=20, squareness=2.2, start_cap_m=0.025 * body.scale, end_cap_m=0.01 * body.scale
    )
    _hang_on_collars(piece, body, low, high - low)
    return piece


def _hang_on_collars(piece: Piece, body: Body, low: Floats, up: Floats) -> None:
    """Bind the trunk's vertices around the shoulders to the collar bones, in place."""
    places = piece.vertices_m - low
    height = places @ up / (up @ up)
    chest = body.spine[-1]
    for side in ("left", "right"):
        if f"{side}_collar" not in body.roles:
            continue
        out = body.place(f"{side}_shoulder") - body.middle("shoulder")
        beside = places @ out / max(float(out @ out), 1e-12)  # 1 at the shoulder
        share = smoothstep((beside - 0.25) / 0.6) * smoothstep((height - _COLLAR_FROM) / 0.2)
        moved = share > 0
        piece.joints[moved] = chest, body.roles[f"{side}_collar"]
        piece.weights[moved] = shares(share[moved])


def neck(body: Body, part: int) -> Piece:
    """From inside the chest to inside the skull."""
    base, skull = body.neck_base(), body.head_place()
    chain = [body.spine[-1], body.roles.get("neck", body.spine[-1]), body.head_joint()]
    at = np.linspace(-0.5, 1.4, 8)
    centres = base + np.maximum(at, 0)[:, None] * (skull - base)
    centres += np.minimum(at, 0)[:, None] * 0.12 * body.scale * UP
    wide = np.interp(at, [-0.5, 0.0, 0.6, 1.4], [0.060, 0.054, 0.049, 0.049]) * body.scale
    places = np.stack([base - (skull - base), base, skull])
    joints, weights = bending(places, chain, centres)
    across, ahead = frames_along(np.tile(skull - base, (len(at), 1)), body.front)
    rings = Rings(centres, across, ahead, wide[:, None] * [1.0, 0.95, 1.05], joints, weights)
    return loft(rings, part, sides=14)


def head(body: Body, skin: int, hair: int) -> list[Piece]:
    """Skull with chin, nose and brow, ears, and hair that leaves the face free."""
    k, joint = body.scale, body.head_joint()
    chin = body.head_place() - k * (_CHIN_BELOW_HEAD_M * UP + _SKULL_BEHIND_HEAD_M * body.front)
    at = np.linspace(0.0, 0.97, 14)
    left = np.cross(UP, body.front)
    radii = smooth_rows(_HEAD, at) * k
    centres = chin + at[:, None] * _HEAD_HEIGHT_M * k * UP
    n = len(at)
    joints, weights = np.full((n, 2), joint), np.tile([1.0, 0.0], (n, 1))
    rings = Rings(centres, np.tile(left, (n, 1)), np.tile(body.front, (n, 1)), radii, joints, weights)
    skull = loft(rings, skin, sides=24, start_cap_m=0.008 * k, end_cap_m=0.0066 * k)
    _shape_face(skull.vertices_m, chin, left, body.front, k)
    cap = loft(rings, hair, sides=24, start_cap_m=0.008 * k, end_cap_m=0.0066 * k)
    _shape_hair(cap.vertices_m, chin, left, body.front, k)
    ears = []
    for sign in (1.0, -1.0):
        place = chin + (0.47 * UP * _HEAD_HEIGHT_M + sign * 0.071 * left - 0.012 * body.front) * k
        axes = np.stack([0.030 * UP, 0.010 * left, 0.017 * body.front]) * k
        ears.append(ellipsoid(place, axes, joint, skin, sides=8))
    return [skull, cap, *ears]


def _shape_face(points_m: Floats, chin: Floats, left: Floats, front: Floats, k: float) -> None:
    """Push a nose out of the skull's points (V, 3) and eyes and mouth in, in place."""
    local = (points_m - chin) / k
    x, y, z = local @ left, local[:, 1] / _HEAD_HEIGHT_M, local @ front
    facing = z > 0.03
    nose = 0.020 * np.exp(-((x / 0.011) ** 2)) * np.exp(-(((y - 0.365) / 0.06) ** 2))
    bridge = 0.010 * np.exp(-((x / 0.010) ** 2)) * np.exp(-(((y - 0.47) / 0.07) ** 2))
    eyes = -0.012 * np.exp(-(((np.abs(x) - 0.032) / 0.016) ** 2)) * np.exp(-(((y - 0.49) / 0.045) ** 2))
    mouth = -0.005 * np.exp(-((x / 0.03) ** 2)) * np.exp(-(((y - 0.20) / 0.03) ** 2))
    points_m += np.where(facing, nose + bridge + eyes + mouth, 0.0)[:, None] * front * k


def _shape_hair(points_m: Floats, chin: Floats, left: Floats, front: Floats, k: float) -> None:
    """Swell a copy of the skull's points (V, 3) above the hairline and sink the rest inside it, in place."""
    local = (points_m - chin) / k
    x, y, z = local @ left, local[:, 1] / _HEAD_HEIGHT_M, local @ front
    centre = np.array([0.0, 0.55 * _HEAD_HEIGHT_M, -0.01])
    # The hairline falls from the forehead past the temples to the nape.
    line = np.interp(z, [-0.10, -0.06, -0.01, 0.02, 0.06, 0.10], [0.16, 0.20, 0.42, 0.58, 0.76, 0.80])
    swell = np.interp((y - line) / 0.11, [-1.0, 1.0], [-0.16, 0.055])
    outward = np.stack([x, local[:, 1], z], axis=1) - centre
    world = outward[:, :1] * left + outward[:, 1:2] * UP + outward[:, 2:] * front
    points_m += world * swell[:, None] * k


def bending(
    places_m: Floats, joints: Sequence[int], points_m: Floats, limit_m: Floats | None = None
) -> tuple[NDArray[np.int64], Floats]:
    """Joints (R, 2) and weights (R, 2) of points (R, 3) along a chain of joints at `places_m` (C, 3).

    The middle of a bone follows its own joint alone; from there to the middle of the next bone the weights
    blend smoothly. From `limit_m` (3,) on, the last joint has all the weight.
    """
    chain = np.asarray(joints)
    if len(chain) == 1:
        return np.full((len(points_m), 2), chain[0]), np.tile([1.0, 0.0], (len(points_m), 1))
    axis = places_m[-1] - places_m[0]
    heights = (places_m - places_m[0]) @ axis / (axis @ axis)  # (C,)
    at = (points_m - places_m[0]) @ axis / (axis @ axis)  # (R,)
    middles = np.append((heights[1:] + heights[:-1]) / 2, heights[-1] + (heights[-1] - heights[-2]) / 2)
    if limit_m is not None:
        middles = np.minimum(middles, (limit_m - places_m[0]) @ axis / (axis @ axis))
    middles = np.maximum.accumulate(middles + 1e-6 * np.arange(len(middles)))
    place = np.clip(np.interp(at, middles, np.arange(len(middles))), 0.0, len(middles) - 1)
    lower = np.minimum(place.astype(np.int64), len(middles) - 2)
    return np.stack([chain[lower], chain[lower + 1]], axis=1), shares(smoothstep(place - lower))
