"""Feet on the floor: its height under a take, contacts of the feet with it, and locking of feet in contact.

`lock_feet` corrects the legs of a whole motion, `FootLockStream` those of frames that come one after another.
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats, frame_blocks
from choreograph.core.timebase import seconds_to_frames
from choreograph.motion import rotations as rot
from choreograph.motion.body import BODY_JOINTS, body_indices, body_pos_m, checked_body_pos_m
from choreograph.motion.bone_map import joint_roles, rest_pose_is_upright
from choreograph.motion.kinematics import ancestors, flexion_rad, forward, move_limb, to_local
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import Skeleton

# Floor height under a take, from the lowest points that its feet return to.


_LOW_PERCENT = 10.0  # of frames whose lower foot may lie below the floor (noise)
_WINDOW_S = 2.0  # longer than a jump, shorter than the drift
_SMOOTH_S = 0.5


def sole_pos_m(motion: Motion) -> Floats:
    """Sole points of both feet (T, F, 3) in metres. See `foot_sole_pos_m`."""
    pos_m, global_quat = forward(motion.skeleton, motion.root_pos_m, motion.local_quat)
    feet = [foot_sole_pos_m(motion.skeleton, pos_m, global_quat, side) for side in ("left", "right")]
    return np.concatenate(feet, axis=1)


def foot_sole_pos_m(skeleton: Skeleton, pos_m: Floats, global_quat: Floats, side: str) -> Floats:
    """Sole points of one foot (T, F, 3) in metres, which touch the floor when the foot stands flat.

    These are the ball of the foot, and heel and toe tip where the skeleton has them as end sites. On a rig
    without any of them, it is the ankle. Each is lowered by its height above the sole. Heights are taken in
    the rest pose or, if that is not upright (some rigs lay all bones along one axis), in the motion's lowest
    frames. `pos_m` (T, J, 3) and `global_quat` (T, J, 4) are world positions and rotations.

    Raises `ParameterError` if the rig's joint names are unknown.
    """
    roles = joint_roles(skeleton)
    rest_m = skeleton.rest_pos_m()
    ankle, ball = roles[f"{side}_ankle"], roles.get(f"{side}_foot")
    foot_joints = [ankle] if ball is None else [ankle, ball]
    points = [] if ball is None else [pos_m[:, ball]]
    heights = [] if ball is None else [rest_m[ball, 1]]
    for tip in np.flatnonzero(np.isin(skeleton.tip_parents, foot_joints)):
        parent, offset = skeleton.tip_parents[tip], skeleton.tips_m[tip]
        points.append(pos_m[:, parent] + rot.rotate(global_quat[:, parent], offset))
        heights.append(rest_m[parent, 1] + offset[1])
    if not points:
        points, heights = [pos_m[:, ankle]], [rest_m[ankle, 1]]
    foot_m = np.stack(points, axis=1)  # (T, F, 3)
    heights_m = (
        np.array(heights)
        if rest_pose_is_upright(skeleton)
        else np.percentile(foot_m[..., 1], _LOW_PERCENT, axis=0)
    )
    clearance = heights_m - heights_m.min()  # (F,)
    return foot_m - clearance[:, None] * [0.0, 1.0, 0.0]  # (T, F, 3)


def estimate_floor_m(foot_pos_m: Floats) -> float:
    """Height of the floor in metres, one value for the take.

    `foot_pos_m` (T, F, 3) are points of the feet that all have the same height when a foot stands on the
    floor. The lowest point of a frame is on the floor most of the time. Its low percentile is robust to jumps
    (frames that are much higher) and noise (a few frames that are much lower).

    Raises `ParameterError` if there is no point or a value is not finite.
    """
    return float(np.percentile(_lowest(foot_pos_m), _LOW_PERCENT))


def track_floor_m(foot_pos_m: Floats, fps: float) -> Floats:
    """Height of the floor at each frame, (T,) metres, for captures with vertical drift.

    The points are as for `estimate_floor_m`. The result is smooth, so subtracting it adds no jerk.

    Raises `ParameterError` if there is no point or a value is not finite.
    """
    lowest = _lowest(foot_pos_m)
    window = max(1, min(round(_WINDOW_S * fps), len(lowest)))
    envelope = scipy.ndimage.percentile_filter(lowest, _LOW_PERCENT * 2, size=window, mode="nearest")
    return scipy.ndimage.gaussian_filter1d(envelope, _SMOOTH_S * fps, mode="nearest")


def _lowest(foot_pos_m: Floats) -> Floats:
    foot_pos_m = np.asarray(foot_pos_m, np.float64)
    if foot_pos_m.ndim != 3 or foot_pos_m.shape[-1] != 3 or 0 in foot_pos_m.shape:
        raise ParameterError(f"expected foot points (T, F, 3), got {foot_pos_m.shape}")
    if not np.isfinite(foot_pos_m).all():
        raise ParameterError("expected finite foot positions, got nan or infinity")
    return foot_pos_m[..., 1].min(axis=1)  # (T,)


# Foot contacts with the floor, from the height and speed of the foot joints.


CONTACT_JOINTS = ("left_ankle", "left_foot", "right_ankle", "right_foot")

FLOOR_PERCENT = 10.0  # of frames: a joint's height while its foot is on the floor
_LOW_M, _LOW_WIDTH_M = 0.045, 0.007  # above that height, where contact and no contact are equally likely
_SLOW_M_S = 0.4  # at that speed the confidence is halved
_CONTACT_SMOOTH_S = 0.04  # against noise in the speed and flickering contacts


def foot_contacts(body_pos_m: NDArray[np.floating], fps: float) -> NDArray[np.float64]:
    """Contact confidence of each of `CONTACT_JOINTS`, (T, 4) from 0 to 1. Values above 0.5 are contacts.

    The columns are left ankle (heel), left foot (ball), right ankle, right foot of body positions
    (T, 21, 3) in metres at any rate `fps`. The confidence is a smooth function of height and speed. With a
    hard threshold, foot locking would switch on and off within a frame.

    Raises `ParameterError` if the shape is wrong or a value is not finite.
    """
    pos = checked_body_pos_m(body_pos_m, fps)
    feet = pos[:, [BODY_JOINTS.index(name) for name in CONTACT_JOINTS]]  # (T, 4, 3)
    return contacts_above(feet, np.percentile(feet[..., 1], FLOOR_PERCENT, axis=0), fps)


def contacts_of(motion: Motion) -> Floats:
    """`foot_contacts` (T, 4) of a motion, one joint after another, since those of a long dance are large."""
    feet_m = body_pos_m(motion, CONTACT_JOINTS)  # (T, 4, 3)
    floor_m = np.percentile(feet_m[..., 1], FLOOR_PERCENT, axis=0)
    parts = [contacts_above(feet_m[:, [joint]], floor_m[[joint]], motion.fps) for joint in range(4)]
    return np.concatenate(parts, axis=1)


def contacts_above(
    feet: NDArray[np.float64], floor_m: NDArray[np.float64], fps: float
) -> NDArray[np.float64]:
    """`foot_contacts` (T, 4) from these joints alone (T, 4, 3), with the height of each in contact, (4,)."""
    height = feet[..., 1] - floor_m  # (T, 4)
    sigma = _CONTACT_SMOOTH_S * fps
    smooth = scipy.ndimage.gaussian_filter1d(feet, sigma, axis=0, mode="nearest")
    step = np.gradient(smooth, axis=0) if len(feet) > 1 else np.zeros_like(feet)
    speed = np.linalg.norm(step, axis=-1) * fps  # (T, 4)
    confidence = scipy.special.expit((_LOW_M - height) / _LOW_WIDTH_M) / (1.0 + (speed / _SLOW_M_S) ** 4)
    contacts: Floats = scipy.ndimage.gaussian_filter1d(confidence, sigma, axis=0, mode="nearest")
    return contacts.clip(0.0, 1.0)


def step_counts(
    body_pos_m: NDArray[np.floating], fps: float, start_frames: NDArray[np.integer], n_frames: int
) -> NDArray[np.int64]:
    """Number of steps (N,) within `n_frames` from each of `start_frames` (N,).

    A step is the beginning of a contact of a foot, by heel or ball. The other arguments and the errors are
    those of `foot_contacts`.
    """
    contacts = foot_contacts(body_pos_m, fps)
    stands = np.maximum(contacts[:, ::2], contacts[:, 1::2]) > 0.5  # (T, foot)
    began = (stands[1:] & ~stands[:-1]).sum(axis=1)
    steps = np.concatenate([[0, 0], np.cumsum(began)])[: len(stands) + 1]  # before each frame, and the end
    first = np.clip(start_frames, 0, len(stands))
    return steps[np.minimum(first + n_frames, len(stands))] - steps[first]


# Foot locking: corrections of the legs alone keep feet in contact in place.


SIDES = ("left", "right")
_RETURN_S = 1.0  # a shifted foot returns to its own path within it. Longer contacts may drift
TAKE_SHIFT_S = 0.2  # a shift comes and goes within it. Shorter ones add motion beats that were not danced
DANCE_SHIFT_S = 0.3  # for a dance of takes whose feet are locked already, where less is left to do
_ORDER = 3  # the derivative of the shift that is kept small: jerk
_STRAIGHT_RAD, _WRONG_RAD = 0.12, 0.25  # bent the wrong way: the most of recorded legs, and more than any
_LIFT_S = 0.15  # to each side, for a foot that would go through the floor


def lock_feet(
    motion: Motion,
    contacts: NDArray[np.floating] | NDArray[np.bool_] | None = None,
    *,
    floor_m: float = 0.0,
    shift_s: float | Floats = TAKE_SHIFT_S,
    feet_shift_m: Floats | None = None,
) -> Motion:
    """The motion with its feet locked where they are in contact, as far as that adds no jerk.

    Parameters
    ----------
    motion : on any rig whose joints are known by name
    contacts : float or bool array (T, 4)   contact confidence, 0 to 1, of left ankle, left foot (ball),
                                            right ankle and right foot, by default from `foot_contacts`
    floor_m : float                         height of the floor
    shift_s : float or float array (T,)     time over which a foot's shift comes and goes
    feet_shift_m : float array (T, 2, 3)    shifts of left and right foot to apply before, smooth in time

    Feet keep their world rotation, so a flat foot stays flat, and no point of a sole goes through the
    floor. The root stays where it is, since moving the whole body adds motion beats. A leg that is too
    short reaches as far as it can. ChoreoGraph does not lock feet.

    Raises `ParameterError` if shapes disagree, a contact is outside 0 to 1, or the rig's names are unknown.
    """
    locked = replace(motion, local_quat=motion.local_quat.copy())
    lock_feet_in_place(locked, contacts, shift_s, floor_m=floor_m, feet_shift_m=feet_shift_m)
    return locked


def lock_feet_in_place(
    motion: Motion,
    contacts: NDArray[np.floating] | NDArray[np.bool_] | None = None,
    shift_s: float | Floats = TAKE_SHIFT_S,
    *,
    floor_m: float = 0.0,
    feet_shift_m: Floats | None = None,
) -> None:
    """As `lock_feet`, but it changes the rotations of `motion`."""
    skeleton, roles = motion.skeleton, joint_roles(motion.skeleton)
    blocks = list(frame_blocks(motion.n_frames))  # all joints of a long motion are large

    def world(block: slice) -> tuple[Floats, Floats]:
        return forward(skeleton, motion.root_pos_m[block], motion.local_quat[block])

    if contacts is None:
        contacts = contacts_of(motion)
    confidence: Floats = np.asarray(contacts, np.float64)
    if confidence.shape != (motion.n_frames, 4):
        raise ParameterError(f"expected contacts ({motion.n_frames}, 4), got {confidence.shape}")
    if not ((confidence >= 0) & (confidence <= 1)).all():
        raise ParameterError("expected contacts from 0 to 1, got values outside")
    ease = lift_frames(motion.fps)
    targets = {}
    given_m = np.zeros((motion.n_frames, 2, 3)) if feet_shift_m is None else feet_shift_m
    feet = zip(*([_of_foot(skeleton, roles, side, *world(b)) for side in SIDES] for b in blocks), strict=True)
    for index, (side, of_blocks) in enumerate(zip(SIDES, feet, strict=True)):
        foot_m, lowest_m, wrong = (np.concatenate(parts) for parts in zip(*of_blocks, strict=True))
        given = given_m[:, index]
        points_m = foot_m + given[:, None]  # (T, 2, 3)
        shift = locking_shift(points_m, confidence[:, 2 * index : 2 * index + 2], motion.fps, shift_s)
        shift[:, 1] = lift(lowest_m + given[:, 1], floor_m, ease)
        shift += given
        targets[side] = foot_m[:, 0] + shift * (1.0 - smooth_cover(wrong, ease))[:, None]
    local_quat = motion.local_quat
    for block in blocks:
        pos_m, global_quat = world(block)
        for side, target in targets.items():
            move_leg(skeleton, roles, side, pos_m, global_quat, target[block])
        local_quat[block] = to_local(skeleton, global_quat)
    rot.make_continuous(local_quat, out=local_quat)


def _of_foot(
    skeleton: Skeleton, roles: dict[str, int], side: str, pos_m: Floats, global_quat: Floats
) -> tuple[Floats, Floats, Floats]:
    """Ankle and ball of a foot (T, 2, 3), its lowest height (T,), and how wrong its knee is bent (T,)."""
    ankle = roles[f"{side}_ankle"]
    return (
        pos_m[:, [ankle, roles.get(f"{side}_foot", ankle)]],
        foot_sole_pos_m(skeleton, pos_m, global_quat, side)[..., 1].min(axis=1),
        wrong_knee(skeleton, roles, side, pos_m, global_quat),
    )


def lift_frames(fps: float) -> int:
    """Number of frames, to each side, over which a foot is lifted or released."""
    return max(2, round(_LIFT_S * fps))


def locking_shift(
    points_m: Floats, contacts: Floats, fps: float, shift_s: float | Floats, given_m: Floats | None = None
) -> Floats:
    """The shift of a foot in each frame, (T, 3): the smoothest small shift that stops it in contacts.

    `points_m` (T, P, 3) are points of the foot, and `contacts` (T, P) their contact confidence. With the
    velocities v of the points, the shift d minimises the sum of contact * |v + d'|^2 + a * |d|^2
    + b * |third derivative of d|^2. This is one banded system, so that no correction starts or stops at a
    frame. `given_m` (N, 3) are the shifts of the first N frames if they are already fixed.
    """
    n_frames = len(points_m)
    if n_frames <= _ORDER:
        return np.zeros((n_frames, 3))
    confidence = np.minimum(contacts[1:], contacts[:-1])  # (T-1, P)
    pull = _RETURN_S**-2
    bands = np.zeros((_ORDER + 1, n_frames))
    bands[0] = pull
    _add_differences(bands, confidence.sum(axis=1) * fps**2, 1)
    bending = np.broadcast_to(pull * (np.asarray(shift_s) * fps) ** (2 * _ORDER), n_frames)
    _add_differences(bands, 0.5 * (bending[1:-2] + bending[2:-1]), _ORDER)
    steps = np.einsum("tp,tpi->ti", confidence, np.diff(points_m, axis=0)) * fps**2  # (T-1, 3)
    wanted = np.diff(steps, axis=0, prepend=0.0, append=0.0)  # (T, 3)
    if given_m is None:
        return scipy.linalg.solveh_banded(bands, wanted, lower=True)
    n_given = len(given_m)
    for below in range(1, _ORDER + 1):  # the terms of given shifts in the equations of later frames
        for given in range(max(0, n_given - below), n_given):
            wanted[given + below] -= bands[below, given] * given_m[given]
    rest = scipy.linalg.solveh_banded(bands[:, n_given:], wanted[n_given:], lower=True)
    return np.concatenate([given_m, rest])


def _add_differences(bands: Floats, weights: Floats, order: int) -> None:
    """Add the sum of weights * (difference of that order)^2 to a symmetric matrix in lower bands."""
    taps = np.diff(np.eye(1, 2 * order + 1, order), n=order)[0]  # 1, -order, ...
    for i, a in enumerate(taps):
        for j, b in enumerate(taps[i:], start=i):
            bands[j - i, i : i + len(weights)] += weights * a * b


def lift(lowest_m: Floats, floor_m: float, ease: int) -> Floats:
    """The lift of a foot, (T,), with which the lowest point of its sole (T,) is not under the floor."""
    return smooth_cover(np.maximum(floor_m - lowest_m, 0.0), ease)


def wrong_knee(
    skeleton: Skeleton, roles: dict[str, int], side: str, pos_m: Floats, global_quat: Floats
) -> Floats:
    """How much the knee is bent the wrong way, (T,) from 0 to 1. At 1, the foot is not shifted.

    A leg may swing through straight far to the wrong side, as fast ones do in transitions. For a shifted
    foot, it would have to jump to the right side and back.
    """
    hip, knee, ankle = (roles[f"{side}_{part}"] for part in ("hip", "knee", "ankle"))
    hinge = _hinge_axis(skeleton, roles, global_quat[:, knee])
    backwards = -flexion_rad(pos_m[:, hip], pos_m[:, knee], pos_m[:, ankle], hinge)
    return np.clip((backwards - _STRAIGHT_RAD) / (_WRONG_RAD - _STRAIGHT_RAD), 0.0, 1.0)


def _hinge_axis(skeleton: Skeleton, roles: dict[str, int], knee_quat: Floats) -> Floats:
    """World axis (T, 3) of a positive bend of a knee with world rotation `knee_quat` (T, 4)."""
    rest_m = skeleton.rest_pos_m()
    left = rest_m[roles["left_hip"]] - rest_m[roles["right_hip"]]
    return rot.rotate(knee_quat, left / np.linalg.norm(left))


def smooth_cover(amount: Floats, ease: int) -> Floats:
    """A smooth curve (T,) that is not below `amount` anywhere, up to the tails of its smoothing."""
    if not amount.any():
        return amount
    cover = scipy.ndimage.maximum_filter1d(amount, 2 * ease + 1)
    return scipy.ndimage.gaussian_filter1d(cover, ease / 2.0, mode="nearest")


def move_leg(
    skeleton: Skeleton, roles: dict[str, int], side: str, pos_m: Floats, global_quat: Floats, target: Floats
) -> None:
    """Rotate thigh and shin in `global_quat` (T, J, 4), but not the foot, to bring the ankle to `target`."""
    hip, knee, ankle = (roles[f"{side}_{part}"] for part in ("hip", "knee", "ankle"))
    hinge = _hinge_axis(skeleton, roles, global_quat[:, knee])
    move_limb(skeleton, (hip, knee, ankle), pos_m, global_quat, target, hinge)


# Foot locking of a stream of frames, with a few frames of future.
#
# The same least-squares problem is solved repeatedly, over the known frames and 0.3 s beyond them. No contact
# is assumed in these 0.3 s, so that a shift has time to end. Shifts of earlier frames are given, and only the
# first frames of a solution are used. The less future is known, the shorter `shift_s` has to be. With 0.1 s
# of future, a shift within 0.2 s comes too late for most steps.


_GIVEN = 3  # fixed shifts before the first free one, on which the third derivative depends
_BEYOND_S = 0.3
_FLOOR_S = 10.0  # of the past from which the height of a foot in contact is estimated


class FootLockStream:
    """Locks the feet of frames at `fps`, on a floor at height 0. `shift_s` is as in `lock_feet`."""

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
        """Rotations (T, J, 4) of the next frames, locked. All frames pushed after them are their future."""
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
        """The next targets of the ankle, (T, 3). `confidence` (1 + W, 2) begins with the frame before."""
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
        moved[:, 1] = lift(soles_m[..., 1].min(axis=1), 0.0, ease)[first : first + n_frames]
        wrong = wrong_knee(self._skeleton, self._roles, side, self._pos_m, self._quat)
        moved *= 1.0 - smooth_cover(wrong, ease)[first : first + n_frames, None]
        return self._pos_m[first : first + n_frames, ankle] + moved
