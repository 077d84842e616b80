"""What both sets of unseen measures (`research.unseen_measures`) are made of."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from choreograph.evaluation.movement import Window


@dataclass(frozen=True)
class MeasureSet:
    """Measures that were written together, before a value of any of them was known."""

    title: str
    of_legs: Mapping[str, Callable[[Window], float]]  # of legs and pelvis, also of a robot
    of_bodies: Mapping[str, Callable[[Window], float]]  # of a body with trunk, head, arms and feet

    def of(self, *, is_robot: bool) -> dict[str, Callable[[Window], float]]:
        """The measures by name, without those that a robot cannot have."""
        return {**self.of_legs} if is_robot else {**self.of_legs, **self.of_bodies}


def between_feet_m(window: Window) -> np.ndarray:
    """From the right foot to the left one in the frame of the dancer, (T, 3)."""
    return window.facing_joint("left_foot") - window.facing_joint("right_foot")


def pelvis_aside_m(window: Window) -> np.ndarray:
    """The pelvis to the left of the middle of the feet, (T,)."""
    middle = 0.5 * (window.facing_joint("left_foot") + window.facing_joint("right_foot"))
    return window.facing_joint("pelvis")[:, 0] - middle[:, 0]


def landings(stands: np.ndarray) -> np.ndarray:
    """The frames before those in which a foot begins to stand, (L,), of whether it stands, (T,)."""
    return np.flatnonzero(np.diff(stands.astype(np.int8)) == 1)
