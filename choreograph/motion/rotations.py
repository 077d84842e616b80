"""Quaternions `wxyz` with any leading dimensions. Scipy is used where conventions are intricate.

Conventions: unit, right-handed, active (`rotate(q, v)` rotates v). `multiply(a, b)` applies b first.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
import scipy

from choreograph.core.numerics import Floats, frame_blocks

IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])


def multiply(a: Floats, b: Floats) -> Floats:
    """Hamilton product a ⊗ b of quaternions (..., 4), broadcasting."""
    if a.shape == b.shape and _is_compiled(a) and _is_compiled(b):
        product = np.empty(a.shape)
        compiled(_multiply)(_rows(a), _rows(b), product.reshape(-1, 4))
        return product
    aw, ax, ay, az = _components(a)
    bw, bx, by, bz = _components(b)
    return np.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ],
        axis=-1,
    )  # (..., 4)


def invert(quat: Floats) -> Floats:
    """Inverse of unit quaternions (..., 4)."""
    return quat * np.array([1.0, -1.0, -1.0, -1.0], dtype=quat.dtype)


def rotate(quat: Floats, vector: Floats) -> Floats:
    """Rotate vectors (..., 3) by unit quaternions (..., 4), broadcasting."""
    w, xyz = quat[..., :1], quat[..., 1:]
    cross = 2.0 * _cross(xyz, vector)
    return vector + w * cross + _cross(xyz, cross)  # (..., 3)


def _cross(a: Floats, b: Floats) -> Floats:
    """Cross product of (..., 3). For a few joints numpy's version is mostly call overhead."""
    ax, ay, az = _components(a)
    bx, by, bz = _components(b)
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


def _components(values: Floats) -> list[Floats]:
    return [values[..., index] for index in range(values.shape[-1])]


def normalize(quat: Floats) -> Floats:
    """Scale quaternions (..., 4) to unit length. A zero quaternion becomes the identity."""
    if _is_compiled(quat):
        unit = np.empty(quat.shape)
        compiled(_normalize)(_rows(quat), unit.reshape(-1, 4))
        return unit
    norm = np.linalg.norm(quat, axis=-1, keepdims=True)
    return np.where(norm > 1e-12, quat / np.maximum(norm, 1e-12), IDENTITY)


def make_continuous(quat: Floats, *, out: Floats | None = None) -> Floats:
    """Flip signs along axis 0 (time) so that successive quaternions (T, ..., 4) do not change sign.

    The result is written to `out`, which may be `quat` itself, or to a new array.
    """
    if _is_compiled(quat) and (out is None or out.flags.c_contiguous):
        out = np.empty(quat.shape) if out is None else out
        n_joints = math.prod(quat.shape[1:-1])
        by_time = _rows(quat).reshape(-1, n_joints, 4), out.reshape(-1, n_joints, 4)
        compiled(_make_continuous)(*by_time)
        return out
    flips = np.empty(quat[1:].shape[:-1])  # (T-1, ...)
    for block in frame_blocks(len(flips)):
        dots = np.sum(quat[1:][block] * quat[:-1][block], axis=-1)
        flips[block] = np.where(dots < 0, -1.0, 1.0)
    np.cumprod(flips, axis=0, out=flips)
    out = np.empty(quat.shape, np.result_type(quat, flips)) if out is None else out
    out[:1] = quat[:1]
    np.multiply(quat[1:], flips[..., None], out=out[1:])
    return out


def slerp(a: Floats, b: Floats, weight: Floats | float) -> Floats:
    """Spherical interpolation on the shorter arc from a to b (..., 4) by weight (...). 0 gives a."""
    weight = np.asarray(weight, dtype=np.float64)[..., None]
    dot = np.sum(a * b, axis=-1, keepdims=True)
    b = np.where(dot < 0, -b, b)
    angle = np.arccos(np.clip(np.abs(dot), 0.0, 1.0))
    sin = np.sin(angle)
    near = sin < 1e-5
    safe = np.where(near, 1.0, sin)
    wa = np.where(near, 1.0 - weight, np.sin((1.0 - weight) * angle) / safe)
    wb = np.where(near, weight, np.sin(weight * angle) / safe)
    return normalize(wa * a + wb * b)


