"""Layers: the nodes that are active in each second, and the seconds in which music returns."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from choreograph.core.arguments import as_floats, check_kind, unexpected
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import AnyFloats, AnyInts, Floats
from choreograph.core.progress import one_line
from choreograph.core.timebase import CLIP_S, NET_FPS, NODE_FRAMES, SEGMENT_S
from choreograph.library.repertoire import Repertoire
from choreograph.music.count_grids import SongGrid
from choreograph.music.form import Form, Phrase

Moments = tuple[tuple[int, float], ...]  # number of each moment, and after which share of the second it is
_TAKE_FRAMES = 1 << 24  # more than the frames of any take
MIDDLE = 0.5  # share of a second
SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)  # of a second
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

    def places_m(self, clip: AnyInts, frames: AnyFloats) -> AnyFloats:
        """Places on the floor (N, F, 2), x and z, of clips (N,) at fractional frames (N, F)."""
        ...

    def count_uncertainty(self, clip: AnyInts, start: AnyFloats, stop: AnyFloats) -> AnyFloats:
        """Uncertainty (N,), 0 … 1, of the counts halfway between two frames of each clip."""
        ...


@dataclass(frozen=True, eq=False)
class Warp:
    """How the nodes of a layer were warped: N quarters of warped segments."""

    segment: AnyInts
    """(N,) second × K + rank, the same for all nodes of one warped segment."""

    offset: AnyInts
    """(N,) quarter of its segment that each node is, 0 to 3."""

    clip: AnyInts
    """(N,) index of each node's clip in the repertoire."""

    time_map_id: AnyInts
    """(N,) number that nodes of one continuous time map of a take with counts share, -1 for others."""

    density_mismatch: AnyFloats
    """(N,) mean squared difference of tempo-densities in this second."""

    unmatched_beat: AnyFloats
    """(N,) share of the motion and music beats of this second without a partner."""

    first_beat: AnyFloats
    """(N,) frame at 20 fps of the first motion beat in the second, nan if there is none."""

    last_beat: AnyFloats
    """(N,) frame at 20 fps of the last motion beat in the second, nan if there is none."""

    off_bar: AnyFloats
    """(N,) share of the beats of this second whose number in the bar is not that of the take."""

    enter_penalty: AnyFloats
    """(N,) penalty for entering the take here, 0 at the border of a figure or bar."""

    leave_penalty: AnyFloats
    """(N,) penalty for leaving the take at the end of the second."""

    __repr__ = one_line

    @property
    def part(self) -> AnyInts:
        """A number (N,) of each node in its segment or time map. -1 for the first node of a segment."""
        in_segment = np.where(self.offset == 0, -1, self.segment * SEGMENT_S + self.offset)
        return np.where(self.time_map_id >= 0, -2 - self.time_map_id, in_segment)

    @property
    def next_part(self) -> AnyInts:
        """The `part` (N,) of the node of the next second that continues each node."""
        in_segment = self.segment * SEGMENT_S + self.offset + 1
        return np.where(self.time_map_id >= 0, -2 - self.time_map_id, in_segment)


@dataclass(frozen=True, eq=False)
class Danced:
    """What has been danced along the cheapest path to each of N nodes, up to and with the node."""

    take_usage_s: AnyFloats
    """(N, columns) recent use of takes along the path, in seconds, decayed."""

    motif_counts: AnyInts
    """(N, M) how often each motif is danced along the cheapest path to the node. M is 0 if no cost uses
    motifs."""

    danced: AnyFloats
    """(N, R) positions in takes at the moments that return, along the path, nan for later ones."""

    turn_rad: AnyFloats
    """(N,) rotation of the take in the dance, along the cheapest path to the node, in radians."""

    place_m: AnyFloats
    """(N, 2) place of the pelvis at the end of the second, along the path, in metres from the middle."""

    __repr__ = one_line


