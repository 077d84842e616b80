"""Software renderer of a mesh on a floor in studio light, and cameras that follow one dancer or several."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import scipy
from numpy.typing import NDArray

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats
from choreograph.motion.body import body_pos_m, ground_pos_m
from choreograph.motion.cameras import FOV_RAD
from choreograph.motion.kinematics import forward
from choreograph.motion.motion import Motion
from choreograph.motion.skinned_mesh import SkinnedMesh, build_mannequin, palette_of, skin_matrices
from choreograph.view import render_kernels as kernels

F32 = NDArray[np.float32]
Pixels = NDArray[np.uint8]

_SHADE_TEXELS = 192  # of the square of floor that holds the shadow, along each side
_LONE_M = 1.9  # from its middle, the reach of one body
_CONTACT_TOP_M = 0.22  # only lower parts cast the contact shadow
_KEY_TEXEL_M = 0.007
_LARGEST_KEY_MAP = 1024
_CAST_TOP_M = 2.6  # the whole body casts the wide shadow
_NEAR_M = 0.05  # nothing closer to the camera is drawn
# Ordered dither: rounding thresholds spread evenly over 4 x 4 pixels.
_BAYER = np.array([[0, 8, 2, 10], [12, 4, 14, 6], [3, 11, 1, 9], [15, 7, 13, 5]])
_THRESHOLDS = ((_BAYER + 0.5) / 16).astype(np.float32)


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera without roll, in metres, Y up. `fov_rad` is the vertical field of view."""

    eye_m: Floats  # (3,)
    target_m: Floats  # (3,)
    fov_rad: float = float(np.radians(32.0))

    def __post_init__(self) -> None:
        sight = np.asarray(self.target_m, float) - np.asarray(self.eye_m, float)
        if not np.hypot(sight[0], sight[2]) > 1e-6:
            raise ParameterError(
                "expected a camera that does not look straight up or down: move its target to the side"
            )
        if not 0.0 < self.fov_rad < np.pi:
            raise ParameterError(
                f"expected a field of view between 0 and 180 degrees, got {self.fov_rad} rad"
            )

    def axes(self) -> F32:
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
    fill: tuple[float, float, float] = (0.8, 0.25, -0.5)  # direction of the fill light
    back: tuple[float, float, float] = (0.3, 0.6, 0.8)  # direction of the light from behind
    key_rgb: tuple[float, float, float] = (1.08, 1.02, 0.94)  # colours in linear light
    fill_rgb: tuple[float, float, float] = (0.16, 0.19, 0.24)  # of the fill light
    back_rgb: tuple[float, float, float] = (0.22, 0.24, 0.28)  # of the light from behind
    sky_rgb: tuple[float, float, float] = (0.27, 0.29, 0.33)  # from overhead
    ground_rgb: tuple[float, float, float] = (0.13, 0.115, 0.10)  # reflected by the floor


@dataclass(frozen=True)
class Stage:
    """sRGB colours of floor and backdrop. `shadow` is the share of light that the darkest shadow loses."""

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
    """A picture of the figure, (H, W, 3) sRGB bytes.

    `pos_m` (J, 3) and `global_quat` (J, 4) are one frame of `kinematics.forward`. The floor is at Y = 0.
    Raises `ParameterError` if the size is not positive or the pose has another number of joints.
    """
    width, height = size
    if width < 1 or height < 1:
        raise ParameterError(f"expected a picture of at least 1 x 1 pixels, got {width} x {height}")
    if np.shape(pos_m) != mesh.bind_pos_m.shape:
        raise ParameterError(
            f"expected joint positions {mesh.bind_pos_m.shape} as in the mesh, got {np.shape(pos_m)}"
        )
    points, normals = skinned(mesh, skin_matrices(mesh, pos_m, global_quat))
    axes, eye = camera.axes(), np.asarray(camera.eye_m, np.float32)
    focal = np.float32(0.5 * height / np.tan(0.5 * camera.fov_rad))  # pixels
    lights = np.stack([_unit(np.array(d) @ axes) for d in (light.key, light.fill, light.back)])
    shade, origin = _floor_shade(points, mesh.triangles, lights[0], stage.shadow)
    image = np.empty((height, width, 3), np.float32)
    sky, floor = _linear(stage.horizon, stage.overhead), _linear(stage.floor, stage.grid)
    kernels.paint_backdrop(image, eye, axes, focal, sky, floor, shade, origin)
    screen = projected(points, eye, axes, focal * kernels.GRID, (width * kernels.GRID, height * kernels.GRID))
    _draw_mesh(image, mesh, (screen, points, normals), eye, lights, light)
    return kernels.to_srgb(image, _srgb_table(), _THRESHOLDS)