def from_rotvec(rotvec: Floats) -> Floats:
    """Quaternions (..., 4) of rotation vectors (..., 3) in radians."""
    rows = np.ascontiguousarray(rotvec, np.float64).reshape(-1, 3)
    quat = np.empty((len(rows), 4))
    _fastest(_from_rotvec, len(rows))(rows, quat)
    return quat.reshape(*rotvec.shape[:-1], 4)


def to_rotvec(quat: Floats) -> Floats:
    """Rotation vectors (..., 3) in radians, with angles of at most π, of quaternions (..., 4).

    Raises `ValueError` for a quaternion of length 0.
    """
    rows = np.ascontiguousarray(quat, np.float64).reshape(-1, 4)
    if not rows.any(axis=1).all():
        raise ValueError("expected quaternions of unit length, got one of length 0")
    rotvec = np.empty((len(rows), 3))
    _fastest(_to_rotvec, len(rows))(rows, rotvec)
    return rotvec.reshape(*quat.shape[:-1], 3)


def from_matrix(matrix: Floats) -> Floats:
    """Quaternions (..., 4) of rotation matrices (..., 3, 3)."""
    flat = scipy.spatial.transform.Rotation.from_matrix(np.reshape(matrix, (-1, 3, 3))).as_quat(
        scalar_first=True
    )
    return flat.reshape(*matrix.shape[:-2], 4)


def to_matrix(quat: Floats) -> Floats:
    """Rotation matrices (..., 3, 3) of quaternions (..., 4)."""
    flat = scipy.spatial.transform.Rotation.from_quat(
        np.reshape(quat, (-1, 4)), scalar_first=True
    ).as_matrix()
    return flat.reshape(*quat.shape[:-1], 3, 3)


