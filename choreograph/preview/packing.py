"""Motion and mesh as few bytes, for a page that carries them: what `page/unpack.js` undoes.

A motion is a table of whole numbers, a row a channel: the root's place in steps of half a millimetre, then
each joint's rotation vector in steps of 0.25 mrad. In time its second differences are small numbers; they
are folded to unsigned (0, -1, 1, -2, … -> 0, 1, 2, 3, …), split into a plane of low and one of high bytes,
and deflated. Four minutes of 24 joints at 60 fps come to about 0.9 MB in base64, a millimetre off at the
fingertips.
"""

from __future__ import annotations

import base64
import zlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.motion import rotations as rot
from choreograph.motion.motion import Motion
from choreograph.preview.figure import Figure
from choreograph.zigzag import zigzag_encode

ROTVEC_STEP_RAD = 2.5e-4  # a turn of pi is 12,566 steps: two bytes hold any rotation
_ROOT_STEP_M = 5e-4
_LARGEST = 32_000  # steps that two bytes hold, with room to spare
_MAX_FPS = 60.0
_MAX_MOTION_BYTES = 2_200_000  # leaves room for the rest of the page within 3 MB


@dataclass(frozen=True)
class PackedMotion:
    """A motion's bytes and how to read them."""

    text: str  # base64 of deflated bytes
    fps: float
    n_frames: int
    root_step_m: float
    root_origin_m: tuple[float, ...]  # (3,)


def pack_motion(motion: Motion, *, max_bytes: int = _MAX_MOTION_BYTES) -> PackedMotion:
    """The motion at 60 fps or its own rate if lower; at half, a quarter, … of that if it would not fit."""
    motion = motion.resampled(min(motion.fps, _MAX_FPS))
    packed = _packed(motion)
    while len(packed.text) > max_bytes and motion.n_frames > 2:
        motion = motion.resampled(motion.fps / 2)
        packed = _packed(motion)
    return packed


def _packed(motion: Motion) -> PackedMotion:
    origin = np.round((motion.root_pos_m.min(axis=0) + motion.root_pos_m.max(axis=0)) / 2, 3)
    root = motion.root_pos_m - origin
    root_step_m = max(_ROOT_STEP_M, float(np.abs(root).max()) / _LARGEST)
    turns = rot.to_rotvec(motion.local_quat).reshape(motion.n_frames, -1)  # (T, 3J)
    table = np.concatenate([root / root_step_m, turns / ROTVEC_STEP_RAD], axis=1)  # (T, 3 + 3J)
    steps = np.round(table.T).astype(np.int64)  # (3 + 3J, T)
    change = np.diff(steps, n=2, axis=1, prepend=np.zeros((len(steps), 2), np.int64))
    change = change.astype(np.int16)  # wraps, and so does the page when it adds up
    folded = zigzag_encode(change)
    planes = np.concatenate([(folded & 0xFF).ravel(), (folded >> 8).ravel()]).astype(np.uint8)
    return PackedMotion(
        to_text(planes.tobytes()), motion.fps, motion.n_frames, root_step_m, tuple(map(float, origin))
    )


def pack_figure(figure: Figure) -> tuple[str, dict[str, object]]:
    """The mesh as text, and the numbers that the page needs to read it.

    In this order: places (V, 3) int16 in steps of `step_m`, triangles (F, 3) uint32, joints (V, 2) uint16,
    first weights (V,) uint8 of 255, normals (V, 3) int8 of 127, parts (V,) uint8.
    """
    step_m = max(float(np.abs(figure.vertices_m).max()) / _LARGEST, 1e-9)
    arrays: list[NDArray] = [
        np.round(figure.vertices_m / step_m).astype("<i2"),
        figure.triangles.astype("<u4"),
        figure.joints.astype("<u2"),
        np.round(255 * figure.weights[:, 0]).astype(np.uint8),
        np.round(127 * figure.normals).astype(np.int8),
        figure.parts.astype(np.uint8),
    ]
    text = to_text(b"".join(array.tobytes() for array in arrays))
    numbers = {
        "vertices": len(figure.vertices_m),
        "triangles": len(figure.triangles),
        "step_m": step_m,
        "palette": np.round(figure.palette, 4).tolist(),
        "bind_pos_m": np.round(figure.bind_pos_m, 6).tolist(),
        "bind_quat": np.round(figure.bind_quat, 8).tolist(),
    }
    return text, numbers


def to_text(data: bytes) -> str:
    """Deflated, in base64."""
    return base64.b64encode(zlib.compress(data, 9)).decode("ascii")
