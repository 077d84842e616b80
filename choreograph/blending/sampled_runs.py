"""A run sampled at the dance's rate, put in its place, and joined to the one before."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from choreograph.blending.runs import Run
from choreograph.blending.stage import steer_rad
from choreograph.blending.transitions import apply_offset, crossfade, fading, inertial_offsets
from choreograph.config import TRANSITION_LENGTHS_S
from choreograph.motion import rotations as rot
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion
from choreograph.motion.pose import ground_pos_m, heading_rad
from choreograph.timebase import seconds_to_frames

Floats = NDArray[np.float64]
# take, first and last instant wanted -> motion around them and the instant of its first frame
MotionReader = Callable[[str, float, float], tuple[Motion, float]]

_JOIN_SHARE = 0.5  # of a run may be blended at either end: a short one still is itself in its middle


@dataclass(frozen=True, eq=False)
class SampledRun:
    """A run at the dance's rate, with a margin of frames before and after it."""

    motion: Motion  # any frame of it: for skeleton and roles
    first_frame: int  # dance frame of row 0; negative in the margin before the dance
    start: int  # dance frame where the run begins,
    stop: int  # and the one after its last
    root: Floats  # (T, 3)
    quat: Floats  # (T, J, 4)
    locked: bool  # see `Run`,
    transition_s: float | None  # and there

    def rows(self, first: int, stop: int) -> slice:
        """The rows of dance frames."""
        return slice(first - self.first_frame, stop - self.first_frame)

    @cached_property
    def bodies_m(self) -> Floats:
        """The body in every row, (T, 21, 3)."""
        return body_pos_m(Motion(self.motion.skeleton, self.root, self.quat, self.motion.fps))

    def still(self, frame: int) -> Floats:
        """The body (21, 3) at a frame of the dance."""
        return self.bodies_m[frame - self.first_frame]

    def moved(self, yaw: float, shift_m: Floats) -> SampledRun:
        """Turned about Y, then shifted by (3,)."""
        turn = rot.about_y(yaw)
        quat = np.array(self.quat)
        quat[:, 0] = rot.multiply(turn, quat[:, 0])
        return replace(self, root=rot.rotate(turn, self.root) + shift_m, quat=quat)


def play(run: Run, read_motion: MotionReader, fps: float, margin: int) -> SampledRun:
    """Sample a run at its warped times; beyond its ends the take plays on at the end's speed."""
    start, stop = seconds_to_frames(run.start_s, fps), seconds_to_frames(run.stop_s, fps)
    source = run.source_s(np.arange(start - margin, stop + margin) / fps)
    motion, first_s = read_motion(run.take, float(source.min()), float(source.max()))
    played = motion.sampled_smooth((source - first_s) * motion.fps)
    return SampledRun(
        motion,
        start - margin,
        start,
        stop,
        played.root_pos_m,
        played.local_quat,
        run.locked,
        run.transition_s,
    )


def alignment_at(previous: SampledRun, played: SampledRun, frame: int) -> tuple[float, Floats]:
    """Turn about Y and shift (3,) after which at a frame `played` stands and faces as the previous one."""
    before, after = previous.still(frame), played.still(frame)
    yaw = float(heading_rad(before) - heading_rad(after))
    return yaw, _shift_m(before, after, yaw)


def placed(previous: SampledRun, played: SampledRun, fps: float) -> SampledRun:
    """`played` moved so that where it starts its body stands and faces as the previous one's, but for a
    little more turning that keeps the dance on the stage."""
    yaw, _ = alignment_at(previous, played, played.start)
    before, after = previous.still(played.start), played.still(played.start)
    end = played.still(played.stop - 1)
    travel_m = rot.rotate(rot.about_y(yaw), ground_pos_m(end) - ground_pos_m(after))
    share = min(1.0, (played.stop - played.start) / fps)  # short runs come with many joins
    yaw += share * steer_rad(ground_pos_m(before), travel_m)
    return played.moved(yaw, _shift_m(before, after, yaw))


def _shift_m(before: Floats, after: Floats, yaw: float) -> Floats:
    """What brings a body (21, 3), turned, to where another one stands."""
    return ground_pos_m(before) - rot.rotate(rot.about_y(yaw), ground_pos_m(after))


def join(
    a: SampledRun,
    b: SampledRun,
    blending: str,
    fps: float,
    root_out: Floats,
    quat_out: Floats,
    first_out: int = 0,
) -> None:
    """Blend the frames around b's start in an output whose row 0 is dance frame `first_out`.

    The output already holds a before the join and b after it.
    """
    frame = b.start
    share = _JOIN_SHARE / 2 if a.locked and b.locked else _JOIN_SHARE
    # Frames of each run that may be blended.
    room_a, room_b = (max(1, int(share * n)) for n in (frame - a.start, b.stop - frame))
    # How much of the difference each side makes up for: a firm run none, if the other is not.
    part_a, part_b = (0.5, 0.5) if a.locked == b.locked else (float(b.locked), float(a.locked))
    last_out = first_out + len(root_out)
    longest = max(1, seconds_to_frames(b.transition_s or TRANSITION_LENGTHS_S[blending][0], fps))
    if blending == "linear":
        first = max(first_out, frame - min(int(part_a * longest), room_a))
        stop = min(last_out, frame + min(int(part_b * longest), room_b))
        if first < stop:
            out = slice(first - first_out, stop - first_out)
            in_a, in_b = a.rows(first, stop), b.rows(first, stop)
            root_out[out], quat_out[out] = crossfade(a.root[in_a], a.quat[in_a], b.root[in_b], b.quat[in_b])
        return
    in_a, in_b = a.rows(frame - 1, frame + 2), b.rows(frame - 1, frame + 2)
    offsets = inertial_offsets(a.root[in_a], a.quat[in_a], b.root[in_b], b.quat[in_b], fps=fps)
    if part_b > 0:
        length = min(longest, room_b)
        after = np.arange(frame, min(last_out, frame + length))
        _add(offsets, part_b * _FORWARDS, after - frame, length, fps, root_out, quat_out, frame - first_out)
    if part_a > 0:
        length = min(longest, room_a)
        before = np.arange(max(first_out, frame - length), frame)
        _add(offsets, part_a * _BACKWARDS, before - frame, length, fps, root_out, quat_out, frame - first_out)


_FORWARDS = np.array([1.0, 1.0, 1.0])
_BACKWARDS = np.array([-1.0, 1.0, -1.0])  # seen backwards in time the first derivative changes its sign


def _add(
    offsets: tuple[Floats, Floats],
    parts: Floats,
    frames: NDArray[np.int64],
    length: int,
    fps: float,
    root_out: Floats,
    quat_out: Floats,
    row: int,
) -> None:
    """Add offsets of root (3, 3) and joints (3, J, 3), times `parts` (3,), that fade with `length` frames.

    `frames` are counted from the join, which is `row` of the output.
    """
    times_s = np.abs(frames) / fps
    root = fading(parts[:, None] * offsets[0], times_s, length / fps)
    turn = fading(parts[:, None, None] * offsets[1], times_s, length / fps)
    rows = row + frames
    root_out[rows], quat_out[rows] = apply_offset(root_out[rows], quat_out[rows], root, turn)
