"""Joins, where one run gives way to the next: place and heading, time and length of the transition.

A run is sampled at the frame rate of the dance and moved so that its body stands where the body of the run
before it stands. It is steered a little, so that the dance faces the audience and stays on the stage. The
join lies on a count if it can, and its transition is as short as accelerations allow. Rendering plays the
joins so: `choreograph.render.assembly`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import pairwise

import numpy as np
import scipy

from choreograph.core.arguments import as_stage_m
from choreograph.core.cache import NO_MEMORY, Memory
from choreograph.core.numerics import Floats, Indices
from choreograph.core.progress import StepReport
from choreograph.core.timebase import seconds_to_frames
from choreograph.library.repertoire import Repertoire
from choreograph.motion import rotations as rot
from choreograph.motion.body import BODY_JOINTS, body_indices, ground_pos_m, heading_rad, mirrored_motion
from choreograph.motion.kinematics import ancestors, forward
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import Skeleton
from choreograph.plan.runs import Run, TransitionTiming
from choreograph.settings import TRANSITION_LENGTHS_S

# Keeping a dance near the middle of the stage, by small extra rotations at transitions.


STAGE_RADIUS_M = 2.0  # steering to the middle grows from none at half this distance to its maximum here
_TRAVEL_M = 0.1  # shorter paths have no direction
MAX_STEER_RAD = 0.25  # per transition, 14°, which moves the feet by about 3 cm


def steer_rad(
    pos_m: Floats,
    travel_m: Floats,
    turned_rad: float = 0.0,
    *,
    stage: str = "near",
    most_rad: float = MAX_STEER_RAD,
) -> float:
    """Extra rotation at a position (3,) for the path (3,) ahead, from -`most_rad` to `most_rad`.

    It brings a dancer who is turned by `turned_rad` from where its take faces the audience back to the front.
    What is left of it bends the path towards the middle of the stage. Without it, takes that all lead forward
    would leave the stage. Far from the stage "near", the path comes first. The transition smooths the
    rotation. `stage` is as in `DanceConfig`.
    """
    front = np.clip((np.pi - turned_rad) % (2 * np.pi) - np.pi, -most_rad, most_rad)
    if np.linalg.norm(travel_m) < _TRAVEL_M:
        return float(front)
    home, ahead = np.arctan2(-pos_m[0], -pos_m[2]), np.arctan2(travel_m[0], travel_m[2])
    off = (home - ahead + np.pi) % (2 * np.pi) - np.pi
    radii = _radii(pos_m, stage)
    need = np.clip(2.0 * radii - 1.0, 0.0, 1.0)
    far = np.clip(0.5 * radii - 1.0, 0.0, 1.0) if stage == "near" else 0.0
    left = most_rad - abs(front)
    near_rad = front + need * np.clip(off - front, -left, left)
    return float((1.0 - far) * near_rad + far * np.clip(off, -most_rad, most_rad))


def _radii(pos_m: Floats, stage: str) -> float:
    """How far a position (3,) is from the middle of a stage, 1 at its border. Always 0 on a free one."""
    if stage == "free":
        return 0.0
    size_m = as_stage_m(stage)
    if size_m is None:
        return float(np.linalg.norm(pos_m)) / STAGE_RADIUS_M
    return 2.0 * float(max(abs(pos_m[0]) / size_m[0], abs(pos_m[2]) / size_m[1]))


_FEET_M = 0.3  # from the pelvis to a foot that steps aside


def stage_half_m(stage_m: tuple[float, float]) -> tuple[float, float]:
    """How far the pelvis may be from the middle of a stage, to the sides and to front and back.

    The feet should stay within the borders as well, so that it stays 0.3 m, or a quarter, within.
    """
    width_m, depth_m = (max(side_m / 2 - _FEET_M, side_m / 4) for side_m in stage_m)
    return width_m, depth_m


# Runs are sampled at the frame rate of the dance and aligned with the run before them.


_PELVIS_WEIGHT = 0.3  # weight of the pelvis in the alignment. A foot on the floor has the weight 1
_ANKLE_M, _BALL_M = 0.07, 0.015  # heights of a foot that stands flat
# Height above these at which a foot is as likely in the air as on the floor, and the width of the change.
_LOW_M, _LOW_WIDTH_M = 0.05, 0.012
_FEET = [
    (BODY_JOINTS.index(f"{side}_ankle"), BODY_JOINTS.index(f"{side}_foot")) for side in ("left", "right")
]

# take, first and last time -> the motion around them and the time of its first frame
MotionReader = Callable[[str, float, float], tuple[Motion, float]]


@dataclass(frozen=True, eq=False)
class SampledRun:
    """A run at the dance's frame rate, with a margin of frames before and after it."""

    skeleton: Skeleton
    fps: float  # of the dance
    first_frame: int  # dance frame of row 0, negative in the margin before the dance
    start: int  # dance frame at which the run starts
    stop: int  # dance frame after its last one
    root: Floats  # (T, 3)
    quat: Floats  # (T, J, 4)
    locked: bool  # as in `Run`
    transition_s: float | None  # as in `Run`

    def rows(self, first: int, stop: int) -> slice:
        """The rows of dance frames `first` to `stop`."""
        return slice(first - self.first_frame, stop - self.first_frame)

    def bodies_m(self, first: int, stop: int, joints: tuple[str, ...] = BODY_JOINTS) -> Floats:
        """The body, or some of its joints, at dance frames `first` to `stop`, (T, 21, 3)."""
        indices, needed = _body_and_ancestors(self.skeleton, joints)
        rows = self.rows(first, stop)
        pos_m: Floats = forward(self.skeleton, self.root[rows], self.quat[rows], needed)[0][:, indices]
        return pos_m

    def body_at(self, frame: int) -> Floats:
        """The body (21, 3) at a frame of the dance."""
        body_m: Floats = self.bodies_m(frame, frame + 1)[0]
        return body_m

    def moved(self, yaw_rad: float, shift_m: Floats) -> SampledRun:
        """Rotated about Y, then shifted by (3,)."""
        turn = rot.about_y(yaw_rad)
        quat = np.array(self.quat)
        quat[:, 0] = rot.multiply(turn, quat[:, 0])
        return replace(self, root=rot.rotate(turn, self.root) + shift_m, quat=quat)


