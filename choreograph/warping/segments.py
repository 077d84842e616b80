"""Warping every second's candidates: the segments that the graph inserts."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.features.motion_beats import MIN_PROMINENCE
from choreograph.motion.interpolation import frame_weights
from choreograph.timebase import CLIP_FRAMES, NET_FPS, NODE_FRAMES, SEGMENT_FRAMES, SEGMENT_S
from choreograph.warping.dtw import subsequence_dtw
from choreograph.warping.time_maps import smooth_time_maps

NEAR_FRAMES = 1.0  # 50 ms: beats no further apart match fully
FAR_FRAMES = 5.0  # 250 ms: beats further apart do not match at all


@dataclass(frozen=True, eq=False)
class ClipBeats:
    """Motion beats of all clips, in clip frames at 20 fps, end to end."""

    frames: NDArray[np.float64]  # (Q,)
    ranges: NDArray[np.int64]  # (N, 2)


@dataclass(frozen=True, eq=False)
class Segments:
    """The warped segments inserted at each second; S seconds, K candidates."""

    clip: NDArray[np.int64]  # (S, K)
    time_maps: NDArray[np.float32]  # (S, K, 81) clip frames at the 80 output frames and the end
    density_mismatch: NDArray[np.float32]  # (S, K, 4) mean squared difference of densities per quarter
    unmatched_beat: NDArray[np.float32]  # (S, K, 4) share of music and motion beats without a partner
    first_beat: NDArray[np.float32]  # (S, K, 4) frame of the quarter's first motion beat, nan if none
    last_beat: NDArray[np.float32]  # (S, K, 4)


def warp_segments(
    clip: NDArray[np.integer],
    music_density: NDArray[np.float32],
    music_beats_s: NDArray[np.floating],
    clip_density: Callable[[NDArray[np.integer]], NDArray[np.float32]],
    clip_speed: Callable[[NDArray[np.integer]], NDArray[np.float32]],
    beats: ClipBeats,
    *,
    as_recorded: bool = False,
    report: Callable[[int, int], None] | None = None,
) -> Segments:
    """Warp the candidates `clip` (S, K) of every second onto the music's tempo-density (S, 80).

    `clip_density` and `clip_speed` give tempo-densities and mean joint speeds (K, 160) of clips;
    `music_beats_s` (Q,) are times in the song. `as_recorded` skips the warp: segments are the clips' middle
    4 s at their own speed, with the same measures. ChoreoGraph, section 3.2; smoothing the time maps is
    ours.
    """
    n_seconds, k = clip.shape
    time_maps = np.empty((n_seconds, k, SEGMENT_FRAMES + 1), np.float32)
    per_quarter = [np.empty((n_seconds, k, SEGMENT_S), np.float32) for _ in range(4)]

    def warp(second: int) -> None:
        chosen = clip[second]
        here = music_beats_s[slice(*np.searchsorted(music_beats_s, [second - 0.5, second + SEGMENT_S + 0.5]))]
        maps, *measures = _warp_candidates(
            music_density[second], clip_density(chosen), clip_speed(chosen), (here - second) * NET_FPS,
            beats.frames, beats.ranges[chosen], as_recorded=as_recorded,
        )  # fmt: skip
        time_maps[second] = maps
        for stored, measure in zip(per_quarter, measures, strict=True):
            stored[second] = measure

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for done, _ in enumerate(pool.map(warp, range(n_seconds))):
            if report is not None:
                report(done + 1, n_seconds)
    return Segments(np.asarray(clip, np.int64), time_maps, *per_quarter)


def _warp_candidates(
    query: NDArray[np.float32],
    targets: NDArray[np.float32],
    speeds: NDArray[np.float32],
    music_frames: NDArray[np.floating],
    beat_frames: NDArray[np.float64],
    beat_ranges: NDArray[np.int64],
    *,
    as_recorded: bool,
) -> tuple[NDArray, ...]:
    """Time maps (K, 81) of one second's candidates, then the measures (K, 4) in the order of `Segments`."""
    from choreograph.warping._kernels import segment_beats

    if as_recorded:
        middle = (CLIP_FRAMES - SEGMENT_FRAMES) // 2
        maps = np.tile(np.arange(middle, middle + SEGMENT_FRAMES + 1, dtype=np.float64), (len(targets), 1))
    else:
        paths, _ = subsequence_dtw(query, targets)  # (K, 80)
        maps = smooth_time_maps(
            paths, clip_frames=CLIP_FRAMES - 1, motion_beats=beat_frames, beat_ranges=beat_ranges,
            music_beats=music_frames,
        )  # fmt: skip
        # The end of the last frame, with the slope of the frame before it inside the clip.
        end = np.minimum(2 * maps[:, -1] - maps[:, -2], CLIP_FRAMES - 1)
        maps = np.concatenate([maps, end[:, None]], axis=1)  # (K, 81)
    beats = segment_beats(maps, speeds, music_frames, NEAR_FRAMES, FAR_FRAMES, MIN_PROMINENCE)
    return maps, _density_mismatch(query, targets, maps), *beats


def _density_mismatch(
    query: NDArray[np.float32], targets: NDArray[np.float32], maps: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Mean squared difference of densities along the smoothed maps, per quarter, (K, 4)."""
    low, high, weights = frame_weights(maps[:, :-1], targets.shape[1])
    weight = weights.astype(np.float32)
    rows = np.arange(len(targets))[:, None]
    warped = targets[rows, low] * (1 - weight) + targets[rows, high] * weight  # (K, 80)
    return ((warped - query) ** 2).reshape(len(maps), SEGMENT_S, NODE_FRAMES).mean(axis=2)
