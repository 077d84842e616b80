"""From the staircase of a DTW path to a time map that can be played."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import ParameterError
from choreograph.warping.dtw import MAX_SLOPE, MIN_SLOPE

STIFFNESS = (
    40_000.0  # (frames)⁴: tempo bends over about 2π·⁴√40000 frames ≈ 4.4 s, faster only to meet a beat
)
ANCHOR_WEIGHT = 400.0  # an anchored beat outweighs the path around it
SNAP_FRAMES = 4.0  # 0.2 s: a music beat further from its motion beat is left alone


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
    """Smooth, monotone time maps (K, Tq) near the DTW paths, motion beats on music beats.

    Each map φ minimises Σ(φᵢ - pathᵢ)² + stiffness·Σ(φᵢ₋₁ - 2φᵢ + φᵢ₊₁)² + weight·Σ(φ(mₐ) - bₐ)²
    over the pairs (music beat mₐ, motion beat bₐ) that the path already brings within
    `snap_frames`; then slopes are held in [0.5, 2]. The paper plays the path as it is; a raw path
    alternates between half, one and double speed from frame to frame.

    Parameters
    ----------
    source_frames : float array (K, Tq)   DTW paths, clip frames
    clip_frames : int                     frames of a clip; maps stay in [0, clip_frames - 1]
    motion_beats : float array (Q,)       beats of all clips, increasing within each, clip frames
    beat_ranges : int array (K, 2)        candidate k has motion_beats[range[0]:range[1]]
    music_beats : float array (M,)        beats of the music segment, increasing, output frames
    """
    from choreograph.warping._kernels import smooth_batch

    paths = np.ascontiguousarray(source_frames, np.float64)
    ranges = np.ascontiguousarray(beat_ranges, np.int64)
    if paths.ndim != 2 or paths.shape[1] < 3 or ranges.shape != (len(paths), 2):
        raise ParameterError(
            f"expected DTW paths (K, Tq) of three frames or more and ranges (K, 2), got {paths.shape} "
            f"and {ranges.shape}"
        )
    return smooth_batch(
        paths, np.asarray(motion_beats, np.float64), ranges, np.asarray(music_beats, np.float64),
        float(snap_frames), float(stiffness), ANCHOR_WEIGHT, MIN_SLOPE, MAX_SLOPE, float(clip_frames - 1),
    )  # fmt: skip