@lru_cache(maxsize=16)
def _body_and_ancestors(skeleton: Skeleton, joints: tuple[str, ...]) -> tuple[list[int], Indices]:
    """Indices of joints of the body, and those of all joints but the root on which their places depend."""
    indices = body_indices(skeleton, joints)
    needed = {above for joint in indices for above in ancestors(skeleton, joint)} - {0}
    return indices, np.array(sorted(needed), np.int64)


def sample_run(run: Run, read_motion: MotionReader, fps: float, margin: int) -> SampledRun:
    """Sample a run at its warped times. Beyond its ends the take continues at the speed of the end."""
    start, stop = seconds_to_frames(run.start_s, fps), seconds_to_frames(run.stop_s, fps)
    source_s = run.source_s(np.arange(start - margin, stop + margin) / fps)
    motion, first_s = read_motion(run.take, float(source_s.min()), float(source_s.max()))
    motion = mirrored_motion(motion) if run.mirrored else motion
    sampled = motion.sampled_smooth((source_s - first_s) * motion.fps)
    return SampledRun(
        motion.skeleton, fps, start - margin, start, stop, sampled.root_pos_m, sampled.local_quat,
        run.locked, run.transition_s,
    )  # fmt: skip


RunSampler = Callable[[Run, MotionReader, float, int], SampledRun]  # as `sample_run`