def unit(vectors: Floats) -> Floats:
    """Vectors (..., 3) of length 1. Those shorter than 1e-9 stay short."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9)


def from_euler(order: str, angles: Floats) -> Floats:
    """Quaternions (..., 4) of intrinsic Euler angles (..., 3) in radians, in an order such as "ZXY"."""
    flat = scipy.spatial.transform.Rotation.from_euler(order.upper(), np.reshape(angles, (-1, len(order))))
    return flat.as_quat(scalar_first=True).reshape(*angles.shape[:-1], 4)


def to_euler(order: str, quat: Floats) -> Floats:
    """Intrinsic Euler angles (..., 3) in radians. In gimbal lock the third angle is zero."""
    i, j, k = ("XYZ".index(axis) for axis in order.upper())
    if len({i, j, k}) < 3:
        raise ValueError(f"expected an order of X, Y and Z, got {order!r}")
    rows = np.ascontiguousarray(quat, np.float64).reshape(-1, 4)
    angles = np.empty((len(rows), 3))
    _fastest(_to_euler, len(rows))(rows, np.array([i, j, k]), angles)
    return angles.reshape(*quat.shape[:-1], 3)


def between(source: Floats, target: Floats) -> Floats:
    """Shortest rotation (..., 4) that takes direction `source` (..., 3) to direction `target` (..., 3)."""
    source = source / np.maximum(np.linalg.norm(source, axis=-1, keepdims=True), 1e-12)
    target = target / np.maximum(np.linalg.norm(target, axis=-1, keepdims=True), 1e-12)
    dot = np.sum(source * target, axis=-1, keepdims=True)
    quat = np.concatenate([1.0 + dot, np.cross(source, target)], axis=-1)
    helper = np.where(np.abs(source[..., :1]) < 0.9, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    half_turn = np.concatenate([np.zeros_like(dot), np.cross(source, helper)], axis=-1)
    return normalize(np.where(dot < -1.0 + 1e-9, half_turn, quat))


def about_y(angle: Floats | float) -> Floats:
    """Rotation (..., 4) by `angle` (...) radians about the vertical. Positive takes +Z towards +X."""
    half = 0.5 * np.asarray(angle, dtype=np.float64)
    zero = np.zeros_like(half)
    return np.stack([np.cos(half), zero, np.sin(half), zero], axis=-1)


def rotate_about_y(angle_rad: Floats, vector: Floats) -> Floats:
    """Vectors (..., 3) turned by `angle_rad` (...), broadcasting.

    This is `rotate` with the quaternions of `about_y` without the products with their zeros, and takes
    less than a third of the time. The numbers are the same.
    """
    quat = about_y(angle_rad)
    w, y = quat[..., 0], quat[..., 2]
    along_x, _, along_z = _components(vector)
    cross_x, cross_z = 2.0 * (y * along_z), -2.0 * (y * along_x)
    turned = np.empty((*cross_x.shape, 3), cross_x.dtype)
    turned[..., 0] = along_x + w * cross_x + y * cross_z
    turned[..., 1] = vector[..., 1]
    turned[..., 2] = along_z + w * cross_z - y * cross_x
    return turned


def yaw(quat: Floats) -> Floats:
    """Heading (...) in radians of quaternions (..., 4): their twist about Y."""
    return 2.0 * np.arctan2(quat[..., 2], quat[..., 0])


# The same for many quaternions, compiled. Operations and their order are those above, so that the results are
# the same numbers.


_MANY = 2048  # quaternions, for which it takes less time to load a kernel than to do without it
_SOME = 64  # the same, of kernels that are run by Python otherwise
_LOCKED_RAD = 1e-7  # of gimbal lock
_SMALL_RAD = 1e-3  # angles up to which a series is used, as scipy does


@lru_cache
def compiled(kernel: Callable[..., None]) -> Callable[..., None]:
    """A kernel, compiled at its first call, since numba takes a third of a second to import."""
    from choreograph.core.kernel_cache import njit

    return njit(nogil=True)(kernel)


def _fastest(kernel: Callable[..., None], n_rows: int) -> Callable[..., None]:
    """The kernel, compiled if there are many rows. The numbers are the same."""
    return compiled(kernel) if n_rows > _SOME else kernel


def _is_compiled(quat: Floats) -> bool:
    return quat.size >= 4 * _MANY and quat.dtype == np.float64 and quat.shape[-1] == 4


def _rows(quat: Floats) -> Floats:
    """Quaternions (..., 4) as an array (N, 4) of the one layout for which kernels are compiled."""
    return np.require(quat, requirements=["C", "W"]).reshape(-1, 4)


def _multiply(a: Any, b: Any, product: Any) -> None:  # pragma: no cover - compiled
    """Set `product` (N, 4) to a ⊗ b."""
    for n in range(len(a)):
        aw, ax, ay, az = a[n, 0], a[n, 1], a[n, 2], a[n, 3]
        bw, bx, by, bz = b[n, 0], b[n, 1], b[n, 2], b[n, 3]
        product[n, 0] = aw * bw - ax * bx - ay * by - az * bz
        product[n, 1] = aw * bx + ax * bw + ay * bz - az * by
        product[n, 2] = aw * by - ax * bz + ay * bw + az * bx
        product[n, 3] = aw * bz + ax * by - ay * bx + az * bw


def _normalize(quat: Any, unit: Any) -> None:  # pragma: no cover - compiled
    """Set `unit` (N, 4) to quaternions (N, 4) of unit length."""
    for n in range(len(quat)):
        w, x, y, z = quat[n, 0], quat[n, 1], quat[n, 2], quat[n, 3]
        norm = np.sqrt(w * w + x * x + y * y + z * z)
        if norm > 1e-12:
            unit[n, 0], unit[n, 1], unit[n, 2], unit[n, 3] = w / norm, x / norm, y / norm, z / norm
        else:
            unit[n, 0], unit[n, 1], unit[n, 2], unit[n, 3] = 1.0, 0.0, 0.0, 0.0


def _make_continuous(quat: Any, out: Any) -> None:  # pragma: no cover - compiled
    """Set `out` (T, J, 4), which may be `quat`, to these rotations without changes of sign."""
    before, sign = np.zeros((quat.shape[1], 4)), np.ones(quat.shape[1])
    for t in range(len(quat)):
        for j in range(quat.shape[1]):
            dot = 0.0
            for k in range(4):
                dot += quat[t, j, k] * before[j, k]
            if dot < 0.0:
                sign[j] = -sign[j]
            for k in range(4):
                before[j, k] = quat[t, j, k]
                out[t, j, k] = sign[j] * before[j, k]


def _to_rotvec(quat: Any, rotvec: Any) -> None:  # pragma: no cover - compiled
    """Set `rotvec` (N, 3) to the rotation vectors of quaternions (N, 4), as scipy does."""
    for n in range(len(quat)):
        w, x, y, z = quat[n, 0], quat[n, 1], quat[n, 2], quat[n, 3]
        norm = math.sqrt(x * x + y * y + z * z + w * w)
        w, x, y, z = w / norm, x / norm, y / norm, z / norm
        if w < 0.0 or (w == 0.0 and (x < 0.0 or (x == 0.0 and (y < 0.0 or (y == 0.0 and z < 0.0))))):
            w, x, y, z = -w, -x, -y, -z
        angle = 2.0 * math.atan2(math.sqrt(x * x + y * y + z * z), w)
        if angle <= _SMALL_RAD:
            squared = angle * angle
            scale = 2.0 + squared / 12.0 + 7.0 * squared * squared / 2880.0
        else:
            scale = angle / math.sin(angle / 2.0)
        rotvec[n, 0], rotvec[n, 1], rotvec[n, 2] = scale * x, scale * y, scale * z


def _from_rotvec(rotvec: Any, quat: Any) -> None:  # pragma: no cover - compiled
    """Set `quat` (N, 4) to the quaternions of rotation vectors (N, 3), as scipy does."""
    for n in range(len(rotvec)):
        x, y, z = rotvec[n, 0], rotvec[n, 1], rotvec[n, 2]
        angle = math.sqrt(x * x + y * y + z * z)
        if angle <= _SMALL_RAD:
            squared = angle * angle
            scale = 0.5 - squared / 48.0 + squared * squared / 3840.0
        else:
            scale = math.sin(angle / 2.0) / angle
        quat[n, 0] = math.cos(angle / 2.0)
        quat[n, 1], quat[n, 2], quat[n, 3] = scale * x, scale * y, scale * z


def _to_euler(quat: Any, axes: Any, angles: Any) -> None:  # pragma: no cover - compiled
    """Set `angles` (N, 3) to the intrinsic Euler angles of quaternions (N, 4), as scipy does.

    Bernardes and Viollet, Quaternion to Euler angles conversion: A direct, general and computationally
    efficient method (2022), in which the `axes` (3,) are those of rotations about fixed axes, the last first.
    """
    k, j, i = axes[0], axes[1], axes[2]
    sign = ((i - j) * (j - k) * (k - i)) // 2
    for n in range(len(quat)):
        w, x, y, z = quat[n, 0], quat[n, 1], quat[n, 2], quat[n, 3]
        norm = math.sqrt(x * x + y * y + z * z + w * w)
        w = w / norm
        at_i, at_j, at_k = quat[n, 1 + i] / norm, quat[n, 1 + j] / norm, quat[n, 1 + k] / norm
        a, b = w - at_j, at_i + at_k * sign
        c, d = at_j + w, at_k * sign - at_i
        second = 2.0 * math.atan2(math.hypot(c, d), math.hypot(a, b))
        half_sum, half_difference = math.atan2(b, a), math.atan2(d, c)
        if abs(second) <= _LOCKED_RAD:
            first, third = 2.0 * half_sum, 0.0
        elif abs(second - math.pi) <= _LOCKED_RAD:
            first, third = 2.0 * half_difference, 0.0
        else:
            first, third = half_sum + half_difference, (half_sum - half_difference)
        angles[n, 0], angles[n, 1], angles[n, 2] = first * sign, second - math.pi / 2.0, third
        for m in range(3):
            if angles[n, m] < -math.pi:
                angles[n, m] += 2.0 * math.pi
            elif angles[n, m] > math.pi:
                angles[n, m] -= 2.0 * math.pi
