"""Warped segments of the candidates of every second, which are inserted into the graph."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.graph.warping import (
    NO_TIME_MAP,
    CountedClips,
    count_time_maps,
    smooth_time_maps,
    subsequence_dtw,
)
from choreograph.core.numerics import frame_weights
from choreograph.core.timebase import CLIP_FRAMES, NET_FPS, NODE_FRAMES, SEGMENT_FRAMES, SEGMENT_S
from choreograph.motion.motion_beats import MIN_PROMINENCE

NEAR_FRAMES = 1.0  # 50 ms, up to which beats match fully
FAR_FRAMES = 5.0  # 250 ms, beyond which beats do not match at all
_UNKNOWN_OFF_BAR = 0.75  # of a take without counts, as by chance in a bar of four


@dataclass(frozen=True, eq=False)
class ClipBeats:
    """Motion beats of all clips, in clip frames at 20 fps, concatenated."""

    frames: NDArray[np.float64]  # (Q,)
    ranges: NDArray[np.int64]  # (N, 2)


@dataclass(frozen=True, eq=False)
class Segments:
    """The warped segments inserted at each second (S seconds, K candidates)."""

    clip: NDArray[np.int64]  # (S, K)
    time_maps: NDArray[np.float32]  # (S, K, 81) clip frames at the 80 output frames and the end
    density_mismatch: NDArray[np.float32]  # (S, K, 4) mean squared difference of densities per quarter
    unmatched_beat: NDArray[np.float32]  # (S, K, 4) share of music and motion beats without a partner
    first_beat: NDArray[np.float32]  # (S, K, 4) frame of the quarter's first motion beat, nan if none
    last_beat: NDArray[np.float32]  # (S, K, 4)
    time_map_id: NDArray[np.int64]  # (S, K) equal in segments of one time map. `NO_TIME_MAP` if none
    off_bar: NDArray[np.float32]  # (S, K, 4) share of beats whose number in the bar is not the take's
    phrase_penalty: NDArray[np.float32]  # (S, K, 5) of changing takes at the quarters' borders, 0 … 1


def warp_segments(
    clip: NDArray[np.integer],
    music_density: NDArray[np.float32],
    music_beats_s: NDArray[np.floating],
    clip_density: Callable[[NDArray[np.integer]], NDArray[np.float32]],
    clip_speed: Callable[[NDArray[np.integer]], NDArray[np.float32]],
    beats: ClipBeats,
    *,
    counted: CountedClips | None = None,
    as_recorded: bool = False,
    smoothed: bool = True,
    report: Callable[[int, int], None] | None = None,
) -> Segments:
    """Warp the candidates `clip` (S, K) of every second onto the music's tempo-density (S, 80).

    `clip_density` and `clip_speed` return tempo-densities and mean joint speeds (K, 160) of clips.
    `music_beats_s` (Q,) are times in the song. Clips of takes with counts (`counted`) are aligned by their
    counts instead (`count_time_maps`). With `as_recorded`, segments are the clips' middle 4 s at their own
    speed. See ChoreoGraph, section 3.2. Smooth time maps (`smoothed`) and alignment by counts are ours.
    """
    from choreograph.choreography.graph.warp_kernels import segment_beats

    n_seconds, k = clip.shape
    time_maps = np.empty((n_seconds, k, SEGMENT_FRAMES + 1), np.float32)
    density_mismatch = np.zeros((n_seconds, k, SEGMENT_S), np.float32)
    of_beats = [np.empty((n_seconds, k, SEGMENT_S), np.float32) for _ in range(3)]
    time_map_id = np.full((n_seconds, k), NO_TIME_MAP, np.int64)
    off_bar = np.full((n_seconds, k, SEGMENT_S), _UNKNOWN_OFF_BAR, np.float32)
    phrase_penalty = np.ones((n_seconds, k, SEGMENT_S + 1), np.float32)

    def warp(second: int) -> None:
        chosen = clip[second]
        searched = np.ones(k, bool)
        if counted is not None:
            laid = count_time_maps(second, chosen, counted)
            searched[laid.candidates] = False
            time_maps[second, laid.candidates] = laid.time_maps
            time_map_id[second, laid.candidates] = laid.time_map_id
            off_bar[second, laid.candidates] = laid.off_bar
            phrase_penalty[second, laid.candidates] = laid.phrase_penalty
        here = music_beats_s[slice(*np.searchsorted(music_beats_s, [second - 0.5, second + SEGMENT_S + 0.5]))]
        music_frames = (here - second) * NET_FPS
        if searched.any():
            others = chosen[searched]
            time_maps[second, searched], density_mismatch[second, searched] = _warp_by_density(
                music_density[second], clip_density(others), music_frames, beats.frames, beats.ranges[others],
                as_recorded=as_recorded, smoothed=smoothed,
            )  # fmt: skip
        measures = segment_beats(
            time_maps[second].astype(np.float64), clip_speed(chosen), music_frames, NEAR_FRAMES, FAR_FRAMES,
            MIN_PROMINENCE,
        )  # fmt: skip
        for stored, measure in zip(of_beats, measures, strict=True):
            stored[second] = measure

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for done, _ in enumerate(pool.map(warp, range(n_seconds))):
            if report is not None:
                report(done + 1, n_seconds)
    unmatched_beat, first_beat, last_beat = of_beats
    return Segments(
        np.asarray(clip, np.int64), time_maps, density_mismatch, unmatched_beat, first_beat, last_beat,
        time_map_id, off_bar, phrase_penalty,
    )  # fmt: skip


def _warp_by_density(
    query: NDArray[np.float32],
    targets: NDArray[np.float32],
    music_frames: NDArray[np.floating],
    beat_frames: NDArray[np.float64],
    beat_ranges: NDArray[np.int64],
    *,
    as_recorded: bool,
    smoothed: bool,
) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
    """Time maps (K, 81) of one second's candidates, and the mismatch of densities along them (K, 4)."""
    if as_recorded:
        middle = (CLIP_FRAMES - SEGMENT_FRAMES) // 2
        maps = np.tile(np.arange(middle, middle + SEGMENT_FRAMES + 1, dtype=np.float64), (len(targets), 1))
    else:
        if smoothed:
            paths, _ = subsequence_dtw(query, targets)  # (K, 80)
            maps = smooth_time_maps(
                paths, clip_frames=CLIP_FRAMES - 1, motion_beats=beat_frames, beat_ranges=beat_ranges,
                music_beats=music_frames,
            )  # fmt: skip
        else:  # a frame of the clip is left for the end of the last frame
            paths, _ = subsequence_dtw(query, targets[:, :-1])
            maps = paths.astype(np.float64)
        # The end of the last frame, with the slope of the frame before it inside the clip.
        end = np.minimum(2 * maps[:, -1] - maps[:, -2], CLIP_FRAMES - 1)
        maps = np.concatenate([maps, end[:, None]], axis=1)  # (K, 81)
    return maps, _density_mismatch(query, targets, maps)


def _density_mismatch(
    query: NDArray[np.float32], targets: NDArray[np.float32], maps: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Mean squared difference of densities along the smoothed maps, per quarter, (K, 4)."""
    low, high, weights = frame_weights(maps[:, :-1], targets.shape[1])
    weight = weights.astype(np.float32)
    rows = np.arange(len(targets))[:, None]
    warped = targets[rows, low] * (1 - weight) + targets[rows, high] * weight  # (K, 80)
    mismatch: NDArray[np.float32] = (
        ((warped - query) ** 2).reshape(len(maps), SEGMENT_S, NODE_FRAMES).mean(axis=2)
    )
    return mismatch
