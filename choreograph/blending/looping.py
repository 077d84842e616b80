"""A dance cut to whole bars, so that it ends where it begins: for games, idle loops and backgrounds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.blending.filled_gaps import fill_gaps
from choreograph.errors import ParameterError
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion
from choreograph.motion.pose import clips_to_root_frame
from choreograph.timebase import seconds_to_frames

Floats = NDArray[np.float64]

_KEPT_S = 0.5  # after the loop's start: what its end is led to
_SHORTEST_SHARE = 0.75  # of the bars there are: a shorter loop repeats too soon
_LOOK_AHEAD_S = 0.1  # velocities count as the distance that they cover in it


@dataclass(frozen=True, eq=False)
class Loop:
    """A motion whose last frame is its first, and where it was cut from."""

    motion: Motion
    start_s: float  # in the dance
    end_s: float
    n_bars: int


def looped(motion: Motion, bar_times_s: Sequence[float] | Floats) -> Loop:
    """The motion from one start of a bar to another, led and blended so that it ends where it begins.

    Of the spans that hold three quarters or more of the bars, it is the one whose ends are the most alike in
    pose and velocity. Its last frame is its first. On the way there the body is turned and shifted, most
    where it travels, and feet are locked, as where gaps are filled.

    Raises `ParameterError` if fewer than two bars begin within the motion.
    """
    frames = np.unique([seconds_to_frames(time, motion.fps) for time in bar_times_s])
    kept = max(2, seconds_to_frames(_KEPT_S, motion.fps))
    # What is around the first frame of a loop is what its last one is led to.
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
    return Loop(
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