@dataclass(frozen=True, eq=False)
class Layer:
    """All nodes that are active in one second of the song. Axis 0 of every array is the node.

    Costs (`Cost`) are computed from layers. Poses are in the root frame: the pelvis is above the origin, and
    the body faces +Z. Poses of two nodes can therefore be compared as if one had been aligned to the other.
    The fields `first_*` belong to the start of the second and `last_*` to its end. The last pose of a node is
    the first pose of its successor in the segment. `poses_m`, `headings_rad` and `travel_m` give the motion
    during the second.

    What the warp of the graph engine says of the nodes is in `warp`, and what has been danced on the way to
    them is in `path`. In the mixer and the rollout, the nodes are the motion words of takes in one beat, and
    "the second" is that beat. Words have neither, and to read them raises `ParameterError`.

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
    >>> bool(layer.poses_m([0.0, 0.5])[..., 1].max() > 1.0)  # heights of joints in metres
    True
    >>> of_house = layer.subset(layer.genre == "house")
    >>> set(of_house.genre.tolist())
    {'house'}
    """

    second: int
    """Second of the song, from 0 on."""

    take: AnyInts
    """(N,) index of each node's take in the repertoire."""

    usage_column: AnyInts
    """(N,) column of `path.take_usage_s` of each node's take. Each take of candidates has one."""

    take_names: NDArray[np.str_]
    """(N,) name of each node's take."""

    genre: NDArray[np.str_]
    """(N,) genre of each node's take."""

    style: AnyFloats
    """(N, 32) style vector of each node's clip."""

    take_frames: AnyFloats
    """(N, 2) frames of the take at 20 fps at the two borders of the second."""

    count_uncertainty: AnyFloats
    """(N,) uncertainty of the counts of the take here, 0 to 1. It is 0 if they are not estimated."""

    heading_rad: AnyFloats
    """(N, 21) headings at the 20 frames and the end of the second, from the front of the take, in radians."""

    join_heading_rad: AnyFloats
    """(N, 2) headings where takes may change at the start of the second and at its end, in radians."""

    facing: AnyFloats
    """(N, 4) means of cosine and sine of the heading, and of twice the heading."""

    walk_m: AnyFloats
    """(N, M, 2) travel as `travel_m` at M shares of the second, in metres. M is 0 unless the stage has
    borders."""

    liveliness: AnyFloats
    """(N,) rank of the travel and width of the node, as danced, in its genre, 0 to 1."""

    steps: AnyFloats
    """(N,) rank of the density of the clip's steps in its genre, 0 to 1."""

    source: AnyInts
    """(N,) row of each node in `bank`: its clip, or the take of a word."""

    source_frames: AnyFloats
    """(N, 21) frames of the `source` at the 20 frames and the end of the second."""

    first_pose_m: AnyFloats
    """(N, 21, 3) pose where takes may change at the start of the second, in metres."""

    last_pose_m: AnyFloats
    """(N, 21, 3) pose where takes may change at the end of the second, in metres."""

    first_velocity_m_s: AnyFloats
    """(N, 21, 3) velocities at the first pose, in metres per second."""

    last_velocity_m_s: AnyFloats
    """(N, 21, 3) velocities at the last pose, in metres per second."""

    motifs: AnyInts
    """(N, W) motifs of the node's words in order, padded with -1. W is 0 if no cost uses motifs."""

    bank: PoseBank
    """The motion of all clips, for `poses_m`, `headings_rad` and `travel_m`."""

    new_goal: bool = False
    """Whether the count of motifs restarts at this second."""

    moments: Moments = ()
    """The moments of this second that return later."""

    returns: int | None = None
    """The moment, a number below R, that the middle of this second returns to, or None."""

    steer_rad: float = 0.0
    """The most by which a transition rotates a take back to the front, in radians."""

    _warp: Warp | None = None
    _path: Danced | None = None
    _word_parts: AnyInts | None = None

    __repr__ = one_line

    @property
    def n_nodes(self) -> int:
        """Number of nodes N."""
        return len(self.take)

    @property
    def warp(self) -> Warp:
        """How the nodes were warped. Raises `ParameterError` for a layer of words, which are not."""
        if self._warp is None:
            raise ParameterError(f"expected a layer of the graph engine for its warp, {_OF_WORDS}")
        return self._warp

    @property
    def path(self) -> Danced:
        """What has been danced up to each node. Raises `ParameterError` for a layer of words."""
        if self._path is None:
            raise ParameterError(f"expected a layer of the graph engine for its path, {_OF_WORDS}")
        return self._path

    @property
    def part(self) -> AnyInts:
        """A number (N,) of each node in its continuous part of a take, at most one node of which is here."""
        return self.warp.part if self._word_parts is None else self._word_parts

    @property
    def next_part(self) -> AnyInts:
        """The `part` (N,) of the node of the next second that continues each node."""
        return self.warp.next_part if self._word_parts is None else self._word_parts

    def subset(self, nodes: AnyInts | NDArray[np.bool_] | slice) -> Layer:
        """The layer with some of its nodes.

        `nodes` are indices (M,), a mask (N,), or a slice, which copies nothing. Raises `ParameterError` for
        anything else.
        """
        try:
            if not isinstance(nodes, slice) and np.ndim(nodes) != 1:
                raise IndexError
            n_nodes = len(self.take[nodes])
            arrays = {name: rows_of(values, nodes, n_nodes) for name, values in arrays_by_name(self).items()}
        except (IndexError, ValueError):
            n_nodes = self.n_nodes
            raise unexpected(f"indices below {n_nodes} of nodes, or a mask ({n_nodes},)", nodes) from None
        return changed_layer(self, **arrays)

    def poses_m(self, shares: Sequence[float] = SHARES) -> AnyFloats:
        """Poses (N, M, 21, 3) in the root frame after these shares of the second (M,), 0 … 1.

        `[..., 1]` is the height of each joint above the floor. Raises `ParameterError` for other shares.
        """
        frames = self._frames_at(shares)  # (N, M)
        poses_m, _ = self.bank.poses_m(np.repeat(self.source, frames.shape[1]), frames.ravel())
        return poses_m.reshape(*frames.shape, *poses_m.shape[1:])

    def headings_rad(self, shares: Sequence[float] = SHARES) -> AnyFloats:
        """Headings (N, M) from the front of the take, after these shares of the second (M,), 0 … 1.

        They are continuous along a take, so a full turn adds 2π. In the dance, the take is rotated by
        `turn_rad` besides. Raises `ParameterError` for other shares.
        """
        return self.bank.headings_rad(self.source, self._frames_at(shares))

    def travel_m(self, shares: Sequence[float] = SHARES) -> AnyFloats:
        """How far the pelvis is on the floor from where the second begins, (N, M, 2), x and z.

        It is given after these shares of the second (M,), 0 … 1, with the front of the take at +Z. Raises
        `ParameterError` for other shares.
        """
        frames = np.concatenate([self.source_frames[:, :1], self._frames_at(shares)], axis=1)  # (N, 1 + M)
        places_m = self.bank.places_m(self.source, frames)
        travel_m: AnyFloats = places_m[:, 1:] - places_m[:, :1]
        return travel_m

    def _frames_at(self, shares: Sequence[float]) -> AnyFloats:
        """Clip frames (N, M) after these shares of the second (M,)."""
        at = as_floats("shares of the second", shares) * NODE_FRAMES
        if at.ndim != 1 or not ((at >= 0) & (at <= NODE_FRAMES)).all():
            raise unexpected("shares of the second (M,), 0 to 1", shares)
        low = np.minimum(np.floor(at).astype(np.int64), NODE_FRAMES - 1)
        before, after = self.source_frames[:, low], self.source_frames[:, low + 1]
        frames: AnyFloats = before + (at - low) * (after - before)
        return frames

    def with_motif_counts(self, counts_before: AnyInts) -> Layer:
        """The layer with the motif counts of the path that ends at each node.

        They are the counts of the path up to the node, `counts_before` (N, M), plus the node's own motifs.
        Where a new goal begins, only the node's own motifs are counted. Raises `ParameterError` for another
        shape or other values than whole numbers.
        """
        check_kind("motif counts", counts_before, np.ndarray)
        shape = self.path.motif_counts.shape
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
        shape = self.path.take_usage_s.shape
        if usage_before_s.shape != shape or usage_before_s.dtype.kind != "f":
            raise unexpected(f"usage of takes {shape} in seconds", usage_before_s)
        if usage_before_s.shape[1] == 0:
            return self
        usage_s = usage_before_s * np.float32(np.exp(-1.0 / USAGE_DECAY_S))
        usage_s[np.arange(self.n_nodes), self.usage_column] += 1.0
        return changed_layer(self, take_usage_s=usage_s)

    def with_danced(self, danced_before: AnyFloats) -> Layer:
        """The layer with the positions `danced_before` (N, R) of the path to each node, and its own ones.

        Raises `ParameterError` for another shape or other values than floating-point numbers.
        """
        check_kind("danced positions", danced_before, np.ndarray)
        shape = self.path.danced.shape
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

    def with_turn(self, before: Layer, parent: AnyInts | slice) -> Layer:
        """The layer with each node's take rotated to continue its `parent` (N,) in the layer `before`.

        A take that is joined begins at the heading at which the one before it ends, and is steered towards 0,
        where its front is that of the audience, by as much as a transition steers. A node that continues its
        take keeps the rotation. The first layer, which is `before` itself, has none. On a stage with borders,
        the node also begins where its parent ends. Raises `ParameterError` unless there is a parent for each
        node.
        """
        check_kind("the layer before", before, Layer)
        try:
            row = np.arange(before.n_nodes)[parent]
            if np.shape(row) != (self.n_nodes,):
                raise IndexError
        except (IndexError, ValueError):
            expected = f"indices ({self.n_nodes},) of nodes of the layer before, below {before.n_nodes}"
            raise unexpected(expected, parent) from None
        turned, start_m = self, 0.0 * before.path.place_m[row]
        if before.second != self.second:
            turn_rad, start_m = before.path.turn_rad[row], before.path.place_m[row]
            ends_rad, starts_rad = before.join_heading_rad[row, 1], self.join_heading_rad[:, 0]
            joined = joined_rad(turn_rad, ends_rad, starts_rad, self.steer_rad)
            continues = before.next_part[row] == self.part
            turned = changed_layer(self, turn_rad=np.where(continues, turn_rad, joined))
        if self.walk_m.shape[1] == 0:
            return turned
        return changed_layer(turned, place_m=start_m + rotated(self.walk_m[:, -1], turned.path.turn_rad))

    def successors_in(self, following: Layer) -> tuple[AnyInts, AnyInts]:
        """The pairs of nodes that are consecutive in one warped segment or time map.

        Returns the indices (M,) in this layer and the indices (M,) in `following`, the layer of the next
        second. Raises `ParameterError` if `following` is no layer.
        """
        check_kind("the following layer", following, Layer)
        here, there = self.next_part, following.part
        order = np.argsort(here)
        row = order[np.minimum(np.searchsorted(here, there, sorter=order), self.n_nodes - 1)]
        follows = here[row] == there
        return row[follows], np.flatnonzero(follows)


