"""Cameras that show several dancers at once, drawn as one mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from choreograph.core.numerics import Floats
from choreograph.motion.cameras import FOV_RAD
from choreograph.motion.motion import Motion
from choreograph.motion.skinned_mesh import SkinnedMesh, palette_of
from choreograph.view.renderer import Shots, follow_camera

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
