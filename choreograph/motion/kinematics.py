"""Forward kinematics, and inverse kinematics of a leg or an arm."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from choreograph.core.numerics import Floats
from choreograph.motion import rotations as rot
from choreograph.motion.skeleton import Skeleton

# Forward kinematics: world positions and rotations from root positions and local rotations.


def forward(
    skeleton: Skeleton, root_pos_m: Floats, local_quat: Floats, joints: Iterable[int] | None = None
) -> tuple[Floats, Floats]:
    """World positions (..., J, 3) in metres and world rotations (..., J, 4) of all joints.

    `root_pos_m` is (..., 3) and `local_quat` (..., J, 4), with any leading dimensions. If `joints` are given,
    increasing and after their parents, only these and the root are computed, and the others are 0.
    """
    shape, n_joints = local_quat.shape[:-2], skeleton.n_joints
    local = np.ascontiguousarray(local_quat, np.float64).reshape(-1, n_joints, 4)  # (T, J, 4)
    pos_m, global_quat = np.zeros((len(local), n_joints, 3)), np.zeros(local.shape)
    pos_m[:, 0] = np.reshape(root_pos_m, (-1, 3))
    global_quat[:, 0] = local[:, 0]
    order = np.fromiter(range(1, n_joints) if joints is None else joints, np.int64)
    rot.compiled(_forward_kinematics)(skeleton.parents, skeleton.offsets_m, order, local, pos_m, global_quat)
    pos_m, global_quat = pos_m.reshape(*shape, n_joints, 3), global_quat.reshape(*shape, n_joints, 4)
    return pos_m, global_quat


def _forward_kinematics(
    parents: NDArray[np.int64],
    offsets_m: Floats,
    joints: NDArray[np.int64],
    local_quat: Floats,
    pos_m: Floats,
    global_quat: Floats,
) -> None:  # pragma: no cover - compiled
    """Set positions (T, J, 3) and rotations (T, J, 4) of `joints`, in order, from those of joint 0.

    Operations and their order are those of `rotations.multiply` and `rotations.rotate`, so the results are
    the same numbers.
    """
    for t in range(len(local_quat)):
        for joint in joints:
            parent = parents[joint]
            w, x, y, z = global_quat[t, parent]
            bw, bx, by, bz = local_quat[t, joint]
            global_quat[t, joint, 0] = w * bw - x * bx - y * by - z * bz
            global_quat[t, joint, 1] = w * bx + x * bw + y * bz - z * by
            global_quat[t, joint, 2] = w * by - x * bz + y * bw + z * bx
            global_quat[t, joint, 3] = w * bz + x * by - y * bx + z * bw
            vx, vy, vz = offsets_m[joint]
            cx, cy, cz = 2.0 * (y * vz - z * vy), 2.0 * (z * vx - x * vz), 2.0 * (x * vy - y * vx)
            pos_m[t, joint, 0] = pos_m[t, parent, 0] + (vx + w * cx + (y * cz - z * cy))
            pos_m[t, joint, 1] = pos_m[t, parent, 1] + (vy + w * cy + (z * cx - x * cz))
            pos_m[t, joint, 2] = pos_m[t, parent, 2] + (vz + w * cz + (x * cy - y * cx))


def to_local(skeleton: Skeleton, global_quat: Floats) -> Floats:
    """Local rotations (..., J, 4) from world rotations (..., J, 4)."""
    world = np.require(global_quat, np.float64, ["C", "W"]).reshape(-1, skeleton.n_joints, 4)  # (T, J, 4)
    local = np.empty(world.shape)
    rot.compiled(_local_rotations)(skeleton.parents, world, local)
    return local.reshape(global_quat.shape)


def _local_rotations(
    parents: NDArray[np.int64], global_quat: Floats, local_quat: Floats
) -> None:  # pragma: no cover - compiled
    """Set local rotations (T, J, 4). They are those of `rotations.multiply` and `rotations.invert`."""
    for t in range(len(global_quat)):
        for k in range(4):
            local_quat[t, 0, k] = global_quat[t, 0, k]
        for joint in range(1, len(parents)):
            w, x, y, z = global_quat[t, parents[joint]]
            x, y, z = -x, -y, -z
            bw, bx, by, bz = global_quat[t, joint]
            local_quat[t, joint, 0] = w * bw - x * bx - y * by - z * bz
            local_quat[t, joint, 1] = w * bx + x * bw + y * bz - z * by
            local_quat[t, joint, 2] = w * by - x * bz + y * bw + z * bx
            local_quat[t, joint, 3] = w * bz + x * by - y * bx + z * bw


# Two-bone IK: analytic inverse kinematics of a leg or an arm, all frames at once.


_SOFT_FROM = 0.98  # of the full length. Beyond it, the limb extends more and more slowly (soft IK)
_FULL = 0.9995  # of the full length, which is never exceeded, so that the limb never locks straight
_HINGE_RAD = 0.15  # a limb that is bent less bends about its hinge, one that is bent more about its own axis


def two_bone(
    start_m: Floats, middle_m: Floats, end_m: Floats, target_m: Floats, hinge_axis: Floats
) -> tuple[Floats, Floats]:
    """World rotations (..., 4) to apply to upper and lower bone so that the end reaches the target.

    `start_m`, `middle_m`, `end_m` and `target_m` (..., 3) are, for a leg, the hip, the knee, the ankle and
    the target of the ankle. The limb keeps its bending direction. The straighter it is, the more the
    direction follows `hinge_axis` (..., 3), the world axis of a positive bend. A target out of reach is
    approached softly. If the end is at the target, the limb does not change, even if it is bent the wrong
    way. As the target comes nearer, such a limb passes through straight to the right side, and misses the
    target meanwhile (by 3 mm for a leg bent by 0.1 rad). The result is a continuous function of the
    arguments.
    """
    upper, lower = middle_m - start_m, end_m - middle_m
    a, b = _length(upper), _length(lower)
    bone = upper / np.maximum(a, 1e-9)[..., None]
    hinge = _perpendicular(np.broadcast_to(hinge_axis, bone.shape), bone)
    bend = _bend(bone, lower / np.maximum(b, 1e-9)[..., None])
    reach = _soft_reach(_length(target_m - start_m), _length(end_m - start_m), a + b)
    reach = np.maximum(reach, np.abs(a - b) + 1e-6)
    cos = (reach**2 - a**2 - b**2) / np.maximum(2.0 * a * b, 1e-12)
    new_bend = _resized_bend(bend, np.arccos(np.clip(cos, -1.0, 1.0)), hinge)
    turn = rot.multiply(rot.from_rotvec(new_bend), rot.from_rotvec(-bend))
    swing = rot.between(upper + rot.rotate(turn, lower), target_m - start_m)
    return swing, rot.multiply(swing, turn)


def move_limb(
    skeleton: Skeleton,
    limb: tuple[int, int, int],
    pos_m: Floats,
    global_quat: Floats,
    target_m: Floats,
    hinge_axis: Floats,
) -> None:
    """Rotate both bones of a limb in `global_quat` (T, J, 4) so that its end comes to `target_m` (T, 3).

    `limb` are its joints, such as hip, knee and ankle. The children of the end keep their world rotation.
    """
    start, middle, end = limb
    upper, lower = two_bone(pos_m[:, start], pos_m[:, middle], pos_m[:, end], target_m, hinge_axis)
    for joint in range(start, skeleton.n_joints):
        path = ancestors(skeleton, joint)
        if end in path or start not in path:
            continue
        global_quat[:, joint] = rot.multiply(lower if middle in path else upper, global_quat[:, joint])


def ancestors(skeleton: Skeleton, joint: int) -> list[int]:
    """A joint, its parent, and so on up to the root."""
    path = [joint]
    while skeleton.parents[path[-1]] >= 0:
        path.append(int(skeleton.parents[path[-1]]))
    return path


def flexion_rad(start_m: Floats, middle_m: Floats, end_m: Floats, hinge_axis: Floats) -> Floats:
    """Bend (...) of a limb about its hinge, as in `two_bone`, negative if it is bent the wrong way."""
    upper, lower = middle_m - start_m, end_m - middle_m
    bone = upper / np.maximum(_length(upper), 1e-9)[..., None]
    hinge = _perpendicular(np.broadcast_to(hinge_axis, bone.shape), bone)
    bend = _bend(bone, lower / np.maximum(_length(lower), 1e-9)[..., None])
    return np.sum(bend * hinge, axis=-1)


def _bend(bone: Floats, lower: Floats) -> Floats:
    """The bend as a rotation vector (..., 3) at right angles to `bone`, between two unit directions."""
    axis = np.cross(bone, lower)
    sin = _length(axis)
    angle = np.arctan2(sin, np.sum(bone * lower, axis=-1))
    return axis * (angle / np.maximum(sin, 1e-12))[..., None]


def _resized_bend(bend: Floats, angle: Floats, hinge: Floats) -> Floats:
    """The bend (..., 3), changed to the magnitude `angle` (...).

    A bend changes along a straight line, about `hinge` if it is nearly straight, and otherwise about its own
    axis. For a limb that is bent the wrong way, the line meets the circle of that angle twice, at the present
    bend and on the right side. The limb goes from the one to the other as the angle grows to twice its own.
    """
    size = _length(bend)
    smaller = bend * np.minimum(angle / np.maximum(size, 1e-12), 1.0)[..., None]
    backwards = np.minimum(np.sum(bend * hinge, axis=-1), 0.0)
    along = bend + hinge * (_HINGE_RAD - backwards)[..., None]
    along = along / _length(along)[..., None]  # at least _HINGE_RAD long
    ahead = np.sum(bend * along, axis=-1)
    more = np.maximum(angle**2 - size**2, 0.0)
    step = -ahead + np.sqrt(ahead**2 + more)
    wrong = np.maximum(-ahead, 0.0)
    share = np.clip((angle - size) / np.maximum(wrong, 1e-12), 0.0, 1.0)
    step = step * np.where(wrong > 0.0, share * share * (3.0 - 2.0 * share), 1.0)
    return np.where((angle > size)[..., None], bend + along * step[..., None], smaller)


def _soft_reach(target: Floats, current: Floats, full: Floats) -> Floats:
    """Start-to-end distance of a limb of length `full`: `target`, softly limited below the full length."""
    hard = np.maximum(_FULL * full, current)
    soft = np.clip(current, _SOFT_FROM * full, hard - 1e-6)
    room = hard - soft
    # Clipped because the exponential underflows.
    beyond = hard - room * np.exp(-np.clip((target - soft) / room, 0.0, 500.0))
    return np.where(target <= soft, target, np.where(target <= current, target, beyond))


def _perpendicular(vector: Floats, bone: Floats) -> Floats:
    """The unit vector (..., 3) nearest to `vector` at right angles to the unit vector `bone`."""
    across = vector - bone * np.sum(vector * bone, axis=-1, keepdims=True)
    return across / np.maximum(_length(across), 1e-9)[..., None]


def _length(vector: Floats) -> Floats:
    return np.linalg.norm(vector, axis=-1)
