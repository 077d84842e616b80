"""Layers: the nodes active in each second, built from the warped segments of the last four."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, fields
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.graph.segments import Segments
from choreograph.core.arguments import check_kind, unexpected
from choreograph.core.numerics import AnyFloats, AnyInts
from choreograph.core.progress import one_line
from choreograph.core.timebase import NET_FPS, NODE_FRAMES, SEGMENT_S

Moments = tuple[tuple[int, float], ...]  # number of each moment, and after which share of the second it is

_ALL = slice(None)
_TAKE_FRAMES = 1 << 24  # more than the frames of any take
MIDDLE = 0.5  # share of a second
USAGE_DECAY_S = 120.0  # time constant: recent usage falls to 1/e after this time


class PoseBank(Protocol):
    """The features of clips at fractional frames that layers read from the repertoire."""

    def poses_m(self, clip: AnyInts, frames: AnyFloats) -> tuple[AnyFloats, AnyFloats]:
        """Poses (N, 21, 3) and velocities (N, 21, 3) in m/s, both in the root frame."""
        ...

    def liveliness(self, clip: AnyInts, start: AnyFloats, stop: AnyFloats) -> AnyFloats:
        """Rank (N,), 0 … 1, in its genre of each clip played from frame `start` to `stop` in one second."""
        ...

    def headings_rad(self, clip: AnyInts, frames: AnyFloats) -> AnyFloats:
        """Headings (N, F) of clips (N,) at fractional frames (N, F), from the front of their takes."""
        ...

    def count_uncertainty(self, clip: AnyInts, start: AnyFloats, stop: AnyFloats) -> AnyFloats:
        """Uncertainty (N,), 0 … 1, of the counts halfway between two frames of each clip."""
        ...


@dataclass(frozen=True, eq=False)
class Layer:
    """All nodes that are active in one second of the song. Axis 0 of every array is the node.

    Costs (`Cost`) are computed from layers. Poses are in the root frame: the pelvis is above the origin, and
    the body faces +Z. Poses of two nodes can therefore be compared as if one had been aligned to the other.
    The fields `first_*` belong to the start of the second and `last_*` to its end. The last pose of a node is
    the first pose of its successor in the segment.

    Examples
    --------
    >>> layers = []
    >>> class Recorder(cg.Cost):
    ...     def node(self, layer, song_features):
    ...         layers.append(layer)
    >>> dance = cg.dance(cg.example_songs()["house"], duration_s=2, costs=[Recorder()])
    >>> layer = layers[0]
    >>> layer.second, layer.first_pose_m.shape == (layer.n_nodes, 21, 3)
    (0, True)
    >>> of_house = layer.subset(layer.genre == "house")
    >>> set(of_house.genre.tolist())
    {'house'}
    """

    second: int  # second of the song
    segment: AnyInts  # (N,) second × K + rank, the same for all nodes of one warped segment
    offset: AnyInts  # (N,) 0 … 3: the node's quarter of its segment
    clip: AnyInts  # (N,) index in the repertoire
    take: AnyInts  # (N,) index in the repertoire
    take_names: NDArray[np.str_]  # (N,)
    genre: NDArray[np.str_]  # (N,)
    style: AnyFloats  # (N, 32) of the clip
    take_usage_s: AnyFloats  # (N, takes) recent use of each take along the cheapest path to the node, decayed
    take_frames: AnyFloats  # (N, 2) take frames (20 fps) at the second's two borders
    density_mismatch: AnyFloats  # (N,) mean squared difference of tempo-densities in this second
    unmatched_beat: AnyFloats  # (N,) share of this second's music and motion beats without a partner
    first_beat: AnyFloats  # (N,) frame (20 fps) of the first motion beat in the second, nan if none
    last_beat: AnyFloats  # (N,) frame of the last one
    time_map_id: AnyInts  # (N,) equal for nodes of one continuous time map of a counted take, -1 for others
    count_uncertainty: AnyFloats  # (N,) of the counts of the node's take here, 0 … 1: 0 if not estimated
    off_bar: AnyFloats  # (N,) share of this second's beats whose number in the bar is not the take's
    enter_penalty: AnyFloats  # (N,) of entering the node's take here: 0 at the border of a figure or bar
    leave_penalty: AnyFloats  # (N,) of leaving it at the second's end
    heading_rad: AnyFloats  # (N, 2) at the second's borders, from the front of its take
    turned_away: AnyFloats  # (N,) mean of (1 - cos heading) / 2: 0 faces the audience, 1 turns the back to it
    liveliness: AnyFloats  # (N,) rank of its travel and width as danced among its genre's seconds, 0 … 1
    steps: AnyFloats  # (N,) rank of the clip's steps in its genre, 0 … 1
    source_frames: AnyFloats  # (N, 21) clip frames at the 20 output frames and the second's end
    first_pose_m: AnyFloats  # (N, 21, 3) where takes may change at the second's start,
    last_pose_m: AnyFloats  # (N, 21, 3) and at its end
    first_velocity_m_s: AnyFloats  # (N, 21, 3)
    last_velocity_m_s: AnyFloats  # (N, 21, 3)
    motifs: AnyInts  # (N, W) of the node's words, in order, padded with -1. W = 0 if no cost uses motifs
    motif_counts: AnyInts  # (N, M) of each motif along the cheapest path to the node. M = 0 likewise
    danced: AnyFloats  # (N, R) positions in takes at the moments that return, along the path. nan if later
    new_goal: bool = False  # the count of motifs restarts at this second
    moments: Moments = ()  # of this second that return later
    returns: int | None = None  # the moment, a number below R, that the middle of this second returns to

    __repr__ = one_line

    @property
    def n_nodes(self) -> int:
        """Number of nodes N."""
        return len(self.segment)

    def subset(self, nodes: AnyInts | NDArray[np.bool_]) -> Layer:
        """The layer with some of its nodes.

        `nodes` are indices (M,) or a mask (N,). Raises `ParameterError` for anything else.
        """
        try:
            if not isinstance(nodes, slice) and np.ndim(nodes) != 1:
                raise IndexError
            arrays = {name: getattr(self, name)[nodes] for name in _ARRAYS}
        except (IndexError, ValueError):
            n_nodes = self.n_nodes
            raise unexpected(f"indices below {n_nodes} of nodes, or a mask ({n_nodes},)", nodes) from None
        return changed_layer(self, **arrays)

    def with_motif_counts(self, counts_before: AnyInts) -> Layer:
        """The layer with the motif counts of the path that ends at each node.

        They are the counts of the path up to the node, `counts_before` (N, M), plus the node's own motifs.
        Where a new goal begins, only the node's own motifs are counted. Raises `ParameterError` for another
        shape or other values than whole numbers.
        """
        check_kind("motif counts", counts_before, np.ndarray)
        shape = self.motif_counts.shape
        if counts_before.shape != shape or counts_before.dtype.kind not in "iu":
            raise unexpected(f"motif counts {shape} as whole numbers", counts_before)
        if counts_before.shape[1] == 0:
            return self
        counts = np.zeros_like(counts_before) if self.new_goal else counts_before.copy()
        node, slot = np.nonzero(self.motifs >= 0)
        np.add.at(counts, (node, self.motifs[node, slot]), 1)
        return changed_layer(self, motif_counts=counts)

    def with_take_usage(self, usage_before_s: AnyFloats) -> Layer:
        """The layer with `usage_before_s` (N, takes) of the path to each node, plus the node's own second.

        Raises `ParameterError` for another shape or other values than floating-point numbers.
        """
        check_kind("usage of takes", usage_before_s, np.ndarray)
        shape = self.take_usage_s.shape
        if usage_before_s.shape != shape or usage_before_s.dtype.kind != "f":
            raise unexpected(f"usage of takes {shape} in seconds", usage_before_s)
        if usage_before_s.shape[1] == 0:
            return self
        usage_s = usage_before_s * np.float32(np.exp(-1.0 / USAGE_DECAY_S))
        usage_s[np.arange(self.n_nodes), self.take] += 1.0
        return changed_layer(self, take_usage_s=usage_s)

    def with_danced(self, danced_before: AnyFloats) -> Layer:
        """The layer with the positions `danced_before` (N, R) of the path to each node, and its own ones.

        Raises `ParameterError` for another shape or other values than floating-point numbers.
        """
        check_kind("danced positions", danced_before, np.ndarray)
        shape = self.danced.shape
        if danced_before.shape != shape or danced_before.dtype.kind != "f":
            raise unexpected(f"danced positions {shape}", danced_before)
        if shape[1] == 0:
            return self
        if not self.moments:
            return changed_layer(self, danced=danced_before)
        danced = danced_before.copy()
        for number, share in self.moments:
            danced[:, number] = positions(self, share)
        return changed_layer(self, danced=danced)

    def successors_in(self, following: Layer) -> tuple[AnyInts, AnyInts]:
        """The pairs of nodes that are consecutive in one warped segment or time map.

        Returns the indices (M,) in this layer and the indices (M,) in `following`, the layer of the next
        second. Raises `ParameterError` if `following` is no layer.
        """
        check_kind("the following layer", following, Layer)
        next_in_segment = self.segment * SEGMENT_S + self.offset + 1
        here = np.where(self.time_map_id >= 0, -2 - self.time_map_id, next_in_segment)
        in_segment = following.segment * SEGMENT_S + following.offset
        in_segment = np.where(following.offset == 0, -1, in_segment)  # a segment's first node follows none
        there = np.where(following.time_map_id >= 0, -2 - following.time_map_id, in_segment)
        order = np.argsort(here)
        row = order[np.minimum(np.searchsorted(here, there, sorter=order), self.n_nodes - 1)]
        follows = here[row] == there
        return row[follows], np.flatnonzero(follows)


_ARRAYS = tuple(f.name for f in fields(Layer) if f.name not in ("second", "new_goal", "moments", "returns"))


def positions(layer: Layer, share: float) -> AnyFloats:
    """The take and frame of each node after a `share` of its second, as one number (N,) in frames."""
    first, last = layer.take_frames.T
    found: AnyFloats = layer.take * float(_TAKE_FRAMES) + first + share * (last - first)
    return found


def changed_layer(layer: Layer, **values: Any) -> Layer:
    """As `dataclasses.replace`, which takes 20 µs for so many fields. A search makes 60,000 layers."""
    made = object.__new__(type(layer))
    vars(made).update(vars(layer) | values)
    return made


def joined_layers(parts: Sequence[Layer]) -> Layer:
    """The nodes of several layers of one second, in order."""
    arrays: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts]) for name in _ARRAYS
    }
    return changed_layer(parts[0], **arrays)


@dataclass(frozen=True, eq=False)
class ClipTable:
    """Columns of the repertoire's clips and takes that layers contain."""

    take: AnyInts  # (N,)
    start_frame: AnyInts  # (N,) in its take, 20 fps
    take_names: NDArray[np.str_]  # (takes,)
    genres: NDArray[np.str_]  # (takes,)
    style: NDArray[np.float32]  # (N, 32)
    steps: NDArray[np.float32]  # (N,) rank in its genre


