"""Gauss-Newton refinement of fitted rotations, which spreads the residual along each limb."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from choreograph.motion import rotations as rot
from choreograph.motion.kinematics import forward, to_local
from choreograph.motion.skeleton import Skeleton

Floats = NDArray[np.float64]

_DAMPING_M2 = 0.003  # limits rotations that the targets hardly constrain, such as twists of straight limbs


def refine(
    skeleton: Skeleton,
    root_pos_m: Floats,
    local_quat: Floats,
    targets_m: Mapping[int, Floats],
    refined: Sequence[int],
    *,
    sweeps: int = 2,
) -> tuple[Floats, Floats]:
    """Root positions (T, 3) and local rotations (T, J, 4) with a smaller sum of squared distances.

    `targets_m` maps joints to target positions (T, 3) in metres; `refined` are the joints whose rotation
    may change. Each sweep moves the root by the mean residual, then rotates one joint after the other,
    with all its descendants, by a damped Gauss-Newton step.
    """
    pos_m, global_quat = forward(skeleton, root_pos_m, local_quat)
    descendants = _descendants(skeleton)
    joints = np.array(sorted(targets_m))
    target_m = np.stack([targets_m[joint] for joint in joints], axis=1)  # (T, R, 3)
    for _ in range(sweeps):
        pos_m = pos_m + np.mean(target_m - pos_m[:, joints], axis=1, keepdims=True)
        for joint in refined:
            is_below = np.isin(joints, descendants[joint])
            if not is_below.any():
                continue
            center = pos_m[:, joint, None]
            step = _gauss_newton_rotation(pos_m[:, joints[is_below]] - center, target_m[:, is_below] - center)
            moved = descendants[joint]
            pos_m[:, moved] = center + rot.rotate(step[:, None], pos_m[:, moved] - center)
            rotated = [joint, *moved]
            global_quat[:, rotated] = rot.multiply(step[:, None], global_quat[:, rotated])
    return pos_m[:, 0], rot.make_continuous(to_local(skeleton, global_quat))


def _gauss_newton_rotation(current: Floats, target: Floats) -> Floats:
    """World rotation (T, 4) about the origin that brings points (T, R, 3) closer to `target`."""
    eye = np.eye(3)
    inertia = np.sum(current**2, axis=(1, 2))[:, None, None] * eye - np.einsum(
        "tri,trj->tij", current, current
    )  # (T, 3, 3)
    torque = np.cross(current, target).sum(axis=1)  # (T, 3)
    return rot.from_rotvec(np.linalg.solve(inertia + _DAMPING_M2 * eye, torque[..., None])[..., 0])


def _descendants(skeleton: Skeleton) -> list[list[int]]:
    descendants: list[list[int]] = [[] for _ in range(skeleton.n_joints)]
    for joint in range(skeleton.n_joints - 1, 0, -1):
        descendants[int(skeleton.parents[joint])] += [joint, *descendants[joint]]
    return descendants
