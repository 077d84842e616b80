"""When a foot stands on the floor, from where its joints are and how fast they move."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, label

from choreograph.errors import ParameterError
from choreograph.motion.body import BODY_JOINTS

CONTACT_JOINTS = ("left_ankle", "left_foot", "right_ankle", "right_foot")

_STANDING_PERCENT = 10.0  # of frames: a joint's height while its foot stands
_SURE_HEIGHT_M, _MAYBE_HEIGHT_M = 0.03, 0.06  # over that height
_SURE_SPEED_M_S, _MAYBE_SPEED_M_S = 0.25, 0.5
_SMOOTH_S = 0.04  # against noise in the speed
_SHORTEST_S = 0.08


def foot_contacts(body_pos_m: NDArray[np.floating], fps: float) -> NDArray[np.bool_]:
    """Whether each of `CONTACT_JOINTS` is at rest on the floor, (T, 4) bool.

    The columns are left ankle (heel), left foot (ball), right ankle, right foot of body positions
    (T, 21, 3) in metres at any rate `fps`. With hysteresis: a contact holds a frame that is surely
    low and slow, reaches as far as the joint may still be so, and lasts 0.08 s or longer.

    Raises `ParameterError` if the shape is wrong or a value is not finite.
    """
    pos = np.asarray(body_pos_m, np.float64)
    if pos.ndim != 3 or pos.shape[1:] != (len(BODY_JOINTS), 3) or len(pos) == 0:
        raise ParameterError(f"expected body positions (T, {len(BODY_JOINTS)}, 3), got {pos.shape}")
    if not np.isfinite(pos).all():
        raise ParameterError("expected finite body positions, got nan or infinity")
    feet = pos[:, [BODY_JOINTS.index(name) for name in CONTACT_JOINTS]]  # (T, 4, 3)
    height = feet[..., 1] - np.percentile(feet[..., 1], _STANDING_PERCENT, axis=0)  # (T, 4)
    smooth = gaussian_filter1d(feet, _SMOOTH_S * fps, axis=0, mode="nearest")
    step = np.gradient(smooth, axis=0) if len(feet) > 1 else np.zeros_like(feet)
    speed = np.linalg.norm(step, axis=-1) * fps  # (T, 4)
    sure = (height < _SURE_HEIGHT_M) & (speed < _SURE_SPEED_M_S)
    maybe = (height < _MAYBE_HEIGHT_M) & (speed < _MAYBE_SPEED_M_S)
    shortest = min(_SHORTEST_S * fps, len(feet))
    return np.stack([_held(sure[:, k], maybe[:, k], shortest) for k in range(4)], axis=1)


def _held(sure: NDArray[np.bool_], maybe: NDArray[np.bool_], shortest: float) -> NDArray[np.bool_]:
    """Runs of `maybe` (T,) that hold a `sure` frame and are long enough."""
    runs, n_runs = label(maybe)
    length = np.bincount(runs, minlength=n_runs + 1)
    certain = np.bincount(runs, weights=sure, minlength=n_runs + 1) > 0
    keep = certain & (length >= shortest)
    keep[0] = False  # run 0 is everything outside
    return keep[runs]
