"""Named arm poses for either arm, and their coordinates for interpolation.

A direction is (out, up, fwd): away from the body's midline, up, forward, in the chest's frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats
from choreograph.motion import rotations as rot

Direction = tuple[float, float, float]


@dataclass(frozen=True)
class Arm:
    """An arm in the chest's frame: directions of upper arm and forearm, angles of wrist and palm."""

    upper: Direction
    fore: Direction
    wrist: float = 0.0  # towards the palm, degrees
    palm: float = 0.0  # turned in (thumb towards the body, palm back or down), degrees

    @cached_property
    def coordinates(self) -> tuple[float, ...]:
        """(6,): rotation vector of the left shoulder relative to `_MIDDLE`, elbow, wrist and palm in radians.

        Relative to a mean of all poses, rotation vectors stay far from their wrap at π and
        interpolate well.
        """
        upper = np.array(self.upper) / np.linalg.norm(self.upper)
        fore = np.array(self.fore) / np.linalg.norm(self.fore)
        elbow = float(np.arctan2(np.linalg.norm(np.cross(upper, fore)), upper @ fore))
        # The hint defines the bend direction of a straight arm: forward and in.
        bend = fore - upper * (upper @ fore)
        hint = np.array([-0.3, 0.15, 1.0])
        bend = bend + 0.08 * (hint - upper * (hint @ upper))
        bend /= np.linalg.norm(bend)
        turn = rot.from_matrix(np.stack([upper, np.cross(bend, upper), bend], axis=-1))
        vector = rot.to_rotvec(rot.multiply(turn, rot.invert(_MIDDLE)))
        return (*map(float, vector), elbow, np.radians(self.wrist), np.radians(self.palm))


# The left upper arm forward, a little out and down, its elbow bending up.
_MIDDLE = rot.from_matrix(
    np.stack([(0.6, -0.48, 0.64), np.cross((0.0, 0.8, 0.6), (0.6, -0.48, 0.64)), (0.0, 0.8, 0.6)], axis=-1)
)


def shoulder_quat(vectors: Floats) -> Floats:
    """Left shoulder rotations (..., 4) in the collar's frame, from the first three `Arm.coordinates`."""
    return rot.multiply(rot.from_rotvec(vectors), _MIDDLE)


