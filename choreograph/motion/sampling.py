"""Motions between their frames, smoothly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from choreograph.motion import rotations as rot
from choreograph.motion.motion import Motion


def sampled_smoothly(motion: Motion, frames: NDArray[np.float64], *, fps: float | None = None) -> Motion:
    """The poses at fractional `frames` (T',) by cubic splines; outside, the end poses hold.

    Slerp's corners at every source frame (`Motion.sampled`) are visible jerk when 25 fps is played at 60.
    """
    frames = np.clip(frames, 0, motion.n_frames - 1)
    if motion.n_frames < 4:
        return motion.sampled(frames, fps=fps)
    knots = np.arange(motion.n_frames)
    quat = rot.normalize(CubicSpline(knots, rot.make_continuous(motion.local_quat))(frames))
    root_pos_m = CubicSpline(knots, motion.root_pos_m)(frames)
    return replace(motion, root_pos_m=root_pos_m, local_quat=quat, fps=fps or motion.fps)
