"""Compiled loops of the renderer: rasterisation, floor and backdrop, shading of the mesh, sRGB bytes.

Colours are linear light until `to_srgb`. Arrays are float32 unless noted.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.core.kernel_cache import njit

F32 = NDArray[np.float32]
I32 = NDArray[np.int32]
Vector = tuple[np.float32, np.float32, np.float32]

GRID = 2  # samples of a pixel along each axis
TEXEL_M = np.float32(4.2 / 192)  # of the floor's shadow
NOTHING = -1  # in a buffer of triangle indices
_BIAS_M = np.float32(0.012)  # a surface closer than this to another casts no shadow on it
_SHADOW = np.float32(0.3)  # share of the key light in shadows on the body, since the source is large
_LINE_M = np.float32(0.006)  # half width of the floor's grid lines
_GLOSS = np.float32(0.1)
_WRAP = np.float32(0.25)  # how far the key light reaches around the body, as it does on skin


@njit(nogil=True, error_model="numpy")
def rasterise(screen: F32, triangles: I32, nearness: F32, owners: I32) -> None:  # pragma: no cover - compiled
    """Write each front-facing triangle into `nearness` and `owners` (int32) where it is nearest.

    `screen` (V, 3) holds x, y and a positive nearness that is linear on the screen, whose y grows down. The
    sample (row, column) is at y = row + 0.5, x = column + 0.5. Counter-clockwise triangles face away.
    """
    height, width = nearness.shape
    half = np.float32(0.5)
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
            px, py = np.float32(left) + half - x0, np.float32(row) + half - y0
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


@njit(nogil=True, error_model="numpy", fastmath=True)
def paint_backdrop(
    image: F32, eye: F32, axes: F32, focal: np.float32, sky: F32, floor: F32, shade: F32, origin: F32
) -> None:  # pragma: no cover - compiled
    """Paint the sky, and the floor with its grid and shadow, into `image` (H, W, 3).

    `axes` (3, 3) are the camera's unit directions to the right, which is level, up and ahead. `sky` (2, 3)
    are the colours at the horizon and overhead, and `floor` (2, 3) those of floor and grid. `shade` (N, N) is
    the light that the floor loses. Its first texel is at `origin` (x, z). The floor is brightest in its
    middle, and fades into the horizon away from it.
    """
    height, width, _ = image.shape
    right, up, ahead = axes[0], axes[1], axes[2]
    half_w, half_h = np.float32(0.5 * width - 0.5), np.float32(0.5 * height - 0.5)
    zero, half, one = np.float32(0.0), np.float32(0.5), np.float32(1.0)
    pixel, middle = one / focal, half * np.float32(len(shade)) * TEXEL_M
    for row in range(height):
        v = (half_h - np.float32(row)) * pixel
        dy = ahead[1] + v * up[1]  # the camera has no roll: all pixels of a row have the same slope
        down = dy < np.float32(-1e-4) and eye[1] > 0
        away = -eye[1] / dy if down else zero
        for column in range(width):
            u = (np.float32(column) - half_w) * pixel
            dx = ahead[0] + u * right[0] + v * up[0]
            dz = ahead[2] + u * right[2] + v * up[2]
            inverse = one / np.sqrt(dx * dx + dy * dy + dz * dz)
            mix = min(max(dy * inverse, zero) * np.float32(1.6), one)
            x, z = eye[0] + away * dx, eye[2] + away * dz
            px, pz = x - origin[0] - middle, z - origin[1] - middle
            far = np.sqrt(px * px + pz * pz)
            solid = line = lit = zero  # share of the floor, of a grid line on it, and its light
            if down:
                solid = max(one - far * np.float32(1.0 / 9.0), zero)
                solid = solid * solid * (np.float32(3.0) - np.float32(2.0) * solid)
            if solid > 0:
                # The footprint of a sample on the floor, across and along the view.
                steep = max(-dy * inverse, np.float32(0.02))
                sharp = one / max(away * pixel / (inverse * np.sqrt(steep)), _LINE_M)
                gx, gz = np.abs(x - np.floor(x + half)), np.abs(z - np.floor(z + half))
                line = min(max(one - gx * sharp, zero) + max(one - gz * sharp, zero), one) * _LINE_M * sharp
                lit = np.float32(0.80) + np.float32(0.20) / (one + np.float32(0.18) * far * far)
                lit *= one - _bilinear(shade, (x - origin[0]) / TEXEL_M, (z - origin[1]) / TEXEL_M)
            for c in range(3):
                colour = sky[0, c] + (sky[1, c] - sky[0, c]) * mix
                ground = lit * (floor[0, c] + (floor[1, c] - floor[0, c]) * line)
                image[row, column, c] = colour + (ground - colour) * solid


@njit(nogil=True, error_model="numpy", fastmath=True, inline="always")
def _bilinear(image: F32, x: np.float32, y: np.float32) -> np.float32:  # pragma: no cover - compiled
    """A square image (N, N) at a fractional column `x` and row `y`, 0 outside."""
    n = len(image)
    if not (0 <= x < n - 1 and 0 <= y < n - 1):
        return np.float32(0.0)
    ix, iy = int(x), int(y)
    wx, wy = x - np.float32(ix), y - np.float32(iy)
    low = image[iy, ix] + (image[iy, ix + 1] - image[iy, ix]) * wx
    high = image[iy + 1, ix] + (image[iy + 1, ix + 1] - image[iy + 1, ix]) * wx
    return low + (high - low) * wy


@njit(nogil=True, error_model="numpy", fastmath=True)
def shade_mesh(
    image: F32, owners: I32, vertices: F32, triangles: I32, eye: F32, lights: F32, tints: F32, key_map: F32
) -> None:  # pragma: no cover - compiled
    """Blend the mesh's samples into `image` (H, W, 3), which has `GRID` × `GRID` samples a pixel.

    `owners` (H · GRID, W · GRID) are the triangles of the samples. `vertices` (5, V, 3) are positions on the
    screen with inverse depths, positions in the world, normals, positions in the view of the key light, and
    colours. `lights` (3, 3) are unit directions to key, fill and back light. `tints` (5, 3) are their
    colours, the light from overhead and the light from the floor. `key_map` (N, N) is the nearness in metres
    to the key light of the nearest surface that faces away from it. Surfaces behind it get little key light.
    """
    screen, points, normals, seen_by_key, colours = (
        vertices[0], vertices[1], vertices[2], vertices[3], vertices[4],
    )  # fmt: skip
    rows, columns, _ = image.shape
    n_samples = GRID * GRID
    half, one = np.float32(0.5), np.float32(1.0)
    share = one / np.float32(n_samples)
    for row in range(rows):
        for column in range(columns):
            top, left = row * GRID, column * GRID
            cell = owners[top : top + GRID, left : left + GRID]
            covered, alike = 0, True
            for sample in range(n_samples):
                owner = cell[sample // GRID, sample % GRID]
                covered += owner != NOTHING
                alike = alike and owner == cell[0, 0]
            if covered == 0:
                continue
            pixel = image[row, column]
            pixel *= one - np.float32(covered) * share
            # Most pixels lie in one triangle and are shaded once, at their centre.
            weight = one if alike else share
            for sample in range(1 if alike else n_samples):
                sy, sx = sample // GRID, sample % GRID
                t = cell[sy, sx]
                if t == NOTHING:
                    continue
                middle = half * np.float32(GRID) if alike else half
                i, j, k = triangles[t]
                x, y = np.float32(left + sx) + middle, np.float32(top + sy) + middle
                b = _shares(screen, i, j, k, x, y)
                key, fill, back, gloss, above = _light(
                    _between(normals, i, j, k, b), _between(points, i, j, k, b), eye, lights,
                    _unshadowed(key_map, _between(seen_by_key, i, j, k, b)),
                )  # fmt: skip
                for c in range(3):
                    diffuse = key * tints[0, c] + fill * tints[1, c]
                    diffuse += above * tints[3, c] + (one - above) * tints[4, c]
                    pixel[c] += weight * (colours[i, c] * diffuse + back * tints[2, c] + gloss * tints[0, c])


@njit(nogil=True, error_model="numpy", fastmath=True, inline="always")
def _shares(
    screen: F32, i: int, j: int, k: int, x: np.float32, y: np.float32
) -> Vector:  # pragma: no cover - compiled
    """Perspective-correct barycentric coordinates of a place on the screen. They sum to 1.

    `screen` (V, 3) are the positions and inverse depths of the vertices.
    """
    one = np.float32(1.0)
    ax, ay = screen[j, 0] - screen[i, 0], screen[j, 1] - screen[i, 1]
    bx, by = screen[k, 0] - screen[i, 0], screen[k, 1] - screen[i, 1]
    px, py = x - screen[i, 0], y - screen[i, 1]
    scale = one / (ax * by - bx * ay)
    flat1, flat2 = (px * by - py * bx) * scale, (py * ax - px * ay) * scale
    b0, b1, b2 = (one - flat1 - flat2) * screen[i, 2], flat1 * screen[j, 2], flat2 * screen[k, 2]
    total = one / (b0 + b1 + b2)
    return b0 * total, b1 * total, b2 * total


@njit(nogil=True, error_model="numpy", fastmath=True, inline="always")
def _between(values: F32, i: int, j: int, k: int, b: Vector) -> Vector:  # pragma: no cover - compiled
    """`values` (V, 3) of three corners, interpolated by barycentric coordinates."""
    return (
        b[0] * values[i, 0] + b[1] * values[j, 0] + b[2] * values[k, 0],
        b[0] * values[i, 1] + b[1] * values[j, 1] + b[2] * values[k, 1],
        b[0] * values[i, 2] + b[1] * values[j, 2] + b[2] * values[k, 2],
    )


@njit(nogil=True, error_model="numpy", fastmath=True, inline="always")
def _dot(a: Vector, b: Vector) -> np.float32:  # pragma: no cover - compiled
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(nogil=True, error_model="numpy", fastmath=True, inline="always")
def _unit(a: Vector) -> Vector:  # pragma: no cover - compiled
    scale = np.float32(1.0) / np.sqrt(_dot(a, a) + np.float32(1e-12))
    return a[0] * scale, a[1] * scale, a[2] * scale


@njit(nogil=True, error_model="numpy", fastmath=True, inline="always")
def _light(
    normal: Vector, point: Vector, eye: F32, lights: F32, key_share: np.float32
) -> tuple[np.float32, np.float32, np.float32, np.float32, np.float32]:  # pragma: no cover - compiled
    """Key, fill and back light, gloss, and the share of overhead light that a surface sends to the eye.

    `key_share` of the key light reaches it.
    """
    zero, half, one = np.float32(0.0), np.float32(0.5), np.float32(1.0)
    n = _unit(normal)
    view = _unit((eye[0] - point[0], eye[1] - point[1], eye[2] - point[2]))
    edge = one - max(_dot(n, view), zero)
    key = key_share * max((_dot(n, lights[0]) + _WRAP) / (one + _WRAP), zero)
    fill = max(_dot(n, lights[1]), zero)
    back = edge * edge * edge * (half + max(_dot(n, lights[2]), zero))
    halfway = _unit((view[0] + lights[0, 0], view[1] + lights[0, 1], view[2] + lights[0, 2]))
    gloss = _GLOSS * max(_dot(n, halfway), zero) ** 32
    return key, fill, back, gloss, half + half * n[1]


@njit(nogil=True, inline="always")
def _unshadowed(key_map: F32, place: Vector) -> np.float32:  # pragma: no cover - compiled
    """The share of the key light that reaches a place on its shadow map, filtered over 4 × 4 texels.

    The outer texels are weighted by their overlap with the 4 × 4 window, so that shadows have no steps.
    """
    n, one = len(key_map), np.float32(1.0)
    left, top, near = place[0] - np.float32(2.5), place[1] - np.float32(2.5), place[2] + _BIAS_M
    x0, y0 = int(left), int(top)
    if x0 < 0 or y0 < 0 or x0 + 4 >= n or y0 + 4 >= n:
        return one
    fx, fy = left - np.float32(x0), top - np.float32(y0)
    free = np.float32(0.0)
    for row in range(5):
        down = one - fy if row == 0 else fy if row == 4 else one
        for column in range(5):
            across = one - fx if column == 0 else fx if column == 4 else one
            if key_map[y0 + row, x0 + column] <= near:
                free += down * across
    return _SHADOW + (one - _SHADOW) * free * np.float32(1.0 / 16.0)


@njit(nogil=True)
def to_srgb(image: F32, table: F32, thresholds: F32) -> NDArray[np.uint8]:  # pragma: no cover - compiled
    """Bytes (H, W, 3) of linear light (H, W, 3). `table` (N,) holds sRGB, 0 to 255, of 0 to 1 in even steps.

    `thresholds` (4, 4), 0 to 1, are an ordered dither, repeated over the picture. It hides the banding
    of a smooth backdrop.
    """
    height, width, _ = image.shape
    last = len(table) - 1
    out = np.empty((height, width, 3), np.uint8)
    for row in range(height):
        for column in range(width):
            threshold = thresholds[row & 3, column & 3]
            for c in range(3):
                value = int(image[row, column, c] * np.float32(last) + np.float32(0.5))
                out[row, column, c] = np.uint8(table[min(max(value, 0), last)] + threshold)
    return out
