"""Assembles runs to one motion: they are sampled from their takes, aligned, and blended at transitions.

A transition is the paper's crossfade, or an offset between the two runs that decays (inertialization). Around
joins, feet are locked by the contacts of both takes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import get_args

import numpy as np
import scipy

from choreograph.core.arguments import as_stage_m, check_choice
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats, frame_blocks
from choreograph.core.progress import StepReport
from choreograph.core.timebase import frame_times_s, seconds_to_frames
from choreograph.motion import rotations as rot
from choreograph.motion.body import body_pos_m, ground_pos_m
from choreograph.motion.contacts import CONTACT_JOINTS, FLOOR_PERCENT, contacts_above
from choreograph.motion.motion import Motion
from choreograph.plan.joins import MotionReader, RunSampler, SampledRun, align_to, sample_run
from choreograph.plan.runs import Run
from choreograph.settings import TRANSITION_LENGTHS_S, Blending


def assemble(
    runs: Sequence[Run],
    read_motion: MotionReader,
    *,
    fps: float,
    duration_s: float,
    blending: str,
    stage: str = "near",
    to_front: bool = True,
    sample: RunSampler = sample_run,
    report: StepReport | None = None,
) -> tuple[Motion, Joins]:
    """The dance before foot locking, and its joins.

    Each run is rotated about Y and shifted on the ground so that its body stands where the previous run's
    stood at the transition (the paper does not say how nodes are joined), and steered a little to face the
    audience (`to_front`) and to keep the dance on the `stage`, both ours. The dance begins in the middle of
    the stage. If that has borders, its middle is above the origin.
    `linear` is the paper's crossfade. With `inertial` the difference of pose, velocity and acceleration
    decays on both sides, so that neither motion is smeared. Transitions between short runs are shorter.

    Raises `ParameterError` for an unknown blending, or if there is no run.
    """
    check_choice("a blending", blending, get_args(Blending))
    longest_s = max((*TRANSITION_LENGTHS_S[blending], *(run.transition_s or 0.0 for run in runs)))
    margin = max(2, seconds_to_frames(longest_s + 0.05, fps))  # frames: velocities need two beyond the end
    total = seconds_to_frames(runs[-1].stop_s, fps) if runs else 0
    root_out = np.empty((total, 3))
    quat_out: Floats | None = None
    feet_m: list[tuple[int, Floats]] = []
    previous: SampledRun | None = None
    middle_m = np.zeros(3)  # of the stage
    for done, run in enumerate(runs, start=1):
        sampled = sample(run, read_motion, fps, margin)
        if previous is None:
            middle_m = ground_pos_m(sampled.body_at(sampled.start))
            if as_stage_m(stage):
                sampled, middle_m = sampled.moved(0.0, -middle_m), np.zeros(3)
        else:
            bent = "free" if to_front and run is runs[-1] else stage  # so that the last pose faces the front
            sampled = align_to(previous, sampled, fps, stage=bent, middle_m=middle_m, to_front=to_front)
        if quat_out is None:
            quat_out = np.empty((total, *sampled.quat.shape[1:]))
        rows = sampled.rows(sampled.start, sampled.stop)
        root_out[sampled.start : sampled.stop] = sampled.root[rows]
        quat_out[sampled.start : sampled.stop] = sampled.quat[rows]
        if previous is not None:
            blend_transition(previous, sampled, blending, fps, root_out, quat_out)
            feet_m += feet_at_join(previous, sampled, fps)
        previous = sampled
        if report is not None:
            report(done, len(runs))
    if previous is None or quat_out is None:
        raise ParameterError("expected a plan of one second or more, got none")
    n_frames = max(1, seconds_to_frames(duration_s, fps))
    for block in frame_blocks(total):
        quat_out[block] = rot.normalize(quat_out[block])
    motion = Motion(previous.skeleton, root_out, rot.make_continuous(quat_out, out=quat_out), fps)
    joins = Joins(np.array([run.start_s for run in runs[1:]], np.float64), tuple(feet_m))
    return motion.sliced(0, min(n_frames, total)), joins


def off_stage(motion: Motion, stage: str) -> tuple[str, ...]:
    """A note if a dance leaves a `stage` such as "4x3", which it begins in the middle of. None otherwise.

    Raises `ParameterError` for what is no stage.
    """
    size_m = as_stage_m(stage)
    if size_m is None:
        return ()
    places_m = np.abs(motion.root_pos_m - motion.root_pos_m[0])[:, [0, 2]]  # (T, 2)
    outside = float((places_m > np.array(size_m) / 2).any(axis=1).mean())
    if outside == 0:
        return ()
    return (f"the dancer is off the stage ({stage} m) for {max(outside, 0.01):.0%} of the time",)


# The blend from one run to the next: a crossfade, or an offset that decays (inertialization).


_BLENDED_SHARE = 0.5  # of a run that may be blended at either end, so that its middle stays as recorded
_MINIMUM_JERK_PEAK = 1.875  # speed in the middle of a minimum-jerk path, relative to its mean speed
_RATE_S = 0.4  # longest decay of a difference of velocity. With a longer one, limbs swing further
_MAX_SWING = 0.1  # m or rad, limit of the swing by a difference of acceleration
_SWING_OF_ACCELERATION = 0.01728  # of a T², the peak of t² / 2 (1 - t / T)³ a
_FORWARDS = np.array([1.0, 1.0, 1.0])
_BACKWARDS = np.array([-1.0, 1.0, -1.0])  # backwards in time, the first derivative changes its sign


def crossfade(a_root: Floats, a_quat: Floats, b_root: Floats, b_quat: Floats) -> tuple[Floats, Floats]:
    """Linear blend from a to b over all their frames: roots (T, 3), rotations (T, J, 4).

    The paper's transition (ChoreoGraph, section 3.3).
    """
    weight = (np.arange(len(a_root)) + 0.5) / len(a_root)  # (T,)
    root = a_root * (1 - weight)[:, None] + b_root * weight[:, None]
    return root, rot.slerp(a_quat, b_quat, weight[:, None])


def inertial_offsets(
    a_root: Floats, a_quat: Floats, b_root: Floats, b_quat: Floats, *, fps: float, part_b: float = 0.5
) -> tuple[Floats, Floats]:
    """The offset from b to a, with its first and second time derivative: (3, 3) and (3, J, 3).

    The arguments are the three frames around the transition, (3, 3) and (3, J, 4). Row 0 of a result is
    the offset (metres, rotation vector), row 1 its rate per second, and row 2 that per second². The
    derivatives of a rotation are those of the remaining offset after b and a have been rotated towards each
    other, which is small even if they are far apart.
    """
    turn = rot.to_rotvec(rot.multiply(a_quat[1], rot.invert(b_quat[1])))  # (J, 3)
    back_a, back_b = rot.from_rotvec((part_b - 1.0) * turn), rot.from_rotvec(-part_b * turn)
    left = rot.multiply(back_a, rot.multiply(rot.multiply(a_quat, rot.invert(b_quat)), back_b))
    turns = _derivatives(rot.to_rotvec(left), fps)  # (3, J, 3), its row 0 zero
    turns[0] = turn
    return _derivatives(a_root - b_root, fps), turns


def _derivatives(values: Floats, fps: float) -> Floats:
    before, here, after = values
    return np.stack([here, (after - before) * fps / 2, (after - 2 * here + before) * fps**2])


def decay_offset(offset: Floats, times_s: Floats, length_s: float) -> Floats:
    """The quintic that starts with `offset` (3, ...) and its derivatives and comes to rest at zero after
    `length_s`: values (T, ...) at `times_s` (T,) ≥ 0.

    Bollo, Inertialization (GDC 2018), without its clamp, which stops what swings out: see `decay_rate`.
    """
    d = length_s
    x, v, a = offset
    a = np.zeros_like(a) if d == 0 else a
    # p(0) = x, p'(0) = v and p''(0) = a, and p(d) = p'(d) = p''(d) = 0.
    c3 = -(10 * x + 6 * v * d + 1.5 * a * d**2) / d**3
    c4 = (15 * x + 8 * v * d + 1.5 * a * d**2) / d**4
    c5 = -(6 * x + 3 * v * d + 0.5 * a * d**2) / d**5
    t = np.minimum(np.asarray(times_s), d).reshape(-1, *([1] * x.ndim))
    decayed: Floats = x + v * t + a * t**2 / 2 + c3 * t**3 + c4 * t**4 + c5 * t**5
    return decayed


def decay_distance(distance: Floats, times_s: Floats, length_s: float, *, shared: bool) -> Floats:
    """The decay of an offset (..., 3) between two motions of the same velocity, values (T, ..., 3).

    If both sides share the offset, they pass the transition at full speed, on the minimum-jerk path across
    both (Flash and Hogan, 1985). A single side must come to rest there. If both did, a dance would have an
    additional motion beat at every transition.
    """
    zero = np.zeros_like(distance)
    rate = -_MINIMUM_JERK_PEAK * distance / length_s if shared else zero
    return decay_offset(np.stack([distance, rate, zero]), times_s, length_s)


def decay_rate(
    rate: Floats, acceleration: Floats, times_s: Floats, length_s: float, *, shared: bool
) -> Floats:
    """The decay of an offset of zero with a rate and an acceleration (..., 3), values (T, ..., 3).

    A side that starts at zero swings by 0.2 rate × time, which stretches legs beyond straight. If both sides
    share the offset, they start from the same value against the rate, so that the path cuts the corner
    between a and b. Acceleration is continuous unless it would swing a joint by more than 0.1 rad.
    """
    swing = _SWING_OF_ACCELERATION * length_s**2 * np.linalg.norm(acceleration, axis=-1, keepdims=True)
    bend = acceleration * np.minimum(1.0, _MAX_SWING / np.maximum(swing, 1e-9))
    zero = np.zeros_like(rate)
    if not shared:
        return decay_offset(np.stack([zero, rate, bend]), times_s, length_s)
    d = min(length_s, _RATE_S)
    # Halfway between the quintic held at zero and -rate d / 3 (1 - t / d)³, which does not swing at all.
    corner = np.stack([-rate * d / 6, rate, -rate / d])
    return decay_offset(corner, times_s, d) + decay_offset(np.stack([zero, zero, bend]), times_s, length_s)


def apply_offset(root: Floats, quat: Floats, root_offset: Floats, turn: Floats) -> tuple[Floats, Floats]:
    """Roots (T, 3) shifted by (T, 3) and joints (T, J, 4) rotated by rotation vectors (T, J, 3)."""
    return root + root_offset, rot.multiply(rot.from_rotvec(turn), quat)


def blend_transition(
    a: SampledRun,
    b: SampledRun,
    blending: str,
    fps: float,
    root_out: Floats,
    quat_out: Floats,
    first_out: int = 0,
) -> None:
    """Blend the frames around b's start in an output whose row 0 is dance frame `first_out`.

    The output already holds a before the transition and b after it.
    """
    frame = b.start
    share = _BLENDED_SHARE / 2 if a.locked and b.locked else _BLENDED_SHARE
    # Frames of each run that may be blended.
    room_a, room_b = (max(1, int(share * n)) for n in (frame - a.start, b.stop - frame))
    # The share of the offset for each side. It is 0 for a locked run, unless both are locked.
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
    shared = part_a > 0 and part_b > 0
    if shared:  # both sides start from the same values, and take the same time
        room_a = room_b = min(room_a, room_b)
    length_a, length_b = min(longest, room_a), min(longest, room_b)
    in_a, in_b = a.rows(frame - 1, frame + 2), b.rows(frame - 1, frame + 2)
    offsets = inertial_offsets(a.root[in_a], a.quat[in_a], b.root[in_b], b.quat[in_b], fps=fps, part_b=part_b)
    before = np.arange(max(first_out, frame - length_a), frame)
    after = np.arange(frame, min(last_out, frame + length_b))
    for frames, length, parts in (
        (before, length_a, part_a * _BACKWARDS),
        (after, length_b, part_b * _FORWARDS),
    ):
        if parts.any():
            rows, times_s = frames - first_out, np.abs(frames - frame) / fps
            root_out[rows], quat_out[rows] = _with_offsets(
                root_out[rows], quat_out[rows], offsets, parts, times_s, length / fps, shared
            )


def _with_offsets(
    root: Floats,
    quat: Floats,
    offsets: tuple[Floats, Floats],
    parts: Floats,
    times_s: Floats,
    length_s: float,
    shared: bool,
) -> tuple[Floats, Floats]:
    """One side with its parts (3,) of the offset and its derivatives, `times_s` (T,) from the transition."""
    shift, turn = offsets
    both = parts[:, None, None] * np.concatenate([shift[:, None], turn], axis=1)  # (3, 1 + J, 3)
    distance, rate, acceleration = both
    still = decay_distance(distance, times_s, length_s, shared=shared)  # (T, 1 + J, 3)
    moving = decay_rate(rate, acceleration, times_s, length_s, shared=shared)
    root, quat = apply_offset(root, quat, still[:, 0], still[:, 1:])
    return apply_offset(root, quat, moving[:, 0], moving[:, 1:])


# Feet at joins. The two takes of a join have their feet in different places, so that feet that stand in both
# takes move during the transition. They are locked by the contacts of the takes.


_BLENDED_S = 0.65  # to each side of a join: a little more than the longest transition
_LOCKED_S = 0.35  # distance from a join within which feet are locked firmly
_FIRM_SHIFT_S = 0.06  # time over which the shift of a foot comes and goes there
_EASE_S = 0.3  # from there to the longer time of the rest of the dance
_CONTACT_EASE_S = 0.04  # standard deviation of the Gaussian that smooths contacts


@dataclass(frozen=True, eq=False)
class Joins:
    """The times at which the takes of a dance change, and the feet of both takes around them."""

    times_s: Floats  # (B,) at which a take begins after another one
    feet_m: tuple[tuple[int, Floats], ...]  # first dance frame, and `CONTACT_JOINTS` (n, 4, 3) of a take

    def between(self, begin: int, end: int, fps: float) -> Joins:
        """The joins of a part of the dance, from one frame to another, with times from its start."""
        feet_m = [
            (max(first, begin) - begin, of_take_m[max(0, begin - first) : max(0, end - first)])
            for first, of_take_m in self.feet_m
        ]
        return Joins(self.times_s - begin / fps, tuple(one for one in feet_m if len(one[1])))

    def contacts(self, motion: Motion, from_s: float, to_s: float) -> Floats:
        """Contacts (T, 4) of a motion, and near joins from `from_s` to `to_s` also those of its takes."""
        feet_m = body_pos_m(motion, CONTACT_JOINTS)  # (T, 4, 3)
        floor_m = np.percentile(feet_m[..., 1], FLOOR_PERCENT, axis=0)
        of_takes = np.zeros((motion.n_frames, 4))
        for first, of_take_m in self.feet_m:
            rows = of_takes[first : first + len(of_take_m)]
            rows[:] = np.maximum(rows, contacts_above(of_take_m, floor_m, motion.fps)[: len(rows)])
        scipy.ndimage.gaussian_filter1d(of_takes, _CONTACT_EASE_S * motion.fps, axis=0, output=of_takes)
        times_s = frame_times_s(motion.n_frames, motion.fps)
        of_takes[(times_s < from_s) | (times_s > to_s)] = 0.0
        contacts = np.empty_like(of_takes)
        for joint in range(4):  # one by one, since all of a long dance are large
            one = slice(joint, joint + 1)
            contacts[:, one] = contacts_above(feet_m[:, one], floor_m[one], motion.fps)
        return np.maximum(contacts, of_takes, out=contacts).clip(0.0, 1.0, out=contacts)

    def shift_s(self, n_frames: int, fps: float, usual_s: float) -> Floats:
        """Time (T,) over which the shift of a locked foot comes and goes: `usual_s`, and less near joins."""
        times_s = frame_times_s(n_frames, fps)
        near = np.zeros(n_frames)
        reach = seconds_to_frames(_LOCKED_S + _EASE_S, fps) + 2
        for at_s in self.times_s:
            frame = seconds_to_frames(at_s, fps)
            part = slice(max(0, frame - reach), max(0, frame + reach))
            away = np.clip((np.abs(times_s[part] - at_s) - _LOCKED_S) / _EASE_S, 0.0, 1.0)
            near[part] = np.maximum(near[part], 1.0 - away * away * (3.0 - 2.0 * away))
        shift_s: Floats = usual_s * (_FIRM_SHIFT_S / usual_s) ** near
        return shift_s


def feet_at_join(a: SampledRun, b: SampledRun, fps: float) -> list[tuple[int, Floats]]:
    """The feet of both runs around the start of `b`, in the form of `Joins.feet_m`."""
    reach = seconds_to_frames(_BLENDED_S, fps)
    spans = (a, max(a.start, b.start - reach), b.start), (b, b.start, min(b.stop, b.start + reach))
    return [(first, run.bodies_m(first, stop, CONTACT_JOINTS)) for run, first, stop in spans]