_OF_WORDS = "got one of words in the mixer or the rollout"
_OF_ALL_NODES = ("second", "bank", "new_goal", "moments", "returns", "steer_rad")
_WARP, _PATH = (frozenset(field.name for field in fields(kind)) for kind in (Warp, Danced))
_OWN = tuple(f.name for f in fields(Layer) if f.name not in (*_OF_ALL_NODES, "_warp", "_path", "_word_parts"))


def arrays_by_name(layer: Layer) -> dict[str, NDArray[Any]]:
    """All arrays of a layer, its warp and its path by name, each with a row for every node."""
    own = vars(layer)
    arrays = {name: own[name] for name in _OWN}
    for part in (layer._warp, layer._path):
        if part is not None:
            arrays.update(vars(part))
    if layer._word_parts is not None:
        arrays["_word_parts"] = layer._word_parts
    return arrays


def layer_of(values: dict[str, Any]) -> Layer:
    """A layer of the graph engine from the values of its fields, its warp and its path, by name."""
    warp = Warp(**{name: values[name] for name in _WARP})
    path = Danced(**{name: values[name] for name in _PATH})
    own = {name: value for name, value in values.items() if name not in _WARP and name not in _PATH}
    return Layer(**own, _warp=warp, _path=path)


def repeated(row: NDArray[Any], n_nodes: int) -> NDArray[Any]:
    """A row (...) for every node, (N, ...), which is not copied unless the result would be contiguous.

    No kernel is compiled for contiguous arrays that cannot be written.
    """
    rows = np.broadcast_to(row, (n_nodes, *row.shape))
    return rows.copy() if rows.flags.c_contiguous else rows


