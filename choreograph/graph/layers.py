"""Layers: the nodes active in each second, built from the warped segments of the last four."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from choreograph.timebase import NODE_FRAMES, SEGMENT_S
from choreograph.warping.segments import Segments

Floats = NDArray[np.floating]
Ints = NDArray[np.integer]

_ALL = slice(None)
_FORGET_S = 120.0  # of what a take has danced, a third still tires it after this time


class PoseBank(Protocol):
    """What a layer needs of the repertoire: poses and velocities of clips at fractional frames."""

    def poses_m(self, clip: Ints, frames: Floats) -> tuple[Floats, Floats]:
        """Poses (N, 21, 3) seen from their own place and velocities (N, 21, 3) in m/s."""
        ...


@dataclass(frozen=True, eq=False)
class Layer:
    """All nodes active in one second; every array field runs over the nodes, axis 0.

    Poses are seen from the body's own place: pelvis above the origin, facing +Z, so that poses of
    two nodes compare as if one had been moved onto the other. `first_*` and `last_*` are at the two
    borders of the second: what a node ends on is what its successor in the segment begins with.
    """

    second: int  # second of the song
    segment: Ints  # (N,) second × K + rank: nodes of one warped segment share it
    offset: Ints  # (N,) 0 … 3: which quarter of its segment a node is
    clip: Ints  # (N,) index in the repertoire
    take: Ints  # (N,) index in the repertoire
    take_names: NDArray[np.str_]  # (N,)
    genre: NDArray[np.str_]  # (N,)
    style: Floats  # (N, 32) of the clip
    recent_usage_s: Floats  # (N,) seconds that the best dance so far has lately danced the node's take
    take_frames: Floats  # (N, 2) take frames (20 fps) at the second's two borders
    fit: Floats  # (N,) mean squared difference of tempo-densities, this second
    unmatched_beat: Floats  # (N,) share of beats, music's and motion's, that fall alone this second
    first_beat: Floats  # (N,) frame (20 fps) of the first motion beat in the second, nan if none
    last_beat: Floats  # (N,) frame of the last one
    source_frames: Floats  # (N, 21) clip frames at the 20 output frames and the second's end
    first_pose_m: Floats  # (N, 21, 3)
    last_pose_m: Floats  # (N, 21, 3)
    first_velocity_m_s: Floats  # (N, 21, 3)
    last_velocity_m_s: Floats  # (N, 21, 3)
    motifs: Ints  # (N, W) of the words danced, in order, padded with -1; W = 0 if no cost asks
    danced: Ints  # (N, M) how often each motif came on the cheapest way through the node; M = 0 likewise

    @property
    def n_nodes(self) -> int:
        """Number of nodes N."""
        return len(self.segment)

    def chosen(self, nodes: Ints | NDArray[np.bool_]) -> Layer:
        """The layer with only these nodes, by index or mask."""
        arrays = {f.name: getattr(self, f.name)[nodes] for f in fields(self) if f.name != "second"}
        return replace(self, **arrays)

    def after(self, danced: Ints) -> Layer:
        """The layer as reached: `danced` (N, M) on the way to each node, and what the node itself dances."""
        if danced.shape[1] == 0:
            return self
        danced = danced.copy()
        node, place = np.nonzero(self.motifs >= 0)
        np.add.at(danced, (node, self.motifs[node, place]), 1)
        return replace(self, danced=danced)

    def with_recent_usage(self, recent_usage_s: Floats) -> Layer:
        """The layer where each take is as tired as `recent_usage_s` (takes,) says."""
        return replace(self, recent_usage_s=recent_usage_s[self.take])

    def successors_in(self, following: Layer) -> tuple[Ints, Ints]:
        """Pairs (node here, node there) that follow one another inside one warped segment."""
        order = np.argsort(self.segment)
        place = np.searchsorted(self.segment, following.segment, sorter=order)
        place = order[np.minimum(place, self.n_nodes - 1)]
        follows = (self.segment[place] == following.segment) & (self.offset[place] + 1 == following.offset)
        return place[follows], np.flatnonzero(follows)


@dataclass(frozen=True, eq=False)
class ClipTable:
    """Per clip of the repertoire, what layers show of it."""

    take: Ints  # (N,)
    start_frame: Ints  # (N,) in its take, 20 fps
    take_names: NDArray[np.str_]  # (takes,)
    genres: NDArray[np.str_]  # (takes,)
    style: NDArray[np.float32]  # (N, 32)


class LayerSource:
    """Builds the layer of any second; segments inserted more than three seconds before are gone.

    `tie_break_s` (takes,) is how tired each take starts, in seconds; None: they never tire. `motifs`
    (S, K, 4, W), as `node_motifs` gives them, are what each node dances of `n_motifs` in all; None: nobody
    asks.
    """

    def __init__(
        self,
        segments: Segments,
        clips: ClipTable,
        poses: PoseBank,
        *,
        tie_break_s: Floats | None = None,
        motifs: NDArray[np.integer] | None = None,
        n_motifs: int = 0,
    ) -> None:
        self._segments = segments
        self._motifs = np.zeros((*segments.clip.shape, SEGMENT_S, 0), np.int16) if motifs is None else motifs
        self._n_motifs = 0 if motifs is None else n_motifs
        self._whims_s = tie_break_s
        self._clips = clips
        self._poses = poses
        # A layer looks at the last four insertions, and the planner at two layers.
        self._borders = lru_cache(maxsize=SEGMENT_S + 1)(self._make_borders)

    @property
    def n_seconds(self) -> int:
        """Number of layers S."""
        return len(self._segments.clip)

    def recent_usage_after(self, takes: Sequence[int]) -> NDArray[np.float32]:
        """How tired each take is, (takes,), in seconds, once `takes` have been danced, one a second."""
        n_takes = len(self._clips.take_names)
        if self._whims_s is None:
            return np.zeros(n_takes, np.float32)
        left = np.exp(-np.arange(len(takes))[::-1] / _FORGET_S)
        danced_s = np.bincount(np.asarray(takes, np.int64), left, n_takes)
        return (self._whims_s + danced_s).astype(np.float32)

    def layer(self, second: int) -> Layer:
        """All nodes active in `second`."""
        inserted = range(max(0, second - SEGMENT_S + 1), second + 1)
        parts = [self._quarter(start, second - start) for start in inserted]
        joined = {
            f.name: np.concatenate([getattr(p, f.name) for p in parts])
            for f in fields(Layer)
            if f.name != "second"
        }
        return Layer(second=second, **joined)

    def node(self, key: int) -> Layer:
        """The one node with segment × 4 + offset = `key`, without building its whole layer."""
        segment, offset = divmod(key, SEGMENT_S)
        start, rank = divmod(segment, self._segments.clip.shape[1])
        # Picked out as copies: a view would keep the maps of all candidates alive.
        return self._quarter(start, offset, slice(rank, rank + 1)).chosen(np.array([0]))

    def _make_borders(self, start: int, part: slice = _ALL) -> tuple[Floats, Floats]:
        """Poses and velocities at the five borders of the segments inserted at `start`, (5, K, 21, 3)."""
        clip = self._segments.clip[start, part]
        maps = self._segments.time_maps[start, part]
        borders = maps[:, ::NODE_FRAMES]  # (K, 5)
        speed = np.gradient(maps, axis=1)[:, ::NODE_FRAMES]  # (K, 5) source frames per output frame
        pose, velocity = self._poses.poses_m(np.repeat(clip, 5), borders.ravel())
        shape = (len(clip), 5, *pose.shape[1:])
        velocity = velocity.reshape(shape) * speed[:, :, None, None]
        return pose.reshape(shape).swapaxes(0, 1), velocity.swapaxes(0, 1)

    def _quarter(self, start: int, offset: int, part: slice = _ALL) -> Layer:
        segments, clips = self._segments, self._clips
        clip = segments.clip[start, part]
        take = clips.take[clip]
        k = segments.clip.shape[1]
        pose, velocity = self._borders(start) if part == _ALL else self._make_borders(start, part)
        window = slice(offset * NODE_FRAMES, (offset + 1) * NODE_FRAMES + 1)
        source_frames = segments.time_maps[start, part, window]  # (K, 21)
        return Layer(
            second=start + offset,
            segment=start * k + np.arange(k)[part],
            offset=np.full(len(clip), offset),
            clip=clip,
            take=take,
            take_names=clips.take_names[take],
            genre=clips.genres[take],
            style=clips.style[clip],
            recent_usage_s=np.zeros(len(clip), np.float32),
            take_frames=clips.start_frame[clip, None] + source_frames[:, ::NODE_FRAMES],
            fit=segments.fit[start, part, offset],
            unmatched_beat=segments.unmatched_beat[start, part, offset],
            first_beat=segments.first_beat[start, part, offset],
            last_beat=segments.last_beat[start, part, offset],
            source_frames=source_frames,
            first_pose_m=pose[offset],
            last_pose_m=pose[offset + 1],
            first_velocity_m_s=velocity[offset],
            last_velocity_m_s=velocity[offset + 1],
            motifs=self._motifs[start, part, offset],
            danced=np.zeros((len(clip), self._n_motifs), np.int16),
        )
