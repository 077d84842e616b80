"""Costs of nodes and edges. The built-in ones use nothing that a cost of your own cannot."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from choreograph.features.song_features import SongFeatures
from choreograph.graph.layers import Layer
from choreograph.timebase import CLIP_FRAMES, NODE_FRAMES

Floats = NDArray[np.floating]

_TIRED_AFTER_S = 12.0  # three minutes in 15 takes
_PLAYING_ON = NODE_FRAMES // 4


class Cost:
    """A price on nodes, on edges, or on both; subclass it and override what you need.

    `name` is what plans, weights and errors call it; by default the class' name in lower case.
    Values are of any unit (a weight brings them to scale); `inf` forbids, `nan` is an error. Say in
    `least_jump` what an edge that leaves its warped segment costs at least, and the exact planner need not
    look at edges that cannot win: 0 if no edge is ever negative.
    """

    name: str = ""
    least_jump: float = -math.inf

    def __init_subclass__(cls, **kwargs: object) -> None:
        super().__init_subclass__(**kwargs)
        if "name" not in cls.__dict__:
            cls.name = cls.__name__.lower()

    def node(self, layer: Layer, song_features: SongFeatures) -> Floats | None:
        """Cost (N,) of dancing each node of `layer`, or None."""
        return None

    def edge(self, previous: Layer, next: Layer, song_features: SongFeatures) -> Floats | None:
        """Cost (P, N) of going from each node of `previous` to each of `next`, or None."""
        return None

    def least_edges(self, previous: Layer, next: Layer, song_features: SongFeatures) -> Floats | float:
        """What an edge that leaves its segment costs at least, by the node of `next` (N,) or for all."""
        return self.least_jump


class Style(Cost):
    """‖S_x(clip) - S_m(second)‖₂: how far a clip's style is from the music's (equation 5)."""

    def node(self, layer: Layer, song_features: SongFeatures) -> Floats:
        return np.linalg.norm(layer.style - song_features.style[layer.second], axis=1)


class Completeness(Cost):
    """1 for leaving a warped segment; less for staying in it, the longer an action has no beat.

    σ((20 - V) / 5) with V the frames from the last motion beat before the border to the first after
    it; where a second has no beat, the gap reaches to that second's far end. The paper's figure of
    the two joined seconds, section 3.3.
    """

    least_jump = 1.0

    def edge(self, previous: Layer, next: Layer, song_features: SongFeatures) -> Floats:
        cost = np.ones((previous.n_nodes, next.n_nodes), np.float32)
        here, there = previous.successors_in(next)
        last = np.nan_to_num(previous.last_beat[here], nan=0.0)
        first = np.nan_to_num(next.first_beat[there], nan=float(NODE_FRAMES))
        gap = NODE_FRAMES - last + first  # frames, at most two seconds
        cost[here, there] = 1.0 / (1.0 + np.exp(-(NODE_FRAMES - gap) / 5.0))
        return cost


class Transition(Cost):
    """Root mean square joint distance, metres, with the next body moved onto the previous one.

    The paper's ‖·‖₂ over all joints, divided by √21 so that it reads in metres whatever the joint
    count, and taken at the border of the two seconds: nodes that follow one another in a segment
    are at distance 0. The first node costs nothing.
    """

    least_jump = 0.0

    def edge(self, previous: Layer, next: Layer, song_features: SongFeatures) -> Floats:
        return _rms_distances(previous.last_pose_m, next.first_pose_m)


class Velocity(Cost):
    """Root mean square difference of joint velocities at the border, m/s; ours, not the paper's."""

    least_jump = 0.0

    def edge(self, previous: Layer, next: Layer, song_features: SongFeatures) -> Floats:
        return _rms_distances(previous.last_velocity_m_s, next.first_velocity_m_s)


class Rhythm(Cost):
    """How badly the warped node keeps time: share of lone beats plus misfit of tempo-densities.

    Ours: the paper's cost does not see the fit, and picks clips that cannot be warped to the beat.
    """

    def node(self, layer: Layer, song_features: SongFeatures) -> Floats:
        return layer.unmatched_beat + layer.fit


class Pace(Cost):
    """How far from its own speed the take is played, in octaves, on average over quarters of the second.

    Ours: every warp within the slope limits costs the paper nothing, and its dances hurry. Played half as
    fast again, feet slide half as far again, and what a body throws about is thrown twice as hard.
    """

    def node(self, layer: Layer, song_features: SongFeatures) -> Floats:
        parts = np.diff(layer.source_frames[:, :: NODE_FRAMES // 4], axis=1) / (NODE_FRAMES // 4)  # (N, 4)
        return np.abs(np.log2(parts)).mean(axis=1)


class Variety(Cost):
    """Seconds that the dance so far has lately danced the node's take, over 12: favourites tire.

    Ours, not the paper's, whose cheapest path likes best to play one long take on and on.
    """

    def node(self, layer: Layer, song_features: SongFeatures) -> Floats:
        return layer.recent_usage_s / _TIRED_AFTER_S


class Repeat(Cost):
    """1 for going back to what has just been danced: less than a clip's length back in the same take.

    Ours. Beats may be shared: up to a quarter second back is playing on.
    """

    least_jump = 0.0

    def edge(self, previous: Layer, next: Layer, song_features: SongFeatures) -> Floats:
        from choreograph.graph._kernels import goes_back

        return goes_back(
            previous.take,
            previous.take_frames[:, 1],
            next.take,
            next.take_frames[:, 0],
            _PLAYING_ON,
            CLIP_FRAMES,
        )


BUILTIN_COSTS: tuple[type[Cost], ...] = (
    Style,
    Completeness,
    Transition,
    Velocity,
    Rhythm,
    Pace,
    Variety,
    Repeat,
)


def _rms_distances(a: Floats, b: Floats) -> Floats:
    """Root mean square joint distances (P, N) of poses (P, 21, 3) and (N, 21, 3)."""
    from choreograph.graph._kernels import root_of_differences

    n_joints = a.shape[1]
    flat_a = np.ascontiguousarray(a, np.float32).reshape(len(a), -1)
    flat_b = np.ascontiguousarray(b, np.float32).reshape(len(b), -1)
    sq_a = np.einsum("pd,pd->p", flat_a, flat_a)
    sq_b = np.einsum("nd,nd->n", flat_b, flat_b)
    return root_of_differences(flat_a @ flat_b.T, sq_a, sq_b, np.float32(1.0 / n_joints))
