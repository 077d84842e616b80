"""From the staircase of a DTW path to a smooth time map that can be played."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import ParameterError
from choreograph.timebase import MAX_SLOPE, MIN_SLOPE

# In frames⁴: tempo changes over about 2π·⁴√40000 frames ≈ 4.4 s, faster only to match a beat.
STIFFNESS = 40_000.0
ANCHOR_WEIGHT = 400.0  # a matched beat outweighs the path around it
SNAP_FRAMES = 4.0  # 0.2 s: beats further apart are not matched


def smooth_time_maps(
    source_frames: NDArray[np.floating],
    *,
    clip_frames: int,
    motion_beats: NDArray[np.floating],
    beat_ranges: NDArray[np.integer],
    music_beats: NDArray[np.floating],
    stiffness: float = STIFFNESS,
    snap_frames: float = SNAP_FRAMES,
) -> NDArray[np.float64]:
    """Smooth, monotone time maps (K, Tq) near the DTW paths, with motion beats on music beats.

    Each map φ minimises Σ(φᵢ - pathᵢ)² + stiffness·Σ(φᵢ₋₁ - 2φᵢ + φᵢ₊₁)² + weight·Σ(φ(mₐ) - bₐ)²
    over the pairs (music beat mₐ, motion beat bₐ) that are within `snap_frames` of each other on the
    path; then slopes are clamped to [0.5, 2]. The paper plays the path itself, whose speed alternates
    between half, normal and double from frame to frame.

    Parameters
    ----------
    source_frames : float array (K, Tq)   DTW paths, clip frames
    clip_frames : int                     frames of a clip; maps stay in [0, clip_frames - 1]
    motion_beats : float array (Q,)       beats of all clips, increasing within each, clip frames
    beat_ranges : int array (K, 2)        candidate k has motion_beats[range[0]:range[1]]
    music_beats : float array (M,)        beats of the music segment, increasing, output frames

    Raises `ParameterError` for paths or ranges of another shape, or paths of fewer than three frames.
    """
    from choreograph.warping._kernels import smooth_batch

    paths = np.ascontiguousarray(source_frames, np.float64)
    ranges = np.ascontiguousarray(beat_ranges, np.int64)
    if paths.ndim != 2 or paths.shape[1] < 3 or ranges.shape != (len(paths), 2):
        raise ParameterError(
            f"expected DTW paths (K, Tq) of at least 3 frames and ranges (K, 2), got {paths.shape} "
            f"and {ranges.shape}"
        )
    return smooth_batch(
        paths, np.asarray(motion_beats, np.float64), ranges, np.asarray(music_beats, np.float64),
        float(snap_frames), float(stiffness), ANCHOR_WEIGHT, MIN_SLOPE, MAX_SLOPE, float(clip_frames - 1),
    )  # fmt: skip
