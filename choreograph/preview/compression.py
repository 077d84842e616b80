"""Compression of motion and mesh for self-contained pages; `page/decompress.js` is the decoder.

A motion is quantised to a table of integers, one row per channel: the root position in steps of half a
millimetre, then each joint's rotation vector in steps of 0.25 mrad. Its second differences in time are
small. They are zigzag-encoded (0, -1, 1, -2, … -> 0, 1, 2, 3, …), split into a plane of low and one of high
bytes, and deflated. Four minutes of 24 joints at 60 fps take about 0.9 MB in base64, with an
error of a millimetre at the fingertips.
"""

from __future__ import annotations

import base64
import zlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.mannequin.skinned_mesh import SkinnedMesh
from choreograph.motion import rotations as rot
from choreograph.motion.motion import Motion
from choreograph.zigzag import zigzag_encode

ROTVEC_STEP_RAD = 2.5e-4  # pi is 12,566 steps: any rotation fits into two bytes
_ROOT_STEP_M = 5e-4
_LARGEST = 32_000  # steps: fits into two bytes with a margin
_MAX_FPS = 60.0
_MAX_MOTION_BYTES = 2_200_000  # leaves room for the rest of the page within 3 MB


@dataclass(frozen=True)
class CompressedMotion:
    """A quantised, deflated motion and the parameters to decode it."""

    text: str  # base64 of deflated bytes
    fps: float
    n_frames: int
    root_step_m: float
    root_origin_m: tuple[float, ...]  # (3,)


def compress_motion(motion: Motion, *, max_bytes: int = _MAX_MOTION_BYTES) -> CompressedMotion:
    """Compress at 60 fps or the motion's rate if lower; halve the rate until the text fits `max_bytes`."""
    motion = motion.resampled(min(motion.fps, _MAX_FPS))
    compressed = _compressed(motion)
    while len(compressed.text) > max_bytes and motion.n_frames > 2:
        motion = motion.resampled(motion.fps / 2)
        compressed = _compressed(motion)
    return compressed


def _compressed(motion: Motion) -> CompressedMotion:
    origin = np.round((motion.root_pos_m.min(axis=0) + motion.root_pos_m.max(axis=0)) / 2, 3)
    root = motion.root_pos_m - origin
    root_step_m = max(_ROOT_STEP_M, float(np.abs(root).max()) / _LARGEST)
    turns = rot.to_rotvec(motion.local_quat).reshape(motion.n_frames, -1)  # (T, 3J)
    table = np.concatenate([root / root_step_m, turns / ROTVEC_STEP_RAD], axis=1)  # (T, 3 + 3J)
    steps = np.round(table.T).astype(np.int64)  # (3 + 3J, T)
    change = np.diff(steps, n=2, axis=1, prepend=np.zeros((len(steps), 2), np.int64))
    change = change.astype(np.int16)  # wraps around, as the sums in the decoder do
    folded = zigzag_encode(change)
    planes = np.concatenate([(folded & 0xFF).ravel(), (folded >> 8).ravel()]).astype(np.uint8)
    return CompressedMotion(
        deflate_base64(planes.tobytes()), motion.fps, motion.n_frames, root_step_m, tuple(map(float, origin))
    )


def compress_mesh(mesh: SkinnedMesh) -> tuple[str, dict[str, object]]:
    """The mesh as text, and the parameters that the page needs to decode it.

    In this order: positions (V, 3) int16 in steps of `step_m`, triangles (F, 3) uint32, joints (V, 2) uint16,
    first weights (V,) uint8 of 255, normals (V, 3) int8 of 127, parts (V,) uint8.
    """
    step_m = max(float(np.abs(mesh.vertices_m).max()) / _LARGEST, 1e-9)
    arrays: list[NDArray] = [
        np.round(mesh.vertices_m / step_m).astype("<i2"),
        mesh.triangles.astype("<u4"),
        mesh.joints.astype("<u2"),
        np.round(255 * mesh.weights[:, 0]).astype(np.uint8),
        np.round(127 * mesh.normals).astype(np.int8),
        mesh.parts.astype(np.uint8),
    ]
    text = deflate_base64(b"".join(array.tobytes() for array in arrays))
    numbers = {
        "vertices": len(mesh.vertices_m),
        "triangles": len(mesh.triangles),
        "step_m": step_m,
        "palette": np.round(mesh.palette, 4).tolist(),
        "bind_pos_m": np.round(mesh.bind_pos_m, 6).tolist(),
        "bind_quat": np.round(mesh.bind_quat, 8).tolist(),
    }
    return text, numbers


def deflate_base64(data: bytes) -> str:
    """The bytes deflated, in base64."""
    return base64.b64encode(zlib.compress(data, 9)).decode("ascii")
