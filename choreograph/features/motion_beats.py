"""Motion beats: the moments a dance comes to rest, local minima of mean joint speed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from choreograph.errors import ParameterError
from choreograph.timebase import frames_to_seconds

SMOOTHING_S = 0.03  # standard deviation: takes marker noise out, leaves every visible stop in
MIN_GAP_S = 0.1  # faster than anybody steps
MIN_PROMINENCE = 0.03  # of the median speed: shallower dips are tremor and sampling


def mean_joint_speed_m_s(body_pos_m: NDArray[np.floating], fps: float) -> NDArray[np.float64]:
    """Mean speed of the joints in the world, m/s, (T,), of positions (T, J, 3); travel counts."""
    pos = np.asarray(body_pos_m, np.float64)
    if pos.ndim != 3 or pos.shape[2] != 3:
        raise ParameterError(f"expected joint positions (T, J, 3), got {pos.shape}")
    if len(pos) < 2:
        return np.zeros(len(pos))
    smooth = gaussian_filter1d(pos, SMOOTHING_S * fps, axis=0, mode="nearest")
    return np.linalg.norm(np.gradient(smooth, axis=0) * fps, axis=2).mean(axis=1)


def motion_beat_times_s(body_pos_m: NDArray[np.floating], fps: float) -> NDArray[np.float64]:
    """Instants of the motion beats in seconds, increasing (Q,), of positions (T, J, 3).

    Local minima of mean joint speed by scipy's find_peaks, as the paper has them (ChoreoGraph,
    section 3.1), to a fraction of a frame. Beats of a dance are those at 60 fps: at 20 fps
    about one shallow beat in eight is missed. A dip
    shallower than 3 % of the median speed is tremor, not a beat (the paper gives no threshold).
    """
    from scipy.signal import find_peaks  # half a second to import, and planning does without

    speed = mean_joint_speed_m_s(body_pos_m, fps)
    if len(speed) < 3:
        return np.zeros(0)
    frames, _ = find_peaks(
        -speed,
        distance=max(1, round(MIN_GAP_S * fps)),
        prominence=max(MIN_PROMINENCE * float(np.median(speed)), 1e-3),
    )
    return frames_to_seconds(frames + _vertex(speed, frames), fps)


def _vertex(speed: NDArray[np.float64], frames: NDArray[np.integer]) -> NDArray[np.float64]:
    """Offset in (-0.5, 0.5) of the parabola's lowest point through each minimum and its neighbours."""
    before, here, after = speed[frames - 1], speed[frames], speed[frames + 1]
    bend = before - 2 * here + after
    return np.where(bend > 1e-12, 0.5 * (before - after) / np.maximum(bend, 1e-12), 0.0).clip(-0.5, 0.5)
