"""Does a dance obey its floor and its body: foot slide, penetration, jerk at joins.

Conventions: body positions (T, 21, 3) in metres at `fps`, Y up, the floor at y = 0. A foot is low
when its ball is at most `LOW_M` over the floor. Jerk is the third difference of all joints' places
at one rate, 20 fps whatever the source's, so that dances and takes compare; m/s³. Positions of another
shape, not finite, or without a rate are refused with a `ParameterError`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from choreograph.errors import ParameterError
from choreograph.motion.body import BODY_JOINTS, checked_body_pos_m
from choreograph.timebase import NET_FPS, frame_times_s

Floats = NDArray[np.float64]

LOW_M = 0.05
JERK_FPS = NET_FPS
ANKLE_OVER_SOLE_M = 0.07  # of the canonical body; real ones have 7 to 10 cm
_FEET = [BODY_JOINTS.index("left_foot"), BODY_JOINTS.index("right_foot")]
_ANKLES = [BODY_JOINTS.index("left_ankle"), BODY_JOINTS.index("right_ankle")]


def foot_slide_cm_s(body_pos_m: Floats, fps: float, *, low_m: float = LOW_M) -> float:
    """Mean horizontal speed of the balls of the feet while low, cm/s; 0 if they never are.

    A step counts as low if the foot is low at both its ends.
    """
    feet = checked_body_pos_m(body_pos_m, fps)[:, _FEET]  # (T, 2, 3)
    low = feet[..., 1] <= low_m
    low = low[1:] & low[:-1]
    speed = np.linalg.norm(np.diff(feet[..., [0, 2]], axis=0), axis=-1) * fps * 100.0  # (T-1, 2)
    return float(speed[low].mean()) if low.any() else 0.0


def floor_penetration_cm(body_pos_m: Floats, fps: float, *, sole_pos_m: Floats | None = None) -> float:
    """Mean depth in cm, over all frames, of the lowest point of the feet under the floor.

    The points are those of the soles (T, F, 3) if given, as `motion.floor.sole_pos_m` knows them of a
    motion's rig; else the balls, and heels `ANKLE_OVER_SOLE_M` under the ankles.

    Raises `ParameterError`, too, if the soles' frames are not the body's.
    """
    pos = checked_body_pos_m(body_pos_m, fps)
    heels_y_m = pos[:, _ANKLES, 1] - ANKLE_OVER_SOLE_M
    points_y_m = np.concatenate([pos[:, _FEET, 1], heels_y_m], axis=1)  # (T, 4)
    if sole_pos_m is not None:
        soles = np.asarray(sole_pos_m, np.float64)
        if soles.ndim != 3 or soles.shape[0] != len(pos) or soles.shape[2] != 3 or soles.shape[1] == 0:
            raise ParameterError(f"expected points of the soles ({len(pos)}, F, 3), got {soles.shape}")
        if not np.isfinite(soles).all():
            raise ParameterError("expected finite points of the soles, got nan or infinity")
        points_y_m = soles[..., 1]
    return float(np.maximum(-points_y_m.min(axis=1), 0.0).mean() * 100.0)


def joint_jerk_m_s3(body_pos_m: Floats, fps: float) -> tuple[Floats, Floats]:
    """Instants in seconds and mean jerk over the joints in m/s³, both (T' - 3,) at `JERK_FPS`."""
    pos = checked_body_pos_m(body_pos_m, fps)
    times_s = frame_times_s(len(pos), fps)
    if fps != JERK_FPS and len(pos) > 1:
        wanted_s = frame_times_s(int(times_s[-1] * JERK_FPS) + 1, JERK_FPS)
        pos, times_s = CubicSpline(times_s, pos)(wanted_s), wanted_s
    if len(pos) < 4:
        return np.zeros(0), np.zeros(0)
    jerk = np.linalg.norm(np.diff(pos, n=3, axis=0), axis=-1).mean(axis=1) * JERK_FPS**3  # (T' - 3,)
    return times_s[:-3] + 1.5 / JERK_FPS, jerk


def jerk_ratio_at(
    body_pos_m: Floats, fps: float, boundary_times_s: Sequence[float] | Floats, *, half_width_s: float = 0.12
) -> float:
    """95th percentile of jerk within `half_width_s` of any boundary, over the 95th percentile elsewhere.

    `nan` if no frame is near a boundary or none is elsewhere.
    """
    times_s, jerk = joint_jerk_m_s3(body_pos_m, fps)
    boundaries = np.asarray(boundary_times_s, np.float64).reshape(-1)
    if len(boundaries) == 0 or len(jerk) == 0:
        return float("nan")
    near = (np.abs(times_s[:, None] - boundaries) <= half_width_s).any(axis=1)
    if near.all() or not near.any():
        return float("nan")
    return float(np.percentile(jerk[near], 95) / max(np.percentile(jerk[~near], 95), 1e-9))


def evaluate(
    body_pos_m: Floats, fps: float, boundary_times_s: Sequence[float] | Floats = ()
) -> dict[str, float]:
    """All metrics of this module by name."""
    _, jerk = joint_jerk_m_s3(body_pos_m, fps)
    return {
        "foot_slide_cm_s": foot_slide_cm_s(body_pos_m, fps),
        "floor_penetration_cm": floor_penetration_cm(body_pos_m, fps),
        "jerk_p95_m_s3": float(np.percentile(jerk, 95)) if len(jerk) else 0.0,
        "jerk_ratio_at_boundaries": jerk_ratio_at(body_pos_m, fps, boundary_times_s),
    }
