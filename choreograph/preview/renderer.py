"""Software renderer: a mesh in a pose, on a floor in studio light, seen by a camera."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import ParameterError
from choreograph.mannequin.skinned_mesh import SkinnedMesh, skin_matrices
from choreograph.preview import _raster_kernels as raster
from choreograph.preview import _shading_kernels as shading

Floats = NDArray[np.float64]
Pixels = NDArray[np.uint8]

_GRID = 2  # samples a pixel along each axis
_SHADE_TEXELS = 192
_SHADE_M = 4.2  # width of the square of floor that holds the shadow
_CONTACT_TOP_M = 0.22  # only lower parts cast the contact shadow
_KEY_TEXEL_M = 0.007
_LARGEST_KEY_MAP = 1024
_LINE_M = 0.006  # half width of the floor's grid lines
# Ordered dither: rounding thresholds spread evenly over 4 x 4 pixels.
_BAYER = np.array([[0, 8, 2, 10], [12, 4, 14, 6], [3, 11, 1, 9], [15, 7, 13, 5]])
_THRESHOLDS = ((_BAYER + 0.5) / 16).astype(np.float32)


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera without roll, in metres, Y up; `fov_rad` is the vertical field of view."""

    eye_m: Floats  # (3,)
    target_m: Floats  # (3,)
    fov_rad: float = float(np.radians(32.0))

    def __post_init__(self) -> None:
        sight = np.asarray(self.target_m, float) - np.asarray(self.eye_m, float)
        if not np.hypot(sight[0], sight[2]) > 1e-6:
            raise ParameterError("a camera cannot look straight up or down: move its target off the vertical")
        if not 0.0 < self.fov_rad < np.pi:
            raise ParameterError(
                f"expected a field of view between 0 and 180 degrees, got {self.fov_rad} rad"
            )

    def axes(self) -> NDArray[np.float32]:
        """Unit directions to the right, up and into the picture, rows of (3, 3)."""
        ahead = np.asarray(self.target_m, float) - np.asarray(self.eye_m, float)
        ahead /= np.linalg.norm(ahead)
        right = np.cross(ahead, [0.0, 1.0, 0.0])
        right /= np.linalg.norm(right)
        return np.stack([right, np.cross(right, ahead), ahead]).astype(np.float32)


@dataclass(frozen=True)
class Light:
    """Directions to the lights and their linear colours, in camera space."""

    key: tuple[float, float, float] = (-0.55, 0.75, -0.55)  # right, up, into the picture
    fill: tuple[float, float, float] = (0.8, 0.25, -0.5)
    back: tuple[float, float, float] = (0.3, 0.6, 0.8)
    key_rgb: tuple[float, float, float] = (1.08, 1.02, 0.94)
    fill_rgb: tuple[float, float, float] = (0.16, 0.19, 0.24)
    back_rgb: tuple[float, float, float] = (0.22, 0.24, 0.28)
    sky_rgb: tuple[float, float, float] = (0.27, 0.29, 0.33)
    ground_rgb: tuple[float, float, float] = (0.13, 0.115, 0.10)


@dataclass(frozen=True)
class Stage:
    """sRGB colours of floor and backdrop; `shadow` is the share of light missing in the darkest shadow."""

    horizon: str = "#e6e4e0"
    overhead: str = "#9fb0c2"
    floor: str = "#dedad3"
    grid: str = "#c3beb5"
    shadow: float = 0.62


def render_pose(
    mesh: SkinnedMesh,
    pos_m: Floats,
    global_quat: Floats,
    camera: Camera,
    *,
    size: tuple[int, int] = (1280, 720),
    light: Light = Light(),
    stage: Stage = Stage(),
) -> Pixels:
    """The figure seen by the camera, (H, W, 3) sRGB bytes.

    `pos_m` (J, 3) and `global_quat` (J, 4) are one frame of `kinematics.forward`; the floor is at Y = 0.
    Raises `ParameterError` if the size is not positive or the pose has another number of joints.
    """
    width, height = size
    if width < 1 or height < 1:
        raise ParameterError(f"expected a picture of at least 1 x 1 pixels, got {width} x {height}")
    if np.shape(pos_m) != mesh.bind_pos_m.shape:
        raise ParameterError(
            f"expected joint positions {mesh.bind_pos_m.shape} as in the mesh, got {np.shape(pos_m)}"
        )
    points, normals = raster.skin(
        mesh.vertices_m, mesh.normals, mesh.joints, mesh.weights,
        skin_matrices(mesh, pos_m, global_quat),
    )  # fmt: skip
    axes, eye = camera.axes(), np.asarray(camera.eye_m, np.float32)
    focal = np.float32(0.5 * height / np.tan(0.5 * camera.fov_rad))  # pixels
    lights = np.stack([_unit(np.array(d) @ axes) for d in (light.key, light.fill, light.back)])
    image = np.empty((height, width, 3), np.float32)
    shade, origin = _floor_shade(points, mesh.triangles, lights[0], stage.shadow)
    middle = points[:, [0, 2]].mean(axis=0)
    shading.paint_backdrop(
        image, eye, axes[0], axes[1], axes[2], focal, np.float32(_LINE_M),
        _linear(stage.horizon, stage.overhead), _linear(stage.floor, stage.grid),
        shade, origin, np.float32(_SHADE_M / _SHADE_TEXELS), middle,
    )  # fmt: skip
    _draw_mesh(image, mesh, points, normals, eye, axes, focal, lights, light)
    return shading.to_srgb(image, _srgb_table(), _THRESHOLDS)


