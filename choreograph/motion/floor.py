"""Floor height under a take, from the lowest points that its feet return to."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, percentile_filter

from choreograph.errors import ParameterError
from choreograph.motion import rotations as rot
from choreograph.motion.kinematics import forward
from choreograph.motion.motion import Motion
from choreograph.motion.rigs import joint_roles, rest_pose_is_upright
from choreograph.motion.skeleton import Skeleton

Floats = NDArray[np.float64]

_LOW_PERCENT = 10.0  # of frames whose lower foot may lie below the floor (noise)
_WINDOW_S = 2.0  # longer than a jump, shorter than the drift
_SMOOTH_S = 0.5


def sole_pos_m(motion: Motion) -> Floats:
    """Sole points of both feet (T, F, 3) in metres; see `foot_sole_pos_m`."""
    pos_m, global_quat = forward(motion.skeleton, motion.root_pos_m, motion.local_quat)
    feet = [foot_sole_pos_m(motion.skeleton, pos_m, global_quat, side) for side in ("left", "right")]
    return np.concatenate(feet, axis=1)


def foot_sole_pos_m(skeleton: Skeleton, pos_m: Floats, global_quat: Floats, side: str) -> Floats:
    """Sole points of one foot (T, F, 3) in metres: they touch the floor when the foot stands flat.

    These are the ball of the foot, and heel and toe tip where the skeleton has them as end sites; the
    ankle for a rig without any. Each is lowered by its height above the sole. Heights are taken in the
    rest pose or, if that is not upright (some rigs lay all bones along one axis), in the motion's lowest
    frames. `pos_m` (T, J, 3) and `global_quat` (T, J, 4) are world positions and rotations.

    Raises `ParameterError` if the rig's joint names are unknown.
    """
    roles = joint_roles(skeleton)
    rest_m = skeleton.rest_pos_m()
    ankle, ball = roles[f"{side}_ankle"], roles.get(f"{side}_foot")
    foot_joints = [ankle] if ball is None else [ankle, ball]
    points = [] if ball is None else [pos_m[:, ball]]
    heights = [] if ball is None else [rest_m[ball, 1]]
    for tip in np.flatnonzero(np.isin(skeleton.tip_parents, foot_joints)):
        parent, offset = skeleton.tip_parents[tip], skeleton.tips_m[tip]
        points.append(pos_m[:, parent] + rot.rotate(global_quat[:, parent], offset))
        heights.append(rest_m[parent, 1] + offset[1])
    if not points:
        points, heights = [pos_m[:, ankle]], [rest_m[ankle, 1]]
    foot_m = np.stack(points, axis=1)  # (T, F, 3)
    heights_m = (
        np.array(heights)
        if rest_pose_is_upright(skeleton)
        else np.percentile(foot_m[..., 1], _LOW_PERCENT, axis=0)
    )
    clearance = heights_m - heights_m.min()  # (F,)
    return foot_m - clearance[:, None] * [0.0, 1.0, 0.0]  # (T, F, 3)


def estimate_floor_m(foot_pos_m: Floats) -> float:
    """Height of the floor in metres, one for the take.

    `foot_pos_m` (T, F, 3) are foot points that all have the same height above the floor when the foot is
    down. The lowest point of a frame is on the floor most of the time, so its low percentile is robust
    to jumps (frames much higher) and noise (a few frames much lower).

    Raises `ParameterError` if there is no point or a value is not finite.
    """
    return float(np.percentile(_lowest(foot_pos_m), _LOW_PERCENT))


def track_floor_m(foot_pos_m: Floats, fps: float) -> Floats:
    """Height of the floor at each frame, (T,) metres, for captures with vertical drift.

    Points as for `estimate_floor_m`. The result is smooth, so subtracting it adds no jerk.

    Raises `ParameterError` if there is no point or a value is not finite.
    """
    lowest = _lowest(foot_pos_m)
    window = max(1, min(round(_WINDOW_S * fps), len(lowest)))
    envelope = percentile_filter(lowest, _LOW_PERCENT * 2, size=window, mode="nearest")
    return gaussian_filter1d(envelope, _SMOOTH_S * fps, mode="nearest")


def _lowest(foot_pos_m: Floats) -> Floats:
    foot_pos_m = np.asarray(foot_pos_m, np.float64)
    if foot_pos_m.ndim != 3 or foot_pos_m.shape[-1] != 3 or 0 in foot_pos_m.shape:
        raise ParameterError(f"expected foot points (T, F, 3), got {foot_pos_m.shape}")
    if not np.isfinite(foot_pos_m).all():
        raise ParameterError("expected finite foot positions, got nan or infinity")
    return foot_pos_m[..., 1].min(axis=1)  # (T,)
