"""Forward kinematics: from root positions and local rotations to world positions and rotations."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from choreograph.motion import rotations as rot
from choreograph.motion.skeleton import Skeleton

Floats = NDArray[np.float64]


def forward(
    skeleton: Skeleton, root_pos_m: Floats, local_quat: Floats, joints: Iterable[int] | None = None
) -> tuple[Floats, Floats]:
    """World positions (..., J, 3) in metres and world rotations (..., J, 4) of all joints.

    `root_pos_m` (..., 3), `local_quat` (..., J, 4); any leading dimensions. With `joints`, increasing
    and after their parents, only these are computed beside the root, and the others are 0.
    """
    global_quat = np.zeros_like(local_quat, dtype=np.float64)  # (..., J, 4)
    pos_m = np.zeros((*local_quat.shape[:-1], 3))  # (..., J, 3)
    global_quat[..., 0, :] = local_quat[..., 0, :]
    pos_m[..., 0, :] = root_pos_m
    for joint in range(1, skeleton.n_joints) if joints is None else joints:
        parent = skeleton.parents[joint]
        global_quat[..., joint, :] = rot.multiply(global_quat[..., parent, :], local_quat[..., joint, :])
        offset = rot.rotate(global_quat[..., parent, :], skeleton.offsets_m[joint])
        pos_m[..., joint, :] = pos_m[..., parent, :] + offset
    return pos_m, global_quat


def to_local(skeleton: Skeleton, global_quat: Floats) -> Floats:
    """Local rotations (..., J, 4) from world rotations (..., J, 4)."""
    local = np.array(global_quat, dtype=np.float64)
    parents = skeleton.parents[1:]
    local[..., 1:, :] = rot.multiply(rot.invert(global_quat[..., parents, :]), global_quat[..., 1:, :])
    return local
