"""Motion beats: local minima of mean joint speed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from choreograph.errors import ParameterError
from choreograph.timebase import frames_to_seconds

SMOOTHING_S = 0.03  # standard deviation: removes marker noise, keeps every visible stop
MIN_GAP_S = 0.1  # shorter than any dancer's step
MIN_PROMINENCE_M_S = 1e-3  # however slow the motion
MIN_PROMINENCE = 0.03  # of the median speed: shallower dips are tremor and sampling noise


def mean_joint_speed_m_s(body_pos_m: NDArray[np.floating], fps: float) -> NDArray[np.float64]:
    """Mean world speed of the joints in m/s, (T,), of positions (T, J, 3); includes root motion."""
    pos = np.asarray(body_pos_m, np.float64)
    if pos.ndim != 3 or pos.shape[2] != 3:
        raise ParameterError(f"expected joint positions (T, J, 3), got {pos.shape}")
    if len(pos) < 2:
        return np.zeros(len(pos))
    smooth = gaussian_filter1d(pos, SMOOTHING_S * fps, axis=0, mode="nearest")
    return np.linalg.norm(np.gradient(smooth, axis=0) * fps, axis=2).mean(axis=1)


def motion_beat_times_s(body_pos_m: NDArray[np.floating], fps: float) -> NDArray[np.float64]:
    """Times of the motion beats in seconds, increasing (Q,), of positions (T, J, 3).

    Best computed at 60 fps: at 20 fps about one shallow beat in eight is missed.
    """
    speed = mean_joint_speed_m_s(body_pos_m, fps)
    return frames_to_seconds(speed_minima(speed, fps), fps)


def speed_minima(speed_m_s: NDArray[np.floating], fps: float) -> NDArray[np.float64]:
    """Fractional frames of the motion beats of a speed curve (T,), increasing (Q,).

    Local minima by scipy's find_peaks, as in the paper (ChoreoGraph, section 3.1). A dip shallower than
    3 % of the median speed is tremor, not a beat (the paper gives no threshold). The warper's kernel
    finds the beats of warped motion by the same definition (`warping._kernels`).
    """
    from scipy.signal import find_peaks  # half a second to import, and planning does not need it

    speed = np.asarray(speed_m_s, np.float64)
    if len(speed) < 3:
        return np.zeros(0)
    frames, _ = find_peaks(
        -speed,
        distance=max(1, round(MIN_GAP_S * fps)),
        prominence=max(MIN_PROMINENCE * float(np.median(speed)), MIN_PROMINENCE_M_S),
    )
    return frames + _vertex_offset(speed, frames)


def _vertex_offset(speed: NDArray[np.float64], frames: NDArray[np.integer]) -> NDArray[np.float64]:
    """Offset in (-0.5, 0.5) of the vertex of the parabola through each minimum and its neighbours."""
    before, here, after = speed[frames - 1], speed[frames], speed[frames + 1]
    bend = before - 2 * here + after
    return np.where(bend > 1e-12, 0.5 * (before - after) / np.maximum(bend, 1e-12), 0.0).clip(-0.5, 0.5)