class LayerSource:
    """Builds the layer of any second from the segments inserted in it and in the three seconds before.

    Parameters
    ----------
    tie_break_s : float array (takes,)     recent usage that each take starts with. None if it is not counted
    motifs : int array (S, K, 4, W)        of each node, see `node_motifs`. None if no cost uses motifs
    n_motifs : number of motifs in the vocabulary
    goal_starts : seconds at which the count of motifs restarts
    join_times_s : float array (S + 5,)    when takes may change around each second, by default on the second
    moments : `Layer.moments` of each second, and
    returns : `Layer.returns` of each second. None if no cost uses them
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
    ) -> None:
        self._segments = segments
        self._motifs = np.zeros((*segments.clip.shape, SEGMENT_S, 0), np.int16) if motifs is None else motifs
        self._n_motifs = 0 if motifs is None else n_motifs
        usage_s = np.zeros(0) if tie_break_s is None else tie_break_s
        self._usage_at_start_s = usage_s.astype(np.float32)  # (takes,), or (0,)
        self._clips = clips
        self._poses = poses
        self._goal_starts = frozenset(goal_starts)
        seconds = np.arange(len(segments.clip) + SEGMENT_S + 1, dtype=np.float64)
        self._join_times_s = seconds if join_times_s is None else join_times_s
        self._moments = moments or [()] * len(segments.clip)
        self._returns = returns or [None] * len(segments.clip)
        self._not_danced = np.full(sum(map(len, self._moments)), np.nan)
        self._latest_borders: dict[int, tuple[AnyFloats, AnyFloats]] = {}

    @property
    def n_seconds(self) -> int:
        """Number of layers S."""
        return len(self._segments.clip)

    def layer(self, second: int) -> Layer:
        """All nodes active in `second`."""
        inserted = range(max(0, second - SEGMENT_S + 1), second + 1)
        parts = [self._quarter(start, second - start) for start in reversed(inserted)]
        layer = joined_layers(parts)
        return layer.subset(_one_per_time_map(layer.time_map_id)) if (layer.time_map_id >= 0).any() else layer

    def node(self, key: int) -> Layer:
        """The one node with segment × 4 + offset = `key`, without building its whole layer."""
        segment, offset = divmod(key, SEGMENT_S)
        start, rank = divmod(segment, self._segments.clip.shape[1])
        # Indexing copies: a view would keep the time maps of all candidates alive.
        return self._quarter(start, offset, slice(rank, rank + 1)).subset(np.array([0]))

    def _borders(self, start: int) -> tuple[AnyFloats, AnyFloats]:
        """`_make_borders` of all segments. The latest results are kept.

        An `lru_cache` of a method would keep the source alive, and with it all time maps.
        """
        if start not in self._latest_borders:
            # A layer contains the last four insertions, and the planner uses two layers.
            if len(self._latest_borders) > SEGMENT_S:
                self._latest_borders.pop(next(iter(self._latest_borders)))
            self._latest_borders[start] = self._make_borders(start)
        return self._latest_borders[start]

    def _make_borders(self, start: int, part: slice = _ALL) -> tuple[AnyFloats, AnyFloats]:
        """Poses and velocities at the five borders of the segments inserted at `start`, (5, K, 21, 3)."""
        clip = self._segments.clip[start, part]
        maps = self._segments.time_maps[start, part]
        joins = (self._join_times_s[start : start + SEGMENT_S + 1] - start) * NET_FPS  # (5,) output frames
        low = np.clip(np.floor(joins).astype(np.int64), 0, maps.shape[1] - 2)
        speed = maps[:, low + 1] - maps[:, low]  # (K, 5) source frames per output frame
        borders = maps[:, low] + (joins - low) * speed  # (K, 5)
        pose, velocity = self._poses.poses_m(np.repeat(clip, 5), borders.ravel())
        shape = (len(clip), 5, *pose.shape[1:])
        velocity = velocity.reshape(shape) * speed[:, :, None, None]
        return pose.reshape(shape).swapaxes(0, 1), velocity.swapaxes(0, 1)

    def _quarter(self, start: int, offset: int, part: slice = _ALL) -> Layer:
        """Quarter `offset` of the segments inserted at `start`, as the part of a layer that they make."""
        segments, clips = self._segments, self._clips
        clip = segments.clip[start, part]
        take = clips.take[clip]
        k = segments.clip.shape[1]
        pose, velocity = self._borders(start) if part == _ALL else self._make_borders(start, part)
        window = slice(offset * NODE_FRAMES, (offset + 1) * NODE_FRAMES + 1)
        source_frames = segments.time_maps[start, part, window]  # (K, 21)
        headings = self._poses.headings_rad(clip, source_frames)  # (K, 21)
        return Layer(
            second=start + offset,
            segment=start * k + np.arange(k)[part],
            offset=np.full(len(clip), offset),
            clip=clip,
            take=take,
            take_names=clips.take_names[take],
            genre=clips.genres[take],
            style=clips.style[clip],
            take_usage_s=np.tile(self._usage_at_start_s, (len(clip), 1)),
            take_frames=clips.start_frame[clip, None] + source_frames[:, ::NODE_FRAMES],
            density_mismatch=segments.density_mismatch[start, part, offset],
            unmatched_beat=segments.unmatched_beat[start, part, offset],
            first_beat=segments.first_beat[start, part, offset],
            last_beat=segments.last_beat[start, part, offset],
            time_map_id=segments.time_map_id[start, part],
            count_uncertainty=self._poses.count_uncertainty(clip, source_frames[:, 0], source_frames[:, -1]),
            off_bar=segments.off_bar[start, part, offset],
            enter_penalty=segments.phrase_penalty[start, part, offset],
            leave_penalty=segments.phrase_penalty[start, part, offset + 1],
            heading_rad=headings[:, ::NODE_FRAMES],
            turned_away=(0.5 - 0.5 * np.cos(headings)).mean(axis=1),
            liveliness=self._poses.liveliness(clip, source_frames[:, 0], source_frames[:, -1]),
            steps=clips.steps[clip],
            source_frames=source_frames,
            first_pose_m=pose[offset],
            last_pose_m=pose[offset + 1],
            first_velocity_m_s=velocity[offset],
            last_velocity_m_s=velocity[offset + 1],
            motifs=self._motifs[start, part, offset],
            motif_counts=np.zeros((len(clip), self._n_motifs), np.int16),
            danced=np.broadcast_to(self._not_danced, (len(clip), len(self._not_danced))),
            new_goal=start + offset in self._goal_starts,
            moments=self._moments[start + offset],
            returns=self._returns[start + offset],
        )


def _one_per_time_map(time_map_id: AnyInts) -> AnyInts:
    """Indices of the first node of each time map, and of all nodes (N,) without one."""
    own_id = -1 - np.arange(len(time_map_id))
    _, first = np.unique(np.where(time_map_id >= 0, time_map_id, own_id), return_index=True)
    return np.sort(first)
