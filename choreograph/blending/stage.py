"""Keeping a dance near the middle of the stage, by small extra rotations at transitions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

STAGE_RADIUS_M = 2.0  # steering grows from none at half this distance to its maximum here
MAX_STEER_RAD = 0.25  # a transition or word: 14°, which moves the feet by about 3 cm


def steer_rad(pos_m: Floats, travel_m: Floats) -> float:
    """Extra rotation that bends the path ahead (3,) from a position (3,) towards the middle of the stage.

    Parts of takes that each lead forward add up to a walk out of the room. A rotation at a transition is
    smoothed by the transition.
    """
    if np.linalg.norm(travel_m) < 0.1:
        return 0.0
    home, ahead = np.arctan2(-pos_m[0], -pos_m[2]), np.arctan2(travel_m[0], travel_m[2])
    off = (home - ahead + np.pi) % (2 * np.pi) - np.pi
    need = np.clip(2.0 * float(np.linalg.norm(pos_m)) / STAGE_RADIUS_M - 1.0, 0.0, 1.0)
    return float(np.clip(off, -MAX_STEER_RAD, MAX_STEER_RAD) * need)
