"""The path of a dance on the stage, and its poses at any rate, while the network still predicts it.

What `generation` does to a whole dance, frame by frame with two frames of future (67 ms):

- heading: smoothed by the same Gaussian, cut off one frame ahead, so that it lags by about 35 ms
- stage: steered back word by word as there, but by the direction of the last two seconds, not of the next
- poses: a cubic B-spline whose control points are the network's poses. It smooths as the Gaussian there does
  (a deviation of 0.577 frames, 19 ms) and is as smooth at any rate as the spline that follows it there
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.blending.stage import steer_rad
from choreograph.motion import rotations as rot
from choreograph.nets.rollout.data import ROLLOUT_FPS
from choreograph.nets.rollout.model import N_FEET, ROOT_DIM
from choreograph.rollout.generation import SMOOTH_HEADING_S, STEER_FRAMES

Floats = NDArray[np.float64]

FUTURE_FRAMES = 3  # that poses wait for: two control points, and one frame more for the heading of the last
_UP = np.array([0.0, 1.0, 0.0])
_PAST_FRAMES = 10  # of the heading's Gaussian, four deviations
_DEVIATIONS = np.arange(-_PAST_FRAMES, 2) / (SMOOTH_HEADING_S * ROLLOUT_FPS)
_HEADING_WEIGHTS = np.exp(-0.5 * _DEVIATIONS**2) / np.exp(-0.5 * _DEVIATIONS**2).sum()  # (12,)


@dataclass(frozen=True, eq=False)
class Poses:
    """Poses in the world, and the contacts the network predicts for them."""

    root_pos_m: Floats  # (T, 3)
    local_quat: Floats  # (T, J, 4)
    contacts: Floats  # (T, 2) of the left and the right foot, 0 to 1


class StagePath:
    """Poses in the world from pose rows (P,), added one by one from frame 0 on, above the origin."""

    def __init__(self) -> None:
        self._row: Floats | None = None  # the last one added
        self._turns: list[float] = []  # changes of heading of the last frames added
        self._steer: list[float] = []  # extra changes of heading, of the next frames to be placed
        self._heading = 0.0
        self._pos_m = np.zeros(3)  # on the ground
        self._travelled: list[Floats] = []  # positions of the last two seconds
        self._root_pos_m: list[Floats] = []  # control points, the last four
        self._headings: list[Floats] = []
        self._quats: list[Floats] = []  # (J, 4), the root's without its heading
        self._contacts: list[Floats] = []

    def begin_word(self, n_frames: int) -> None:
        """Say that the next frames are a word: a path that leaves the stage is bent back in it."""
        before = self._travelled[0] if self._travelled else self._pos_m
        window = np.hanning(n_frames + 2)[1:-1]
        angle = steer_rad(self._pos_m, self._pos_m - before)
        self._steer = (angle * window / max(window.sum(), 1e-9)).tolist()

    def add(self, row: NDArray[np.floating]) -> None:
        """Add the next pose row; the frame before it is placed on the stage."""
        pose = np.asarray(row, np.float64)
        self._turns.append(float(pose[3]) if self._row is not None else 0.0)
        if self._row is not None:
            self._place(self._row)
        self._row = pose

    def _place(self, row: Floats) -> None:
        """Place the pose before the last one added: the control point of its frame."""
        if self._root_pos_m:
            shift = rot.rotate(rot.about_y(self._heading), np.array([row[0], 0.0, row[1]]))
            self._pos_m = self._pos_m + shift
            turns = self._turns[-_PAST_FRAMES - 2 :]
            weights = _HEADING_WEIGHTS[-len(turns) :]
            self._heading += float(np.dot(turns, weights) / weights.sum())
            self._heading += self._steer.pop(0) if self._steer else 0.0
        self._turns = self._turns[-_PAST_FRAMES - 2 :]
        self._travelled = [*self._travelled[-STEER_FRAMES:], self._pos_m]
        quat = rot.normalize(row[ROOT_DIM:-N_FEET].reshape(-1, 4))
        if self._quats:
            quat = np.where(np.sum(quat * self._quats[-1], axis=-1, keepdims=True) < 0, -quat, quat)
        control = (self._pos_m + row[2] * _UP, np.array(self._heading), quat, row[-N_FEET:])
        points = (self._root_pos_m, self._headings, self._quats, self._contacts)
        for values, value in zip(points, control, strict=True):
            values += [value] * (1 if values else 2)  # the first one is repeated before frame 0
            del values[:-4]

    def between(self, since: Floats) -> Poses:
        """Poses at shares (T,) of the frame that the last four control points lie around, 0 to 1."""
        weights = _spline_weights(since)  # (T, 4)
        quat = rot.normalize(np.einsum("tc,cjd->tjd", weights, np.stack(self._quats)))
        heading = weights @ np.array(self._headings)
        quat[:, 0] = rot.multiply(rot.about_y(heading), quat[:, 0])
        return Poses(weights @ np.stack(self._root_pos_m), quat, weights @ np.stack(self._contacts))


def _spline_weights(since: Floats) -> Floats:
    """Weights (T, 4) of the control points around a frame of a uniform cubic B-spline."""
    left = 1.0 - since
    return np.stack(
        [
            left**3,
            3.0 * since**3 - 6.0 * since**2 + 4.0,
            3.0 * left**3 - 6.0 * left**2 + 4.0,
            since**3,
        ],
        axis=1,
    ) / 6.0  # fmt: skip
