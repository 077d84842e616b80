"""Foot contacts with the floor, from the height and speed of the foot joints."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.special import expit

from choreograph.motion.body import BODY_JOINTS, checked_body_pos_m

CONTACT_JOINTS = ("left_ankle", "left_foot", "right_ankle", "right_foot")

FLOOR_PERCENT = 10.0  # of frames: a joint's height while its foot is on the floor
_LOW_M, _LOW_WIDTH_M = 0.045, 0.007  # above that height: contact and no contact are equally likely
_SLOW_M_S = 0.4  # at that speed the confidence is halved
_SMOOTH_S = 0.04  # against noise in the speed and flickering contacts


def foot_contacts(body_pos_m: NDArray[np.floating], fps: float) -> NDArray[np.float64]:
    """Contact confidence of each of `CONTACT_JOINTS`, (T, 4) from 0 to 1; above 0.5 is a contact.

    The columns are left ankle (heel), left foot (ball), right ankle, right foot of body positions
    (T, 21, 3) in metres at any rate `fps`. Height and speed enter smoothly: with a hard threshold,
    foot locking would switch on and off within a frame.

    Raises `ParameterError` if the shape is wrong or a value is not finite.
    """
    pos = checked_body_pos_m(body_pos_m, fps)
    feet = pos[:, [BODY_JOINTS.index(name) for name in CONTACT_JOINTS]]  # (T, 4, 3)
    return contacts_above(feet, np.percentile(feet[..., 1], FLOOR_PERCENT, axis=0), fps)


def contacts_above(
    feet: NDArray[np.float64], floor_m: NDArray[np.float64], fps: float
) -> NDArray[np.float64]:
    """`foot_contacts` (T, 4) of the joints alone (T, 4, 3), with the height of each, (4,), in contact."""
    height = feet[..., 1] - floor_m  # (T, 4)
    smooth = gaussian_filter1d(feet, _SMOOTH_S * fps, axis=0, mode="nearest")
    step = np.gradient(smooth, axis=0) if len(feet) > 1 else np.zeros_like(feet)
    speed = np.linalg.norm(step, axis=-1) * fps  # (T, 4)
    confidence = expit((_LOW_M - height) / _LOW_WIDTH_M) / (1.0 + (speed / _SLOW_M_S) ** 4)
    return gaussian_filter1d(confidence, _SMOOTH_S * fps, axis=0, mode="nearest").clip(0.0, 1.0)


def step_counts(
    body_pos_m: NDArray[np.floating], fps: float, start_frames: NDArray[np.integer], n_frames: int
) -> NDArray[np.int64]:
    """Steps (N,) within `n_frames` from each of `start_frames` (N,): a foot comes to stand, heel or ball.

    Arguments and errors as of `foot_contacts`.
    """
    contacts = foot_contacts(body_pos_m, fps)
    stands = np.maximum(contacts[:, ::2], contacts[:, 1::2]) > 0.5  # (T, foot)
    began = (stands[1:] & ~stands[:-1]).sum(axis=1)
    steps = np.concatenate([[0, 0], np.cumsum(began)])[: len(stands) + 1]  # before each frame, and the end
    first = np.clip(start_frames, 0, len(stands))
    return steps[np.minimum(first + n_frames, len(stands))] - steps[first]
