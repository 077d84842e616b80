"""Fills gaps of a dance with other motion, and makes dances that end where they begin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats
from choreograph.core.timebase import seconds_to_frames
from choreograph.motion import rotations as rot
from choreograph.motion.body import body_pos_m, clips_to_root_frame, heading_rad
from choreograph.motion.contacts import foot_contacts, lock_feet
from choreograph.motion.motion import Motion
from choreograph.plan.joins import SampledRun, alignment_at
from choreograph.render.assembly import blend_transition

# Gaps of a dance are filled with other motion that meets the kept parts on both sides.
#
# This is not in the papers. Rhythm is a Dancer (section 5.5.2) fills gaps between motifs, not between
# motions.


Frames = tuple[int, int]  # the first, and the one after the last

TRANSITION_S = 0.5  # from a kept part into the filling, and back, within the filling
_SHIFT_S = 0.1  # of locked feet. With longer shifts, the feet of a corrected body would slide
_EASE_S = 0.2  # over which the locking of feet begins and ends beside kept parts
_SMOOTH_S = 0.3  # of the speed by which the correction of the filling is distributed
_RADIUS_M = 0.3  # distance that the feet move in a turn of a radian, about
_STANDING = 0.05  # share of the mean speed at which a standing body is corrected


def fill_gaps(kept: Motion, filling: Motion, spans: Sequence[Frames]) -> Motion:
    """`kept` within `spans`, unchanged, and elsewhere `filling`, moved and blended to meet it.

    Parameters
    ----------
    kept, filling : motions of one skeleton, rate and length
    spans : frames of `kept` in order, disjoint, a gap of a second or more between two

    The filling of a gap begins where the body stands. It is turned and shifted so that it ends where the next
    kept part begins. The correction is largest where the body travels and least where it stands. Feet are
    locked in gaps. A joint's quaternion may change its sign, not its rotation, where a gap ends.

    Raises `ParameterError` if the motions do not match.
    """
    if (kept.n_frames, kept.fps) != (filling.n_frames, filling.fps) or not _alike(kept, filling):
        raise ParameterError(
            f"expected a filling as the dance that is kept, {kept.n_frames} frames at {kept.fps:g} fps, got "
            f"{filling.n_frames} at {filling.fps:g}, or another skeleton"
        )
    root, quat = np.array(kept.root_pos_m), np.array(kept.local_quat)
    gaps = gaps_between(spans, kept.n_frames)
    for gap in gaps:
        _fill(root, quat, gap, kept, filling)
    filled = Motion(kept.skeleton, root, rot.normalize(quat), kept.fps)
    quat = _with_locked_feet(filled, gaps)
    for first, stop in spans:
        quat[first:stop] = kept.local_quat[first:stop]
    return replace(filled, local_quat=quat)


def of_length(motion: Motion, n_frames: int) -> Motion:
    """The motion cut to a number of frames, or extended to it with its last pose."""
    if motion.n_frames >= n_frames:
        return motion.sliced(0, n_frames)
    return motion.sampled(np.minimum(np.arange(n_frames), motion.n_frames - 1).astype(np.float64))


def gaps_between(spans: Sequence[Frames], n_frames: int) -> list[Frames]:
    """The gaps between spans of `n_frames` frames, in order."""
    borders = [0, *(border for span in spans for border in span), n_frames]
    pairs = zip(borders[::2], borders[1::2], strict=True)
    return [(first, stop) for first, stop in pairs if first < stop]


def correction_speed_m_s(kept: Motion, filling: Motion, spans: Sequence[Frames]) -> float:
    """The fastest correction of a filling in any gap, turn and shift together, in metres a second."""
    fastest = 0.0
    for first, stop in gaps_between(spans, kept.n_frames):
        if first > 0 and stop < kept.n_frames:
            before, after = _run(kept, 0, first, locked=True), _run(kept, stop, kept.n_frames, locked=True)
            run = _run(filling, first, stop, locked=False)
            run = run.moved(*alignment_at(before, run, first))
            turn_rad, _ = alignment_at(after, run, stop)
            _, shift_m = alignment_at(after, _turned(run, after, (first, stop)), stop)
            led_m = _RADIUS_M * abs(_wrapped(turn_rad)) + float(np.linalg.norm(shift_m))
            fastest = max(fastest, led_m * kept.fps / (stop - first))
    return fastest


def _alike(a: Motion, b: Motion) -> bool:
    """Whether two motions are of one skeleton, up to the rounding of a motion file."""
    x, y = a.skeleton, b.skeleton
    return x.names == y.names and bool(np.allclose(x.offsets_m[1:], y.offsets_m[1:], atol=1e-3))


def _fill(root: Floats, quat: Floats, gap: Frames, kept: Motion, filling: Motion) -> None:
    """Fill a gap of roots (T, 3) and rotations (T, J, 4) in place."""
    first, stop = gap
    n_frames, last = kept.n_frames, min(stop, kept.n_frames - 1)
    before = _run(kept, 0, max(first, 1), locked=True)
    after = _run(kept, last, n_frames, locked=True)
    run = _run(filling, first, stop, locked=False)
    if first > 0:
        run = run.moved(*alignment_at(before, run, first))
        if stop < n_frames:
            run = _led(run, after, gap)
    elif stop < n_frames:
        run = run.moved(*alignment_at(after, run, stop))
    root[first:stop], quat[first:stop] = run.root[first:stop], run.quat[first:stop]
    if first > 0:
        blend_transition(before, run, "inertial", kept.fps, root, quat)
    if stop < n_frames:
        blend_transition(run, after, "inertial", kept.fps, root, quat)
    signs = np.sign(np.sum(quat[max(first - 1, 0)] * quat[first], axis=-1))  # (J,)
    quat[first:stop] = rot.make_continuous(quat[first:stop]) * np.where(signs < 0, -1.0, 1.0)[:, None]


def _run(motion: Motion, start: int, stop: int, *, locked: bool) -> SampledRun:
    return SampledRun(
        motion.skeleton, motion.fps, 0, start, stop, np.array(motion.root_pos_m),
        np.array(motion.local_quat), locked, TRANSITION_S,
    )  # fmt: skip


def _led(run: SampledRun, after: SampledRun, gap: Frames) -> SampledRun:
    """The filling of a gap, turned and shifted so that it ends where the kept part `after` it begins."""
    turned = _turned(run, after, gap)
    _, shift_m = alignment_at(after, turned, gap[1])
    return replace(turned, root=turned.root + _progress(run, gap)[:, None] * shift_m)


def _turned(run: SampledRun, after: SampledRun, gap: Frames) -> SampledRun:
    """The filling of a gap, turned so that it ends in the direction in which the kept part begins."""
    yaw_rad, _ = alignment_at(after, run, gap[1])
    turn = rot.about_y(_progress(run, gap) * _wrapped(yaw_rad))  # (T, 4)
    steps = rot.rotate(turn[:-1], np.diff(run.root, axis=0))
    root = np.concatenate([run.root[:1], run.root[0] + np.cumsum(steps, axis=0)])
    root += run.root[gap[0]] - root[gap[0]]
    quat = np.array(run.quat)
    quat[:, 0] = rot.multiply(turn, quat[:, 0])
    return replace(run, root=root, quat=quat)


def _wrapped(angle_rad: float) -> float:
    """An angle from -π to π."""
    return float((angle_rad + np.pi) % (2 * np.pi) - np.pi)


def _progress(run: SampledRun, gap: Frames) -> Floats:
    """The share of the correction at each frame (T,), 0 up to the gap and 1 from its end on."""
    first, stop = gap
    fps, n_frames = run.fps, len(run.root)
    heading = np.unwrap(heading_rad(run.bodies_m(0, n_frames)))
    step_m = np.linalg.norm(np.diff(run.root[:, [0, 2]], axis=0), axis=1)  # (T - 1,)
    speed = step_m + _RADIUS_M * np.abs(np.diff(heading))
    speed = scipy.ndimage.gaussian_filter1d(speed[first:stop], _SMOOTH_S * fps, mode="nearest")
    inside = np.arange(stop - first)
    edge = np.clip(np.minimum(inside, stop - first - 1 - inside) / (TRANSITION_S * fps), 0.0, 1.0)
    weight = (speed + _STANDING * speed.mean() + 1e-9) * (0.01 + edge)
    progress = np.zeros(n_frames)
    progress[first + 1 : stop + 1] = np.cumsum(weight)[: n_frames - first - 1] / weight.sum()
    progress[stop:] = 1.0
    return progress


def _with_locked_feet(motion: Motion, gaps: Sequence[Frames]) -> Floats:
    """Rotations (T, J, 4) with feet locked in gaps, less near kept parts."""
    share = np.zeros(motion.n_frames)
    for first, stop in gaps:
        inside = np.arange(first, stop)
        from_start = inside - first if first else np.full(len(inside), np.inf)
        to_end = stop - 1 - inside if stop < motion.n_frames else np.full(len(inside), np.inf)
        ease = np.clip(np.minimum(from_start, to_end) / (_EASE_S * motion.fps), 0.0, 1.0)
        share[first:stop] = ease * ease * (3.0 - 2.0 * ease)
    contacts = foot_contacts(body_pos_m(motion), motion.fps) * (share > 0)[:, None]
    locked = lock_feet(motion, contacts, shift_s=_SHIFT_S)
    return rot.slerp(motion.local_quat, locked.local_quat, share[:, None])


# Dances that are cut to whole bars and end where they begin, for games, idle loops and backgrounds.


_KEPT_S = 0.5  # after the loop's start, which its end must meet
_SHORTEST_SHARE = 0.75  # of all bars. A shorter loop repeats too soon
_LOOK_AHEAD_S = 0.1  # velocities count as the distance that they cover in it


@dataclass(frozen=True, eq=False)
class LoopedMotion:
    """A motion whose last frame is its first, and its place in the dance."""

    motion: Motion
    """The motion from the start of a bar to the start of another."""

    start_s: float
    """Where it begins in the dance, in seconds."""

    end_s: float
    """Where it ends in the dance, in seconds."""

    n_bars: int
    """Number of bars between start and end."""


def looped(motion: Motion, bar_times_s: Sequence[float] | Floats) -> LoopedMotion:
    """The motion from one start of a bar to another, corrected and blended so that it ends where it begins.

    Of the spans with three quarters or more of the bars, it is the one whose ends are the most similar in
    pose and velocity. Its last frame is its first. The body is turned and shifted on the way, and feet are
    locked, as in `fill_gaps`.

    Raises `ParameterError` if fewer than two bars begin within the motion.
    """
    frames = np.unique([seconds_to_frames(time, motion.fps) for time in bar_times_s])
    kept = max(2, seconds_to_frames(_KEPT_S, motion.fps))
    # The frames around the first one of a loop are those that its last one must meet.
    frames = frames[(frames > 0) & (frames < motion.n_frames - kept)].astype(int)
    if len(frames) < 2:
        raise ParameterError(
            f"expected a dance with two bars or more to loop, got {len(frames)} that begin within its "
            f"{motion.duration_s:.1f} s"
        )
    first, last = _most_alike(motion, frames)
    start, stop = int(frames[first]), int(frames[last])
    twice = [motion.sliced(start, stop - 1), motion.sliced(start - 1, start + kept)]
    held = Motion(
        motion.skeleton,
        np.concatenate([part.root_pos_m for part in twice]),
        np.concatenate([part.local_quat for part in twice]),
        motion.fps,
    )
    n_frames = stop - start
    filling = motion.sliced(start, stop + kept)
    made = fill_gaps(held, filling, [(0, kept), (n_frames, n_frames + kept)])
    return LoopedMotion(
        made.sliced(0, n_frames + 1), float(frames[first]) / motion.fps, stop / motion.fps, last - first
    )


def _most_alike(motion: Motion, frames: NDArray[np.int64]) -> tuple[int, int]:
    """The first and the last bar of the loop, as indices of `frames`."""
    poses_m = clips_to_root_frame(body_pos_m(motion)[frames[:, None] + np.arange(2)])  # (N, 2, 21, 3)
    ahead_m = (poses_m[:, 1] - poses_m[:, 0]) * motion.fps * _LOOK_AHEAD_S
    states = np.concatenate([poses_m[:, 0], ahead_m], axis=1).reshape(len(frames), -1)  # (N, 126)
    shortest = max(1, int(np.ceil(_SHORTEST_SHARE * (len(frames) - 1))))
    spans = [(first, last) for first in range(len(frames)) for last in range(first + shortest, len(frames))]
    return min(spans, key=lambda span: float(np.sum((states[span[0]] - states[span[1]]) ** 2)))
