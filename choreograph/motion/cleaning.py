"""Cleaning of recorded motion: removal of jumps, bridging of gaps, smoothing of fitted rotations."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import scipy
from numpy.lib.stride_tricks import sliding_window_view

from choreograph.core.numerics import Floats
from choreograph.motion import rotations as rot
from choreograph.motion.bone_map import joint_roles
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import Skeleton

# Frames are replaced by a smooth path between the frames before and after, with their velocities.


Span = tuple[int, int]  # first frame, and the one after the last


def bridged(values: Floats, spans: Iterable[Span]) -> Floats:
    """`values` (T, ...) with the frames of each span replaced by a cubic between the frames around it.

    The cubic starts and ends with the velocities given by the two frames nearest to the span on either side.
    All other frames stay exactly as they are. A span with less than two frames before or after it is not
    changed. Spans must not touch one another.
    """
    path = np.array(values, np.float64)
    for start, stop in spans:
        if start < 2 or stop > len(path) - 2:
            continue
        ends, beyond = values[[start - 1, stop]], values[[start - 2, stop + 1]]
        rates = (ends - beyond) * np.array([1.0, -1.0]).reshape(-1, *[1] * (values.ndim - 1))
        curve = scipy.interpolate.CubicHermiteSpline([start - 1, stop], ends, rates)
        path[start:stop] = curve(np.arange(start, stop))
    return path


def bridged_rotations(quat: Floats, spans: Iterable[Span]) -> Floats:
    """Rotations (T, ..., 4) bridged as by `bridged`, by the shorter arc. Sign-continuous if `quat` is."""
    turns = np.array(quat, np.float64)
    for start, stop in spans:
        if start < 2 or stop > len(turns) - 2:
            continue
        around = rot.make_continuous(turns[[start - 2, start - 1, stop, stop + 1]])  # (4, ..., 4)
        gap = np.zeros((stop - start, *turns.shape[1:]))
        inside = bridged(np.concatenate([around[:2], gap, around[2:]]), [(2, 2 + stop - start)])
        turns[start:stop] = rot.normalize(inside[2:-2])
    return rot.make_continuous(turns)


# Jumps caused by markers: a limb that leaves its path for a few frames is put back on it.


_OUT_AND_BACK_M_S2 = 180.0  # more than twice the acceleration of the fastest kicks and arms of real takes
_LONGEST_S = 0.05  # three frames at 60 fps, one at 25
_SHORTER = 0.8  # a jump of fewer frames is preferred unless one more frame lowers the rest to this share
# If a joint below one of these leaves its path, the rotations from that one on are replaced.
_LIMBS = {"left_hip": "legs", "right_hip": "legs", "left_shoulder": "arms", "right_shoulder": "arms",
          "neck": "head"}  # fmt: skip


def without_jumps(motion: Motion) -> tuple[Motion, int, tuple[str, ...]]:
    """The motion without jumps of a few frames, their number, and their parts, such as "arms" or "body".

    In a jump, a joint leaves its path for at most 0.05 s or one frame. It is then farther from both the
    straight and the smooth path (see `bridged`) between the frames before and after than a limb can move out
    and back in that time. This is 2.5 cm in one frame at 60 fps, 10 cm in three frames, and 14 cm in one
    frame at 25 fps. The rotations of the limb are replaced there, or those of the whole body and the root if
    it is not a limb alone. All other frames and joints stay exactly as they are.

    Raises `ParameterError` if the rig's joint names are unknown.
    """
    limb_of = _limb_of_joints(motion.skeleton)
    jumps = _jumps(motion.joint_pos_m(), motion.fps)
    root_pos_m, local_quat = np.array(motion.root_pos_m), np.array(motion.local_quat)
    found: set[str] = set()
    for span, joints in jumps:
        limbs = {limb_of[joint] for joint in joints}
        if "" in limbs:
            root_pos_m = bridged(root_pos_m, [span])
            local_quat = bridged_rotations(local_quat, [span])
            found.add("body")
            continue
        for limb in limbs:
            first = joint_roles(motion.skeleton)[limb]
            turned = [first, *(joint for joint, name in enumerate(limb_of) if name == limb)]
            local_quat[:, turned] = bridged_rotations(local_quat[:, turned], [span])
            found.add(_LIMBS[limb])
    if not jumps:
        return motion, 0, ()
    return replace(motion, root_pos_m=root_pos_m, local_quat=local_quat), len(jumps), tuple(sorted(found))


def _limb_of_joints(skeleton: Skeleton) -> list[str]:
    """For each joint the limb whose rotations alone determine it, a key of `_LIMBS`, or ""."""
    names = {index: role for role, index in joint_roles(skeleton).items() if role in _LIMBS}
    limbs = [""]
    for joint in range(1, skeleton.n_joints):
        parent = int(skeleton.parents[joint])
        limbs.append(names.get(parent, limbs[parent]))
    return limbs


def _jumps(pos_m: Floats, fps: float) -> list[tuple[Span, list[int]]]:
    """Spans of frames in which joints have left their path, and those joints, in order of time."""
    found = []  # score, span, joints
    for length in range(1, max(1, round(_LONGEST_S * fps)) + 1):
        off_m = _off_path_m(pos_m, length)  # (N, J), the first for a span that starts at frame 2
        limit_m = _OUT_AND_BACK_M_S2 * ((length + 1) / fps) ** 2 / 8
        for row in np.flatnonzero((off_m > limit_m).any(axis=1)):
            joints = np.flatnonzero(off_m[row] > limit_m).tolist()
            found.append((off_m[row].max() * _SHORTER ** (length - 1), (row + 2, row + 2 + length), joints))
    taken = np.zeros(len(pos_m) + 1, bool)
    jumps = []
    for _, (start, stop), joints in sorted(found, key=lambda jump: -jump[0]):
        # Not if a jump is among the frames that determine the path, since the path is wrong there.
        if not taken[start - 2 : stop + 2].any():
            taken[start:stop] = True
            jumps.append(((int(start), int(stop)), joints))
    return sorted(jumps, key=lambda jump: jump[0])


def _off_path_m(pos_m: Floats, length: int) -> Floats:
    """Largest distance of each joint to the nearer of the paths that bridge `length` frames, (N, J)."""
    if len(pos_m) < length + 4:
        return np.zeros((0, pos_m.shape[1]))
    windows = np.moveaxis(sliding_window_view(pos_m, length + 4, axis=0), -1, 0)  # (length + 4, N, J, 3)
    ends, rates = windows[[1, -2]], np.stack([windows[1] - windows[0], windows[-1] - windows[-2]])
    smooth = scipy.interpolate.CubicHermiteSpline([0, length + 1], ends, rates)(np.arange(1, length + 1))
    straight = np.linspace(ends[0], ends[1], length + 2)[1:-1]
    off_m = [np.linalg.norm(windows[2:-2] - path, axis=-1).max(axis=0) for path in (smooth, straight)]
    return np.minimum(*off_m)


# Smoothing of fitted rotations: flips are bridged, and weighted angles are smoothed over time.


_FLIP_RAD = 1.4  # between two frames


def bridge_flips(local_quat: Floats, half: int) -> Floats:
    """Rotations (T, J, 4) with impossible jumps replaced by slerp from `half` frames before to after.

    Changes `local_quat` in place.
    """
    n_frames = len(local_quat)
    dot = np.abs(np.sum(local_quat[1:] * local_quat[:-1], axis=-1))  # (T-1, J)
    jumps = 2.0 * np.arccos(np.clip(dot, 0.0, 1.0)) > _FLIP_RAD
    for joint in np.flatnonzero(jumps.any(axis=0)):
        jumped = np.convolve(jumps[:, joint], np.ones(2 * half), mode="same") > 0
        edges = np.flatnonzero(
            np.diff(np.concatenate([[False], jumped[: n_frames - 1], [False]]).astype(int))
        )
        for start, stop in zip(edges[::2], edges[1::2], strict=True):  # frames start and stop are valid
            weight = np.linspace(0.0, 1.0, stop - start + 1)
            ends = local_quat[[start, stop], joint]
            local_quat[start : stop + 1, joint] = rot.slerp(ends[:1], ends[1:], weight)
    return rot.make_continuous(local_quat)


def smoothed_angle(cos: Floats, sin: Floats, smoothing: float) -> Floats:
    """Smoothed angles (T,) of vectors (cos, sin), each weighted by its length.

    Least squares in the plane: sum of length * |z - unit vector|² + smoothing * |dz/dt|².
    """
    weight = np.hypot(cos, sin)
    n = len(weight)
    link = np.full(n, smoothing)
    bands = np.zeros((2, n))  # upper form: off-diagonal, diagonal
    bands[1] = weight + 1e-9
    bands[1, 1:] += link[1:]
    bands[1, :-1] += link[1:]
    bands[0, 1:] = -link[1:]
    smooth = scipy.linalg.solveh_banded(bands, np.stack([cos, sin], axis=-1))  # (T, 2)
    return np.arctan2(smooth[:, 1], smooth[:, 0])
