"""Warping every second's candidates: what the graph inserts."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.features.motion_beats import MIN_PROMINENCE
from choreograph.timebase import CLIP_FRAMES, NET_FPS, NODE_FRAMES, SEGMENT_FRAMES, SEGMENT_S
from choreograph.warping.dtw import subsequence_dtw
from choreograph.warping.time_maps import smooth_time_maps

NEAR_FRAMES = 1.0  # 50 ms: on the beat
FAR_FRAMES = 5.0  # 250 ms: off it


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
    fit: NDArray[np.float32]  # (S, K, 4) mean squared difference of densities, a quarter at a time
    unmatched_beat: NDArray[np.float32]  # (S, K, 4) share of beats that fall alone
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
    `music_beats_s` (Q,) are seconds of the song. `as_recorded` leaves the warp out and takes the clips'
    middle 4 s as they are, measured the same way.
    ChoreoGraph, section 3.2; the time map's smoothing is ours.
    """
    n_seconds, k = clip.shape
    time_maps = np.empty((n_seconds, k, SEGMENT_FRAMES + 1), np.float32)
    per_quarter = [np.empty((n_seconds, k, SEGMENT_S), np.float32) for _ in range(4)]

    def warp(second: int) -> None:
        chosen = clip[second]
        here = music_beats_s[slice(*np.searchsorted(music_beats_s, [second - 0.5, second + SEGMENT_S + 0.5]))]
        maps, *fits = _warped(
            music_density[second], clip_density(chosen), clip_speed(chosen), (here - second) * NET_FPS,
            beats.frames, beats.ranges[chosen], as_recorded=as_recorded,
        )  # fmt: skip
        time_maps[second] = maps
        for stored, fit in zip(per_quarter, fits, strict=True):
            stored[second] = fit

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for done, _ in enumerate(pool.map(warp, range(n_seconds))):
            if report is not None:
                report(done + 1, n_seconds)
    return Segments(np.asarray(clip, np.int64), time_maps, *per_quarter)


def _warped(
    query: NDArray[np.float32],
    targets: NDArray[np.float32],
    speeds: NDArray[np.float32],
    music_frames: NDArray[np.floating],
    beat_frames: NDArray[np.float64],
    beat_ranges: NDArray[np.int64],
    *,
    as_recorded: bool,
) -> tuple[NDArray, ...]:
    """Time maps (K, 81) of one second's candidates, then fit, off_beat, first_beat and last_beat (K, 4)."""
    from choreograph.warping._kernels import beat_fit

    if as_recorded:
        middle = (CLIP_FRAMES - SEGMENT_FRAMES) // 2
        maps = np.tile(np.arange(middle, middle + SEGMENT_FRAMES + 1, dtype=np.float64), (len(targets), 1))
    else:
        paths, _ = subsequence_dtw(query, targets)  # (K, 80)
        maps = smooth_time_maps(
            paths, clip_frames=CLIP_FRAMES - 1, motion_beats=beat_frames, beat_ranges=beat_ranges,
            music_beats=music_frames,
        )  # fmt: skip
        # The end of the last frame, at most the slope of the frame before it.
        end = np.minimum(2 * maps[:, -1] - maps[:, -2], CLIP_FRAMES - 1)
        maps = np.concatenate([maps, end[:, None]], axis=1)  # (K, 81)
    fits = beat_fit(maps, speeds, music_frames, NEAR_FRAMES, FAR_FRAMES, MIN_PROMINENCE)
    return maps, _misfit(query, targets, maps), *fits


def _misfit(
    query: NDArray[np.float32], targets: NDArray[np.float32], maps: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Mean squared difference of densities along the smoothed maps, quarter by quarter, (K, 4)."""
    frames = maps[:, :-1]
    low = np.minimum(frames.astype(np.int64), targets.shape[1] - 2)
    weight = (frames - low).astype(np.float32)
    rows = np.arange(len(targets))[:, None]
    warped = targets[rows, low] * (1 - weight) + targets[rows, low + 1] * weight  # (K, 80)
    return ((warped - query) ** 2).reshape(len(maps), SEGMENT_S, NODE_FRAMES).mean(axis=2)
