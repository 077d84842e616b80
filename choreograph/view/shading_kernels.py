"""Compiled shading loops of the renderer: backdrop and floor, the mannequin, conversion to sRGB bytes.

Colours are linear light until `to_srgb`. All arrays are float32 unless noted.
"""

from __future__ import annotations

import numpy as np

from choreograph.core.kernel_cache import njit

_BIAS_M = np.float32(0.012)  # shadow bias: a surface closer than this casts no shadow
_SHADOW = np.float32(0.3)  # share of the key light left in shadows on the body: the light source is large


@njit(nogil=True, error_model="numpy", fastmath=True)
def paint_backdrop(
    image, eye, right, up, ahead, focal, slit, sky, floor, shade, origin, texel, middle
):  # pragma: no cover - compiled
    """Floor with grid and shadow, and sky, into `image` (H, W, 3).

    `right`, `up` and `ahead` (3,) are the camera's unit axes, `right` level. `sky` (2, 3): colours at the
    horizon and overhead. `floor` (2, 3): floor and grid. `slit`: half a grid line's width in metres.
    `shade` (N, N) is the light the floor loses. `middle` (x, z): the floor is brightest there and fades
    into the horizon away from it.
    """
    height, width, _ = image.shape
    n = len(shade)
    half_w, half_h = np.float32(0.5 * width - 0.5), np.float32(0.5 * height - 0.5)
    one, half = np.float32(1.0), np.float32(0.5)
    pixel, per_texel = one / focal, one / texel
    for row in range(height):
        v = (half_h - np.float32(row)) * pixel
        dy = ahead[1] + v * up[1]  # the camera has no roll: all pixels of a row have the same slope
        down = dy < np.float32(-1e-4) and eye[1] > 0
        away = -eye[1] / dy if down else np.float32(0.0)
        for column in range(width):
            u = (np.float32(column) - half_w) * pixel
            dx = ahead[0] + u * right[0] + v * up[0]
            dz = ahead[2] + u * right[2] + v * up[2]
            inverse = one / np.sqrt(dx * dx + dy * dy + dz * dz)
            rise = max(dy * inverse, np.float32(0.0))
            mix = min(rise * np.float32(1.6), one)
            r = sky[0, 0] + (sky[1, 0] - sky[0, 0]) * mix
            g = sky[0, 1] + (sky[1, 1] - sky[0, 1]) * mix
            b = sky[0, 2] + (sky[1, 2] - sky[0, 2]) * mix
            if down:
                x, z = eye[0] + away * dx, eye[2] + away * dz
                px, pz = x - middle[0], z - middle[1]
                far = np.sqrt(px * px + pz * pz)
                solid = max(one - far * np.float32(1.0 / 9.0), np.float32(0.0))
                solid = solid * solid * (np.float32(3.0) - np.float32(2.0) * solid)
                if solid > 0:
                    # The footprint of a sample on the floor, across and along the view.
                    steep = max(-dy * inverse, np.float32(0.02))
                    span = away * pixel / (inverse * np.sqrt(steep))
                    gx = np.abs(x - np.floor(x + half))
                    gz = np.abs(z - np.floor(z + half))
                    sharp = one / max(span, slit)
                    line = max(one - gx * sharp, np.float32(0.0)) + max(one - gz * sharp, np.float32(0.0))
                    line = min(line, one) * slit * sharp
                    lit = np.float32(0.80) + np.float32(0.20) / (one + np.float32(0.18) * far * far)
                    fx, fz = (x - origin[0]) * per_texel, (z - origin[1]) * per_texel
                    if 0 <= fx < n - 1 and 0 <= fz < n - 1:
                        ix, iz = int(fx), int(fz)
                        wx, wz = fx - np.float32(ix), fz - np.float32(iz)
                        low = shade[iz, ix] * (one - wx) + shade[iz, ix + 1] * wx
                        high = shade[iz + 1, ix] * (one - wx) + shade[iz + 1, ix + 1] * wx
                        lit *= one - (low * (one - wz) + high * wz)
                    r += (lit * (floor[0, 0] + (floor[1, 0] - floor[0, 0]) * line) - r) * solid
                    g += (lit * (floor[0, 1] + (floor[1, 1] - floor[0, 1]) * line) - g) * solid
                    b += (lit * (floor[0, 2] + (floor[1, 2] - floor[0, 2]) * line) - b) * solid
            image[row, column, 0] = r
            image[row, column, 1] = g
            image[row, column, 2] = b


