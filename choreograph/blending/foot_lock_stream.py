"""Foot locking of a motion that still goes on: `foot_locking`, with a few frames of future.

The same least squares are solved again and again, over the frames that are known and 0.3 s beyond them, in
which no contact is expected, so that a shift has time to go. Shifts of earlier frames are given; only the
first frames of a solution are used. The less future there is, the shorter `shift_s` has to be: with 0.1 s,
a shift within 0.2 s comes too late for most steps.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from choreograph.blending.foot_locking import (
    SIDES,
    lift,
    lift_frames,
    locking_shift,
    move_leg,
    smooth_cover,
    wrong_knee,
)
from choreograph.features.contacts import CONTACT_JOINTS, FLOOR_PERCENT, contacts_above
from choreograph.motion.body import body_indices
from choreograph.motion.floor import foot_sole_pos_m
from choreograph.motion.inverse_kinematics import ancestors
from choreograph.motion.kinematics import forward, to_local
from choreograph.motion.rigs import joint_roles
from choreograph.motion.skeleton import Skeleton
from choreograph.timebase import seconds_to_frames

Floats = NDArray[np.float64]

_GIVEN = 3  # shifts before the first free one: as many as the third derivative reaches back
_BEYOND_S = 0.3
_FLOOR_S = 10.0  # of the past that says how high a foot in contact is


class FootLockStream:
    """Locks the feet of frames that come in at `fps`, on a floor at height 0; `shift_s`: see `lock_feet`."""

    def __init__(self, skeleton: Skeleton, fps: float, shift_s: float) -> None:
        self._skeleton, self._fps, self._shift_s = skeleton, fps, shift_s
        self._roles = joint_roles(skeleton)
        self._joints = body_indices(skeleton, CONTACT_JOINTS)
        ends = [self._roles.get(f"{side}_foot", self._roles[f"{side}_ankle"]) for side in SIDES]
        self._legs = sorted({j for end in ends for j in ancestors(skeleton, end)} - {0})  # computed alone
        self._keep = 2 * lift_frames(fps)  # locked frames that are kept
        n = skeleton.n_joints
        self._pos_m, self._quat = np.zeros((0, n, 3)), np.zeros((0, n, 4))  # world, (W, J, ...)
        self._local_quat = np.zeros((0, n, 4))  # of frames not locked yet
        self._contacts = np.zeros((0, 4))  # (W, 4) predicted
        self._locked = 0  # of the frames kept
        self._heights: deque[Floats] = deque(maxlen=seconds_to_frames(_FLOOR_S, fps))
        self._confidence = np.zeros((1, 4))  # of the last locked frame
        self._shifts = {side: np.zeros((_GIVEN, 3)) for side in SIDES}

    def push(self, root_pos_m: Floats, local_quat: Floats, contacts: Floats) -> None:
        """Add frames: root (T, 3), rotations (T, J, 4), predicted contacts of both feet (T, 2)."""
        pos_m, quat = forward(self._skeleton, root_pos_m, local_quat, self._legs)
        self._local_quat = np.concatenate([self._local_quat, local_quat])
        self._pos_m = np.concatenate([self._pos_m, pos_m])
        self._quat = np.concatenate([self._quat, quat])
        self._contacts = np.concatenate([self._contacts, contacts.repeat(2, axis=1)])
        self._heights.extend(pos_m[:, self._joints, 1])

    def pop(self, n_frames: int) -> Floats:
        """Rotations (T, J, 4) of the next frames, locked; all frames pushed after them are their future."""
        first, stop = self._locked, self._locked + n_frames
        floor_m = np.percentile(np.array(self._heights), FLOOR_PERCENT, axis=0)  # (4,)
        stands = contacts_above(self._pos_m[:, self._joints], floor_m, self._fps)
        confidence = np.concatenate([self._confidence, np.sqrt(stands * self._contacts)[first:]])
        quat = self._quat[first:stop].copy()
        for index, side in enumerate(SIDES):
            target = self._target_m(side, confidence[:, 2 * index : 2 * index + 2], n_frames)
            move_leg(self._skeleton, self._roles, side, self._pos_m[first:stop], quat, target)
        self._confidence = confidence[n_frames : n_frames + 1]
        drop = max(0, stop - self._keep)
        self._pos_m, self._quat = self._pos_m[drop:], self._quat[drop:]
        self._contacts, self._locked = self._contacts[drop:], stop - drop
        locked, self._local_quat = self._local_quat[:n_frames].copy(), self._local_quat[n_frames:]
        locked[:, self._legs] = to_local(self._skeleton, quat)[:, self._legs]
        return locked

    def _target_m(self, side: str, confidence: Floats, n_frames: int) -> Floats:
        """Where the ankle shall be next, (T, 3); `confidence` (1 + W, 2) is from the frame before on."""
        ankle, first, ease = self._roles[f"{side}_ankle"], self._locked, lift_frames(self._fps)
        points_m = self._pos_m[:, [ankle, self._roles.get(f"{side}_foot", ankle)]]  # (W, 2, 3)
        beyond = seconds_to_frames(_BEYOND_S, self._fps)
        before = points_m[max(first - 1, 0)]
        known = np.concatenate(
            [np.stack([before] * _GIVEN), points_m[first:], np.stack([points_m[-1]] * beyond)]
        )
        contacts = np.pad(confidence, ((_GIVEN - 1, beyond), (0, 0)))
        shift = locking_shift(known, contacts, self._fps, self._shift_s, self._shifts[side])
        self._shifts[side] = shift[n_frames : n_frames + _GIVEN]
        moved = shift[_GIVEN : _GIVEN + n_frames].copy()
        soles_m = foot_sole_pos_m(self._skeleton, self._pos_m, self._quat, side)
        moved[:, 1] = lift(soles_m, 0.0, ease)[first : first + n_frames]
        wrong = wrong_knee(self._skeleton, self._roles, side, self._pos_m, self._quat)
        moved *= 1.0 - smooth_cover(wrong, ease)[first : first + n_frames, None]
        return self._pos_m[first : first + n_frames, ankle] + moved
