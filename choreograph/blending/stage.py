"""Staying on the stage: a dance that leads away from its middle is turned home, a little at a time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

STAGE_RADIUS_M = 2.0  # as far as that from the middle a dance is steered with all it may, not at all at half
MAX_STEER_RAD = 0.25  # extra turn at a time, spread over a join or a word: 14°, feet move by about 3 cm


def steer_rad(place_m: Floats, travel_m: Floats) -> float:
    """Extra turn that bends the coming way over the ground (3,), from `place_m` (3,), to the stage's middle.

    Pieces that each lead forward add up to a walk out of the room; a turn where they are joined costs
    nothing that the join does not smooth anyway.
    """
    if np.linalg.norm(travel_m) < 0.1:
        return 0.0
    home, way = np.arctan2(-place_m[0], -place_m[2]), np.arctan2(travel_m[0], travel_m[2])
    off = (home - way + np.pi) % (2 * np.pi) - np.pi
    need = np.clip(2.0 * float(np.linalg.norm(place_m)) / STAGE_RADIUS_M - 1.0, 0.0, 1.0)
    return float(np.clip(off, -MAX_STEER_RAD, MAX_STEER_RAD) * need)