ARMS: dict[str, Arm] = {
    # at rest
    "relaxed": Arm((0.20, -1.0, 0.05), (0.10, -1.0, 0.32), 8, 15),
    "loose": Arm((0.35, -1.0, 0.0), (0.05, -0.45, 0.8), 10, 20),
    "guard": Arm((0.45, -1.0, 0.15), (-0.25, 0.35, 1.0), 5, 30),
    "low_guard": Arm((0.40, -1.0, 0.0), (-0.1, -0.15, 1.0), 10, 35),
    "hip": Arm((0.75, -0.55, -0.35), (-0.45, -0.80, 0.45), 20, 40),
    "pocket": Arm((0.35, -1.0, -0.25), (0.0, -1.0, 0.45), 20, 40),
    # swings
    "swing_fwd": Arm((0.20, -0.85, 0.55), (-0.15, -0.05, 1.0), 5, 15),
    "swing_back": Arm((0.35, -0.95, -0.50), (0.15, -0.85, 0.35), 10, 15),
    "swing_out": Arm((0.75, -0.75, 0.05), (0.75, -0.50, 0.45), 0, 20),
    "swing_in": Arm((0.05, -0.90, 0.35), (-0.75, -0.20, 0.65), 15, 20),
    "pump_high": Arm((0.50, -0.55, 0.45), (-0.05, 1.0, 0.55), 5, 10),
    "pump_low": Arm((0.50, -1.0, -0.15), (0.0, -0.25, 1.0), 5, 15),
    # shapes
    "out": Arm((1.0, -0.12, 0.10), (1.0, 0.02, 0.22), -8, 10),
    "low_out": Arm((0.85, -0.65, 0.15), (0.85, -0.45, 0.40), -10, 10),
    "wide_up": Arm((0.85, 0.45, 0.15), (0.55, 0.85, 0.10), -5, 0),
    "up": Arm((0.35, 0.95, 0.20), (0.12, 1.0, 0.10), -5, 0),
    "point_up": Arm((0.75, 0.62, 0.25), (0.70, 0.72, 0.22), 0, 0),
    "point_down": Arm((-0.10, -0.75, 0.60), (-0.65, -0.65, 0.45), 0, 20),
    "fwd": Arm((0.20, -0.15, 1.0), (0.05, 0.05, 1.0), -5, 15),
    "across": Arm((-0.10, -0.40, 0.85), (-0.95, 0.05, 0.45), 10, 20),
    "chest": Arm((0.70, -0.55, 0.35), (-0.85, 0.15, 0.50), 15, 25),
    "elbow_out": Arm((0.95, -0.15, 0.15), (-0.45, 0.10, 0.95), 15, 25),
    "elbow_back": Arm((0.45, -0.70, -0.60), (0.10, 0.05, 1.0), 5, 15),
    "clap": Arm((0.25, -0.70, 0.60), (-0.62, 0.40, 0.70), -8, 0),
    "clap_open": Arm((0.70, -0.60, 0.35), (0.25, 0.35, 0.95), -5, 0),
    "head": Arm((0.90, 0.35, 0.15), (-0.55, 0.85, -0.10), 10, 0),
    # one forearm over the other, at four points of a circle: up, away, down, back
    "roll_high": Arm((0.30, -0.60, 0.55), (-0.90, 0.35, 0.60), 10, 30),
    "roll_far": Arm((0.28, -0.62, 0.72), (-0.90, 0.10, 0.70), 10, 30),
    "roll_low": Arm((0.35, -0.85, 0.35), (-0.90, -0.15, 0.65), 10, 30),
    "roll_near": Arm((0.45, -0.80, 0.10), (-0.90, 0.15, 0.62), 10, 30),
    "cross_low": Arm((0.10, -0.85, 0.50), (-0.70, -0.55, 0.60), 10, 25),
    # ballet and ballroom: rounded arms, low, in front, to the side, overhead, and reaching out
    "en_bas": Arm((0.50, -0.92, 0.28), (-0.30, -0.80, 0.55), 8, 20),
    "first": Arm((0.62, -0.50, 0.70), (-0.72, -0.10, 0.62), 5, 25),
    "second": Arm((1.0, -0.32, 0.25), (0.90, -0.20, 0.50), -6, 15),
    "fifth": Arm((0.52, 0.82, 0.22), (-0.28, 0.95, 0.22), 8, 5),
    "reach": Arm((0.30, 0.22, 1.0), (0.22, 0.32, 1.0), -8, 15),
    "reach_back": Arm((0.75, -0.45, -0.45), (0.85, -0.30, -0.30), -8, 15),
    "frame_up": Arm((1.0, -0.15, 0.04), (0.275, 0.05, 0.93), 0, 10),
    "frame_round": Arm((1.0, -0.12, 0.04), (0.285, -0.01, 0.95), 5, 30),
    "frame_low": Arm((1.0, -0.16, 0.02), (0.285, -0.05, 0.95), 5, 30),
    "hold_out": Arm((0.92, -0.22, 0.38), (0.45, 0.55, 0.80), 0, 20),
    "hold_in": Arm((0.85, -0.28, 0.48), (-0.60, 0.12, 0.80), 8, 35),
}


def arm(which: str | Arm) -> Arm:
    """A named arm pose, or the `Arm` itself. `ParameterError` if the name is unknown."""
    if isinstance(which, Arm):
        return which
    if which not in ARMS:
        raise ParameterError(f"no arm pose {which!r}: there are {', '.join(sorted(ARMS))}")
    return ARMS[which]