def skinned(mesh: SkinnedMesh, matrices: F32) -> tuple[F32, F32]:
    """Vertices and unit normals (V, 3) in the world, by linear blend skinning with matrices (J, 3, 4)."""
    blend = np.einsum("vk,vkij->vij", mesh.weights, matrices[mesh.joints])  # (V, 3, 4)
    points = np.einsum("vij,vj->vi", blend[..., :3], mesh.vertices_m) + blend[..., 3]
    normals = np.einsum("vij,vj->vi", blend[..., :3], mesh.normals)
    return points, normals / np.sqrt(np.sum(normals**2, axis=1, keepdims=True) + np.float32(1e-12))


def projected(points: F32, eye: F32, axes: F32, focal: np.float32, size: tuple[int, int]) -> F32:
    """Positions x, y on a screen of `size` (width, height), y down, and 1 / depth, 0 behind it, (V, 3).

    `axes` (3, 3) are the camera's, and `focal` is in the screen's unit.
    """
    x, y, depth = ((points - eye) @ axes.T).T
    seen = depth >= _NEAR_M
    inverse = np.divide(1.0, depth, out=np.zeros_like(depth), where=seen)
    screen = np.stack(
        [0.5 * size[0] + focal * x * inverse, 0.5 * size[1] - focal * y * inverse, inverse], axis=1
    )
    screen[~seen] = 0.0
    return screen.astype(np.float32, copy=False)


def _draw_mesh(
    image: F32, mesh: SkinnedMesh, vertices: tuple[F32, F32, F32], eye: F32, lights: F32, light: Light
) -> None:
    """Draw vertices from their positions on the screen and in the world and normals, (V, 3) each."""
    screen, points, _ = vertices
    seen = screen[screen[:, 2] > 0, :2] / kernels.GRID
    if len(seen) == 0:
        return
    low, high = (
        np.clip(end, 0, image.shape[1::-1]).astype(int)
        for end in (np.floor(seen.min(axis=0)), np.ceil(seen.max(axis=0)))
    )
    if (high <= low).any():
        return
    screen[:, :2] -= low * kernels.GRID
    shape = tuple((high - low)[::-1] * kernels.GRID)
    owners = np.full(shape, kernels.NOTHING, np.int32)
    kernels.rasterise(screen, mesh.triangles, np.zeros(shape, np.float32), owners)
    tints = np.array(
        [light.key_rgb, light.fill_rgb, light.back_rgb, light.sky_rgb, light.ground_rgb], np.float32
    )
    colours = (np.asarray(mesh.palette, np.float32) ** np.float32(2.2))[mesh.parts]
    seen_by_key, key_map = _key_light_map(points, mesh.triangles, lights[0])
    window, shaded = image[low[1] : high[1], low[0] : high[0]], np.stack([*vertices, seen_by_key, colours])
    kernels.shade_mesh(window, owners, shaded, mesh.triangles, eye, lights, tints, key_map)


