"""From a plan to one motion: runs of seconds sampled from their takes, placed, joined."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from choreograph.blending.joins import apply_offset, crossfade, fading, inertial_offsets
from choreograph.blending.runs import Run
from choreograph.blending.stage import steer_rad
from choreograph.errors import ParameterError
from choreograph.motion import rotations as rot
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion
from choreograph.motion.pose import ground_pos_m, heading_rad
from choreograph.motion.sampling import sampled_smoothly
from choreograph.timebase import seconds_to_frames

Floats = NDArray[np.float64]
# take index, first and last instant wanted -> motion around them and the instant of its first frame
MotionReader = Callable[[str, float, float], tuple[Motion, float]]

BLENDINGS = ("inertial", "linear")
JOIN_S = {"inertial": 0.4, "linear": 0.25}  # inertial: to each side; linear: in all
_JOIN_SHARE = 0.5  # of a run may be blended at either end: a short one still is itself in its middle


def assemble(
    runs: Sequence[Run], read_motion: MotionReader, *, fps: float, duration_s: float, blending: str
) -> tuple[Motion, NDArray[np.float64]]:
    """The dance before its feet are locked, and the instants of its joins in seconds.

    Each run is turned about Y and shifted on the ground so that its body stands where the last one's
    stood at the join, and steered a little so that the dance stays on a stage (ours).
    `linear` is the paper's crossfade; `inertial` lets the difference of pose, speed and acceleration
    die away on both sides, so that neither motion is smeared. Short runs are joined in less time.

    Raises `ParameterError` for an unknown blending.
    """
    if blending not in BLENDINGS:
        raise ParameterError(f"expected a blending among {', '.join(BLENDINGS)}, got {blending!r}")
    margin = seconds_to_frames(JOIN_S[blending] + 0.05, fps)
    total = seconds_to_frames(runs[-1].stop_s, fps) if runs else 0
    root_out = np.empty((total, 3))
    quat_out: Floats | None = None
    previous: _Played | None = None
    for run in runs:
        played = _play(run, read_motion, fps, margin)
        if previous is not None:
            played = _placed(previous, played, fps)
        if quat_out is None:
            quat_out = np.empty((total, *played.quat.shape[1:]))
        first = played.first_frame + margin
        stop = seconds_to_frames(run.stop_s, fps)
        body = slice(margin, margin + stop - first)
        root_out[first:stop], quat_out[first:stop] = played.root[body], played.quat[body]
        if previous is not None:
            _join(previous, played, first, blending, fps, root_out, quat_out)
        previous = played
    if previous is None or quat_out is None:
        raise ParameterError("expected a plan of one second or more, got none")
    n_frames = max(1, seconds_to_frames(duration_s, fps))
    motion = Motion(previous.motion.skeleton, root_out, rot.make_continuous(rot.normalize(quat_out)), fps)
    joins_s = np.array([run.start_s for run in runs[1:]], np.float64)
    return motion.sliced(0, min(n_frames, total)), joins_s


@dataclass(frozen=True, eq=False)
class _Played:
    """A run at the dance's rate, with a margin of frames before and after it."""

    motion: Motion  # any frame of it: for skeleton and roles
    first_frame: int  # dance frame of row 0; negative in the margin before the dance
    root: Floats  # (T, 3)
    quat: Floats  # (T, J, 4)
    firm: bool  # see `Run`


def _play(run: Run, read_motion: MotionReader, fps: float, margin: int) -> _Played:
    """Sample a run at its warped times; beyond its ends the take plays on at the end's speed."""
    first = seconds_to_frames(run.start_s, fps) - margin
    source = run.source_s(np.arange(first, seconds_to_frames(run.stop_s, fps) + margin) / fps)
    motion, first_s = read_motion(run.take, float(source.min()), float(source.max()))
    played = sampled_smoothly(motion, (source - first_s) * motion.fps)
    return _Played(motion, first, played.root_pos_m, played.local_quat, run.firm)


