"""Warped segments, and the layers of every second, whose nodes are quarters of them.

`warp_segments` aligns the candidates of each second with its music: `Segments`. `LayerSource` makes the layer
of any second from the segments that were inserted in it and in the three seconds before.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.graph.layers import (
    Layer,
    Moments,
    PoseBank,
    arrays_by_name,
    changed_layer,
    facing,
    layer_of,
    repeated,
)
from choreograph.choreography.graph.warp_kernels import segment_beats
from choreograph.choreography.graph.warping import (
    NO_TIME_MAP,
    CountedClips,
    CountMaps,
    count_time_maps,
    warp_by_density,
)
from choreograph.core.cache import NO_MEMORY, Memory, rows_from
from choreograph.core.long_songs import is_long
from choreograph.core.numerics import AnyFloats, AnyInts
from choreograph.core.timebase import NET_FPS, NODE_FRAMES, SEGMENT_FRAMES, SEGMENT_S
from choreograph.motion.motion_beats import MIN_PROMINENCE

NEAR_FRAMES = 1.0  # 50 ms, up to which beats match fully
FAR_FRAMES = 5.0  # 250 ms, beyond which beats do not match at all
_UNKNOWN_OFF_BAR = 0.75  # of a take without counts, as by chance in a bar of four
_KEY_BYTES = 16  # of the key of a memory
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

    are_made_again = is_long(n_seconds) and not memory.is_on  # time maps, of which ten minutes have 30 MB
    stored: dict[str, Any] = {}
    # Alignment by counts is many short steps of NumPy, which threads would slow down.
    n_threads = 1 if counted is not None else os.cpu_count()
    with ThreadPoolExecutor(n_threads) as pool:
        each_second = map if n_threads == 1 else pool.map
        for second, warped in enumerate(each_second(warp, range(n_seconds))):
            arrays = _arrays_of(warped) | {"inputs": warped.inputs}
            if are_made_again:
                arrays["time_maps"] = arrays["time_maps"][:, :0]
            for name, array in arrays.items():
                if name not in stored:
                    stored[name] = np.empty((n_seconds, *array.shape), array.dtype)
                stored[name][second] = array
            if report is not None:
                report(second + 1, n_seconds)
    segments = Segments(**stored)
    return replace(segments, made_again=TimeMaps(made_again, segments.clip)) if are_made_again else segments


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


@dataclass(frozen=True, eq=False)
class ClipTable:
    """Columns of the repertoire's clips and takes that layers contain."""

    take: AnyInts  # (N,)
    start_frame: AnyInts  # (N,) in its take, 20 fps
    usage_column: AnyInts  # (takes,) of each take, see `Layer`
    take_names: NDArray[np.str_]  # (takes,)
    genres: NDArray[np.str_]  # (takes,)
    style: NDArray[np.float32]  # (N, 32)
    steps: NDArray[np.float32]  # (N,) rank in its genre


@dataclass(frozen=True, eq=False)
class _Borders:
    """Bodies of N nodes where takes may change, at both borders of their second."""

    pose_m: AnyFloats  # (N, 2, 21, 3) in the root frame
    velocity_m_s: AnyFloats  # (N, 2, 21, 3)
    heading_rad: AnyFloats  # (N, 2) from the front of the take


