"""Feet that stand stay where they stand: corrections of the legs that keep the rest of the motion."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from choreograph.errors import ParameterError
from choreograph.motion import rotations as rot
from choreograph.motion.floor import foot_sole_pos_m
from choreograph.motion.ik import two_bone
from choreograph.motion.kinematics import forward, to_local
from choreograph.motion.motion import Motion
from choreograph.motion.rigs import joint_roles
from choreograph.motion.skeleton import Skeleton

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

SIDES = ("left", "right")
_ONTO_FLOOR_M = 0.06  # a standing foot is put on the floor from at most this height
_SAME_PLACE_M = 0.06  # a point that strays farther from its mean place slides on purpose, or steps
_STRETCH = 0.997  # of the leg's length: beyond, the root comes down to the foot


def lock_feet(motion: Motion, contacts: Bools, *, ease_s: float = 0.15, floor_m: float = 0.0) -> Motion:
    """The motion with every foot in contact held at one place for the whole contact.

    Parameters
    ----------
    motion : on any rig whose joints are known by name
    contacts : bool array (T, 4)   as `foot_contacts` gives them: left ankle, left foot, right ...
    ease_s : float                 time in which a correction comes and goes outside contacts
    floor_m : float                height of the floor

    A foot is held by its ball, or by its ankle where only that is at rest, at the place that needs
    the smallest corrections (the mean); a contact that strays is held in its still parts.
    Feet keep their world rotation, so a flat foot stays flat, and no point of a sole goes under the
    floor. If a leg is too short, the root comes down a little.

    Raises `ParameterError` if shapes disagree or the rig's names are unknown.
    """
    if contacts.shape != (motion.n_frames, 4):
        raise ParameterError(f"expected contacts ({motion.n_frames}, 4), got {contacts.shape}")
    if ease_s <= 0:
        raise ParameterError(f"expected ease_s above 0, got {ease_s}")
    skeleton, roles = motion.skeleton, joint_roles(motion.skeleton)
    pos_m, turns = forward(skeleton, motion.root_pos_m, motion.local_quat)
    ease = max(2, round(ease_s * motion.fps))
    targets = {}
    for index, side in enumerate(SIDES):
        soles = foot_sole_pos_m(skeleton, pos_m, turns, side)
        shift = _holding_shift(
            pos_m,
            roles,
            side,
            contacts[:, 2 * index : 2 * index + 2],
            ease,
            floor_m,
            soles[..., 1].min(axis=1),
        )
        lowest = (soles[..., 1] + shift[:, None, 1]).min(axis=1) - floor_m  # (T,)
        shift[:, 1] += _smooth_cover(np.maximum(-lowest, 0.0), ease)
        targets[side] = pos_m[:, roles[f"{side}_ankle"]] + shift
    drop = _root_drop(pos_m, roles, targets, ease)
    root_pos_m = motion.root_pos_m - drop[:, None] * [0.0, 1.0, 0.0]
    pos_m = pos_m - drop[:, None, None] * [0.0, 1.0, 0.0]
    for side, target in targets.items():
        _move_leg(skeleton, roles, side, pos_m, turns, target)
    return replace(motion, root_pos_m=root_pos_m, local_quat=rot.make_continuous(to_local(skeleton, turns)))


def _runs(flags: Bools) -> Iterator[tuple[int, int]]:
    """(start, stop) of the runs of true frames."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    yield from zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)


def _still_parts(start: int, stop: int, point: Floats, ease: int) -> Iterator[tuple[int, int, Floats]]:
    """The contact itself if the point stays near one place, else its parts around the quickest moment."""
    if stop - start < 2:
        return
    inside = point[start:stop, [0, 2]]
    if np.linalg.norm(inside - inside.mean(axis=0), axis=-1).max() <= _SAME_PLACE_M:
        yield start, stop, point
        return
    quickest = start + int(np.argmax(np.linalg.norm(np.diff(inside, axis=0), axis=-1)))
    yield from _still_parts(start, quickest + 1 - ease, point, ease)
    yield from _still_parts(quickest + 1 + ease, stop, point, ease)


def _holding_shift(
    pos_m: Floats,
    roles: dict[str, int],
    side: str,
    contacts: Bools,
    ease: int,
    floor_m: float,
    sole_y_m: Floats,
) -> Floats:
    """How far the foot is moved each frame, (T, 3): exact in contacts, eased outside."""
    ankle, ball = (
        pos_m[:, roles[f"{side}_ankle"]],
        pos_m[:, roles.get(f"{side}_foot", roles[f"{side}_ankle"])],
    )
    holds = [(start, stop, ball) for start, stop in _runs(contacts[:, 1])]
    taken = np.convolve(contacts[:, 1], np.ones(2 * ease + 1), mode="same")[: len(contacts)] > 0
    holds += [(start, stop, ankle) for start, stop in _runs(contacts[:, 0] & ~taken)]
    shift = np.zeros((len(pos_m), 3))
    held = np.zeros(len(pos_m), bool)
    for start, stop, point in [part for hold in holds for part in _still_parts(*hold, ease)]:
        place = point[start:stop].mean(axis=0)
        over = float(np.median(sole_y_m[start:stop])) - floor_m
        if over < _ONTO_FLOOR_M:
            place[1] -= over
        shift[start:stop] = place - point[start:stop]
        held[start:stop] = True
    return _eased(shift, held, ease)