def _placed(previous: _Played, played: _Played, fps: float) -> _Played:
    """`played` moved so that at the join its body stands and faces as the previous one's."""
    at = _join_row(played, previous)
    before = body_pos_m(_still(previous, at[1]))[0]
    after = body_pos_m(_still(played, at[0]))[0]
    end = body_pos_m(_still(played, len(played.root) - 1 - at[0]))[0]
    yaw = heading_rad(before) - heading_rad(after)
    travel_m = rot.rotate(rot.about_y(yaw), ground_pos_m(end) - ground_pos_m(after))
    share = min(1.0, (len(played.root) - 2 * at[0]) / fps)  # short runs come with many joins
    turn = rot.about_y(yaw + share * steer_rad(ground_pos_m(before), travel_m))
    shift = ground_pos_m(before) - rot.rotate(turn, ground_pos_m(after))
    quat = np.array(played.quat)
    quat[:, 0] = rot.multiply(turn, quat[:, 0])
    return replace(played, root=rot.rotate(turn, played.root) + shift, quat=quat)


def _join_row(played: _Played, previous: _Played) -> tuple[int, int]:
    """Rows of the join's frame in the new run and in the previous one."""
    margin = (previous.first_frame + len(previous.root) - played.first_frame) // 2
    frame = played.first_frame + margin
    return margin, frame - previous.first_frame


def _still(played: _Played, row: int) -> Motion:
    return Motion(
        played.motion.skeleton, played.root[row : row + 1], played.quat[row : row + 1], played.motion.fps
    )


def _join(
    a: _Played, b: _Played, frame: int, blending: str, fps: float, root_out: Floats, quat_out: Floats
) -> None:
    """Blend the frames around the join at `frame` of the output, where b is already written after a."""
    row_a, row_b = frame - a.first_frame, frame - b.first_frame
    share = _JOIN_SHARE / 2 if a.firm and b.firm else _JOIN_SHARE
    # Frames of each run without its margins that may be blended.
    room_a, room_b = (max(1, int(share * (len(run.root) - 2 * row_b))) for run in (a, b))
    # How much of the difference each side makes up for: a firm run none, if the other is not.
    part_a, part_b = (0.5, 0.5) if a.firm == b.firm else (float(b.firm), float(a.firm))
    if blending == "linear":
        whole = seconds_to_frames(JOIN_S["linear"], fps)
        first, stop = frame - min(int(part_a * whole), room_a), frame + min(int(part_b * whole), room_b)
        out = slice(max(0, first), min(len(root_out), stop))
        if out.start < out.stop:
            in_a = slice(out.start - a.first_frame, out.stop - a.first_frame)
            in_b = slice(out.start - b.first_frame, out.stop - b.first_frame)
            root_out[out], quat_out[out] = crossfade(a.root[in_a], a.quat[in_a], b.root[in_b], b.quat[in_b])
        return
    around_a, around_b = slice(row_a - 1, row_a + 2), slice(row_b - 1, row_b + 2)
    offsets = inertial_offsets(
        a.root[around_a], a.quat[around_a], b.root[around_b], b.quat[around_b], fps=fps
    )
    longest = seconds_to_frames(JOIN_S["inertial"], fps)
    if part_b > 0:
        length = min(longest, room_b)
        after = np.arange(frame, min(len(root_out), frame + length))
        _add(offsets, part_b * _FORWARDS, after, (after - frame) / fps, length / fps, root_out, quat_out)
    if part_a > 0:
        length = min(longest, room_a)
        before = np.arange(max(0, frame - length), frame)
        _add(offsets, part_a * _BACKWARDS, before, (frame - before) / fps, length / fps, root_out, quat_out)


_FORWARDS = np.array([1.0, 1.0, 1.0])
_BACKWARDS = np.array([-1.0, 1.0, -1.0])  # seen backwards in time the first derivative changes its sign


def _add(
    offsets: tuple[Floats, Floats],
    parts: Floats,
    frames: NDArray[np.int64],
    times_s: Floats,
    length_s: float,
    root_out: Floats,
    quat_out: Floats,
) -> None:
    """Add offsets of root (3, 3) and joints (3, J, 3), times `parts` (3,), fading away from the join."""
    root = fading(parts[:, None] * offsets[0], times_s, length_s)
    turn = fading(parts[:, None, None] * offsets[1], times_s, length_s)
    root_out[frames], quat_out[frames] = apply_offset(root_out[frames], quat_out[frames], root, turn)
