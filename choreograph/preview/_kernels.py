"""Compiled loops of the renderer: skinning, triangles to samples, shading, floor and backdrop.

Screens are sampled on a grid: sample (row, column) is at y = row + 0.5, x = column + 0.5. Colours are
linear light until `to_srgb`. All arrays are float32 unless said.
"""

from __future__ import annotations

import numpy as np
from numba import njit

NOTHING = -1  # in a buffer of triangle indices
_NEAR_M = np.float32(0.05)


@njit(cache=True, nogil=True, error_model="numpy")
def skin(vertices, normals, joints, weights, matrices):  # pragma: no cover - compiled
    """Vertices and unit normals (V, 3) in the world, by joints' matrices (J, 3, 4)."""
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


@njit(cache=True, nogil=True, error_model="numpy")
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


@njit(cache=True, nogil=True, error_model="numpy")
def rasterise(screen, triangles, nearness, owners):  # pragma: no cover - compiled
    """Write each triangle that faces the viewer into `nearness` and `owners` (int32) where it is nearest.

    `screen` (V, 3) holds x, y and a nearness that is linear on the screen, above 0. Counter-clockwise
    on a screen whose y grows down is seen from behind.
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
        # Shares of the corners, each linear on the screen: b = value at the first sample + steps.
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


@njit(cache=True, nogil=True, error_model="numpy")
def flatten_onto_floor(points, triangles, slope, origin, texel, top, cover):  # pragma: no cover - compiled
    """How much of the light each texel of the floor loses, into `cover` (N, N), 0 to 1.

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


@njit(cache=True, nogil=True, inline="always")
def _texel(point, slope, origin, texel):  # pragma: no cover - compiled
    x = (point[0] + slope[0] * point[1] - origin[0]) / texel
    z = (point[2] + slope[1] * point[1] - origin[1]) / texel
    return x, z


