"""The Random Time-Warper: motions whose warp is known, for training and measuring (ChoreoGraph, 3.2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import ParameterError

MAX_SHIFT_S = 0.5
MIN_SLOPE, MAX_SLOPE = 0.5, 2.0  # of the map, as far as the DTW can follow


def random_time_map(
    n_frames: int,
    fps: float,
    rng: np.random.Generator,
    *,
    beat_times_s: NDArray[np.floating],
    max_shift_s: float = MAX_SHIFT_S,
    share: float = 0.5,
) -> NDArray[np.float64]:
    """Source frame of every warped frame, (T,), from 0 to T - 1 with slopes in [0.5, 2].

    About `share` of the motion beats move by up to `max_shift_s`, the ends stay, and between them the
    map is linear. As in the paper; ours: a shift stops where the slope would leave [0.5, 2], because
    the warper's paths end there. Without motion beats inside, knots a second apart move instead.
    """
    if n_frames < 2 or not 0.0 <= share <= 1.0 or max_shift_s < 0:
        raise ParameterError(
            f"expected two frames or more, a share in [0, 1] and a shift of 0 s or more, got {n_frames} "
            f"frames, {share:g} and {max_shift_s:g} s"
        )
    end = n_frames - 1.0
    beats = np.asarray(beat_times_s, np.float64) * fps
    inside = beats[(beats > 1.0) & (beats < end - 1.0)]
    knots = inside if len(inside) else np.arange(fps, end - 1.0, fps)
    source = knots[rng.random(len(knots)) < share] if len(knots) else knots
    source = np.concatenate([[0.0], source, [end]])  # (Q,)
    warped = source.copy()
    shifts = rng.uniform(-max_shift_s * fps, max_shift_s * fps, len(source))
    for i in range(1, len(source) - 1):  # left to right: each keeps room for itself and all after it
        gap, rest = source[i] - source[i - 1], end - source[i]
        low = max(warped[i - 1] + gap / MAX_SLOPE, end - rest / MIN_SLOPE)
        high = min(warped[i - 1] + gap / MIN_SLOPE, end - rest / MAX_SLOPE)
        warped[i] = np.clip(source[i] + shifts[i], low, high)
    return np.interp(np.arange(n_frames), warped, source)


def resampled(values: NDArray[np.floating], frames: NDArray[np.floating]) -> NDArray[np.float32]:
    """`values` (T, ...) at fractional frames (N,), linear between neighbours; the ends hold."""
    at = np.clip(np.asarray(frames, np.float64), 0, len(values) - 1)
    low = np.minimum(at.astype(np.int64), max(len(values) - 2, 0))
    high = np.minimum(low + 1, len(values) - 1)
    weight = (at - low).reshape(-1, *[1] * (values.ndim - 1))
    return (values[low] * (1 - weight) + values[high] * weight).astype(np.float32)


def random_warp(
    body_pos_m: NDArray[np.floating],
    fps: float,
    rng: np.random.Generator,
    *,
    beat_times_s: NDArray[np.floating],
    max_shift_s: float = MAX_SHIFT_S,
    share: float = 0.5,
) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    """Body positions (T, J, 3) randomly warped in time, and their exact map (`random_time_map`)."""
    frames = random_time_map(
        len(body_pos_m), fps, rng, beat_times_s=beat_times_s, max_shift_s=max_shift_s, share=share
    )
    return resampled(body_pos_m, frames), frames
