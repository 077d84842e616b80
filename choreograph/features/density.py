"""The analytic tempo-density: a Gaussian bump on every beat of the motion or of the music.

Baseline and fallback for the learned one (`nets.density`), with the same two functions: one curve per
take at 20 fps, and one per second of music for the 4 s from there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.timebase import NET_FPS, SEGMENT_FRAMES, frame_times_s

BUMP_S = 0.08  # standard deviation of a bump


def bumps(times_s: NDArray[np.floating], beat_times_s: NDArray[np.floating]) -> NDArray[np.float32]:
    """1 at every beat, falling towards 0 between beats, at `times_s` (T,)."""
    if len(beat_times_s) == 0:
        return np.zeros(len(times_s), np.float32)
    after = np.searchsorted(beat_times_s, times_s)
    nearest = [beat_times_s[np.clip(after + side, 0, len(beat_times_s) - 1)] for side in (-1, 0)]
    near = np.minimum(*(np.abs(times_s - beat) for beat in nearest))  # (T,)
    return np.exp(-0.5 * (near / BUMP_S) ** 2).astype(np.float32)


def motion_density(n_frames: int, beat_times_s: NDArray[np.floating]) -> NDArray[np.float32]:
    """Tempo-density of a take, (T,) at 20 fps, from its motion beats in seconds."""
    return bumps(frame_times_s(n_frames, NET_FPS), beat_times_s)


def music_density(n_seconds: int, beat_times_s: NDArray[np.floating]) -> NDArray[np.float32]:
    """Target tempo-density of the 4 s from each second, (S, 80) at 20 fps, from the music's beats."""
    times = np.arange(n_seconds)[:, None] + frame_times_s(SEGMENT_FRAMES, NET_FPS)  # (S, 80)
    return bumps(times.ravel(), beat_times_s).reshape(times.shape)