@njit(cache=True, nogil=True, error_model="numpy")
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


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def paint_backdrop(
    image, eye, right, up, ahead, focal, slit, sky, floor, shade, origin, texel, middle
):  # pragma: no cover - compiled
    """Floor with grid and shadow, and sky, into `image` (H, W, 3).

    `sky` (2, 3): colours at the horizon and overhead. `floor` (2, 3): floor and grid. `slit`: half a
    grid line's width in metres. `shade` (N, N) is the light the floor loses. `middle` (x, z): the floor is
    brightest there and fades into the horizon away from it.
    """
    height, width, _ = image.shape
    n = len(shade)
    half_w, half_h = np.float32(0.5 * width - 0.5), np.float32(0.5 * height - 0.5)
    one, half = np.float32(1.0), np.float32(0.5)
    for row in range(height):
        v = (half_h - np.float32(row)) / focal
        for column in range(width):
            u = (np.float32(column) - half_w) / focal
            dx = ahead[0] + u * right[0] + v * up[0]
            dy = ahead[1] + u * right[1] + v * up[1]
            dz = ahead[2] + u * right[2] + v * up[2]
            length = np.sqrt(dx * dx + dy * dy + dz * dz)
            rise = max(dy / length, np.float32(0.0))
            mix = min(rise * np.float32(1.6), one)
            r = sky[0, 0] + (sky[1, 0] - sky[0, 0]) * mix
            g = sky[0, 1] + (sky[1, 1] - sky[0, 1]) * mix
            b = sky[0, 2] + (sky[1, 2] - sky[0, 2]) * mix
            if dy < np.float32(-1e-4) and eye[1] > 0:
                away = -eye[1] / dy
                x, z = eye[0] + away * dx, eye[2] + away * dz
                px, pz = x - middle[0], z - middle[1]
                far = np.sqrt(px * px + pz * pz)
                solid = max(one - far / np.float32(9.0), np.float32(0.0))
                solid = solid * solid * (3 - 2 * solid)
                if solid > 0:
                    # A sample covers this much floor, across the view and along it.
                    across = away * length / focal
                    steep = max(-dy / length, np.float32(0.02))
                    span = across / np.sqrt(steep)
                    gx = np.abs(x - np.floor(x + half))
                    gz = np.abs(z - np.floor(z + half))
                    near = max(span, slit)
                    line = max(one - gx / near, np.float32(0.0)) + max(one - gz / near, np.float32(0.0))
                    line = min(line, one) * slit / near
                    lit = np.float32(0.80) + np.float32(0.20) / (one + np.float32(0.18) * far * far)
                    fx, fz = (x - origin[0]) / texel, (z - origin[1]) / texel
                    if 0 <= fx < n - 1 and 0 <= fz < n - 1:
                        ix, iz = int(fx), int(fz)
                        wx, wz = fx - ix, fz - iz
                        low = shade[iz, ix] * (one - wx) + shade[iz, ix + 1] * wx
                        high = shade[iz + 1, ix] * (one - wx) + shade[iz + 1, ix + 1] * wx
                        lit *= one - (low * (one - wz) + high * wz)
                    r += (lit * (floor[0, 0] + (floor[1, 0] - floor[0, 0]) * line) - r) * solid
                    g += (lit * (floor[0, 1] + (floor[1, 1] - floor[0, 1]) * line) - g) * solid
                    b += (lit * (floor[0, 2] + (floor[1, 2] - floor[0, 2]) * line) - b) * solid
            image[row, column, 0] = r
            image[row, column, 1] = g
            image[row, column, 2] = b


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def shade_figure(
    image, owners, grid, corner, screen, triangles, points, normals, colours, eye, lights, tints
):  # pragma: no cover - compiled
    """Blend the figure's samples into `image` (H, W, 3): `grid` × `grid` samples a pixel.

    `owners` (h · grid, w · grid) int32 is the window of samples whose pixel (0, 0) is `corner` (row, column).
    `lights` (3, 3): unit directions to key, fill and back light; `tints` (5, 3): their colours, then the
    light from overhead and the light off the floor. `colours` (V, 3) are the vertices' own.
    """
    rows, columns = owners.shape[0] // grid, owners.shape[1] // grid
    share = np.float32(1.0) / np.float32(grid * grid)
    zero, half, one = np.float32(0.0), np.float32(0.5), np.float32(1.0)
    for row in range(rows):
        for column in range(columns):
            r = g = b = zero
            covered = zero
            top, left = row * grid, column * grid
            # Most pixels are of one triangle: those are shaded once, in their middle.
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
                x0, y0 = screen[i, 0], screen[i, 1]
                ax, ay = screen[j, 0] - x0, screen[j, 1] - y0
                bx, by = screen[k, 0] - x0, screen[k, 1] - y0
                px -= x0
                py -= y0
                scale = one / (ax * by - bx * ay)
                b1 = (px * by - py * bx) * scale * screen[j, 2]
                b2 = (py * ax - px * ay) * scale * screen[k, 2]
                b0 = (one - (px * by - py * bx) * scale - (py * ax - px * ay) * scale) * screen[i, 2]
                total = one / (b0 + b1 + b2)
                b0, b1, b2 = b0 * total, b1 * total, b2 * total
                nx = b0 * normals[i, 0] + b1 * normals[j, 0] + b2 * normals[k, 0]
                ny = b0 * normals[i, 1] + b1 * normals[j, 1] + b2 * normals[k, 1]
                nz = b0 * normals[i, 2] + b1 * normals[j, 2] + b2 * normals[k, 2]
                unit = one / np.sqrt(nx * nx + ny * ny + nz * nz + np.float32(1e-12))
                nx, ny, nz = nx * unit, ny * unit, nz * unit
                vx = eye[0] - (b0 * points[i, 0] + b1 * points[j, 0] + b2 * points[k, 0])
                vy = eye[1] - (b0 * points[i, 1] + b1 * points[j, 1] + b2 * points[k, 1])
                vz = eye[2] - (b0 * points[i, 2] + b1 * points[j, 2] + b2 * points[k, 2])
                unit = one / np.sqrt(vx * vx + vy * vy + vz * vz)
                vx, vy, vz = vx * unit, vy * unit, vz * unit
                facing = max(nx * vx + ny * vy + nz * vz, zero)
                edge = (one - facing) * (one - facing) * (one - facing)
                key = nx * lights[0, 0] + ny * lights[0, 1] + nz * lights[0, 2]
                key = max((key + np.float32(0.25)) / np.float32(1.25), zero)  # skin lets light round its edge
                fill = max(nx * lights[1, 0] + ny * lights[1, 1] + nz * lights[1, 2], zero)
                back = max(nx * lights[2, 0] + ny * lights[2, 1] + nz * lights[2, 2], zero)
                back = edge * (half + back)
                hx, hy, hz = vx + lights[0, 0], vy + lights[0, 1], vz + lights[0, 2]
                unit = one / np.sqrt(hx * hx + hy * hy + hz * hz)
                gloss = max((nx * hx + ny * hy + nz * hz) * unit, zero) ** 32 * np.float32(0.10)
                above = half + half * ny
                red = (
                    key * tints[0, 0] + fill * tints[1, 0] + above * tints[3, 0] + (one - above) * tints[4, 0]
                )
                green = (
                    key * tints[0, 1] + fill * tints[1, 1] + above * tints[3, 1] + (one - above) * tints[4, 1]
                )
                blue = (
                    key * tints[0, 2] + fill * tints[1, 2] + above * tints[3, 2] + (one - above) * tints[4, 2]
                )
                c = colours[i]
                r += weight * (c[0] * red + back * tints[2, 0] + gloss * tints[0, 0])
                g += weight * (c[1] * green + back * tints[2, 1] + gloss * tints[0, 1])
                b += weight * (c[2] * blue + back * tints[2, 2] + gloss * tints[0, 2])
                covered += weight
            if covered > 0:
                rest = one - covered * share
                pixel = image[corner[0] + row, corner[1] + column]
                pixel[0] = pixel[0] * rest + r * share
                pixel[1] = pixel[1] * rest + g * share
                pixel[2] = pixel[2] * rest + b * share


@njit(cache=True, nogil=True)
def to_srgb(image, table, thresholds):  # pragma: no cover - compiled
    """Bytes (H, W, 3) of linear light (H, W, 3); `table` (N,) holds sRGB, 0 to 255, of 0 to 1 in even steps.

    `thresholds` (4, 4), 0 to 1, repeat over the picture: what rounds up there. They hide the steps that
    a smooth backdrop would show.
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
