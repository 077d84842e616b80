"""Numba kernels of motion. They are imported where they are called, since numba takes a third of a second."""

from __future__ import annotations

from choreograph.core.kernel_cache import njit
from choreograph.core.numerics import Floats, Indices


@njit(nogil=True)
def forward_kinematics(
    parents: Indices,
    offsets_m: Floats,
    joints: Indices,
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