def sample_kept_run(
    memory: Memory, run: Run, read_motion: MotionReader, fps: float, margin: int
) -> SampledRun:
    """As `sample_run`, with a memory of the takes of `read_motion`, for dances with most runs in common."""
    sampled = memory.value(
        lambda: sample_run(run, read_motion, fps, margin),
        "run", run.take, run.mirrored, run.start_s, run.stop_s, run.source_times_s, fps, margin,
    )  # fmt: skip
    return replace(sampled, locked=run.locked, transition_s=run.transition_s)


def alignment_at(previous: SampledRun, sampled: SampledRun, frame: int) -> tuple[float, Floats]:
    """Rotation about Y and shift (3,) that move `sampled` to place and heading of `previous` at a frame."""
    before, after = previous.body_at(frame), sampled.body_at(frame)
    yaw_rad = _turn_rad(before, after)
    return yaw_rad, _shift_m(before, after, yaw_rad)


def _turn_rad(before: Floats, after: Floats) -> float:
    """The rotation about Y that gives a body (21, 3) the heading of another one."""
    return float(heading_rad(before) - heading_rad(after))


def align_to(
    previous: SampledRun,
    sampled: SampledRun,
    fps: float,
    *,
    stage: str = "near",
    middle_m: Floats | None = None,
    to_front: bool = True,
) -> SampledRun:
    """`sampled`, moved to place and heading of `previous` at its start, and steered a little.

    It is steered back to the heading of its take, which faces the audience with its front (`to_front`), and
    towards `middle_m`, the middle (3,) of the `stage`.
    """
    before, after = previous.body_at(sampled.start), sampled.body_at(sampled.start)
    yaw_rad = _turn_rad(before, after)
    if stage == "free" and not to_front:
        return sampled.moved(yaw_rad, _shift_m(before, after, yaw_rad))
    end = sampled.body_at(sampled.stop - 1)
    travel_m = rot.rotate(rot.about_y(yaw_rad), ground_pos_m(end) - ground_pos_m(after))
    share = min(1.0, (sampled.stop - sampled.start) / fps)  # short runs have many transitions
    turned_rad = yaw_rad if to_front else 0.0
    place_m = ground_pos_m(before) - (0.0 if middle_m is None else middle_m)
    yaw_rad += share * steer_rad(place_m, travel_m, turned_rad, stage=stage)
    return sampled.moved(yaw_rad, _shift_m(before, after, yaw_rad))


def _shift_m(before: Floats, after: Floats, yaw_rad: float) -> Floats:
    """The shift (3,) that brings a body (21, 3), once rotated, to where another one stands.

    Feet that are on the floor in both bodies come to the same place, as far as the two feet are equally far
    apart in both. Otherwise they would slide during the transition. Without such feet, the pelvises come to
    the same place.
    """
    turned = rot.rotate(rot.about_y(yaw_rad), after)
    apart_m = [ground_pos_m(before) - ground_pos_m(turned)]
    weights = [_PELVIS_WEIGHT]
    for ankle, ball in _FEET:
        apart_m.append((before[[ankle, ball]] - turned[[ankle, ball]]).mean(axis=0) * [1.0, 0.0, 1.0])
        heights_m = [min(body[ankle, 1] - _ANKLE_M, body[ball, 1] - _BALL_M) for body in (before, after)]
        weights.append(float(scipy.special.expit((_LOW_M - max(heights_m)) / _LOW_WIDTH_M)))
    shift_m: Floats = np.average(apart_m, axis=0, weights=weights)
    return shift_m


def take_motions(repertoire: Repertoire) -> MotionReader:
    """Reads parts of the repertoire's takes by name, turned so that each take's front is the audience's."""
    indices = {take.name: index for index, take in enumerate(repertoire.takes)}
    fronts_rad = repertoire.clip_motion.fronts_rad

    def read(take: str, start_s: float, stop_s: float) -> tuple[Motion, float]:
        motion, first_s = repertoire.motion(indices[take], start_s, stop_s)
        return motion.moved(yaw_rad=-float(fronts_rad[indices[take]])), first_s

    return read


