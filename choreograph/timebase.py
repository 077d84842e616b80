"""Seconds, frames and beats: the rates of the program and the only conversions between them.

Public functions elsewhere speak seconds; kernels speak frames. Frame `i` at `fps` is the instant
`i / fps`; a span of `duration_s` holds `round(duration_s * fps)` frames.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

SAMPLE_RATE_HZ = 22050  # mono audio inside the program
MUSIC_FPS = 60  # music features
NET_FPS = 20  # motion as the networks, the warper and the costs see it
STORE_FPS = 60  # motion is stored at this rate, or at its own if that is lower

NODE_S = 1  # one node of the graph
SEGMENT_S = 4  # what a style vector describes, and what one warped segment lasts
CLIP_S = 8  # what the warper may choose from

NODE_FRAMES = NODE_S * NET_FPS
SEGMENT_FRAMES = SEGMENT_S * NET_FPS
CLIP_FRAMES = CLIP_S * NET_FPS
MIN_SLOPE = 0.5  # of time maps: source frames per output frame
MAX_SLOPE = 2.0
WORD_FRAMES = 13  # a motion word, from beat to beat, whatever its length
WORD_FPS = 30.0  # of the positions that words are segmented from


def seconds_to_frames(seconds: float, fps: float) -> int:
    """Number of frames in a span, to the nearest frame."""
    return round(seconds * fps)


def frames_to_seconds(frames: ArrayLike, fps: float) -> NDArray[np.float64]:
    """Instants of (fractional) frames, in seconds."""
    return np.asarray(frames, dtype=np.float64) / fps


def times_to_frames(times_s: ArrayLike, fps: float) -> NDArray[np.float64]:
    """Fractional frames of instants in seconds."""
    return np.asarray(times_s, dtype=np.float64) * fps


def frame_times_s(n_frames: int, fps: float) -> NDArray[np.float64]:
    """Instants of frames 0 … n_frames - 1, in seconds, (T,)."""
    return np.arange(n_frames, dtype=np.float64) / fps


def times_to_beats(times_s: ArrayLike, beat_times_s: ArrayLike) -> NDArray[np.float64]:
    """Fractional beat index of instants; before the first and after the last beat by the nearest gap.

    `beat_times_s` (Q,) must be increasing and hold at least two beats.
    """
    times = np.asarray(times_s, dtype=np.float64)
    beats = np.asarray(beat_times_s, dtype=np.float64)
    index = np.interp(times, beats, np.arange(len(beats)))
    index = np.where(times < beats[0], (times - beats[0]) / (beats[1] - beats[0]), index)
    after = len(beats) - 1 + (times - beats[-1]) / (beats[-1] - beats[-2])
    return np.where(times > beats[-1], after, index)