def rows_of(values: NDArray[Any], nodes: Any, n_nodes: int) -> NDArray[Any]:
    """The values of some nodes. Where all nodes have one row, it is not copied: it has all of a song."""
    return values[nodes] if len(values) == 0 or values.strides[0] else repeated(values[0], n_nodes)


def facing(heading_rad: AnyFloats) -> AnyFloats:
    """Means (N, 4) over time of cos h, sin h, cos 2h and sin 2h of the headings (N, F)."""
    cosine, sine = np.cos(heading_rad), np.sin(heading_rad)
    means = [cosine, sine, 2.0 * cosine**2 - 1.0, 2.0 * sine * cosine]
    return np.stack([mean.mean(axis=1) for mean in means], axis=1)


def joined_rad(turn_rad: AnyFloats, end_rad: AnyFloats, start_rad: AnyFloats, steer_rad: float) -> AnyFloats:
    """The rotations (N,) of takes that begin at the headings at which others end, steered towards 0.

    The others end at `end_rad` in their takes, which are rotated by `turn_rad`. The takes begin at
    `start_rad`, and are steered by at most `steer_rad`.
    """
    joined: AnyFloats = (turn_rad + end_rad - start_rad + np.pi) % (2 * np.pi) - np.pi
    return joined - np.clip(joined, -steer_rad, steer_rad)


