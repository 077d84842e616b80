"""Pieces of the mannequin: closed surfaces lofted along its spine and its limbs, hands, and shoes.

`loft` makes a closed surface through cross-sections along a line, with skinning weights. Each piece of the
body is such a surface, or an ellipsoid. `skinned_mesh` puts them together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from choreograph.core.numerics import Floats
from choreograph.motion.retargeting import UP, Body

# Lofting: closed surfaces through cross-sections along a line, with skinning weights.


@dataclass(frozen=True, eq=False)
class MeshPiece:
    """One closed surface of the mannequin."""

    vertices_m: Floats  # (V, 3)
    triangles: NDArray[np.int64]  # (F, 3) counter-clockwise seen from outside
    joints: NDArray[np.int64]  # (V, 2)
    weights: Floats  # (V, 2) rows sum to 1
    parts: NDArray[np.int64]  # (F,) index into `motion.skinned_mesh.PARTS`


@dataclass(frozen=True, eq=False)
class Rings:
    """Cross-sections along a line: half-ellipses that meet at the sides.

    A point of a ring at angle a is centre + cos a · side · `across` + sin a · (front or back) · `ahead`.
    """

    centres_m: Floats  # (R, 3)
    across: Floats  # (R, 3) unit
    ahead: Floats  # (R, 3) unit
    radii_m: Floats  # (R, 3) to the side, to the front, to the back
    joints: NDArray[np.int64]  # (R, 2)
    weights: Floats  # (R, 2)


def smooth_rows(table: Floats, at: Floats) -> Floats:
    """Rows (R, C - 1) interpolated in a table whose first column increases, without overshoot."""
    return scipy.interpolate.PchipInterpolator(table[:, 0], table[:, 1:])(at)


def frames_along(axis: Floats, front: Floats) -> tuple[Floats, Floats]:
    """Unit `across` and `ahead` (R, 3), orthogonal to `axis` (R, 3), with `ahead` closest to `front` (3,).

    If the axis itself points to the front, `ahead` points up.
    """
    axis = axis / np.maximum(np.linalg.norm(axis, axis=-1, keepdims=True), 1e-12)
    parallel = np.abs(axis @ front)[:, None] > 0.97
    wanted = np.where(
        parallel, np.roll(front, 1), front
    )  # (R, 3): another direction, orthogonal to a level front
    ahead = wanted - axis * np.sum(axis * wanted, axis=1, keepdims=True)
    ahead /= np.maximum(np.linalg.norm(ahead, axis=-1, keepdims=True), 1e-9)
    return np.cross(axis, ahead), ahead


def loft(
    rings: Rings,
    parts: int | NDArray[np.int64],
    *,
    sides: int = 16,
    start_cap_m: float = 0.0,
    end_cap_m: float = 0.0,
    cap_rings: int = 2,
    squareness: float = 2.0,
) -> MeshPiece:
    """The closed surface through rings.

    The ends are rounded over `start_cap_m` and `end_cap_m` with `cap_rings` rings and a pole each.
    `parts` is one part, or one per gap between rings (R - 1,). `squareness` is the exponent of the
    rings' superellipse: 2 is round, more has flatter sides.
    """
    rings, bands = _with_caps(rings, start_cap_m, end_cap_m, cap_rings)
    n_rings = len(rings.centres_m)
    angles = np.arange(sides) * (2 * np.pi / sides)
    c, s = np.cos(angles), np.sin(angles)
    c, s = (np.sign(v) * np.abs(v) ** (2.0 / squareness) for v in (c, s))  # (sides,)
    depth = np.where(s > 0, rings.radii_m[:, 1:2] * s, rings.radii_m[:, 2:3] * s)  # (R, sides)
    width = rings.radii_m[:, :1] * c
    points = (
        rings.centres_m[:, None]
        + width[..., None] * rings.across[:, None]
        + depth[..., None] * rings.ahead[:, None]
    )  # (R, sides, 3)
    slope = 1 - np.sin(np.pi / 2 * cap_rings / (cap_rings + 1))  # of a cap: from its last ring to its pole
    poles = np.stack([rings.centres_m[0], rings.centres_m[-1]])
    poles[0] += _outward(rings, 0) * start_cap_m * slope
    poles[1] += _outward(rings, -1) * end_cap_m * slope
    triangles, gaps = _ring_triangles(n_rings, sides)
    ring_of = np.concatenate([np.repeat(np.arange(n_rings), sides), [0, n_rings - 1]])
    vertices = np.concatenate([points.reshape(-1, 3), poles])  # (R · sides + 2, 3)
    gap_parts = np.asarray(parts)[bands[gaps]] if np.ndim(parts) else np.full(len(gaps), parts)
    piece = MeshPiece(vertices, triangles, rings.joints[ring_of], rings.weights[ring_of], gap_parts)
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    if np.einsum("ij,ij->", a - vertices[0], np.cross(b - a, c - a)) < 0:  # the signed volume: inside out
        return replace(piece, triangles=triangles[:, ::-1].copy())
    return piece


def ellipsoid(centre_m: Floats, axes_m: Floats, joint: int, part: int, *, sides: int = 14) -> MeshPiece:
    """An ellipsoid about `centre_m` (3,), with the rows of `axes_m` (3, 3) as half-axes, bound to a joint."""
    lengths = np.maximum(np.linalg.norm(axes_m, axis=1), 1e-9)
    unit = axes_m / lengths[:, None]
    angles = np.linspace(-np.pi / 2, np.pi / 2, sides // 2 + 2)[1:-1]
    n = len(angles)
    rings = Rings(
        centre_m + np.sin(angles)[:, None] * axes_m[0],
        np.tile(unit[1], (n, 1)),
        np.tile(unit[2], (n, 1)),
        np.cos(angles)[:, None] * lengths[[1, 2, 2]],
        np.full((n, 2), joint),
        np.tile([1.0, 0.0], (n, 1)),
    )
    piece = loft(rings, part, sides=sides)
    vertices = np.array(piece.vertices_m)
    vertices[-2:] = centre_m - axes_m[0], centre_m + axes_m[0]
    return replace(piece, vertices_m=vertices)


def vertex_normals(vertices_m: Floats, triangles: NDArray[np.int64]) -> Floats:
    """Unit normals (V, 3): the area-weighted sum of the normals of the adjacent triangles."""
    a, b, c = (vertices_m[triangles[:, k]] for k in range(3))
    faces = np.cross(b - a, c - a)  # (F, 3)
    normals = np.zeros_like(vertices_m)
    for k in range(3):
        np.add.at(normals, triangles[:, k], faces)
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)


def _outward(rings: Rings, end: int) -> Floats:
    """Direction (3,) out of the line's start (`end` 0) or end (-1), orthogonal to that ring."""
    direction = np.cross(rings.across[end], rings.ahead[end])
    inner = rings.centres_m[1 if end == 0 else -2]
    return direction if direction @ (rings.centres_m[end] - inner) > 0 else -direction