def _eased(shift: Floats, held: Bools, ease: int) -> Floats:
    """Fill the frames that are not held: from one hold to the next, or down to nothing and up again.

    Cubic, with the slope that the correction has where a hold begins or ends, so speed never jumps.
    """
    n_frames = len(shift)
    for start, stop in list(_runs(~held)):
        before = (shift[start - 1], _slope(shift, start - 1, -1, held)) if start > 0 else None
        after = (shift[stop], _slope(shift, stop, 1, held)) if stop < n_frames else None
        if before and after and stop - start < 2 * ease:
            shift[start:stop] = _cubic(*before, *after, stop - start + 1)[1:-1]
            continue
        rest = np.zeros(3)
        if before:
            end = min(start + ease, stop)
            shift[start:end] = _cubic(*before, rest, rest, ease + 1)[1 : end - start + 1]
        if after:
            begin = max(stop - ease, start)
            shift[begin:stop] = _cubic(rest, rest, *after, ease + 1)[begin - stop - 1 : -1]
    return shift


def _slope(shift: Floats, frame: int, towards: int, held: Bools) -> Floats:
    """Change of the correction per frame at the end of a hold, from the frames inside it."""
    inside = frame + towards
    if not (0 <= inside < len(shift) and held[inside]):
        return np.zeros(3)
    return (shift[inside] - shift[frame]) * towards


def _cubic(p0: Floats, v0: Floats, p1: Floats, v1: Floats, steps: int) -> Floats:
    """Hermite curve (steps + 1, 3) between two places; speeds are per step."""
    t = np.linspace(0.0, 1.0, steps + 1)[:, None]
    return (
        (2 * t**3 - 3 * t**2 + 1) * p0
        + (t**3 - 2 * t**2 + t) * steps * v0
        + (3 * t**2 - 2 * t**3) * p1
        + (t**3 - t**2) * steps * v1
    )


def _smooth_cover(amount: Floats, ease: int) -> Floats:
    """A smooth curve (T,) that is nowhere below `amount`, up to the tails of its smoothing."""
    if not amount.any():
        return amount
    return gaussian_filter1d(maximum_filter1d(amount, 2 * ease + 1), ease / 2.0, mode="nearest")


def _root_drop(pos_m: Floats, roles: dict[str, int], targets: dict[str, Floats], ease: int) -> Floats:
    """How far the root comes down, (T,), so that both feet reach their places."""
    drop = np.zeros(len(pos_m))
    for side, target in targets.items():
        hip, knee, ankle = (pos_m[:, roles[f"{side}_{part}"]] for part in ("hip", "knee", "ankle"))
        full = np.linalg.norm(knee - hip, axis=-1) + np.linalg.norm(ankle - knee, axis=-1)
        reach = np.maximum(_STRETCH * full, np.linalg.norm(ankle - hip, axis=-1))
        away = target - hip
        flat = np.linalg.norm(away[:, [0, 2]], axis=-1)
        lowest_reach = np.sqrt(np.maximum(reach**2 - flat**2, 0.0))
        drop = np.maximum(drop, np.clip(-away[:, 1] - lowest_reach, 0.0, 0.1))
    return _smooth_cover(drop, ease)


def _move_leg(
    skeleton: Skeleton, roles: dict[str, int], side: str, pos_m: Floats, turns: Floats, target: Floats
) -> None:
    """Turn thigh and shin in `turns` (T, J, 4) to bring the ankle to `target`; the foot keeps its turn."""
    hip, knee, ankle = (roles[f"{side}_{part}"] for part in ("hip", "knee", "ankle"))
    rest_m = skeleton.rest_pos_m()
    left = rest_m[roles["left_hip"]] - rest_m[roles["right_hip"]]
    hinge = rot.rotate(turns[:, knee], left / np.linalg.norm(left))
    upper, lower = two_bone(pos_m[:, hip], pos_m[:, knee], pos_m[:, ankle], target, hinge)
    for joint in range(hip, skeleton.n_joints):
        path = _ancestors(skeleton, joint)
        if ankle in path or hip not in path:
            continue
        turns[:, joint] = rot.multiply(lower if knee in path else upper, turns[:, joint])


def _ancestors(skeleton: Skeleton, joint: int) -> list[int]:
    path = [joint]
    while skeleton.parents[path[-1]] >= 0:
        path.append(int(skeleton.parents[path[-1]]))
    return path