def rotated(walk_m: AnyFloats, turn_rad: AnyFloats) -> AnyFloats:
    """Ways on the floor (N, 2), x and z, of takes that are rotated by `turn_rad` (N,)."""
    cosine, sine = np.cos(turn_rad), np.sin(turn_rad)
    x_m, z_m = walk_m.T
    way_m: AnyFloats = np.stack([cosine * x_m + sine * z_m, cosine * z_m - sine * x_m], axis=1)
    return way_m


def positions(layer: Layer, share: float) -> AnyFloats:
    """The take and frame of each node after a `share` of its second, as one number (N,) in frames."""
    return position(layer.take, layer.take_frames[:, 0], layer.take_frames[:, 1], share)


def position(take: AnyInts, first: AnyFloats, last: AnyFloats, share: float) -> AnyFloats:
    """`positions` of nodes by their takes, and their first and last frames in them."""
    found: AnyFloats = take * float(_TAKE_FRAMES) + first + share * (last - first)
    return found


def changed_layer(layer: Layer, **values: Any) -> Layer:
    """The layer with other values of its fields, or of those of its warp or path, by name.

    `dataclasses.replace` takes 20 µs for so many fields. A search makes 60,000 layers.
    """
    own = dict(vars(layer))
    for part, names in (("_warp", _WARP), ("_path", _PATH)):
        changed = {name: value for name, value in values.items() if name in names}
        if changed:
            made = object.__new__(type(own[part]))
            vars(made).update(vars(own[part]) | changed)
            own[part] = made
    own.update({name: value for name, value in values.items() if name in own})
    found = object.__new__(type(layer))
    vars(found).update(own)
    return found


