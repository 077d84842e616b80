"""Axis-angle poses in SMPL's joint order as motions on the canonical skeleton."""

from __future__ import annotations

from typing import Any

import numpy as np

from choreograph.errors import FormatError, ParameterError
from choreograph.motion import rotations as rot
from choreograph.motion.motion import Motion, check_length
from choreograph.motion.skeleton import CANONICAL_JOINTS, canonical_skeleton

_BODY = 22  # joints shared by SMPL, SMPL-H and SMPL-X; hands, jaw and eyes follow


def smpl_motion(poses: Any, trans: Any, fps: float) -> Motion:
    """Motion of axis-angle `poses` (T, 66 or more) or (T, J, 3), and root positions `trans` (T, 3) in metres.

    The body joints come first and in canonical order. SMPL's two hand joints (72 values) are kept, fingers
    are not. In SMPL the pelvis is a constant vector away from `trans`; estimating the floor corrects its
    height. Raises `FormatError` if shapes or values are wrong.
    """
    try:
        poses, trans = np.asarray(poses, np.float64), np.asarray(trans, np.float64)
    except (TypeError, ValueError):
        raise FormatError("expected poses and translations as arrays of numbers, got others") from None
    if poses.ndim == 3 and poses.shape[2] == 3:
        poses = poses.reshape(len(poses), 3 * poses.shape[1])
    if poses.ndim != 2 or poses.shape[1] < 3 * _BODY or poses.shape[1] % 3 or trans.shape != (len(poses), 3):
        raise FormatError(
            f"expected poses (T, 66 or more) and translations (T, 3), got {poses.shape}, {trans.shape}"
        )
    if len(poses) == 0:
        raise FormatError("expected poses of a frame or more, got no frame")
    try:
        check_length(len(poses), len(CANONICAL_JOINTS), fps)
    except ParameterError as error:
        raise FormatError(str(error)) from None
    if not (np.isfinite(poses).all() and np.isfinite(trans).all()):
        raise FormatError("expected finite poses and translations, got some that are not: damaged data?")
    n_joints = len(CANONICAL_JOINTS)
    kept = n_joints if poses.shape[1] == 3 * n_joints else _BODY
    rotvec = np.zeros((len(poses), n_joints, 3))
    rotvec[:, :kept] = poses[:, : 3 * kept].reshape(len(poses), kept, 3)
    return Motion(canonical_skeleton(), trans, rot.make_continuous(rot.from_rotvec(rotvec)), fps)


def rotated_world(motion: Motion, rotation: np.ndarray) -> Motion:
    """The motion in a world rotated by `rotation` (4,), which changes root position and root rotation."""
    quat = np.array(motion.local_quat)
    quat[:, 0] = rot.multiply(rotation, quat[:, 0])
    root_pos_m = rot.rotate(rotation, motion.root_pos_m)
    return Motion(motion.skeleton, root_pos_m, rot.make_continuous(quat), motion.fps)