class LayerSource:
    """Builds the layer of any second from the segments inserted in it and in the three seconds before.

    Parameters
    ----------
    tie_break_s : float array (columns,)   recent usage that each take starts with. None if it is not counted
    motifs : int array (S, K, 4, W)        of each node, see `node_motifs`. None if no cost uses motifs
    n_motifs : number of motifs in the vocabulary
    goal_starts : seconds at which the count of motifs restarts
    join_times_s : float array (S + 5,)    when takes may change around each second, by default on the second
    moments : `Layer.moments` of each second, and
    returns : `Layer.returns` of each second. None if no cost uses them
    steer_rad : the most by which a transition rotates a take back to the front
    walk_at : shares of the second for `Layer.walk_m`, if the stage has borders
    may_dance : bool array (S, takes)      layers have the nodes of these takes alone, unless there are none
    memory : of layers with the same clips and poses
    """

    def __init__(
        self,
        segments: Segments,
        clips: ClipTable,
        poses: PoseBank,
        *,
        tie_break_s: AnyFloats | None = None,
        motifs: NDArray[np.integer] | None = None,
        n_motifs: int = 0,
        goal_starts: Collection[int] = (),
        join_times_s: NDArray[np.float64] | None = None,
        moments: Sequence[Moments] | None = None,
        returns: Sequence[int | None] | None = None,
        steer_rad: float = 0.0,
        walk_at: Sequence[float] = (),
        may_dance: NDArray[np.bool_] | None = None,
        memory: Memory = NO_MEMORY,
    ) -> None:
        self._segments = segments
        self._may_dance = may_dance
        self._memory = memory
        self._motifs = np.zeros((*segments.clip.shape, SEGMENT_S, 0), np.int16) if motifs is None else motifs
        self._n_motifs = 0 if motifs is None else n_motifs
        usage_s = np.zeros(0) if tie_break_s is None else tie_break_s
        self._usage_at_start_s = usage_s.astype(np.float32)  # (columns,), or (0,)
        self._clips = clips
        self._poses = poses
        self._goal_starts = frozenset(goal_starts)
        self._steer_rad, self._walk_at = steer_rad, walk_at
        seconds = np.arange(len(segments.clip) + SEGMENT_S + 1, dtype=np.float64)
        self._join_times_s = seconds if join_times_s is None else join_times_s
        self._moments = moments or [()] * len(segments.clip)
        self._returns = returns or [None] * len(segments.clip)
        self._not_danced = np.full(sum(map(len, self._moments)), np.nan)

    @property
    def n_seconds(self) -> int:
        """Number of layers S."""
        return len(self._segments.clip)

    def layer(self, second: int) -> Layer:
        """All nodes active in `second`."""
        inserted = range(max(0, second - SEGMENT_S + 1), second + 1)
        part = slice(inserted[0], second + 1)
        joins_s = self._join_times_s[inserted[0] : second + 2]
        layer = self._memory.value_from_last(
            lambda last: self._layer(second, inserted[::-1], last),
            (second, self._segments.inputs[part], joins_s), self._segments.clip[part],
            None if self._may_dance is None else self._may_dance[second],
        )  # fmt: skip
        return self._in_dance(layer)

    def _layer(self, second: int, starts: Sequence[int], last: Sequence[Layer]) -> Layer:
        """The nodes of the segments inserted at `starts`, one of each time map.

        Those among the nodes of the `last` layers, which are of the same seconds, are taken from there.
        """
        kept = one_per_time_map([self._segments.time_map_id[start] for start in starts])
        start = np.repeat(np.asarray(starts), [len(nodes) for nodes in kept])
        rank = np.concatenate(kept)
        clip = self._segments.clip[start, rank]
        if self._may_dance is not None:
            may = self._may_dance[second, self._clips.take[clip]]
            start, rank, clip = (of[may] if may.any() else of for of in (start, rank, clip))
        arrays: dict[str, Any] = rows_from(
            [arrays_by_name(layer) for layer in last],
            [SEGMENT_S * layer.warp.clip + layer.warp.offset for layer in last],
            SEGMENT_S * clip + second - start,
            lambda new: arrays_by_name(self._nodes(start[new], second - start[new], rank[new])),
        )
        arrays["segment"] = self._numbers(start, rank)
        return layer_of({"second": second, "bank": self._poses, **arrays})

    def _numbers(self, start: AnyInts, rank: AnyInts) -> AnyInts:
        """`Warp.segment` of segments `rank` (N,) that are inserted at `start` (N,)."""
        numbers: AnyInts = start * self._segments.clip.shape[1] + rank
        return numbers

    def _in_dance(self, layer: Layer) -> Layer:
        """The layer with what depends on the dance and its seed, not on the segments alone."""
        walk_m = layer.travel_m(self._walk_at) if self._walk_at else layer.walk_m
        start, rank = np.divmod(layer.warp.segment, self._segments.clip.shape[1])
        return changed_layer(
            layer,
            walk_m=walk_m,
            motifs=self._motifs[start, rank, layer.warp.offset],
            motif_counts=repeated(np.zeros(self._n_motifs, np.int16), layer.n_nodes),
            take_usage_s=repeated(self._usage_at_start_s, layer.n_nodes),
            usage_column=self._clips.usage_column[layer.take],
            danced=repeated(self._not_danced, layer.n_nodes),
            new_goal=layer.second in self._goal_starts,
            moments=self._moments[layer.second],
            returns=self._returns[layer.second],
            steer_rad=self._steer_rad,
        )

    def node(self, key: int) -> Layer:
        """The one node with segment × 4 + offset = `key`, without building its whole layer."""
        segment, offset = divmod(key, SEGMENT_S)
        return self.nodes(np.array([segment]), np.array([offset]))

    def nodes(self, segment: AnyInts, offset: AnyInts) -> Layer:
        """The nodes of one second with these values (N,) of `Warp.segment` and `Warp.offset`."""
        start, rank = np.divmod(segment, self._segments.clip.shape[1])
        return self._in_dance(self._nodes(start, offset, rank))

    def _borders(self, start: AnyInts, offset: AnyInts, clip: AnyInts, maps: AnyFloats) -> _Borders:
        """The bodies at both borders of the nodes of `_nodes`, by their clips (N,) and time maps (N, 81)."""
        joins_s = self._join_times_s[(start + offset)[:, None] + [0, 1]] - start[:, None]
        joins = joins_s * NET_FPS  # (N, 2) output frames
        low = np.clip(np.floor(joins).astype(np.int64), 0, maps.shape[1] - 2)
        before = np.take_along_axis(maps, low, axis=1)
        speed = np.take_along_axis(maps, low + 1, axis=1) - before  # (N, 2) source frames per output frame
        borders = before + (joins - low) * speed  # (N, 2)
        pose_m, velocity_m_s = self._poses.poses_m(np.repeat(clip, 2), borders.ravel())
        shape = (len(clip), 2, *pose_m.shape[1:])
        velocity_m_s = velocity_m_s.reshape(shape) * speed[:, :, None, None]
        return _Borders(pose_m.reshape(shape), velocity_m_s, self._poses.headings_rad(clip, borders))

    def _nodes(self, start: AnyInts, offset: AnyInts, rank: AnyInts) -> Layer:
        """Nodes of a second: quarters `offset` (N,) of the segments `rank` (N,) inserted at `start` (N,)."""
        segments, clips = self._segments, self._clips
        clip = segments.clip[start, rank]
        take = clips.take[clip]
        maps = segments.maps(start, rank)
        borders = self._borders(start, offset, clip, maps)
        frames = offset[:, None] * NODE_FRAMES + np.arange(NODE_FRAMES + 1)
        source_frames = np.take_along_axis(maps, frames, axis=1)  # (N, 21)
        headings = self._poses.headings_rad(clip, source_frames)  # (N, 21)
        return layer_of(
            dict(
                second=int(start[0] + offset[0]),
                segment=self._numbers(start, rank),
                offset=offset,
                clip=clip,
                source=clip,
                take=take,
                usage_column=np.zeros(len(clip), np.int64),
                take_names=clips.take_names[take],
                genre=clips.genres[take],
                style=clips.style[clip],
                take_usage_s=np.zeros((len(clip), 0), np.float32),
                take_frames=clips.start_frame[clip, None] + source_frames[:, ::NODE_FRAMES],
                density_mismatch=segments.density_mismatch[start, rank, offset],
                unmatched_beat=segments.unmatched_beat[start, rank, offset],
                first_beat=segments.first_beat[start, rank, offset],
                last_beat=segments.last_beat[start, rank, offset],
                time_map_id=segments.time_map_id[start, rank],
                count_uncertainty=self._poses.count_uncertainty(
                    clip, source_frames[:, 0], source_frames[:, -1]
                ),
                off_bar=segments.off_bar[start, rank, offset],
                enter_penalty=segments.phrase_penalty[start, rank, offset],
                leave_penalty=segments.phrase_penalty[start, rank, offset + 1],
                heading_rad=headings,
                join_heading_rad=borders.heading_rad,
                facing=facing(headings),
                turn_rad=np.zeros(len(clip)),
                walk_m=np.zeros((len(clip), 0, 2)),
                place_m=np.zeros((len(clip), 2)),
                liveliness=self._poses.liveliness(clip, source_frames[:, 0], source_frames[:, -1]),
                steps=clips.steps[clip],
                source_frames=source_frames,
                first_pose_m=np.ascontiguousarray(borders.pose_m[:, 0]),
                last_pose_m=np.ascontiguousarray(borders.pose_m[:, 1]),
                first_velocity_m_s=np.ascontiguousarray(borders.velocity_m_s[:, 0]),
                last_velocity_m_s=np.ascontiguousarray(borders.velocity_m_s[:, 1]),
                motifs=np.zeros((len(clip), 0), np.int16),
                motif_counts=np.zeros((len(clip), 0), np.int16),
                danced=np.zeros((len(clip), 0)),
                bank=self._poses,
            )
        )


def one_per_time_map(time_map_ids: Sequence[AnyInts]) -> list[AnyInts]:
    """The indices of the nodes of each part of a layer, of which each time map has only the first node."""
    shared = np.concatenate(time_map_ids)
    _, first = np.unique(np.where(shared >= 0, shared, -1 - np.arange(len(shared))), return_index=True)
    first, stops = np.sort(first), np.cumsum([len(ids) for ids in time_map_ids])
    found = np.split(first, np.searchsorted(first, stops[:-1]))
    return [nodes - (stop - len(ids)) for nodes, stop, ids in zip(found, stops, time_map_ids, strict=True)]