@njit(nogil=True, error_model="numpy", fastmath=True)
def shade_mesh(
    image,
    owners,
    grid,
    corner,
    screen,
    triangles,
    points,
    normals,
    colours,
    eye,
    lights,
    tints,
    seen_by_key,
    key_map,
):  # pragma: no cover - compiled
    """Blend the mesh's samples into `image` (H, W, 3): `grid` × `grid` samples a pixel.

    `owners` (h · grid, w · grid) int32 is the window of samples whose pixel (0, 0) is `corner` (row, column).
    `lights` (3, 3): unit directions to key, fill and back light; `tints` (5, 3): their colours, then the
    light from overhead and the light off the floor. `colours` (V, 3) belong to the vertices. `key_map` (N, N)
    is the shadow map of the key light: the nearness in metres of the nearest surface that faces away from
    it. `seen_by_key` (V, 3) are the vertices' positions in it: what lies behind gets little key light.
    """
    rows, columns = owners.shape[0] // grid, owners.shape[1] // grid
    share = np.float32(1.0) / np.float32(grid * grid)
    zero, half, one = np.float32(0.0), np.float32(0.5), np.float32(1.0)
    for row in range(rows):
        for column in range(columns):
            r = g = b = zero
            covered = zero
            top, left = row * grid, column * grid
            # Most pixels lie in one triangle: they are shaded once, at their centre.
            alike = True
            for sample in range(1, grid * grid):
                alike = alike and owners[top + sample // grid, left + sample % grid] == owners[top, left]
            n_shaded = 1 if alike else grid * grid
            weight = np.float32(grid * grid) if alike else one
            for sample in range(n_shaded):
                sy, sx = sample // grid, sample % grid
                t = owners[top + sy, left + sx]
                if t < 0:
                    continue
                px, py = np.float32(left), np.float32(top)
                if alike:
                    px += half * np.float32(grid)
                    py += half * np.float32(grid)
                else:
                    px += np.float32(sx) + half
                    py += np.float32(sy) + half
                i, j, k = triangles[t]
                b0, b1, b2 = _shares(screen, i, j, k, px, py)
                key_x, key_y, key_near = _between(seen_by_key, i, j, k, b0, b1, b2)
                key_share = _SHADOW + (one - _SHADOW) * _lit(key_map, key_x, key_y, key_near + _BIAS_M)
                red, green, blue = _light(
                    _between(normals, i, j, k, b0, b1, b2),
                    _between(points, i, j, k, b0, b1, b2),
                    colours[i], eye, lights, tints, key_share,
                )  # fmt: skip
                r += weight * red
                g += weight * green
                b += weight * blue
                covered += weight
            if covered > 0:
                rest = one - covered * share
                pixel = image[corner[0] + row, corner[1] + column]
                pixel[0] = pixel[0] * rest + r * share
                pixel[1] = pixel[1] * rest + g * share
                pixel[2] = pixel[2] * rest + b * share


@njit(nogil=True, error_model="numpy", fastmath=True, inline="always")
def _shares(screen, i, j, k, px, py):  # pragma: no cover - compiled
    """Perspective-correct barycentric coordinates of a picture position: three numbers that sum to 1.

    `screen` (V, 3): the vertices' picture positions and inverse depths.
    """
    one = np.float32(1.0)
    x0, y0 = screen[i, 0], screen[i, 1]
    ax, ay = screen[j, 0] - x0, screen[j, 1] - y0
    bx, by = screen[k, 0] - x0, screen[k, 1] - y0
    px, py = px - x0, py - y0
    scale = one / (ax * by - bx * ay)
    flat1, flat2 = (px * by - py * bx) * scale, (py * ax - px * ay) * scale
    b0, b1, b2 = (one - flat1 - flat2) * screen[i, 2], flat1 * screen[j, 2], flat2 * screen[k, 2]
    total = one / (b0 + b1 + b2)
    return b0 * total, b1 * total, b2 * total


@njit(nogil=True, error_model="numpy", fastmath=True, inline="always")
def _between(values, i, j, k, b0, b1, b2):  # pragma: no cover - compiled
    """The corners' `values` (V, 3) interpolated inside the triangle, as three numbers."""
    return (
        b0 * values[i, 0] + b1 * values[j, 0] + b2 * values[k, 0],
        b0 * values[i, 1] + b1 * values[j, 1] + b2 * values[k, 1],
        b0 * values[i, 2] + b1 * values[j, 2] + b2 * values[k, 2],
    )


@njit(nogil=True, error_model="numpy", fastmath=True, inline="always")
def _light(normal, point, colour, eye, lights, tints, key_share):  # pragma: no cover - compiled
    """Light (r, g, b) that a surface reflects to the eye; `key_share` of the key light reaches it."""
    zero, half, one = np.float32(0.0), np.float32(0.5), np.float32(1.0)
    nx, ny, nz = normal
    unit = one / np.sqrt(nx * nx + ny * ny + nz * nz + np.float32(1e-12))
    nx, ny, nz = nx * unit, ny * unit, nz * unit
    vx, vy, vz = eye[0] - point[0], eye[1] - point[1], eye[2] - point[2]
    unit = one / np.sqrt(vx * vx + vy * vy + vz * vz)
    vx, vy, vz = vx * unit, vy * unit, vz * unit
    facing = max(nx * vx + ny * vy + nz * vz, zero)
    edge = (one - facing) * (one - facing) * (one - facing)
    key = nx * lights[0, 0] + ny * lights[0, 1] + nz * lights[0, 2]
    key = key_share * max((key + np.float32(0.25)) / np.float32(1.25), zero)  # wrap lighting, as on skin
    fill = max(nx * lights[1, 0] + ny * lights[1, 1] + nz * lights[1, 2], zero)
    back = max(nx * lights[2, 0] + ny * lights[2, 1] + nz * lights[2, 2], zero)
    back = edge * (half + back)
    hx, hy, hz = vx + lights[0, 0], vy + lights[0, 1], vz + lights[0, 2]
    unit = one / np.sqrt(hx * hx + hy * hy + hz * hz)
    gloss = max((nx * hx + ny * hy + nz * hz) * unit, zero) ** 32 * np.float32(0.10)
    above = half + half * ny
    below = one - above
    red = key * tints[0, 0] + fill * tints[1, 0] + above * tints[3, 0] + below * tints[4, 0]
    green = key * tints[0, 1] + fill * tints[1, 1] + above * tints[3, 1] + below * tints[4, 1]
    blue = key * tints[0, 2] + fill * tints[1, 2] + above * tints[3, 2] + below * tints[4, 2]
    return (
        colour[0] * red + back * tints[2, 0] + gloss * tints[0, 0],
        colour[1] * green + back * tints[2, 1] + gloss * tints[0, 1],
        colour[2] * blue + back * tints[2, 2] + gloss * tints[0, 2],
    )


@njit(nogil=True, inline="always")
def _lit(key_map, x, y, near):  # pragma: no cover - compiled
    """Unoccluded share of the light at (x, y) on the shadow map, filtered over 4 x 4 texels.

    The outer texels are weighted by their overlap with the 4 x 4 window, so that shadows have no steps.
    """
    n = len(key_map)
    left, top = x - np.float32(2.5), y - np.float32(2.5)
    x0, y0 = int(left), int(top)
    if x0 < 0 or y0 < 0 or x0 + 4 >= n or y0 + 4 >= n:
        return np.float32(1.0)
    fx, fy = left - np.float32(x0), top - np.float32(y0)
    free = np.float32(0.0)
    for row in range(5):
        across = np.float32(0.0)
        for column in range(5):
            if key_map[y0 + row, x0 + column] <= near:
                share = np.float32(1.0)
                if column == 0:
                    share -= fx
                elif column == 4:
                    share = fx
                across += share
        if row == 0:
            across *= np.float32(1.0) - fy
        elif row == 4:
            across *= fy
        free += across
    return free * np.float32(1.0 / 16.0)


@njit(nogil=True)
def to_srgb(image, table, thresholds):  # pragma: no cover - compiled
    """Bytes (H, W, 3) of linear light (H, W, 3); `table` (N,) holds sRGB, 0 to 255, of 0 to 1 in even steps.

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
