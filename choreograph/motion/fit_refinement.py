"""Rotations once more, joint by joint, so that what bone lengths leave over is spread along each limb."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from choreograph.motion import rotations as rot
from choreograph.motion.kinematics import forward, to_local
from choreograph.motion.skeleton import Skeleton

Floats = NDArray[np.float64]

_DAMPING_M2 = 0.003  # keeps a turn small where its joints hardly see it: twists of straight limbs


def refine(
    skeleton: Skeleton,
    root_pos_m: Floats,
    local_quat: Floats,
    targets_m: Mapping[int, Floats],
    turning: Sequence[int],
    *,
    sweeps: int = 2,
) -> tuple[Floats, Floats]:
    """Root positions (T, 3) and local rotations (T, J, 4) with a smaller sum of squared distances.

    `targets_m` maps joints to where they should be, (T, 3) in metres; `turning` are the joints that
    may turn. Each sweep moves the root by the mean of what is left and turns one joint after the
    other, with all that hangs on it, by a damped Gauss-Newton step.
    """
    pos_m, global_quat = forward(skeleton, root_pos_m, local_quat)
    below = _descendants(skeleton)
    joints = np.array(sorted(targets_m))
    target_m = np.stack([targets_m[joint] for joint in joints], axis=1)  # (T, R, 3)
    for _ in range(sweeps):
        pos_m = pos_m + np.mean(target_m - pos_m[:, joints], axis=1, keepdims=True)
        for joint in turning:
            seen = np.isin(joints, below[joint])
            if not seen.any():
                continue
            center = pos_m[:, joint, None]
            turn = _best_turn(pos_m[:, joints[seen]] - center, target_m[:, seen] - center)
            moved = below[joint]
            pos_m[:, moved] = center + rot.rotate(turn[:, None], pos_m[:, moved] - center)
            owners = [joint, *moved]
            global_quat[:, owners] = rot.multiply(turn[:, None], global_quat[:, owners])
    return pos_m[:, 0], rot.make_continuous(to_local(skeleton, global_quat))


def _best_turn(now: Floats, wanted: Floats) -> Floats:
    """World turn (T, 4) that brings points (T, R, 3) around the origin closer to `wanted`."""
    eye = np.eye(3)
    inertia = np.sum(now**2, axis=(1, 2))[:, None, None] * eye - np.einsum(
        "tri,trj->tij", now, now
    )  # (T, 3, 3)
    torque = np.cross(now, wanted).sum(axis=1)  # (T, 3)
    return rot.from_rotvec(np.linalg.solve(inertia + _DAMPING_M2 * eye, torque[..., None])[..., 0])


def _descendants(skeleton: Skeleton) -> list[list[int]]:
    below: list[list[int]] = [[] for _ in range(skeleton.n_joints)]
    for joint in range(skeleton.n_joints - 1, 0, -1):
        below[int(skeleton.parents[joint])] += [joint, *below[joint]]
    return below
