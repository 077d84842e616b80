"""Lofting: closed surfaces through cross-sections along a line, with skinning weights."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from choreograph.core.numerics import Floats


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
    rows: Floats = scipy.interpolate.PchipInterpolator(table[:, 0], table[:, 1:])(at)
    return rows


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
    return outside_out(piece)


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


def outside_out(piece: MeshPiece) -> MeshPiece:
    """The piece with triangles counter-clockwise seen from outside, so that its signed volume is positive."""
    a, b, c = (piece.vertices_m[piece.triangles[:, k]] for k in range(3))
    if np.einsum("ij,ij->", a - piece.vertices_m[0], np.cross(b - a, c - a)) < 0:
        return replace(piece, triangles=piece.triangles[:, ::-1].copy())
    return piece


def vertex_normals(vertices_m: Floats, triangles: NDArray[np.int64]) -> Floats:
    """Unit normals (V, 3): the area-weighted sum of the normals of the adjacent triangles."""
    a, b, c = (vertices_m[triangles[:, k]] for k in range(3))
    faces = np.cross(b - a, c - a)  # (F, 3)
    normals = np.zeros_like(vertices_m)
    for k in range(3):
        np.add.at(normals, triangles[:, k], faces)
    unit: Floats = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return unit


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
