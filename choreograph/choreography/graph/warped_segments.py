"""Warped segments: the candidates of every second of the song, aligned with its music."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.graph.warp_kernels import segment_beats
from choreograph.choreography.graph.warping import (
    NO_TIME_MAP,
    CountedClips,
    CountMaps,
    count_time_maps,
    warp_by_density,
)
from choreograph.core.cache import NO_MEMORY, Memory, rows_from
from choreograph.core.numerics import AnyInts
from choreograph.core.timebase import NET_FPS, SEGMENT_FRAMES, SEGMENT_S
from choreograph.motion.motion_beats import MIN_PROMINENCE

NEAR_FRAMES = 1.0  # 50 ms, up to which beats match fully
FAR_FRAMES = 5.0  # 250 ms, beyond which beats do not match at all
_UNKNOWN_OFF_BAR = 0.75  # of a take without counts, as by chance in a bar of four
_KEY_BYTES = 16  # of the key of a memory
_MOST_KEPT_S = 600  # of a song whose time maps are kept: 30 MB. Those of a longer song are made again
_RECENT_S = 8  # whose time maps are kept in a longer song
_FEW = 8  # segments, whose time maps are made without the others of their second


@dataclass(frozen=True, eq=False)
class ClipBeats:
    """Motion beats of all clips, in clip frames at 20 fps, concatenated."""

    frames: NDArray[np.float64]  # (Q,)
    ranges: NDArray[np.int64]  # (N, 2)


@dataclass(frozen=True, eq=False)
class Segments:
    """The warped segments inserted at each second (S seconds, K candidates)."""

    clip: NDArray[np.int64]  # (S, K)
    time_maps: NDArray[np.float32]  # (S, K, 81) clip frames at the 80 output frames and the end, or (S, K, 0)
    density_mismatch: NDArray[np.float32]  # (S, K, 4) mean squared difference of densities per quarter
    unmatched_beat: NDArray[np.float32]  # (S, K, 4) share of music and motion beats without a partner
    first_beat: NDArray[np.float32]  # (S, K, 4) frame of the quarter's first motion beat, nan if none
    last_beat: NDArray[np.float32]  # (S, K, 4)
    time_map_id: NDArray[np.int64]  # (S, K) equal in segments of one time map. `NO_TIME_MAP` if none
    off_bar: NDArray[np.float32]  # (S, K, 4) share of beats whose number in the bar is not the take's
    phrase_penalty: NDArray[np.float32]  # (S, K, 5) of changing takes at the quarters' borders, 0 … 1
    inputs: NDArray[np.uint8]  # (S, 16) digest of all else that they follow from. 0 without memory
    made_again: TimeMaps | None = None  # the time maps of a long song

    def maps(self, start: AnyInts, rank: AnyInts) -> NDArray[np.float32]:
        """The time maps (N, 81) of the segments `rank` (N,) that are inserted at `start` (N,)."""
        if self.made_again is None:
            kept: NDArray[np.float32] = self.time_maps[start, rank]
            return kept
        maps = np.empty((len(start), SEGMENT_FRAMES + 1), np.float32)
        for second in np.unique(start).tolist():
            here = start == second
            maps[here] = self.made_again.of(second, rank[here])
        return maps


class TimeMaps:
    """Makes the time maps of segments again where they are read, because those of a long song are large."""

    def __init__(self, make: Callable[[int, AnyInts], NDArray[np.float32]], clip: AnyInts) -> None:
        """`make` makes the time maps (N, 81) of clips (N,) from a second on. `clip` (S, K) are all clips."""
        self._make, self._clip = make, clip
        self._recent: dict[int, NDArray[np.float32]] = {}

    def of(self, second: int, rank: AnyInts) -> NDArray[np.float32]:
        """The time maps (N, 81) of the segments `rank` (N,) that are inserted at a second."""
        if second not in self._recent:
            if len(rank) <= _FEW:
                return self._make(second, self._clip[second, rank])
            self._recent = dict(list(self._recent.items())[1 - _RECENT_S :])
            self._recent[second] = self._make(second, self._clip[second])
        return self._recent[second][rank]


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
    memory: Memory = NO_MEMORY,
) -> Segments:
    """Warp the candidates `clip` (S, K) of every second onto the music's tempo-density (S, 80).

    `clip_density` and `clip_speed` return tempo-densities and mean joint speeds (K, 160) of clips.
    `music_beats_s` (Q,) are times in the song. Clips of takes with counts (`counted`) are aligned by their
    counts instead (`count_time_maps`). With `as_recorded`, segments are the clips' middle 4 s at their own
    speed. See ChoreoGraph, section 3.2. Smooth time maps (`smoothed`) and alignment by counts are ours.
    `memory` is of the same clips and `clip_density`. From it, seconds and segments of other candidates are
    taken.
    """
    n_seconds = len(clip)
    grid = None if counted is None else (counted.song, counted.join_times_s)
    memory = memory.of(grid, as_recorded, smoothed)

    def music_frames_from(second: int) -> NDArray[np.floating]:
        near = slice(*np.searchsorted(music_beats_s, [second - 0.5, second + SEGMENT_S + 0.5]))
        return (music_beats_s[near] - second) * NET_FPS

    def warp(second: int) -> Segments:
        music_frames = music_frames_from(second)
        later = None if counted is None else counted.later_counts[second]
        inputs = (second, music_density[second], music_frames, later)
        key = np.frombuffer(memory.key(*inputs) or bytes(_KEY_BYTES), np.uint8)

        def warped(clips: NDArray[np.integer]) -> Segments:
            return _warped_second(
                second, clips, music_density[second], music_frames, clip_density, clip_speed, beats, counted,
                key, as_recorded=as_recorded, smoothed=smoothed,
            )  # fmt: skip

        def from_last(last: list[Segments]) -> Segments:
            arrays: dict[str, Any] = rows_from(
                [_arrays_of(one) for one in last], [one.clip for one in last], clip[second],
                lambda new: _arrays_of(warped(clip[second][new])),
            )  # fmt: skip
            return Segments(**arrays, inputs=key)

        return memory.value_from_last(from_last, inputs, clip[second])

    def made_again(second: int, clips: AnyInts) -> NDArray[np.float32]:
        return _time_maps(
            second, clips, music_density[second], music_frames_from(second), clip_density, beats, counted,
            as_recorded=as_recorded, smoothed=smoothed,
        )[0]  # fmt: skip

    is_long = n_seconds > _MOST_KEPT_S and not memory.is_on
    stored: dict[str, Any] = {}
    # Alignment by counts is many short steps of NumPy, which threads would slow down.
    n_threads = 1 if counted is not None else os.cpu_count()
    with ThreadPoolExecutor(n_threads) as pool:
        each_second = map if n_threads == 1 else pool.map
        for second, warped in enumerate(each_second(warp, range(n_seconds))):
            arrays = _arrays_of(warped) | {"inputs": warped.inputs}
            if is_long:
                arrays["time_maps"] = arrays["time_maps"][:, :0]
            for name, array in arrays.items():
                if name not in stored:
                    stored[name] = np.empty((n_seconds, *array.shape), array.dtype)
                stored[name][second] = array
            if report is not None:
                report(second + 1, n_seconds)
    segments = Segments(**stored)
    return replace(segments, made_again=TimeMaps(made_again, segments.clip)) if is_long else segments


def _arrays_of(segments: Segments) -> dict[str, Any]:
    """The arrays with a row for each segment of one second, by name."""
    return {name: values for name, values in vars(segments).items() if name not in ("inputs", "made_again")}


def _warped_second(
    second: int,
    clip: NDArray[np.integer],
    music_density: NDArray[np.float32],
    music_frames: NDArray[np.floating],
    clip_density: Callable[[NDArray[np.integer]], NDArray[np.float32]],
    clip_speed: Callable[[NDArray[np.integer]], NDArray[np.float32]],
    beats: ClipBeats,
    counted: CountedClips | None,
    inputs: NDArray[np.uint8],
    *,
    as_recorded: bool,
    smoothed: bool,
) -> Segments:
    """The segments (K, ...) of one second, without the axis of seconds."""
    k = len(clip)
    time_maps, density_mismatch, laid = _time_maps(
        second, clip, music_density, music_frames, clip_density, beats, counted, as_recorded=as_recorded,
        smoothed=smoothed,
    )  # fmt: skip
    time_map_id = np.full(k, NO_TIME_MAP, np.int64)
    off_bar = np.full((k, SEGMENT_S), _UNKNOWN_OFF_BAR, np.float32)
    phrase_penalty = np.ones((k, SEGMENT_S + 1), np.float32)
    if laid is not None:
        time_map_id[laid.candidates] = laid.time_map_id
        off_bar[laid.candidates] = laid.off_bar
        phrase_penalty[laid.candidates] = laid.phrase_penalty
    measures = segment_beats(
        time_maps.astype(np.float64), clip_speed(clip), music_frames, NEAR_FRAMES, FAR_FRAMES, MIN_PROMINENCE
    )
    unmatched_beat, first_beat, last_beat = (np.asarray(measure, np.float32) for measure in measures)
    return Segments(
        np.asarray(clip, np.int64), time_maps, density_mismatch, unmatched_beat, first_beat, last_beat,
        time_map_id, off_bar, phrase_penalty, inputs,
    )  # fmt: skip


def _time_maps(
    second: int,
    clip: NDArray[np.integer],
    music_density: NDArray[np.float32],
    music_frames: NDArray[np.floating],
    clip_density: Callable[[NDArray[np.integer]], NDArray[np.float32]],
    beats: ClipBeats,
    counted: CountedClips | None,
    *,
    as_recorded: bool,
    smoothed: bool,
) -> tuple[NDArray[np.float32], NDArray[np.float32], CountMaps | None]:
    """Time maps (K, 81) of one second, mismatch of densities (K, 4), and what is aligned by counts."""
    time_maps = np.empty((len(clip), SEGMENT_FRAMES + 1), np.float32)
    density_mismatch = np.zeros((len(clip), SEGMENT_S), np.float32)
    searched, laid = np.ones(len(clip), bool), None
    if counted is not None:
        laid = count_time_maps(second, clip, counted)
        searched[laid.candidates] = False
        time_maps[laid.candidates] = laid.time_maps
    if searched.any():
        others = clip[searched]
        time_maps[searched], density_mismatch[searched] = warp_by_density(
            music_density, clip_density(others), music_frames, beats.frames, beats.ranges[others],
            as_recorded=as_recorded, smoothed=smoothed,
        )  # fmt: skip
    return time_maps, density_mismatch, laid