def _key_light_map(points: F32, triangles: NDArray[np.int32], key: F32) -> tuple[F32, F32]:
    """The vertices (V, 3) in the view of the key light, and its shadow map, the nearest surfaces (N, N).

    The map has only surfaces that face away from the light, so that lit surfaces do not shadow themselves.
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
    kernels.rasterise(seen, away, nearness, np.empty((n, n), np.int32))
    return seen, nearness


def _floor_shade(points: F32, triangles: NDArray[np.int32], key: F32, darkest: float) -> tuple[F32, F32]:
    """The light that the floor (N, N) around the mesh loses, and the (x, z) of the first texel.

    There is a dark contact shadow below parts that are close to the floor, and a wide, faint shadow of the
    whole body along the key light.
    """
    middle = np.floor(points[:, [0, 2]].mean(axis=0) / kernels.TEXEL_M)
    away_m = float(np.abs(points[:, [0, 2]] - middle * kernels.TEXEL_M).max())
    n_texels = _SHADE_TEXELS
    if away_m > _LONE_M:  # several dancers
        n_texels += 2 * int((away_m - _LONE_M) / float(kernels.TEXEL_M))
    origin = ((middle - n_texels / 2) * kernels.TEXEL_M).astype(np.float32)
    below = np.ascontiguousarray(triangles[:, ::-1])  # surfaces that face down cast it
    slant = -key[[0, 2]] / max(float(key[1]), 0.2) * 0.8
    contact = blurred(floor_cover(points, below, np.zeros(2), origin, _CONTACT_TOP_M, n_texels), 3)
    cast = blurred(floor_cover(points, below, slant, origin, _CAST_TOP_M, n_texels), 7)
    return 1 - (1 - np.float32(darkest) * contact) * (1 - np.float32(0.6 * darkest) * cast), origin


def floor_cover(
    points: F32,
    triangles: NDArray[np.int32],
    slant: NDArray[np.floating],
    origin: F32,
    top_m: float,
    n_texels: int = _SHADE_TEXELS,
) -> F32:
    """The share of light that each texel of the floor (N, N) loses to a mesh, 0 to 1, before it is blurred.

    Points are projected along `slant` (2,), which is x and z per metre of height. A surface on the floor
    blocks all of the light, and one that is `top_m` or more above it blocks none.
    """
    flat = points[:, [0, 2]] + points[:, 1:2] * slant
    strength = 1 - np.maximum(points[:, 1:2], 0.0) / top_m
    places = np.concatenate([(flat - origin) / kernels.TEXEL_M + 0.5, strength], axis=1)
    cover = np.zeros((n_texels, n_texels), np.float32)
    kernels.rasterise(places.astype(np.float32), triangles, cover, np.empty(cover.shape, np.int32))
    return cover


def blurred(image: F32, size: int) -> F32:
    """An image after three box filters of `size` texels along both axes, which are nearly a Gaussian."""
    for _ in range(3):
        image = scipy.ndimage.uniform_filter(image, size, mode="constant")
    return image


@lru_cache(maxsize=8)
def _linear(*colours: str) -> F32:
    bytes_ = [[int(colour[i : i + 2], 16) for i in (1, 3, 5)] for colour in colours]
    return ((np.array(bytes_) / 255.0) ** 2.2).astype(np.float32)


@lru_cache(maxsize=1)
def _srgb_table() -> F32:
    return (255.0 * np.linspace(0.0, 1.0, 8193) ** (1 / 2.2)).astype(np.float32)


def _unit(vector: NDArray[np.floating]) -> F32:
    return (vector / np.linalg.norm(vector)).astype(np.float32)


# Cameras that follow a dancer.


_SIDE_RAD = float(np.radians(10.0))  # a body that is seen straight from the front looks flat
_EYE_OF_HEIGHT = 0.78  # a little below the dancer's eyes
_HIGH_OF_HEIGHT = 1.36  # height of the view: the body with raised arms and a margin
_WIDE_OF_HEIGHT = 1.05  # width of the view: the body with arms to the sides and a margin
_MIDDLE_OF_HEIGHT = 0.54


@dataclass(frozen=True, eq=False)
class Shots:
    """Poses of a motion, with a camera for each."""

    mesh: SkinnedMesh
    pos_m: Floats  # (T, J, 3) of the world
    global_quat: Floats  # (T, J, 4)
    targets_m: Floats  # (T, 3) of the cameras
    towards_eye_m: Floats  # (3,), or (T, 3) of cameras with other directions, from the target to the camera

    def render(self, frame: int, size: tuple[int, int]) -> Pixels:
        """Frame `frame` as an image (H, W, 3)."""
        towards_m = np.broadcast_to(self.towards_eye_m, self.targets_m.shape)[frame]
        camera = Camera(self.targets_m[frame] + towards_m, self.targets_m[frame], FOV_RAD)
        return render_pose(self.mesh, self.pos_m[frame], self.global_quat[frame], camera, size=size)


def follow_camera(
    motion: Motion,
    times_s: Sequence[float] | Floats,
    *,
    aspect: float,
    smoothing_s: float = 0.0,
    front_rad: float = 0.0,
) -> Shots:
    """The poses at `times_s` (T,) and cameras for pictures `aspect` times as wide as high.

    The cameras stand with the audience, 10° to the side, so that a dancer with the back to the audience is
    seen from behind. `front_rad` is the direction of the audience, 0 for +Z. The cameras follow the position
    of the dancer on the ground, smoothed over about `smoothing_s`. Raises `ParameterError` if a time is
    outside of the motion.
    """
    times = np.asarray(times_s, dtype=np.float64)
    if times.ndim != 1 or len(times) == 0 or not np.isfinite(times).all():
        raise ParameterError("expected at least one time to show, each a finite number of seconds")
    if times.min() < 0 or times.max() > motion.duration_s:
        raise ParameterError(
            f"expected times within the motion's 0 to {motion.duration_s:.2f} s, "
            f"got {times.min():.2f} to {times.max():.2f} s"
        )
    mesh = build_mannequin(motion.skeleton, motion)
    ground, frames = _ground_pos_m(motion), times * motion.fps
    if smoothing_s > 0:
        ground = scipy.ndimage.gaussian_filter1d(ground, smoothing_s * motion.fps, axis=0, mode="nearest")
    shown = motion.sampled(frames)
    pos_m, quat = forward(motion.skeleton, shown.root_pos_m, shown.local_quat)
    height = float(np.ptp(mesh.vertices_m[:, 1]))
    grid = np.arange(motion.n_frames)
    targets = np.stack([np.interp(frames, grid, ground[:, axis]) for axis in range(3)], axis=1)  # (T, 3)
    targets[:, 1] = _MIDDLE_OF_HEIGHT * height
    distance = max(_HIGH_OF_HEIGHT, _WIDE_OF_HEIGHT / aspect) * height / (2 * np.tan(FOV_RAD / 2))
    level = np.array([np.sin(front_rad + _SIDE_RAD), 0.0, np.cos(front_rad + _SIDE_RAD)])
    rise = np.array([0.0, (_EYE_OF_HEIGHT - _MIDDLE_OF_HEIGHT) * height, 0.0])
    return Shots(mesh, pos_m, quat, targets, distance * level + rise)


def _ground_pos_m(motion: Motion) -> Floats:
    """Position on the ground (T, 3), that of the root for an unknown rig."""
    try:
        return ground_pos_m(body_pos_m(motion))
    except ParameterError:
        return motion.root_pos_m * [1.0, 0.0, 1.0]


# Several dancers in one picture.


_MARGIN_M = 1.0  # beside the outermost dancers: an arm to the side
_EYE_M, _MIDDLE_M = 1.9, 0.9  # heights of the camera and of its target
_RISE = 0.08  # of the distance, by which the camera is higher, so that a row behind is seen


def shots_of(
    motions: Sequence[Motion],
    times_s: Sequence[float] | Floats,
    *,
    aspect: float,
    smoothing_s: float = 0.0,
    front_rad: float = 0.0,
) -> Shots:
    """Poses and cameras at `times_s` (T,): those of `follow_camera` for one dancer.

    Of several, the camera stands in front of the middle of the stage, and shows the whole way of all.
    """
    shots = [
        follow_camera(motion, times_s, aspect=aspect, smoothing_s=smoothing_s, front_rad=front_rad)
        for motion in motions
    ]
    if len(shots) == 1:
        return shots[0]
    ground_m = np.concatenate([motion.root_pos_m[:, [0, 2]] for motion in motions])
    low, high = ground_m.min(axis=0), ground_m.max(axis=0)
    half_m = 0.5 * (high[0] - low[0]) + _MARGIN_M
    tan = np.tan(FOV_RAD / 2)
    distance = max(half_m / (tan * aspect), 1.4 / tan) + 0.5 * (high[1] - low[1])
    middle = np.array([0.5 * (low[0] + high[0]), _MIDDLE_M, 0.5 * (low[1] + high[1])])
    eye = np.array([0.0, _EYE_M - _MIDDLE_M + _RISE * distance, distance])
    return Shots(
        merged_mesh([one.mesh for one in shots]),
        np.concatenate([one.pos_m for one in shots], axis=1),
        np.concatenate([one.global_quat for one in shots], axis=1),
        np.broadcast_to(middle, shots[0].targets_m.shape),
        eye,
    )


def merged_mesh(meshes: Sequence[SkinnedMesh]) -> SkinnedMesh:
    """One mesh of several dancers in their own colours. Its joints are those of the first, of the second."""
    vertices = np.cumsum([0, *(len(mesh.vertices_m) for mesh in meshes)])
    joints = np.cumsum([0, *(len(mesh.bind_pos_m) for mesh in meshes)])
    n_parts = len(meshes[0].palette)
    joined = {
        name: np.concatenate([getattr(mesh, name) for mesh in meshes])
        for name in ("vertices_m", "normals", "weights", "bind_pos_m", "bind_quat")
    }
    return replace(
        meshes[0],
        triangles=_shifted([mesh.triangles for mesh in meshes], vertices),
        joints=_shifted([mesh.joints for mesh in meshes], joints),
        parts=_shifted([mesh.parts for mesh in meshes], n_parts * np.arange(len(meshes))),
        palette=np.concatenate([palette_of(dancer) for dancer in range(len(meshes))]),
        **joined,
    )


def _shifted(indices: Sequence[np.ndarray], by: np.ndarray) -> np.ndarray:
    """Indices of several meshes as those of one."""
    return np.concatenate([one + np.int32(first) for one, first in zip(indices, by, strict=False)])
