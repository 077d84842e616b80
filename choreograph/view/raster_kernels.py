"""Compiled geometry loops of the renderer: skinning, projection, rasterisation, floor shadows.

Screens are sampled on a grid: sample (row, column) is at y = row + 0.5, x = column + 0.5. All arrays are
float32 unless noted.
"""

from __future__ import annotations

import numpy as np

from choreograph.core.kernel_cache import njit

NOTHING = -1  # in a buffer of triangle indices
_NEAR_M = np.float32(0.05)


@njit(nogil=True, error_model="numpy")
def skin(vertices, normals, joints, weights, matrices):  # pragma: no cover - compiled
    """Linear blend skinning: world vertices and unit normals (V, 3) from joint matrices (J, 3, 4)."""
    placed, turned = np.empty_like(vertices), np.empty_like(normals)
    for v in range(len(vertices)):
        a, b = matrices[joints[v, 0]], matrices[joints[v, 1]]
        wa, wb = weights[v, 0], weights[v, 1]
        x, y, z = vertices[v]
        nx, ny, nz = normals[v]
        length = np.float32(1e-12)
        for i in range(3):
            m0, m1, m2 = wa * a[i, 0] + wb * b[i, 0], wa * a[i, 1] + wb * b[i, 1], wa * a[i, 2] + wb * b[i, 2]
            placed[v, i] = m0 * x + m1 * y + m2 * z + wa * a[i, 3] + wb * b[i, 3]
            n = m0 * nx + m1 * ny + m2 * nz
            turned[v, i] = n
            length += n * n
        turned[v] /= np.sqrt(length)
    return placed, turned


@njit(nogil=True, error_model="numpy")
def project(points, view, focal, centre_x, centre_y):  # pragma: no cover - compiled
    """Screen x, y and 1 / depth (V, 3) of world points; 1 / depth is 0 behind the camera.

    `view` (3, 4): rows to the right, up and into the scene. `focal` in samples; screen y grows down.
    """
    out = np.empty_like(points)
    for v in range(len(points)):
        x, y, z = points[v]
        depth = view[2, 0] * x + view[2, 1] * y + view[2, 2] * z + view[2, 3]
        if depth < _NEAR_M:
            out[v] = np.float32(0.0)
            continue
        inverse = np.float32(1.0) / depth
        right = view[0, 0] * x + view[0, 1] * y + view[0, 2] * z + view[0, 3]
        up = view[1, 0] * x + view[1, 1] * y + view[1, 2] * z + view[1, 3]
        out[v, 0] = centre_x + focal * right * inverse
        out[v, 1] = centre_y - focal * up * inverse
        out[v, 2] = inverse
    return out


@njit(nogil=True, error_model="numpy")
def rasterise(screen, triangles, nearness, owners):  # pragma: no cover - compiled
    """Write each front-facing triangle into `nearness` and `owners` (int32) where it is nearest.

    `screen` (V, 3) holds x, y and a positive nearness that is linear on the screen. Triangles that are
    counter-clockwise on a screen whose y grows down are seen from behind.
    """
    height, width = nearness.shape
    for t in range(len(triangles)):
        i, j, k = triangles[t]
        x0, y0, n0 = screen[i]
        x1, y1, n1 = screen[j]
        x2, y2, n2 = screen[k]
        if n0 <= 0 or n1 <= 0 or n2 <= 0:
            continue
        area = (x2 - x0) * (y1 - y0) - (x1 - x0) * (y2 - y0)
        if area <= 0:
            continue
        left = max(0, int(np.ceil(min(x0, x1, x2) - 0.5)))
        right = min(width - 1, int(np.floor(max(x0, x1, x2) - 0.5)))
        top = max(0, int(np.ceil(min(y0, y1, y2) - 0.5)))
        bottom = min(height - 1, int(np.floor(max(y0, y1, y2) - 0.5)))
        scale = np.float32(1.0) / area
        # Barycentric coordinates, linear on the screen: b = value at the first sample + steps.
        b1x, b1y = -(y2 - y0) * scale, (x2 - x0) * scale
        b2x, b2y = (y1 - y0) * scale, -(x1 - x0) * scale
        nx = b1x * (n1 - n0) + b2x * (n2 - n0)
        for row in range(top, bottom + 1):
            px, py = np.float32(left) + np.float32(0.5) - x0, np.float32(row) + np.float32(0.5) - y0
            b1 = px * b1x + py * b1y
            b2 = px * b2x + py * b2y
            near = n0 + b1 * (n1 - n0) + b2 * (n2 - n0)
            for column in range(left, right + 1):
                if b1 >= 0 and b2 >= 0 and b1 + b2 <= 1 and near > nearness[row, column]:
                    nearness[row, column] = near
                    owners[row, column] = t
                b1 += b1x
                b2 += b2x
                near += nx


@njit(nogil=True, error_model="numpy")
def flatten_onto_floor(points, triangles, slope, origin, texel, top, cover):  # pragma: no cover - compiled
    """Shadow of the triangles on the floor, into `cover` (N, N), from 0 to 1 (no light left).

    Triangles are projected along `slope` (x and z a metre of height); a triangle higher than `top`
    metres takes nothing, one on the floor everything. Texel (row, column) is at `origin` (x, z) + texel.
    """
    n = len(cover)
    for t in range(len(triangles)):
        i, j, k = triangles[t]
        height = (points[i, 1] + points[j, 1] + points[k, 1]) / np.float32(3.0)
        strength = np.float32(1.0) - max(height, np.float32(0.0)) / top
        if strength <= 0:
            continue
        x0, y0 = _texel(points[i], slope, origin, texel)
        x1, y1 = _texel(points[j], slope, origin, texel)
        x2, y2 = _texel(points[k], slope, origin, texel)
        area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
        if area == 0:
            continue
        scale = np.float32(1.0) / area
        for row in range(max(0, int(min(y0, y1, y2))), min(n - 1, int(max(y0, y1, y2)) + 1) + 1):
            for column in range(max(0, int(min(x0, x1, x2))), min(n - 1, int(max(x0, x1, x2)) + 1) + 1):
                px, py = np.float32(column) - x0, np.float32(row) - y0
                b1 = (px * (y2 - y0) - py * (x2 - x0)) * scale
                b2 = (py * (x1 - x0) - px * (y1 - y0)) * scale
                if b1 >= 0 and b2 >= 0 and b1 + b2 <= 1 and strength > cover[row, column]:
                    cover[row, column] = strength


@njit(nogil=True, inline="always")
def _texel(point, slope, origin, texel):  # pragma: no cover - compiled
    x = (point[0] + slope[0] * point[1] - origin[0]) / texel
    z = (point[2] + slope[1] * point[1] - origin[1]) / texel
    return x, z


@njit(nogil=True, error_model="numpy")
def blur(image, radius, times):  # pragma: no cover - compiled
    """A square image (N, N) after `times` box filters of 2 `radius` + 1 along both axes; black outside."""
    n = len(image)
    share = np.float32(1.0) / np.float32(2 * radius + 1)
    out = image.copy()
    line = np.empty(n, np.float32)
    for _ in range(times):
        for axis in range(2):
            for r in range(n):
                row = out[r] if axis == 0 else out[:, r]
                total = np.float32(0.0)
                for c in range(min(radius, n)):
                    total += row[c]
                for c in range(n):
                    if c + radius < n:
                        total += row[c + radius]
                    line[c] = total * share
                    if c - radius >= 0:
                        total -= row[c - radius]
                row[:] = line
    return out