# The time at which each run replaces the one before it, and the length of the transition.


_MIN_RUN_S = 0.6  # least length of a run
# Greatest acceleration by an offset x, in x / T², and by its rate v, in v / T, if two sides share the offset,
# and if one side takes all of it.
_PEAKS_SHARED = 1.45, 2.0
_PEAKS_ALONE = 5.8, 4.0
_EASY_M_S2 = 4.0  # limit of acceleration by a transition, small compared with that of dancers


def time_transitions(
    runs: Sequence[Run],
    joins_s: Sequence[float],
    take_lengths_s: Mapping[str, float],
    read_motion: MotionReader,
    *,
    fps: float,
    blending: str,
    fixed: Sequence[bool] = (),
    report: StepReport | None = None,
    memory: Memory = NO_MEMORY,
) -> list[TransitionTiming]:
    """The time at which each run replaces the one before it, and the length of the transition (N,).

    A run begins at its instant of `joins_s` (N,), a count near its start, if both takes are long enough and
    neither run becomes shorter than 0.6 s. Otherwise, or if it is `fixed` (N,), it begins at its start. An
    inertial transition is the shortest that accelerates no joint by more than 4 m/s². ChoreoGraph changes
    takes on the second. `memory` is of the takes that `read_motion` reads.
    """
    starts = [runs[0].start_s] if runs else []
    for index, (before, after) in enumerate(pairwise(runs), start=1):
        held = before.locked or after.locked or (bool(fixed) and fixed[index])
        at_s = float(joins_s[index])
        possible = (
            not held
            and min(at_s - starts[-1], after.stop_s - at_s) >= _MIN_RUN_S
            and before.source_s(np.array([at_s]))[0] <= take_lengths_s[before.take]
            and after.source_s(np.array([at_s]))[0] >= 0.0
        )
        starts.append(at_s if possible else after.start_s)
    lengths = []
    for (before, after), at_s in zip(pairwise(runs), starts[1:], strict=True):
        length_s = memory.value(
            partial(_length_s, before, after, at_s, read_motion, fps, blending),
            "length of a transition", before, after, at_s, fps, blending,
        )  # fmt: skip
        lengths.append(length_s)
        if report is not None:
            report(len(lengths) + 1, len(runs))
    return [
        TransitionTiming(at_s, length_s)
        for at_s, length_s in zip(starts, (*(run.transition_s for run in runs[:1]), *lengths), strict=True)
    ]


def _length_s(
    before: Run, after: Run, at_s: float, read_motion: MotionReader, fps: float, blending: str
) -> float:
    """The shortest length of the blending within the limit of acceleration, else its longest."""
    options = sorted(TRANSITION_LENGTHS_S[blending])
    if len(options) == 1:
        return options[0]
    # Longer than a frame, so that there are three around the instant.
    span = slice(at_s - 2.0 / fps, at_s + 2.0 / fps)
    a, b = (sample_run(run.cut(span.start, span.stop), read_motion, fps, 1) for run in (before, after))
    offset_m, rate_m_s = _offset(a, b, fps)
    of_offset, of_rate = _PEAKS_ALONE if before.locked != after.locked else _PEAKS_SHARED
    peaks = [np.max(of_offset * offset_m / length**2 + of_rate * rate_m_s / length) for length in options]
    return next(
        (length for length, peak in zip(options, peaks, strict=True) if peak <= _EASY_M_S2), options[-1]
    )


def _offset(a: SampledRun, b: SampledRun, fps: float) -> tuple[Floats, Floats]:
    """Distance and difference of velocity of every joint (21,), once b stands where a stands."""
    frame = a.start + 1
    aligned = b.moved(*alignment_at(a, b, frame))
    apart = [aligned.body_at(at) - a.body_at(at) for at in (frame - 1, frame, frame + 1)]
    return np.linalg.norm(apart[1], axis=-1), np.linalg.norm(apart[2] - apart[0], axis=-1) * fps / 2