def _draw_mesh(image, mesh, points, normals, eye, axes, focal, lights, light) -> None:
    height, width, _ = image.shape
    view = np.concatenate([axes, -(axes @ eye)[:, None]], axis=1).astype(np.float32)
    screen = raster.project(
        points, view, focal * _GRID, np.float32(0.5 * width * _GRID), np.float32(0.5 * height * _GRID)
    )
    seen = screen[screen[:, 2] > 0, :2] / _GRID
    if len(seen) == 0:
        return
    low = np.clip(np.floor(seen.min(axis=0)), 0, [width, height]).astype(np.int64)
    high = np.clip(np.ceil(seen.max(axis=0)), 0, [width, height]).astype(np.int64)
    if (high <= low).any():
        return
    screen[:, :2] -= (low * _GRID).astype(np.float32)
    shape = tuple((high - low)[::-1] * _GRID)
    owners = np.full(shape, raster.NOTHING, np.int32)
    raster.rasterise(screen, mesh.triangles, np.zeros(shape, np.float32), owners)
    tints = np.array(
        [light.key_rgb, light.fill_rgb, light.back_rgb, light.sky_rgb, light.ground_rgb], np.float32
    )
    colours = (np.asarray(mesh.palette, np.float32) ** np.float32(2.2))[mesh.parts]
    seen_by_key, key_map = _key_light_map(points, mesh.triangles, lights[0])
    shading.shade_mesh(
        image, owners, _GRID, low[::-1].copy(), screen, mesh.triangles, points, normals, colours, eye,
        lights, tints, seen_by_key, key_map,
    )  # fmt: skip


def _key_light_map(points, triangles, key) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The vertices (V, 3) in the key light's view, and its shadow map: nearest surfaces (N, N).

    Only surfaces that face away from the light are in the map, so that lit ones never shadow themselves.
    """
    right = _unit(np.cross(key, [0.0, 1.0, 0.0]))
    axes = np.stack([right, -np.cross(right, -key), key]).astype(np.float32)
    seen = points @ axes.T  # x, y down, nearness to the light, metres
    low = seen.min(axis=0)
    seen[:, :2] -= low[:2] - np.float32(4 * _KEY_TEXEL_M)
    seen[:, 2] -= low[2] - np.float32(0.1)  # 0 means no surface
    seen[:, :2] /= np.float32(_KEY_TEXEL_M)
    n = min(int(seen[:, :2].max()) + 5, _LARGEST_KEY_MAP)
    nearness = np.zeros((n, n), np.float32)
    away = np.ascontiguousarray(triangles[:, ::-1])
    raster.rasterise(seen, away, nearness, np.empty((n, n), np.int32))
    return seen, nearness


def _floor_shade(points, triangles, key, darkest: float) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Light missing on the floor (N, N) around the mesh, and the (x, z) of the first texel.

    Two shadows: a dark contact shadow straight below what is close to the floor, and a wide, faint one of
    the whole body along the key light.
    """
    texel = np.float32(_SHADE_M / _SHADE_TEXELS)
    middle = points[:, [0, 2]].mean(axis=0)
    origin = (np.floor(middle / texel) * texel - np.float32(_SHADE_M / 2)).astype(np.float32)
    contact = np.zeros((_SHADE_TEXELS, _SHADE_TEXELS), np.float32)
    cast = np.zeros_like(contact)
    straight = np.zeros(2, np.float32)
    slant = (-key[[0, 2]] / max(key[1], 0.2) * 0.8).astype(np.float32)
    raster.flatten_onto_floor(points, triangles, straight, origin, texel, np.float32(_CONTACT_TOP_M), contact)
    raster.flatten_onto_floor(points, triangles, slant, origin, texel, np.float32(2.6), cast)
    contact, cast = raster.blur(contact, 1, 3), raster.blur(cast, 3, 3)
    return 1 - (1 - np.float32(darkest) * contact) * (1 - np.float32(0.6 * darkest) * cast), origin


@lru_cache(maxsize=8)
def _linear(*colours: str) -> NDArray[np.float32]:
    bytes_ = [[int(colour[i : i + 2], 16) for i in (1, 3, 5)] for colour in colours]
    return ((np.array(bytes_) / 255.0) ** 2.2).astype(np.float32)


@lru_cache(maxsize=1)
def _srgb_table() -> NDArray[np.float32]:
    return (255.0 * np.linspace(0.0, 1.0, 8193) ** (1 / 2.2)).astype(np.float32)


def _unit(vector: Floats) -> NDArray[np.float32]:
    return (vector / np.linalg.norm(vector)).astype(np.float32)
