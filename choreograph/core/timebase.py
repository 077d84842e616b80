"""The frame rates of the program, and the conversions between seconds and frames.

Public functions take seconds, kernels take frames. Frame `i` at `fps` is at time `i / fps`. A span of
`duration_s` has `round(duration_s * fps)` frames.
"""

from __future__ import annotations

import re
import reprlib

import numpy as np
from numpy.typing import ArrayLike, NDArray

from choreograph.core.errors import ParameterError

SAMPLE_RATE_HZ = 22050  # mono audio inside the program
MUSIC_FPS = 60  # music features
NET_FPS = 20  # motion in the networks, the warper and the costs
STORE_FPS = 60  # stored motion, or its native rate if that is lower

NODE_S = 1  # one node of the graph
SEGMENT_S = 4  # the span of a style vector and of a warped segment
CLIP_S = 8  # the span in which the warper places a segment

NODE_FRAMES = NODE_S * NET_FPS
SEGMENT_FRAMES = SEGMENT_S * NET_FPS
CLIP_FRAMES = CLIP_S * NET_FPS
MIN_SLOPE = 0.5  # of time maps: source frames per output frame
MAX_SLOPE = 2.0
WORD_FRAMES = 13  # of a motion word of any duration, from beat to beat
WORD_FPS = 30.0  # of the positions from which words are segmented


_CLOCK = re.compile(r"(?:(\d+):(?=[0-5]\d:))?(\d+):([0-5]?\d(?:\.\d*)?)", re.ASCII)  # hours, minutes, seconds


def parse_seconds(text: str) -> float:
    """Seconds of `75.5`, `1:15.5` or `1:02:03.5`. Raises `ParameterError` for anything else."""
    clock = _CLOCK.fullmatch(text.strip())
    if clock:
        hours, minutes, seconds = clock.groups(default="0")
        return 3600.0 * int(hours) + 60.0 * int(minutes) + float(seconds)
    try:
        return float(text)
    except ValueError:
        raise ParameterError(
            f"expected a time in seconds, such as 75.5, or as 1:15.5, got {reprlib.repr(text)}"
        ) from None


def seconds_to_frames(seconds: float, fps: float) -> int:
    """The nearest whole number of frames in a span."""
    return round(seconds * fps)


def frames_to_seconds(frames: ArrayLike, fps: float) -> NDArray[np.float64]:
    """Times of (fractional) frames, in seconds."""
    return np.asarray(frames, dtype=np.float64) / fps


def times_to_frames(times_s: ArrayLike, fps: float) -> NDArray[np.float64]:
    """Fractional frames of times in seconds."""
    return np.asarray(times_s, dtype=np.float64) * fps


def frame_times_s(n_frames: int, fps: float) -> NDArray[np.float64]:
    """Times of frames 0 … n_frames - 1, in seconds, (T,)."""
    return np.arange(n_frames, dtype=np.float64) / fps
