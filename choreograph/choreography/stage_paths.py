"""Paths of several dancers on one stage: places at the borders of phrases, apart from each other and seen.

Every dancer is brought to its place of the formation at each border. What all dancers travel together stays,
so that dancers in unison are not corrected at all. Formations are made wider until no two bodies come too
near to each other on the way, and dancers that would be hidden for long step aside.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np
import scipy

from choreograph.choreography.scenes import eye_of, in_windows
from choreograph.core.counts import counts_later_s
from choreograph.core.numerics import Floats
from choreograph.motion.body import BODY_JOINTS, body_pos_m
from choreograph.motion.motion import Motion
from choreograph.plan.scenes import ground_shift_m

LEAST_GAP_M = 0.6  # between the capsules of two bodies, on the ground, however large they are
MARGIN_M = 0.02  # for frames between those that are compared
SPACING_M = 1.8  # of neighbours in a formation, at least
_WIDER = 1.04  # a formation, where two bodies are too near
_PUSH_M = 0.06  # on the way to another formation, in each pass
_MOST_PUSH_M = 0.1  # by several dancers
_MOST_PASSES = 150
_PUSHING_PASSES = 40  # before formations are made wider as well
_WANDER_M = 1.2  # from the middle of the stage, of all dancers together
_LEFT_M = 0.06  # a dancer who is so near to the place is not corrected
_PLAN_FPS = 12.0  # at which bodies are compared
_RADII_M = {"head": 0.12, "neck": 0.08, "pelvis": 0.16, "spine3": 0.17, "spine2": 0.15, "wrist": 0.12}
_RADIUS_M = 0.09  # of all other joints
_HIDDEN_M = 0.22  # from the middle of a body to the line of sight past the middle of another one
_ASIDE_M = 0.12  # step of a dancer who is hidden
_IN_FRONT_M = 0.3
_CHANGE_COUNTS = 12  # before a border, in which dancers go to another formation
_SHORTEST_S = 2.0  # between two times at which dancers are at places


@dataclass(frozen=True, eq=False)
class StageBody:
    """A dancer before it goes anywhere: the motion with its height, and the contacts (T, 4) of its feet."""

    motion: Motion
    contacts: Floats
    girth: float = 1.0  # of its flesh, by which the radii around its joints are multiplied


@dataclass(frozen=True, eq=False)
class Knot:
    """A time at which dancers are at their places."""

    time_s: float
    places: Floats  # (N, 2) of the formation, in the order of its places
    in_metres: bool  # or in spacings
    same: bool = True  # as the formation before, in which each dancer keeps its place
    on_way: bool = False  # half-way to the next formation: only there to keep dancers apart


def formation_knots(
    starts_s: Sequence[float],
    formed: Sequence[str],
    places: dict[str, tuple[Floats, bool]],
    beats_s: Sequence[float],
    end_s: float,
) -> list[Knot]:
    """A knot at each border and at the end of a dance, from the name of the formation from each border on.

    `places` has by name the places of a formation, and whether they are in metres. Before another formation,
    there is a knot from which dancers go to it.
    """
    knots: list[Knot] = []
    for index, (time_s, name) in enumerate(zip(starts_s, formed, strict=True)):
        before = formed[index - 1] if index else name
        if name != before:
            leaves_s = float(counts_later_s(beats_s, time_s, -_CHANGE_COUNTS))
            if leaves_s > knots[-1].time_s + _SHORTEST_S:
                knots.append(Knot(leaves_s, *places[before]))
            knots.append(Knot(0.5 * (knots[-1].time_s + time_s), *places[before], on_way=True))
        knots.append(Knot(time_s, *places[name], same=name == before))
    if end_s - knots[-1].time_s > _SHORTEST_S:
        knots.append(Knot(end_s, *places[formed[-1]]))
    return knots


@dataclass(frozen=True, eq=False)
class StagePaths:
    """Where the dancers are at the times of the knots."""

    places_m: Floats  # (K, N, 2)
    formation_m: Floats  # (K, N, 2) as asked for. A dancer who is near enough is not corrected
    least_gap_m: float  # between two bodies, by bounds of their reach
    widened: float  # the greatest factor by which places in metres were made wider, 1 for none


def plan_paths(
    bodies: Sequence[StageBody],
    knots: Sequence[Knot],
    *,
    symmetric: bool,
    hidden_s: float,
    margin_m: float = MARGIN_M,
) -> StagePaths:
    """The places of all dancers (N) at the knots (K).

    If `symmetric`, dancers left and right of the axis remain mirror images. `hidden_s` is how long a dancer
    may be hidden from the audience. `margin_m` is added to the least gap, for feet that stay behind where
    they stand.
    """
    n, crowd = len(bodies), _Crowd.of(bodies, np.array([knot.time_s for knot in knots]))
    order = _order(knots, symmetric)  # (K, N) places of dancers
    at_knots_m = crowd.ground_m[:, crowd.knot_rows].transpose(1, 0, 2)  # (K, N, 2)
    layout = _Layout(knots, order, np.ones(len(knots)), np.zeros((len(knots), n, 2)))
    common_m = _common_path_m(crowd, symmetric)
    for done in range(_MOST_PASSES):
        formation_m = layout.places_m()
        wanted_m = formation_m + common_m[:, None]
        places_m = _nearly(wanted_m, at_knots_m)
        paths_m = crowd.paths_m(places_m)  # (N, T, 2)
        conflicts = crowd.conflicts(paths_m, margin_m)
        if conflicts:
            layout.resolve(conflicts, symmetric=symmetric, wider=done >= _PUSHING_PASSES)
            continue
        hidden = crowd.hidden(paths_m, formation_m, hidden_s)
        if not hidden.any() or symmetric:
            break
        layout.aside_m[..., 0] += hidden * _ASIDE_M
    scale = layout.scale
    in_metres = np.array([knot.in_metres for knot in knots])
    gap_m = crowd.least_gap_m(paths_m)
    return StagePaths(places_m, wanted_m, gap_m, float(np.max(scale[in_metres], initial=1.0)))


@dataclass(frozen=True, eq=False)
class _Conflict:
    """Two dancers who are too near to each other before a knot."""

    one: int
    other: int
    knot: int  # the knot that follows
    towards: Floats  # (2,) direction from the one to the other


@dataclass(frozen=True, eq=False)
class _Layout:
    """The places of a formation at each knot, how wide they are, and steps aside."""

    knots: Sequence[Knot]
    order: np.ndarray  # (K, N) place of each dancer
    scale: Floats  # (K,) of the formations
    aside_m: Floats  # (K, N, 2)

    def places_m(self) -> Floats:
        """The places (K, N, 2) of the dancers."""
        places = np.empty(self.aside_m.shape)
        for index, knot in enumerate(self.knots):
            if knot.in_metres:
                places[index] = (knot.places * self.scale[index])[self.order[index]]
            else:
                places[index] = in_windows(knot.places * SPACING_M * self.scale[index])[self.order[index]]
        for index, knot in enumerate(self.knots):
            if knot.on_way:
                places[index] = 0.5 * (places[index - 1] + places[index + 1])
        places += self.aside_m
        return places

    def resolve(self, conflicts: Sequence[_Conflict], *, symmetric: bool, wider: bool) -> None:
        """Push dancers apart on their way to another formation, and make formations wider elsewhere.

        With `wider`, formations beside a way are made wider as well.
        """
        pushed_m, widened = np.zeros(self.aside_m.shape), np.zeros(len(self.knots), bool)
        parted = np.zeros(len(self.knots), bool)  # both sides of the axis
        on_axis = self.aside_m.shape[1] % 2
        for conflict in conflicts:
            beside = {conflict.knot, max(conflict.knot - 1, 0)}
            on_way = [index for index in beside if self.knots[index].on_way]
            for index in on_way:
                pushed_m[index, conflict.one] -= _PUSH_M * conflict.towards
                pushed_m[index, conflict.other] += _PUSH_M * conflict.towards
            across = min(conflict.one, conflict.other) >= on_axis and (conflict.one + conflict.other) % 2
            if wider or not on_way:
                (parted if symmetric and across else widened)[list(beside)] = True
        if symmetric:
            right, left = pushed_m[:, on_axis::2], pushed_m[:, on_axis + 1 :: 2]
            mean = 0.5 * (right + left * [-1.0, 1.0])
            pushed_m[:, on_axis::2], pushed_m[:, on_axis + 1 :: 2] = mean, mean * [-1.0, 1.0]
            pushed_m[:, :on_axis, 0] = 0.0
            self.aside_m[parted, on_axis::2, 0] += _PUSH_M
            self.aside_m[parted, on_axis + 1 :: 2, 0] -= _PUSH_M
        self.aside_m[...] += pushed_m.clip(-_MOST_PUSH_M, _MOST_PUSH_M)
        self.scale[widened] *= _WIDER


def _order(knots: Sequence[Knot], symmetric: bool) -> np.ndarray:
    """The place of each dancer at each knot (K, N), with the least squares of the ways between formations.

    With least squares, ways at one speed do not come closer than 0.7 of the distance of places (Turpin,
    Michael, Kumar: CAPT, 2014).
    """
    n = len(knots[0].places)
    order = [np.arange(n)]
    for before, knot in pairwise(knots):
        if knot.same:
            order.append(order[-1])
            continue
        a, b = before.places[order[-1]], knot.places
        if symmetric and n > 1:
            order.append(_symmetric_order(a, b, n % 2))
            continue
        cost = np.square(a[:, None] - b[None]).sum(axis=-1)
        order.append(scipy.optimize.linear_sum_assignment(cost)[1])
    return np.array(order)


def _symmetric_order(a: Floats, b: Floats, on_axis: int) -> np.ndarray:
    """As `_order`, for pairs of dancers that keep their sides."""
    cost = np.square(a[on_axis::2, None] - b[None, on_axis::2]).sum(axis=-1)
    pairs = scipy.optimize.linear_sum_assignment(cost)[1]
    places = np.stack([on_axis + 2 * pairs, on_axis + 2 * pairs + 1], axis=1).ravel()
    return np.concatenate([np.arange(on_axis), places])


def _common_path_m(crowd: _Crowd, symmetric: bool) -> Floats:
    """What all dancers travel together by each knot (K, 2), within about `_WANDER_M` of the middle."""
    at_m = crowd.ground_m[:, crowd.knot_rows]  # (N, K, 2)
    drift_m = (at_m - at_m[:, :1]).mean(axis=0)
    if symmetric:
        drift_m[:, 0] = 0.0
    common_m: Floats = _WANDER_M * np.tanh(drift_m / _WANDER_M)
    return common_m


def _nearly(wanted_m: Floats, ground_m: Floats) -> Floats:
    """The places (K, N, 2) near those wanted, of dancers who are not moved where they are near enough.

    `ground_m` (K, N, 2) is where the dancers would be.
    """
    places_m = wanted_m.copy()
    shift_m = wanted_m[0] - ground_m[0]
    for index in range(1, len(places_m)):
        needed_m = wanted_m[index] - ground_m[index]
        moves = np.linalg.norm(needed_m - shift_m, axis=-1, keepdims=True) > _LEFT_M
        shift_m = np.where(moves, needed_m, shift_m)
        places_m[index] = ground_m[index] + shift_m
    return places_m


@dataclass(frozen=True, eq=False)
class _Crowd:
    """All dancers at `_PLAN_FPS`, to be placed on the ground."""

    bodies: Sequence[StageBody]
    times_s: Floats  # (K,) of the knots
    rows: np.ndarray  # (T,) frames of the motions
    knot_rows: np.ndarray  # (K,) index of a row at each knot
    ground_m: Floats  # (N, T, 2) of the roots, without any way
    reach_m: Floats  # (N, T, J, 2) of the joints from the root
    farthest_m: Floats  # (N, T) from the root, of the body in any direction
    radii_m: Floats  # (N, J)

    @classmethod
    def of(cls, bodies: Sequence[StageBody], times_s: Floats) -> _Crowd:
        """The dancers of motions of one length and rate."""
        first = bodies[0].motion
        step = max(1, round(first.fps / _PLAN_FPS))
        at_knots = np.clip(np.round(times_s * first.fps).astype(np.int64), 0, first.n_frames - 1)
        rows = np.union1d(np.arange(0, first.n_frames, step), at_knots)
        known: dict[int, tuple[Floats, Floats, Floats]] = {}
        radii_m = np.array([body.girth * _radii_m() for body in bodies])
        for body, around_m in zip(bodies, radii_m, strict=True):
            if id(body) not in known:
                ground = body.motion.root_pos_m[rows][:, [0, 2]]
                joints = body_pos_m(_frames(body.motion, rows))[..., [0, 2]] - ground[:, None]
                farthest = (np.linalg.norm(joints, axis=-1) + around_m).max(axis=1)
                known[id(body)] = ground, joints, farthest
        ground_m, reach_m, farthest_m = (
            np.array([known[id(body)][index] for body in bodies]) for index in range(3)
        )
        at_rows = np.searchsorted(rows, at_knots)
        return cls(bodies, times_s, rows, at_rows, ground_m, reach_m, farthest_m, radii_m)

    def paths_m(self, places_m: Floats) -> Floats:
        """The roots on the ground (N, T, 2) for places (K, N, 2)."""
        return np.array(
            [
                self.ground_m[index]
                + ground_shift_m(body.motion, body.contacts, self.times_s, places_m[:, index])[self.rows]
                for index, body in enumerate(self.bodies)
            ]
        )

    def conflicts(self, paths_m: Floats, margin_m: float) -> list[_Conflict]:
        """Where two bodies are nearest in each span between knots, if they are too near.

        The gap is measured along the line between the roots, which bounds the true one from below.
        """
        found, near_m = [], LEAST_GAP_M + margin_m
        span = np.searchsorted(self.knot_rows, np.arange(len(self.rows)), side="left")
        span = span.clip(0, len(self.times_s) - 1)
        for one, other in combinations(range(len(paths_m)), 2):
            apart = paths_m[other] - paths_m[one]  # (T, 2)
            distance = np.linalg.norm(apart, axis=-1)
            rows = np.flatnonzero(distance < near_m + self.farthest_m[one] + self.farthest_m[other])
            if not len(rows):
                continue
            gap = _gaps_m(apart[rows], self.reach_m[[one, other]][:, rows], self.radii_m[[one, other]])
            short = gap < near_m
            rows, gap = rows[short], gap[short]
            for knot in np.unique(span[rows]).tolist():
                here = np.flatnonzero(span[rows] == knot)
                row = int(rows[here[np.argmin(gap[here])]])
                found.append(_Conflict(one, other, knot, apart[row] / max(float(distance[row]), 1e-9)))
        return found

    def least_gap_m(self, paths_m: Floats) -> float:
        """The least gap of any two bodies in metres, measured as that of `conflicts`."""
        return min(
            float(_gaps_m(paths_m[b] - paths_m[a], self.reach_m[[a, b]], self.radii_m[[a, b]]).min())
            for a, b in combinations(range(len(paths_m)), 2)
        )

    def hidden(self, paths_m: Floats, formation_m: Floats, most_s: float) -> Floats:
        """The direction, -1, 0 or 1, in which each dancer steps aside at each knot (K, N)."""
        eye = eye_of(formation_m.reshape(-1, 2))
        away = eye[1] - paths_m[..., 1]  # (N, T)
        seen = (paths_m[..., 0] - eye[0]) / away
        aside = np.zeros(formation_m.shape[:2])
        frame_s = np.gradient(self.rows / self.bodies[0].motion.fps) if len(self.rows) > 1 else np.zeros(1)
        for dancer in range(len(paths_m)):
            offset = (seen[dancer] - seen) * away[dancer]  # (N, T)
            covers = (away < away[dancer] - _IN_FRONT_M) & (np.abs(offset) < _HIDDEN_M)
            covered = covers.any(axis=0)
            for first, stop in _spans(covered):
                if frame_s[first:stop].sum() <= 0.75 * most_s:
                    continue
                side = np.sign(offset[covers][0]) or 1.0
                knots = np.searchsorted(self.knot_rows, [first, stop]).clip(0, len(aside) - 1)
                aside[max(0, knots[0] - 1) : knots[1] + 1, dancer] = side
        return aside


def least_gap_m(motions: Sequence[Motion], girths: Sequence[float]) -> float:
    """The least gap of any two finished dancers in metres, bounded from below as in planning.

    `girths` (N,) are those of the bodies.
    """
    every = np.arange(0, motions[0].n_frames, 2)
    ground_m = np.array([motion.root_pos_m[every][:, [0, 2]] for motion in motions])  # (N, T, 2)
    joints_m = np.array([body_pos_m(_frames(motion, every))[..., [0, 2]] for motion in motions])
    reach_m = joints_m - ground_m[:, :, None]
    radii_m = np.outer(girths, _radii_m())  # (N, J)
    return min(
        float(_gaps_m(ground_m[b] - ground_m[a], reach_m[[a, b]], radii_m[[a, b]]).min())
        for a, b in combinations(range(len(motions)), 2)
    )


def _gaps_m(apart_m: Floats, reach_m: Floats, radii_m: Floats) -> Floats:
    """Gaps (T,) of two bodies whose roots are `apart_m` (T, 2).

    `reach_m` (2, T, J, 2) is that of their joints from the roots, and `radii_m` (2, J) are around them.
    """
    distance = np.linalg.norm(apart_m, axis=-1)
    towards = (apart_m / np.maximum(distance, 1e-9)[:, None])[:, :, None]
    reach = ((reach_m[0] @ towards)[..., 0] + radii_m[0]).max(axis=1)
    back = ((-reach_m[1] @ towards)[..., 0] + radii_m[1]).max(axis=1)
    gaps_m: Floats = distance - reach - back
    return gaps_m


def _radii_m() -> Floats:
    """The radius of the body around each joint (J,)."""
    return np.array(
        [next((r for name, r in _RADII_M.items() if name in joint), _RADIUS_M) for joint in BODY_JOINTS]
    )


def _spans(on: np.ndarray) -> list[tuple[int, int]]:
    """The first and the next index after each stretch of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], on, [False]]).astype(np.int8)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def _frames(motion: Motion, rows: np.ndarray) -> Motion:
    return Motion(motion.skeleton, motion.root_pos_m[rows], motion.local_quat[rows], motion.fps)
