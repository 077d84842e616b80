"""The height of the floor under a take, and the contacts of the feet with it."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats
from choreograph.motion import rotations as rot
from choreograph.motion.body import BODY_JOINTS, body_pos_m, checked_body_pos_m
from choreograph.motion.kinematics import forward
from choreograph.motion.motion import Motion
from choreograph.motion.rigs import joint_roles, rest_pose_is_upright
from choreograph.motion.skeleton import Skeleton

# Floor height under a take, from the lowest points that its feet return to.


_LOW_PERCENT = 10.0  # of frames whose lower foot may lie below the floor (noise)
_WINDOW_S = 2.0  # longer than a jump, shorter than the drift
_SMOOTH_S = 0.5


def sole_pos_m(motion: Motion) -> Floats:
    """Sole points of both feet (T, F, 3) in metres. See `foot_sole_pos_m`."""
    pos_m, global_quat = forward(motion.skeleton, motion.root_pos_m, motion.local_quat)
    feet = [foot_sole_pos_m(motion.skeleton, pos_m, global_quat, side) for side in ("left", "right")]
    return np.concatenate(feet, axis=1)


def foot_sole_pos_m(skeleton: Skeleton, pos_m: Floats, global_quat: Floats, side: str) -> Floats:
    """Sole points of one foot (T, F, 3) in metres, which touch the floor when the foot stands flat.

    These are the ball of the foot, and heel and toe tip where the skeleton has them as end sites. On a rig
    without any of them, it is the ankle. Each is lowered by its height above the sole. Heights are taken in
    the rest pose or, if that is not upright (some rigs lay all bones along one axis), in the motion's lowest
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
    sole_m: Floats = foot_m - clearance[:, None] * [0.0, 1.0, 0.0]  # (T, F, 3)
    return sole_m


def estimate_floor_m(foot_pos_m: Floats) -> float:
    """Height of the floor in metres, one value for the take.

    `foot_pos_m` (T, F, 3) are points of the feet that all have the same height when a foot stands on the
    floor. The lowest point of a frame is on the floor most of the time. Its low percentile is robust to jumps
    (frames that are much higher) and noise (a few frames that are much lower).

    Raises `ParameterError` if there is no point or a value is not finite.
    """
    return float(np.percentile(_lowest(foot_pos_m), _LOW_PERCENT))


def track_floor_m(foot_pos_m: Floats, fps: float) -> Floats:
    """Height of the floor at each frame, (T,) metres, for captures with vertical drift.

    The points are as for `estimate_floor_m`. The result is smooth, so subtracting it adds no jerk.

    Raises `ParameterError` if there is no point or a value is not finite.
    """
    lowest = _lowest(foot_pos_m)
    window = max(1, min(round(_WINDOW_S * fps), len(lowest)))
    envelope = scipy.ndimage.percentile_filter(lowest, _LOW_PERCENT * 2, size=window, mode="nearest")
    floor_m: Floats = scipy.ndimage.gaussian_filter1d(envelope, _SMOOTH_S * fps, mode="nearest")
    return floor_m


def _lowest(foot_pos_m: Floats) -> Floats:
    foot_pos_m = np.asarray(foot_pos_m, np.float64)
    if foot_pos_m.ndim != 3 or foot_pos_m.shape[-1] != 3 or 0 in foot_pos_m.shape:
        raise ParameterError(f"expected foot points (T, F, 3), got {foot_pos_m.shape}")
    if not np.isfinite(foot_pos_m).all():
        raise ParameterError("expected finite foot positions, got nan or infinity")
    lowest_m: Floats = foot_pos_m[..., 1].min(axis=1)  # (T,)
    return lowest_m


# Foot contacts with the floor, from the height and speed of the foot joints.


CONTACT_JOINTS = ("left_ankle", "left_foot", "right_ankle", "right_foot")

FLOOR_PERCENT = 10.0  # of frames: a joint's height while its foot is on the floor
_LOW_M, _LOW_WIDTH_M = 0.045, 0.007  # above that height, where contact and no contact are equally likely
_SLOW_M_S = 0.4  # at that speed the confidence is halved
_CONTACT_SMOOTH_S = 0.04  # against noise in the speed and flickering contacts


def foot_contacts(body_pos_m: NDArray[np.floating], fps: float) -> NDArray[np.float64]:
    """Contact confidence of each of `CONTACT_JOINTS`, (T, 4) from 0 to 1. Values above 0.5 are contacts.

    The columns are left ankle (heel), left foot (ball), right ankle, right foot of body positions
    (T, 21, 3) in metres at any rate `fps`. The confidence is a smooth function of height and speed. With a
    hard threshold, foot locking would switch on and off within a frame.

    Raises `ParameterError` if the shape is wrong or a value is not finite.
    """
    pos = checked_body_pos_m(body_pos_m, fps)
    feet = pos[:, [BODY_JOINTS.index(name) for name in CONTACT_JOINTS]]  # (T, 4, 3)
    return contacts_above(feet, np.percentile(feet[..., 1], FLOOR_PERCENT, axis=0), fps)


def contacts_of(motion: Motion) -> Floats:
    """`foot_contacts` (T, 4) of a motion, one joint after another, since those of a long dance are large."""
    feet_m = body_pos_m(motion, CONTACT_JOINTS)  # (T, 4, 3)
    floor_m = np.percentile(feet_m[..., 1], FLOOR_PERCENT, axis=0)
    parts = [contacts_above(feet_m[:, [joint]], floor_m[[joint]], motion.fps) for joint in range(4)]
    return np.concatenate(parts, axis=1)


def contacts_above(
    feet: NDArray[np.float64], floor_m: NDArray[np.float64], fps: float
) -> NDArray[np.float64]:
    """`foot_contacts` (T, 4) from these joints alone (T, 4, 3), with the height of each in contact, (4,)."""
    height = feet[..., 1] - floor_m  # (T, 4)
    sigma = _CONTACT_SMOOTH_S * fps
    smooth = scipy.ndimage.gaussian_filter1d(feet, sigma, axis=0, mode="nearest")
    step = np.gradient(smooth, axis=0) if len(feet) > 1 else np.zeros_like(feet)
    speed = np.linalg.norm(step, axis=-1) * fps  # (T, 4)
    confidence = scipy.special.expit((_LOW_M - height) / _LOW_WIDTH_M) / (1.0 + (speed / _SLOW_M_S) ** 4)
    contacts: Floats = scipy.ndimage.gaussian_filter1d(confidence, sigma, axis=0, mode="nearest")
    return contacts.clip(0.0, 1.0)


def step_counts(
    body_pos_m: NDArray[np.floating], fps: float, start_frames: NDArray[np.integer], n_frames: int
) -> NDArray[np.int64]:
    """Number of steps (N,) within `n_frames` from each of `start_frames` (N,).

    A step is the beginning of a contact of a foot, by heel or ball. The other arguments and the errors are
    those of `foot_contacts`.
    """
    contacts = foot_contacts(body_pos_m, fps)
    stands = np.maximum(contacts[:, ::2], contacts[:, 1::2]) > 0.5  # (T, foot)
    began = (stands[1:] & ~stands[:-1]).sum(axis=1)
    steps = np.concatenate([[0, 0], np.cumsum(began)])[: len(stands) + 1]  # before each frame, and the end
    first = np.clip(start_frames, 0, len(stands))
    counts: NDArray[np.int64] = steps[np.minimum(first + n_frames, len(stands))] - steps[first]
    return counts
