"""A run sampled at the dance's frame rate, and aligned with the run before it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from choreograph.blending.runs import Run
from choreograph.blending.stage import steer_rad
from choreograph.motion import rotations as rot
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion
from choreograph.motion.pose import ground_pos_m, heading_rad
from choreograph.timebase import seconds_to_frames

Floats = NDArray[np.float64]
# take, first and last time wanted -> motion around them and the time of its first frame
MotionReader = Callable[[str, float, float], tuple[Motion, float]]


@dataclass(frozen=True, eq=False)
class SampledRun:
    """A run at the dance's frame rate, with a margin of frames before and after it."""

    motion: Motion  # any part of the take: for skeleton and joint roles
    first_frame: int  # dance frame of row 0; negative in the margin before the dance
    start: int  # dance frame at which the run starts,
    stop: int  # and the one after its last
    root: Floats  # (T, 3)
    quat: Floats  # (T, J, 4)
    locked: bool  # as in `Run`
    transition_s: float | None  # as in `Run`

    def rows(self, first: int, stop: int) -> slice:
        """The rows of dance frames `first` to `stop`."""
        return slice(first - self.first_frame, stop - self.first_frame)

    @cached_property
    def bodies_m(self) -> Floats:
        """The body in every row, (T, 21, 3)."""
        return body_pos_m(Motion(self.motion.skeleton, self.root, self.quat, self.motion.fps))

    def body_at(self, frame: int) -> Floats:
        """The body (21, 3) at a frame of the dance."""
        return self.bodies_m[frame - self.first_frame]

    def moved(self, yaw_rad: float, shift_m: Floats) -> SampledRun:
        """Rotated about Y, then shifted by (3,)."""
        turn = rot.about_y(yaw_rad)
        quat = np.array(self.quat)
        quat[:, 0] = rot.multiply(turn, quat[:, 0])
        return replace(self, root=rot.rotate(turn, self.root) + shift_m, quat=quat)


def sample_run(run: Run, read_motion: MotionReader, fps: float, margin: int) -> SampledRun:
    """Sample a run at its warped times; beyond its ends the take goes on at the speed it has there."""
    start, stop = seconds_to_frames(run.start_s, fps), seconds_to_frames(run.stop_s, fps)
    source_s = run.source_s(np.arange(start - margin, stop + margin) / fps)
    motion, first_s = read_motion(run.take, float(source_s.min()), float(source_s.max()))
    sampled = motion.sampled_smooth((source_s - first_s) * motion.fps)
    return SampledRun(
        motion, start - margin, start, stop, sampled.root_pos_m, sampled.local_quat, run.locked,
        run.transition_s,
    )  # fmt: skip


def alignment_at(previous: SampledRun, sampled: SampledRun, frame: int) -> tuple[float, Floats]:
    """Rotation about Y and shift (3,) that place `sampled` where `previous` stands and faces at a frame."""
    before, after = previous.body_at(frame), sampled.body_at(frame)
    yaw_rad = float(heading_rad(before) - heading_rad(after))
    return yaw_rad, _shift_m(before, after, yaw_rad)


def align_to(
    previous: SampledRun, sampled: SampledRun, fps: float, *, keep_on_stage: bool = True
) -> SampledRun:
    """`sampled`, moved to where `previous` stands and faces at its start, and steered towards the stage."""
    yaw_rad, shift_m = alignment_at(previous, sampled, sampled.start)
    if not keep_on_stage:
        return sampled.moved(yaw_rad, shift_m)
    before, after = previous.body_at(sampled.start), sampled.body_at(sampled.start)
    end = sampled.body_at(sampled.stop - 1)
    travel_m = rot.rotate(rot.about_y(yaw_rad), ground_pos_m(end) - ground_pos_m(after))
    share = min(1.0, (sampled.stop - sampled.start) / fps)  # short runs come with many transitions
    yaw_rad += share * steer_rad(ground_pos_m(before), travel_m)
    return sampled.moved(yaw_rad, _shift_m(before, after, yaw_rad))


def _shift_m(before: Floats, after: Floats, yaw_rad: float) -> Floats:
    """The shift (3,) that brings a body (21, 3), once rotated, to where another one stands."""
    return ground_pos_m(before) - rot.rotate(rot.about_y(yaw_rad), ground_pos_m(after))