class WordLayers:
    """Layers of motion words, for the costs of the user in the engines that dance words."""

    def __init__(self, repertoire: Repertoire) -> None:
        self._vocabulary, self._bank = repertoire.vocabulary, repertoire.clip_motion.of_takes()
        self._names, self._genres = np.array([(t.name, t.credits.genre) for t in repertoire.takes]).T
        clip = _clips_of_words(repertoire)
        self._style = np.zeros((len(clip), repertoire.clip_style.shape[1]), np.float32)  # (W, 32)
        self._style[clip >= 0] = repertoire.clip_style[clip[clip >= 0]]
        self._steps = np.full(len(clip), 0.5, np.float32)  # (W,)
        self._steps[clip >= 0] = repertoire.clip_motion.step_ranks[clip[clip >= 0]]

    def layer(self, words: AnyInts, slot: int, second: int, length_s: float) -> Layer:
        """The words (M,) as the nodes of a slot of the dance, in which they last `length_s`.

        The word that follows in the take is the successor in the next slot.
        """
        v, bank = self._vocabulary, self._bank
        take, start_s, end_s = v.word_take[words], v.word_start_s[words], v.word_end_s[words]
        shares = np.linspace(0.0, 1.0, NODE_FRAMES + 1)
        frames = NET_FPS * (start_s[:, None] + (end_s - start_s)[:, None] * shares)  # (M, 21) of the take
        speed = ((end_s - start_s) / length_s)[:, None, None]
        (first_m, first_m_s), (last_m, last_m_s) = (bank.poses_m(take, frames[:, at]) for at in (0, -1))
        headings_rad = bank.headings_rad(take, frames)
        return Layer(
            second=second, take=take, usage_column=take, take_names=self._names[take],
            genre=self._genres[take], style=self._style[words], take_frames=frames[:, [0, -1]],
            count_uncertainty=bank.count_uncertainty(take, frames[:, 0], frames[:, -1]),
            heading_rad=headings_rad, join_heading_rad=headings_rad[:, [0, -1]], facing=facing(headings_rad),
            walk_m=np.zeros((len(words), 0, 2)),
            liveliness=bank.liveliness(take, frames[:, 0], frames[:, 0] + NET_FPS * speed[:, 0, 0]),
            steps=self._steps[words], source=take, source_frames=frames,
            first_pose_m=first_m, last_pose_m=last_m,
            first_velocity_m_s=first_m_s * speed, last_velocity_m_s=last_m_s * speed,
            motifs=v.word_motif[words, None], bank=bank,
            _word_parts=(take + 1) * _TAKE_FRAMES + words - slot,
        )  # fmt: skip


def _clips_of_words(repertoire: Repertoire) -> AnyInts:
    """The clip (W,) whose middle is nearest to that of each word, or -1 in a take without clips."""
    v = repertoire.vocabulary
    found, middle_s = np.full(len(v.word_take), -1), 0.5 * (v.word_start_s + v.word_end_s)
    order = np.argsort(repertoire.clip_take, kind="stable")
    takes, firsts = np.unique(repertoire.clip_take[order], return_index=True)
    for take, clips in zip(takes.tolist(), np.split(order, firsts[1:]), strict=True):
        words = v.words_of_take(take)
        middles_s = repertoire.clip_start_frame[clips] / NET_FPS + CLIP_S / 2
        found[words] = clips[np.abs(middle_s[words, None] - middles_s).argmin(axis=1)]
    return found


_VARIED_COUNTS = 4  # at the end of what returns, where other music follows
_VARIED_WEIGHT = 0.5
SAME_FRAMES = 0.25 * NET_FPS  # largest distance of two positions in a take that are the same figure