def _with_caps(rings: Rings, start_m: float, end_m: float, n: int) -> tuple[Rings, NDArray[np.int64]]:
    """Rings including the `n` of each rounded end, and, for each gap between them, the original gap."""
    last = len(rings.centres_m) - 1
    order = [0] * (n if start_m else 0) + list(range(last + 1)) + [last] * (n if end_m else 0)
    centres, radii = rings.centres_m[order], rings.radii_m[order]
    angles = np.pi / 2 * np.arange(n, 0, -1) / (n + 1)
    if start_m:
        centres[:n] += np.sin(angles)[:, None] * start_m * _outward(rings, 0)
        radii[:n] *= np.cos(angles)[:, None]
    if end_m:
        centres[-n:] += np.sin(angles[::-1])[:, None] * end_m * _outward(rings, -1)
        radii[-n:] *= np.cos(angles[::-1])[:, None]
    capped = Rings(
        centres, rings.across[order], rings.ahead[order], radii, rings.joints[order], rings.weights[order]
    )
    return capped, np.minimum(np.array(order), last - 1)


def _ring_triangles(n_rings: int, sides: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Triangles (F, 3) between successive rings and onto the two poles, and each one's gap (F,)."""
    around = np.arange(sides)
    here, there = around, (around + 1) % sides
    quads, gaps = [], []
    for ring in range(n_rings - 1):
        low, high = ring * sides, (ring + 1) * sides
        quads += [np.stack([low + here, low + there, high + there], axis=1)]
        quads += [np.stack([low + here, high + there, high + here], axis=1)]
        gaps += [ring] * (2 * sides)
    first, last = n_rings * sides, n_rings * sides + 1
    top = (n_rings - 1) * sides
    quads += [np.stack([np.full(sides, first), there, here], axis=1)]
    quads += [np.stack([np.full(sides, last), top + here, top + there], axis=1)]
    gaps += [0] * sides + [n_rings - 1] * sides
    return np.concatenate(quads), np.array(gaps)


def smoothstep(x: Floats) -> Floats:
    """0 below 0, 1 above 1, smooth between."""
    x = np.clip(x, 0.0, 1.0)
    return x * x * (3 - 2 * x)


def shares(second: Floats) -> Floats:
    """Weights (R, 2) of a first and a second joint from the second's share (R,)."""
    return np.stack([1 - second, second], axis=1)


# Mesh of the mannequin's trunk, neck and head: profiles lofted along the spine.
#
# The tables are in metres on a 1.70 m body. `Body.scale` scales them to the actual one.


# Half width, depth to the front and to the back. First column: 0 at the hips' height, 1 at the shoulders'.
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


def trunk(body: Body, torso: int, pelvis: int, skin: int) -> MeshPiece:
    """The trunk, from the crotch to the base of the neck, which bends with the spine and the collar bones."""
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
    # The whole trunk gets wider with the joints, but less than they do. The neck does not.
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


def _hang_on_collars(piece: MeshPiece, body: Body, low: Floats, up: Floats) -> None:
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


def neck(body: Body, part: int) -> MeshPiece:
    """The neck, from inside the chest to inside the skull."""
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


def head(body: Body, skin: int, hair: int) -> list[MeshPiece]:
    """The skull with chin, nose and brow, the ears, and hair that does not cover the face."""
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

    The middle of a bone follows its own joint alone. From there to the middle of the next bone the weights
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


# Mesh of the mannequin's limbs: profiles lofted along arms and legs, hands, shoes, and plain bones.
#
# The tables are in metres on a 1.70 m body. `Body.scale` scales them to the actual one.


# First column: 0 hip, 1 knee, 2 ankle.
_LEG = np.array([
    (0.00, 0.064, 0.070, 0.084), (0.12, 0.078, 0.083, 0.095), (0.30, 0.075, 0.082, 0.084),
    (0.55, 0.065, 0.073, 0.067), (0.80, 0.053, 0.059, 0.053), (0.93, 0.049, 0.053, 0.049),
    (1.00, 0.047, 0.052, 0.047), (1.08, 0.046, 0.047, 0.049), (1.20, 0.050, 0.040, 0.060),
    (1.34, 0.052, 0.038, 0.066), (1.55, 0.043, 0.036, 0.050), (1.75, 0.032, 0.031, 0.037),
    (1.90, 0.028, 0.028, 0.034), (2.00, 0.029, 0.029, 0.036),
])  # fmt: skip
# First column: 0 shoulder, 1 elbow, 2 wrist. The width of the hand extends to the front and back.
_ARM = np.array([
    (0.00, 0.047, 0.049, 0.050), (0.14, 0.050, 0.051, 0.052), (0.32, 0.046, 0.048, 0.047),
    (0.50, 0.043, 0.046, 0.045), (0.70, 0.039, 0.042, 0.040), (0.90, 0.035, 0.036, 0.036),
    (1.00, 0.034, 0.034, 0.036), (1.10, 0.036, 0.038, 0.036), (1.25, 0.038, 0.040, 0.037),
    (1.50, 0.033, 0.034, 0.032), (1.75, 0.025, 0.027, 0.026), (1.95, 0.020, 0.027, 0.026),
    (2.00, 0.019, 0.026, 0.026),
])  # fmt: skip
_SHORTS, _SLEEVE = 0.30, 0.24  # lower ends of the clothes, on the scale of the first column
# First column: 0 wrist, 1 knuckles. Others: half thickness, width to the thumb's side and to the other.
_PALM = np.array([
    (0.0, 0.018, 0.025, 0.025), (0.25, 0.0165, 0.032, 0.030), (0.6, 0.0155, 0.039, 0.037),
    (0.9, 0.0130, 0.040, 0.037), (1.0, 0.0110, 0.038, 0.035),
])  # fmt: skip
_PALM_M = 0.088
_FINGERS = (
    (0.030, 0.072),
    (0.0105, 0.081),
    (-0.009, 0.075),
    (-0.0275, 0.060),
)  # position across the palm, length
_HANGING = 0.7  # forearms with a larger cosine to the vertical hang, with palms that face the thighs
# Metres ahead of the ankle: half width, height over the sole.
_SHOE = np.array([
    (-0.055, 0.022, 0.044), (-0.040, 0.031, 0.072), (-0.015, 0.035, 0.092), (0.02, 0.036, 0.090),
    (0.05, 0.037, 0.074), (0.09, 0.042, 0.056), (0.13, 0.046, 0.045), (0.17, 0.043, 0.036),
    (0.195, 0.034, 0.028), (0.208, 0.022, 0.021),
])  # fmt: skip
_BALL_AHEAD_M = 0.13  # of the ankle, in the table above
_ANKLE_M = 0.07  # over the sole, in the table above


def leg(body: Body, side: str, part: int, shorts: int) -> list[MeshPiece]:
    """The leg, from inside the pelvis to inside the shoe."""
    names, caps = ("hip", "knee", "ankle"), (0.060, 0.03)
    return _limb(body, [f"{side}_{name}" for name in names], _LEG, caps, (shorts, _SHORTS), part)


def arm(body: Body, side: str, part: int, sleeve: int) -> list[MeshPiece]:
    """The arm, from inside the shoulder to the wrist."""
    names, caps = ("shoulder", "elbow", "wrist"), (0.038, 0.018)
    return _limb(body, [f"{side}_{name}" for name in names], _ARM, caps, (sleeve, _SLEEVE), part)


def _limb(
    body: Body,
    roles: list[str],
    table: Floats,
    caps_m: tuple[float, float],
    cloth: tuple[int, float],
    part: int,
) -> list[MeshPiece]:
    """A tube across the middle joint, and a ball that fills the bend. `cloth` is its part and lower end."""
    start, middle, end = (body.place(role) for role in roles)
    joints = [body.roles[role] for role in roles]
    bend = 1 + np.array([-0.12, -0.045, -0.015, 0.015, 0.045, 0.12])
    at = np.concatenate([np.linspace(0, 0.76, 5), [cloth[1]], bend, np.linspace(1.24, 2.0, 6)])  # (R,)
    at = np.unique(at)
    centres = np.where(
        (at < 1)[:, None],
        start + at[:, None] * (middle - start),
        middle + (at[:, None] - 1) * (end - middle),
    )
    upper, lower = middle - start, end - middle
    turn = smoothstep((at - 0.955) / 0.09)
    axes = upper / np.linalg.norm(upper) * (1 - turn[:, None]) + lower / np.linalg.norm(lower) * turn[:, None]
    across, ahead = frames_along(axes, body.front)
    radii = smooth_rows(table, at) * body.scale
    # The bend is sharp. A wide one would collapse on the outside, where a sharp one is filled by the ball.
    rings = Rings(centres, across, ahead, radii, np.tile(joints[:2], (len(at), 1)), shares(turn))
    parts = np.where(at[:-1] < cloth[1] - 1e-9, cloth[0], part)
    tube = loft(rings, parts, sides=12, start_cap_m=caps_m[0] * body.scale, end_cap_m=caps_m[1] * body.scale)
    wide, front, back = 0.985 * smooth_rows(table, np.array([1.0]))[0] * body.scale
    knee = int(np.argmin(np.abs(at - 1)))
    axes = np.stack([across[knee] * wide, axes[knee] * front, ahead[knee] * (front + back) / 2])
    return [tube, ellipsoid(middle + ahead[knee] * (front - back) / 2, axes, joints[1], part, sides=10)]


def hand(body: Body, side: str, part: int, *, fingers: bool) -> list[MeshPiece]:
    """A palm with the thumb to the front and, if `fingers`, four slightly curled fingers."""
    k, wrist = body.scale, body.place(f"{side}_wrist")
    along = wrist - body.place(f"{side}_elbow")
    if f"{side}_hand" in body.roles:
        along = body.place(f"{side}_hand") - wrist
    along = along / max(float(np.linalg.norm(along)), 1e-9)
    across, ahead = (axes[0] for axes in frames_along(along[None], body.front))
    inward = body.middle("hip") - wrist if abs(along[1]) > _HANGING else -UP
    down = across if across @ inward > 0 else -across  # out of the palm
    joint = body.roles[f"{side}_wrist"]
    at = np.linspace(0.0, 1.0, 6)
    n = len(at)
    still = np.full((n, 2), joint), shares(np.zeros(n))
    frames = np.tile(across, (n, 1)), np.tile(ahead, (n, 1))
    palm = Rings(wrist + at[:, None] * _PALM_M * along * k, *frames, smooth_rows(_PALM, at) * k, *still)
    pieces = [loft(palm, part, sides=12, start_cap_m=0.015 * k, end_cap_m=0.010 * k, squareness=2.4)]
    thumb = [0.030 * along + 0.020 * ahead, 0.060 * along + 0.047 * ahead + 0.006 * down]
    thumb.append(0.088 * along + 0.056 * ahead + 0.014 * down)
    pieces.append(_finger(wrist + np.array(thumb) * k, np.array([0.0145, 0.0115, 0.0085]) * k, joint, part))
    if fingers:
        joint = body.roles.get(f"{side}_hand", joint)
        for place, length in _FINGERS:
            root = (_PALM_M - 0.008) * along + place * ahead
            spread = along + 0.9 * place * ahead
            curve = np.array([root, root + length * (0.55 * spread + 0.06 * down)])
            tip = root + length * (0.97 * spread + 0.28 * down)
            line = wrist + np.vstack([curve, tip]) * k
            pieces.append(_finger(line, np.array([0.0095, 0.0085, 0.0068]) * k, joint, part))
    return pieces


def _finger(line_m: Floats, radii_m: Floats, joint: int, part: int) -> MeshPiece:
    """A rounded tube along three points (3, 3)."""
    across, ahead = frames_along(np.gradient(line_m, axis=0), UP)
    still = np.full((len(line_m), 2), joint), shares(np.zeros(len(line_m)))
    rings = Rings(line_m, across, ahead, radii_m[:, None] * np.ones(3), *still)
    return loft(rings, part, sides=6, start_cap_m=0.5 * radii_m[0], end_cap_m=radii_m[-1], cap_rings=1)


def shoe(body: Body, side: str, part: int) -> MeshPiece:
    """A shoe with its sole on the floor that bends at the ball of the foot."""
    ankle, ball = body.place(f"{side}_ankle"), body.roles.get(f"{side}_foot")
    reach = (body.pos_m[ball] - ankle) * [1.0, 0.0, 1.0] if ball is not None else np.zeros(3)
    long = float(np.linalg.norm(reach))
    k = body.scale
    pointed = long > 0.04 * k
    ahead = reach / long if pointed else body.front
    stretch = np.clip(long / (_BALL_AHEAD_M * k), 0.8, 1.3) if pointed else 1.0
    at = np.concatenate([np.linspace(-0.055, 0.10, 6), np.linspace(0.12, 0.208, 5)])
    table = smooth_rows(_SHOE, at) * k
    rise = max(ankle[1] - body.sole_m, 0.03 * k)
    top = table[:, 1] * np.interp(at, [0.0, 0.12], [np.clip(rise / (_ANKLE_M * k), 0.7, 1.6), 1.0])
    centres = ankle + at[:, None] * ahead * k * stretch
    centres[:, 1] = body.sole_m + 0.42 * top
    n = len(at)
    share = smoothstep((at - 0.10) / 0.05)
    joint = body.roles[f"{side}_ankle"]
    rings = Rings(
        centres,
        np.tile(np.cross(UP, ahead), (n, 1)),
        np.tile(UP, (n, 1)),
        np.stack([table[:, 0], 0.58 * top, 0.42 * top], axis=1),
        np.tile([joint, ball if ball is not None else joint], (n, 1)),
        shares(share),
    )
    piece = loft(rings, part, sides=12, start_cap_m=0.010 * k, end_cap_m=0.010 * k, squareness=2.5)
    piece.vertices_m[:, 1] = np.maximum(piece.vertices_m[:, 1], body.sole_m)
    return piece


def taper(
    start: Floats,
    end: Floats,
    wide_m: float,
    thin_m: float,
    joint: int,
    part: int,
    *,
    sides: int = 10,
    rings: int = 4,
) -> MeshPiece:
    """A tapered bone from `start` to `end` (3,), with rounded ends, bound to one joint."""
    at = np.linspace(0.0, 1.0, rings)[:, None]
    radii = (wide_m + (thin_m - wide_m) * at) * np.ones(3)
    axis = end - start
    helper = UP if abs(axis[1]) < 0.8 * np.linalg.norm(axis) else np.array([0.0, 0.0, 1.0])
    across, ahead = frames_along(np.tile(axis, (rings, 1)), helper)
    still = np.full((rings, 2), joint), shares(np.zeros(rings))
    line = Rings(start + at * axis, across, ahead, radii, *still)
    return loft(line, part, sides=sides, start_cap_m=wide_m, end_cap_m=thin_m)


def knob(centre_m: Floats, radius_m: float, joint: int, part: int) -> MeshPiece:
    """A ball at a joint."""
    return ellipsoid(centre_m, radius_m * np.eye(3), joint, part, sides=10)
