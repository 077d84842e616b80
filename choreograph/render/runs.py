"""Runs, the parts of takes that are played. They are sampled, aligned and kept near the stage's middle."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np

from choreograph.core.arguments import as_stage_m
from choreograph.core.filters import logistic
from choreograph.core.numerics import NO_MEMORY, Floats, Indices, Memory
from choreograph.core.splines import CubicSpline, monotone_cubic
from choreograph.core.timebase import NET_FPS, seconds_to_frames
from choreograph.motion import rotations as rot
from choreograph.motion.body import BODY_JOINTS, body_indices, ground_pos_m, heading_rad
from choreograph.motion.kinematics import ancestors, forward
from choreograph.motion.mirroring import mirrored_motion
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import Skeleton

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


# Runs: parts of takes with their time in the dance, without a transition inside.


_SAME_INSTANT_S = 2e-3  # largest gap between two parts of a take that need no transition


@dataclass(frozen=True, eq=False)
class Run:
    """A part of the dance that is played without a transition: one take, one continuous time map."""

    take: str
    start_s: float  # in the dance
    stop_s: float
    source_times_s: Floats  # (n + 1,) times of the take, evenly spaced from start to stop, both included
    locked: bool = False  # transitions change its neighbours, not it
    transition_s: float | None = None  # length of the transition into it, or None for the blending's default
    mirrored: bool = False  # left and right are exchanged

    @property
    def length_s(self) -> float:
        """Its length in seconds."""
        return self.stop_s - self.start_s

    def source_s(self, times_s: Floats) -> Floats:
        """Source times at times of the dance. Beyond the ends, the speed stays that of the end."""
        knots = np.linspace(0.0, self.length_s, len(self.source_times_s))
        return CubicSpline(knots, self.source_times_s).continued(np.asarray(times_s) - self.start_s)

    def cut(self, start_s: float, stop_s: float) -> Run:
        """The part of the run between two times of the dance."""
        source_times_s = self.source_s(_knots_s(start_s, stop_s))
        return replace(self, start_s=start_s, stop_s=stop_s, source_times_s=source_times_s)


@dataclass(frozen=True)
class TransitionTiming:
    """The time at which a run replaces the one before it, and the length of the transition."""

    start_s: float  # of the dance
    transition_s: float | None = None  # see `Run`


def to_runs(takes: Sequence[str], source_times_s: Sequence[Sequence[float]]) -> list[Run]:
    """Seconds grouped into runs. Each second has its take and 21 source times."""
    runs: list[Run] = []
    for second, (take, given) in enumerate(zip(takes, source_times_s, strict=True)):
        times = np.asarray(given, np.float64)
        if runs and _continues(runs[-1], take, times[0]):
            longer = np.concatenate([runs[-1].source_times_s, times[1:]])
            runs[-1] = Run(take, runs[-1].start_s, second + 1.0, longer)
        else:
            runs.append(Run(take, float(second), second + 1.0, times))
    return runs


def words_to_runs(
    takes: Sequence[str],
    spans_s: Floats,
    sources_s: Floats,
    locked: Sequence[bool],
    mirrored: Sequence[bool] | None = None,
) -> list[Run]:
    """Words grouped into runs. Each word has its take, its span of the dance (N, 2) and of the take (N, 2).

    A word is played at constant speed. Words that follow one another in their take are one run, whose
    speed changes smoothly from word to word.
    """
    runs: list[Run] = []
    first = 0
    sides = [False] * len(takes) if mirrored is None else mirrored
    for index in range(1, len(takes) + 1):
        goes_on = (
            index < len(takes)
            and takes[index] == takes[index - 1]
            and sides[index] == sides[index - 1]
            and abs(sources_s[index, 0] - sources_s[index - 1, 1]) < _SAME_INSTANT_S
            and abs(spans_s[index, 0] - spans_s[index - 1, 1]) < _SAME_INSTANT_S
        )
        if not goes_on:
            part = slice(first, index)
            run = _word_run(takes[first], spans_s[part], sources_s[part], any(locked[part]))
            runs.append(replace(run, mirrored=True) if sides[first] else run)
            first = index
    return runs


def _word_run(take: str, spans_s: Floats, sources_s: Floats, locked: bool) -> Run:
    start_s, stop_s = float(spans_s[0, 0]), float(spans_s[-1, 1])
    knots, values = (*spans_s[:, 0].tolist(), stop_s), (*sources_s[:, 0].tolist(), float(sources_s[-1, 1]))
    return Run(take, start_s, stop_s, _smooth_times_s(knots, values), locked)


@lru_cache(maxsize=4096)  # the mixer makes the runs of most words six times
def _smooth_times_s(knots: tuple[float, ...], values: tuple[float, ...]) -> Floats:
    """Source times through `values` at the times `knots` of the dance, as of `Run`. They are read-only."""
    times_s: Floats = monotone_cubic(knots, values, _knots_s(knots[0], knots[-1]))
    times_s.flags.writeable = False
    return times_s


def overlay_runs(runs: Sequence[Run], instead: Sequence[Run]) -> list[Run]:
    """`runs`, replaced by those of `instead` where they overlap. Both are in order of time."""
    left: list[Run] = []
    for run in runs:
        start_s = run.start_s
        for cover in instead:
            if cover.stop_s <= start_s or cover.start_s >= run.stop_s:
                continue
            if cover.start_s - start_s > _SAME_INSTANT_S:
                left.append(run.cut(start_s, cover.start_s))
            start_s = max(start_s, cover.stop_s)
        if run.stop_s - start_s > _SAME_INSTANT_S:
            left.append(run if start_s == run.start_s else run.cut(start_s, run.stop_s))
    return sorted([*left, *instead], key=lambda run: run.start_s)


def without_holes(runs: Sequence[Run], duration_s: float) -> list[Run]:
    """The runs of a dance, each extended at its speed to the middle of a hole beside it, or to an end."""
    borders_s = [0.0, *((before.stop_s + after.start_s) / 2 for before, after in pairwise(runs)), duration_s]
    return [
        run if _covers(run, *span_s) else run.cut(*span_s)
        for run, span_s in zip(runs, pairwise(borders_s), strict=True)
    ]


def _covers(run: Run, start_s: float, stop_s: float) -> bool:
    return abs(run.start_s - start_s) < _SAME_INSTANT_S and abs(run.stop_s - stop_s) < _SAME_INSTANT_S


def with_transitions(runs: Sequence[Run], transitions: Sequence[TransitionTiming]) -> list[Run]:
    """The runs, each starting at the time of its timing (N,).

    The run before it is extended or cut accordingly.
    """
    moved = [
        replace(run, transition_s=timing.transition_s) for run, timing in zip(runs, transitions, strict=True)
    ]
    for index, start_s in enumerate(timing.start_s for timing in transitions):
        before, after = moved[index - 1], moved[index]
        if index == 0 or start_s == after.start_s or not before.start_s < start_s < after.stop_s:
            continue
        moved[index - 1] = before.cut(before.start_s, start_s)
        moved[index] = after.cut(start_s, after.stop_s)
    return moved


def _continues(run: Run, take: str, source_s: float) -> bool:
    return run.take == take and abs(run.source_times_s[-1] - source_s) < _SAME_INSTANT_S


def _knots_s(start_s: float, stop_s: float) -> Floats:
    """Knots of a time map from start to stop, about as many as at 20 fps."""
    return np.linspace(start_s, stop_s, max(2, round((stop_s - start_s) * NET_FPS)) + 1)


# Runs are sampled at the frame rate of the dance and aligned with the run before them.


_PELVIS_WEIGHT = 0.3  # weight of the pelvis in the alignment. A foot on the floor has the weight 1
_ANKLE_M, _BALL_M = 0.07, 0.015  # heights of a foot that stands flat
# Height above these at which a foot is as likely in the air as on the floor, and the width of the change.
_LOW_M, _LOW_WIDTH_M = 0.05, 0.012
_KEPT_BYTES = 1 << 26  # of sampled runs: the words of a dance of 5 minutes at 60 fps
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


class RecentRuns:
    """Keeps the runs that were sampled last, for dances that have most runs in common.

    They are kept in a `memory` of their repertoire, or without one up to 64 MB.
    """

    def __init__(self, memory: Memory = NO_MEMORY) -> None:
        self._memory = memory if memory.is_on else Memory(_KEPT_BYTES)

    def sample(self, run: Run, read_motion: MotionReader, fps: float, margin: int) -> SampledRun:
        """As `sample_run`, always with the same `read_motion`."""
        sampled = self._memory.value(
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
        weights.append(float(logistic((_LOW_M - max(heights_m)) / _LOW_WIDTH_M)))
    shift_m: Floats = np.average(apart_m, axis=0, weights=weights)
    return shift_m