@dataclass(frozen=True, eq=False)
class PhraseReturns:
    """The seconds of a song in which music returns, each with the moment that its middle returns to.

    A new phrase after one that returns is paired as well, with what followed there before (ABAC: C with the
    first B). A dance should not return there.
    """

    seconds: NDArray[np.int64]  # (R,) increasing
    first_s: Floats  # (R,) the moments, count by count
    is_return: NDArray[np.bool_]  # (R,) or else new music
    weights: Floats  # (R,) 1, and less at the end of what returns
    counts_later: NDArray[np.int64]  # (R,) from the moment to its return

    @classmethod
    def of(cls, form: Form, grid: SongGrid, is_planned: Callable[[float], bool]) -> PhraseReturns:
        """The returns of a song's phrases, by the grid of its beats, among the moments that are planned."""
        pairs: list[_Pair] = []
        labels = form.labels
        for number, phrase in enumerate(form.phrases):
            before = [other for other in range(number) if labels[other] == labels[number]]
            after = [other + 1 for other in range(number - 1) if labels[other] == labels[number - 1]]
            paired: dict[int, _Pair] = {}
            for other in before or after:
                ends = labels[number + 1 : number + 2] != labels[other + 1 : other + 2]
                for pair in _pairs(phrase, form.phrases[other], grid, is_planned, ends=ends):
                    paired.setdefault(pair.second, replace(pair, is_return=bool(before)))
            pairs += [paired[second] for second in sorted(paired)]
        return cls(
            np.array([pair.second for pair in pairs], np.int64),
            np.array([pair.first_s for pair in pairs], np.float64),
            np.array([pair.is_return for pair in pairs], bool),
            np.array([pair.weight for pair in pairs], np.float64),
            np.array([pair.counts_later for pair in pairs], np.int64),
        )

    def first_seconds(self, n_seconds: int) -> NDArray[np.int64]:
        """For every second (S,), the second that it returns to, or itself if its music is new."""
        firsts = np.arange(n_seconds)
        firsts[self.seconds[self.is_return]] = np.floor(self.first_s[self.is_return])
        return firsts

    def shifts(self, n_seconds: int, grid: SongGrid) -> Floats:
        """By how many counts (S,) every second begins later in its phrase than its `first_seconds`."""
        shifts = np.zeros(n_seconds)
        again = self.seconds[self.is_return]
        starts = grid.index_at(again.astype(np.float64))
        firsts = grid.index_at(np.floor(self.first_s[self.is_return]))
        shifts[again] = starts - self.counts_later[self.is_return] - firsts
        return shifts

    def moments(self, n_seconds: int) -> list[Moments]:
        """`Layer.moments` of every second."""
        moments: list[Moments] = [()] * n_seconds
        for number, first_s in enumerate(self.first_s):
            second = int(first_s)
            moments[second] = (*moments[second], (number, float(first_s - second)))
        return moments

    def returning(self, n_seconds: int) -> list[int | None]:
        """`Layer.returns` of every second."""
        returning: list[int | None] = [None] * n_seconds
        for number, second in enumerate(self.seconds):
            returning[second] = number
        return returning


@dataclass(frozen=True)
class _Pair:
    """A second, and the moment of an earlier phrase that its middle is compared with."""

    second: int
    first_s: float
    weight: float
    counts_later: int
    is_return: bool = True


def moments_of(layer: Layer) -> Moments:
    """The moments that a second is, and the one that it returns to."""
    return layer.moments if layer.returns is None else (*layer.moments, (layer.returns, MIDDLE))


def _pairs(
    phrase: Phrase, first: Phrase, grid: SongGrid, is_planned: Callable[[float], bool], *, ends: bool
) -> Iterator[_Pair]:
    """The pairs of a phrase with an earlier one. At its end, other music follows if it `ends`."""
    start, first_start, end = grid.index_at(np.array([phrase.start_s, first.start_s, phrase.end_s]))
    counts_later = round(start - first_start)
    for second in range(max(0, int(phrase.start_s)), int(phrase.end_s) + 1):
        middle_s = second + MIDDLE
        index = float(grid.index_at(np.array([middle_s]))[0])
        first_s = grid.time_at(index - counts_later)
        in_phrase = phrase.start_s <= middle_s < phrase.end_s and first_s < min(first.end_s, second)
        if in_phrase and is_planned(first_s) and is_planned(middle_s):
            weight = _VARIED_WEIGHT if ends and index >= end - _VARIED_COUNTS else 1.0
            yield _Pair(second, first_s, weight, counts_later)
