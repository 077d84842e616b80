"""From one run to the next: a crossfade, or an offset that decays (inertialization)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.blending.sampled_runs import SampledRun
from choreograph.config import TRANSITION_LENGTHS_S
from choreograph.motion import rotations as rot
from choreograph.timebase import seconds_to_frames

Floats = NDArray[np.float64]

_BLENDED_SHARE = 0.5  # of a run may be blended at either end, so that its middle stays as recorded
_FORWARDS = np.array([1.0, 1.0, 1.0])
_BACKWARDS = np.array([-1.0, 1.0, -1.0])  # backwards in time the first derivative changes its sign


def crossfade(a_root: Floats, a_quat: Floats, b_root: Floats, b_quat: Floats) -> tuple[Floats, Floats]:
    """Linear blend from a to b over all their frames: roots (T, 3), rotations (T, J, 4).

    The paper's transition (ChoreoGraph, section 3.3).
    """
    weight = (np.arange(len(a_root)) + 0.5) / len(a_root)  # (T,)
    root = a_root * (1 - weight)[:, None] + b_root * weight[:, None]
    return root, rot.slerp(a_quat, b_quat, weight[:, None])


def inertial_offsets(
    a_root: Floats, a_quat: Floats, b_root: Floats, b_quat: Floats, *, fps: float
) -> tuple[Floats, Floats]:
    """The offset from b to a, with its first and second time derivative: (3, 3) and (3, J, 3).

    The arguments are the three frames around the transition, (3, 3) and (3, J, 4). Row 0 of a result is
    the offset (metres, rotation vector), row 1 its rate per second, row 2 per second².
    """
    root = a_root - b_root  # (3, 3)
    turn = rot.to_rotvec(rot.multiply(a_quat, rot.invert(b_quat)))  # (3, J, 3)
    return _derivatives(root, fps), _derivatives(turn, fps)


def _derivatives(values: Floats, fps: float) -> Floats:
    before, here, after = values
    return np.stack([here, (after - before) * fps / 2, (after - 2 * here + before) * fps**2])


def decay_offset(offset: Floats, times_s: Floats, length_s: float) -> Floats:
    """The quintic that starts with `offset` (3, ...) and its derivatives and comes to rest at zero after
    `length_s`: values (T, ...) at `times_s` (T,) ≥ 0.

    Bollo, Inertialization (GDC 2018), without the clamp on overshoot: both sides of our transitions
    share the offset, which halves it.
    """
    d = length_s
    x, v, a = offset
    a = np.zeros_like(a) if d == 0 else a
    # p(0) = x, p'(0) = v, p''(0) = a; p(d) = p'(d) = p''(d) = 0.
    c3 = -(10 * x + 6 * v * d + 1.5 * a * d**2) / d**3
    c4 = (15 * x + 8 * v * d + 1.5 * a * d**2) / d**4
    c5 = -(6 * x + 3 * v * d + 0.5 * a * d**2) / d**5
    t = np.minimum(np.asarray(times_s), d).reshape(-1, *([1] * x.ndim))
    return x + v * t + a * t**2 / 2 + c3 * t**3 + c4 * t**4 + c5 * t**5


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
    # How much of the offset each side takes: a locked run none of it, unless both are locked.
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
        _decay(offsets, part_b * _FORWARDS, after - frame, length, fps, root_out, quat_out, frame - first_out)
    if part_a > 0:
        length = min(longest, room_a)
        before = np.arange(max(first_out, frame - length), frame)
        _decay(
            offsets, part_a * _BACKWARDS, before - frame, length, fps, root_out, quat_out, frame - first_out
        )


def _decay(
    offsets: tuple[Floats, Floats],
    parts: Floats,
    frames: NDArray[np.int64],
    length: int,
    fps: float,
    root_out: Floats,
    quat_out: Floats,
    row: int,
) -> None:
    """Add offsets of root (3, 3) and joints (3, J, 3), times `parts` (3,), that decay within `length` frames.

    `frames` are counted from the transition, which is `row` of the output.
    """
    times_s = np.abs(frames) / fps
    root = decay_offset(parts[:, None] * offsets[0], times_s, length / fps)
    turn = decay_offset(parts[:, None, None] * offsets[1], times_s, length / fps)
    rows = row + frames
    root_out[rows], quat_out[rows] = apply_offset(root_out[rows], quat_out[rows], root, turn)
