"""Costs that depend on what the path has danced: headings, takes, phrases that return, and places.

A beginning of a path is rated with what it danced: where its dancer faces and stands, which takes it used and
what it danced at the moments that return. The exact planner evaluates these costs along the cheapest path
found to each node.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.graph.cost import Cost, CostContext
from choreograph.choreography.graph.layers import SAME_FRAMES, Layer, PhraseReturns, moments_of, positions
from choreograph.core.kernel_cache import njit
from choreograph.core.numerics import AnyFloats, AnyInts
from choreograph.core.timebase import NET_FPS, NODE_FRAMES, seconds_to_frames
from choreograph.motion.body import BODY_JOINTS
from choreograph.music.count_grids import held_times_s
from choreograph.music.song_features import SongFeatures
from choreograph.plan.joins import stage_half_m

F32 = NDArray[np.float32]
PER_USAGE = np.float32(1.0 / 12.0)  # in three minutes, each of 15 takes is used for 12 s
TURNED_TAKE = 4.0  # of 1 - cos of the rotation at which a take is entered
_LAST_POSE = 6.0  # of 1 - cos of the heading of the last pose
_LEFT_HIP, _RIGHT_HIP = (BODY_JOINTS.index(f"{side}_hip") for side in ("left", "right"))
WALK_AT = 0.5, 1.0  # shares of the second at which the place on the stage is compared with its borders


class FrontCost(Cost):
    """How far the dancer is turned from the audience in the dance, 0 … 1 (ours).

    It is the square of (1 - cos heading) / 2, so that the back costs much more than the side. The heading is
    followed along the path: takes that are joined at different headings turn everything that comes after
    them. A change of takes therefore also costs four times 1 - cos of the rotation at which the next take is
    danced. The last pose costs six times 1 - cos of its heading. Raise its weight if the dancer shows the
    back to the audience for too long.
    """

    name = "front"
    default_weight = 3.0
    sentence = "The dancer turns away from the audience."
    is_compiled = True
    of_path = True
    min_path_cost = 0.0
    min_jump_cost = 0.0

    def node(self, layer: Layer, song_features: SongFeatures) -> AnyFloats | None:
        if layer.second > 0:
            return None
        series, constant = heading_series(layer, song_features)
        turned: AnyFloats = np.maximum(constant + series[:, 0] + series[:, 2], 0.0)
        return turned

    def edge(self, previous: Layer, next: Layer, song_features: SongFeatures) -> AnyFloats:
        costs: AnyFloats = turned_costs(
            previous.path.turn_rad, np.ascontiguousarray(previous.join_heading_rad[:, 1]),
            np.ascontiguousarray(next.join_heading_rad[:, 0]), next.steer_rad, previous.next_part, next.part,
            *heading_series(next, song_features), TURNED_TAKE,
        )  # fmt: skip
        return costs

    def min_edge_costs(self, previous: Layer, next: Layer, song_features: SongFeatures) -> AnyFloats:
        # The square of x is at least 2 t x - t². With t as the x of a take that is not rotated, the sum of
        # costs is a constant minus a cosine of the rotation.
        towards, aside = next.facing[:, 0], next.facing[:, 1]
        away = 0.5 - 0.5 * towards
        last = last_pose(next, song_features)
        cosine, sine = away * towards + TURNED_TAKE, away * aside
        constant = away - away**2 + TURNED_TAKE
        if last is not None:
            cosine, sine, constant = cosine + last[:, 0], sine + last[:, 1], constant + _LAST_POSE
        least: AnyFloats = np.maximum(constant - np.hypot(cosine, sine), 0.0)
        return least


def heading_series(layer: Layer, song_features: SongFeatures) -> tuple[AnyFloats, float]:
    """The Fourier series (N, 4) of the cost of each node by the rotation of its take, and its constant."""
    # ((1 - cos h) / 2)² = 3/8 - cos(h) / 2 + cos(2 h) / 8, where h is the heading in the take plus φ
    series = layer.facing * np.array([-1 / 2, 1 / 2, 1 / 8, -1 / 8])
    last = last_pose(layer, song_features)
    if last is None:
        return series, 3 / 8
    series[:, :2] += last * [-1.0, 1.0]
    return series, 3 / 8 + _LAST_POSE


def last_pose(layer: Layer, song_features: SongFeatures) -> AnyFloats | None:
    """Cosine and sine (N, 2) of the hips' headings in the last pose, times its cost. Else None."""
    last = _frame_of_last_pose(song_features) - layer.second * NODE_FRAMES
    if not 0 <= last < NODE_FRAMES:
        return None
    poses_m, _ = layer.bank.poses_m(layer.source, layer.source_frames[:, last])
    across_m = poses_m[:, _LEFT_HIP] - poses_m[:, _RIGHT_HIP]  # hips may be turned against the shoulders
    heading_rad = layer.heading_rad[:, last] + np.arctan2(-across_m[:, 2], across_m[:, 0])
    pose: AnyFloats = _LAST_POSE * np.stack([np.cos(heading_rad), np.sin(heading_rad)], axis=1)
    return pose


def _frame_of_last_pose(song_features: SongFeatures) -> int:
    """The frame of the song, at 20 fps, whose pose is held at the end, or is the last one."""
    _, held_s = held_times_s(song_features.opening_s, song_features.closing_s)
    is_held = song_features.closing_s < song_features.duration_s
    last = seconds_to_frames(held_s if is_held else song_features.duration_s, NET_FPS)
    return min(last, song_features.n_seconds * NODE_FRAMES - 1)


@njit(
    "float32[:,::1](float64[::1], float32[::1], float32[::1], float64, int64[::1], int64[::1], "
    "float64[:,::1], float64, float64)",
    nogil=True,
)
def turned_costs(
    turn_rad: AnyFloats,
    end_rad: AnyFloats,
    start_rad: AnyFloats,
    steer_rad: float,
    next_part: AnyInts,
    part: AnyInts,
    series: AnyFloats,
    constant: float,
    of_rotation: float,
) -> F32:  # pragma: no cover - compiled
    """Costs (P, N) of the rotations φ at which the takes of N nodes are danced after those of P nodes.

    With the Fourier series (a, b, c, d) of each node, `series` (N, 4), the cost is `constant` + a cos φ +
    b sin φ + c cos 2φ + d sin 2φ, and of_rotation · (1 - cos φ) where takes change. Where a node continues
    the other (`Layer.part`), φ is `turn_rad` (P,). Otherwise φ brings the heading `start_rad` (N,) to
    `turn_rad` + `end_rad` (P,), and is then steered towards 0 by `steer_rad`.
    """
    n_a, n_b = len(end_rad), len(start_rad)
    costs = np.empty((n_a, n_b), np.float32)
    cos_b, sin_b = np.cos(start_rad), np.sin(start_rad)
    steer = np.cos(steer_rad), np.sin(steer_rad)
    for i in range(n_a):
        turn = np.cos(turn_rad[i]), np.sin(turn_rad[i])
        end = np.cos(turn_rad[i] + end_rad[i]), np.sin(turn_rad[i] + end_rad[i])
        for j in range(n_b):
            costs[i, j] = turned_cost(
                next_part[i] == part[j], turn, end, (cos_b[j], sin_b[j]), steer,
                (series[j, 0], series[j, 1], series[j, 2], series[j, 3]), constant, of_rotation,
            )  # fmt: skip
    return costs


_Angle = tuple[float, float]  # cosine and sine


@njit(inline="always")
def turned_cost(
    continues: bool,
    turn: _Angle,
    end: _Angle,
    start: _Angle,
    steer: _Angle,
    series: tuple[float, float, float, float],
    constant: float,
    of_rotation: float,
) -> float:  # pragma: no cover - compiled
    """The formula of `FrontCost`, one of the `turned_costs`, without branches.

    `end` is that of `turn_rad` + `end_rad`, and `series` those of the node.
    """
    joined_cos = end[0] * start[0] + end[1] * start[1]
    joined_sin = end[1] * start[0] - end[0] * start[1]
    side = steer[1] if joined_sin >= 0 else -steer[1]
    is_turned = joined_cos < steer[0]
    cosine = joined_cos * steer[0] + joined_sin * side if is_turned else 1.0
    sine = joined_sin * steer[0] - joined_cos * side if is_turned else 0.0
    rotated = of_rotation * max(1.0 - cosine, 0.0)
    cosine = turn[0] if continues else cosine
    sine = turn[1] if continues else sine
    rotated = 0.0 if continues else rotated
    cost = constant + series[0] * cosine + series[1] * sine
    cost += series[2] * (2.0 * cosine * cosine - 1.0) + series[3] * (2.0 * sine * cosine)
    return max(cost, 0.0) + rotated


class Variety(Cost):
    """Recent use of the node's take along the path to it, in seconds, divided by 12 (ours).

    Without it, the cheapest path tends to stay in one long take. Raise its weight for more different takes in
    a dance.
    """

    default_weight = 0.75
    sentence = "The same take was danced shortly before."
    is_compiled = True
    of_path = True
    min_path_cost = 0.0

    min_jump_cost = 0.0

    def node(self, layer: Layer, song_features: SongFeatures) -> AnyFloats | None:
        if layer.second > 0 or layer.path.take_usage_s.shape[1] == 0:
            return None
        usage: AnyFloats = layer.path.take_usage_s[np.arange(layer.n_nodes), layer.usage_column] * PER_USAGE
        return usage

    def edge(self, previous: Layer, next: Layer, song_features: SongFeatures) -> AnyFloats | None:
        if previous.path.take_usage_s.shape[1] == 0:
            return None
        usage: AnyFloats = previous.path.take_usage_s[:, next.usage_column] * PER_USAGE
        return usage

    def min_edge_costs(self, previous: Layer, next: Layer, song_features: SongFeatures) -> AnyFloats | float:
        if previous.path.take_usage_s.shape[1] == 0:
            return 0.0
        least: AnyFloats = previous.path.take_usage_s.min(axis=0)[next.usage_column] * PER_USAGE
        return least


class FormCost(Cost):
    """1 in each second whose music returns, unless it dances what the path danced there before (ours).

    It dances the same if it is at the same moment of the same take, within a quarter of a second. In the last
    four counts before other music, the cost is 0.5, so that a phrase may end in another way. A new phrase
    after one that returns has a cost of 1 in each second that dances what followed there before. A song
    without phrases that return has no such cost. Raise its weight if the dance should return more often.
    """

    default_weight = 4.0
    sentence = "A phrase that returns in the music is danced in another way."
    is_compiled = True
    name = "form"
    of_path = True
    min_path_cost = 0.0
    min_jump_cost = 0.0

    def __init__(self, returns: PhraseReturns) -> None:
        self.returns = returns

    @classmethod
    def for_dance(cls, context: CostContext) -> FormCost | None:
        return None if context.returns is None else cls(context.returns)

    def node(self, layer: Layer, song_features: SongFeatures) -> AnyFloats | None:
        if layer.second > 0:
            return None
        total = np.zeros(layer.n_nodes)
        for number, share in layer.moments:
            total += self._cost(number, layer.path.danced[:, number], positions(layer, share))
        return total

    def edge(self, previous: Layer, next: Layer, song_features: SongFeatures) -> AnyFloats | None:
        total: NDArray[np.float32] | None = None
        for number, share in moments_of(next):
            danced = previous.path.danced[:, number]
            if np.isnan(danced).all():
                continue
            cost = self._cost(number, danced[:, None], positions(next, share))
            total = cost if total is None else total + cost
        return total

    def min_edge_costs(self, previous: Layer, next: Layer, song_features: SongFeatures) -> AnyFloats:
        least = np.zeros(next.n_nodes)
        for number, share in moments_of(next):
            values = np.unique(previous.path.danced[:, number])
            least += self._cost(number, values[:, None], positions(next, share)).min(axis=0)
        return least

    def _cost(self, number: int, danced: AnyFloats, here: AnyFloats) -> NDArray[np.float32]:
        """The cost of positions at one end of a pair, by what is danced at the other. 0 if nothing is yet."""
        broken = breaks_form(danced, here, bool(self.returns.is_return[number]))
        cost: F32 = np.float32(self.returns.weights[number]) * broken.astype(np.float32)
        return cost


def breaks_form(danced: Any, here: Any, is_return: bool) -> Any:
    """The formula of `FormCost`: whether positions differ where music returns, or agree elsewhere.

    They are arrays or numbers. Those of later moments are nan, and break nothing.
    """
    away = abs(danced - here)
    return away > SAME_FRAMES if is_return else away <= SAME_FRAMES


class StageCost(Cost):
    """How far the dancer leaves the stage along the path, in metres (ours).

    It is a mean over the second. The pelvis should stay 0.3 m within the borders, so that the feet do as
    well. A stage without borders has no such cost. Raise its weight if the dancer leaves the stage.
    """

    name = "stage"
    default_weight = 6.0
    sentence = "The dancer leaves the stage."
    unit = "m"
    of_path = True
    min_path_cost = 0.0
    min_jump_cost = 0.0

    def __init__(self, size_m: tuple[float, float]) -> None:
        """The width and the depth of the stage in metres."""
        self._half_m = stage_half_m(size_m)

    @classmethod
    def for_dance(cls, context: CostContext) -> StageCost | None:
        return None if context.stage_m is None else cls(context.stage_m)

    def edge(self, previous: Layer, next: Layer, song_features: SongFeatures) -> AnyFloats:
        beyond_m: AnyFloats = beyond_stage_m(
            np.ascontiguousarray(previous.path.place_m), previous.path.turn_rad,
            np.ascontiguousarray(previous.join_heading_rad[:, 1]),
            np.ascontiguousarray(next.join_heading_rad[:, 0]), next.steer_rad, previous.next_part, next.part,
            np.ascontiguousarray(next.walk_m, np.float64), *self._half_m,
        )  # fmt: skip
        return beyond_m


@njit(
    "float32[:,::1](float64[:,::1], float64[::1], float32[::1], float32[::1], float64, int64[::1], "
    "int64[::1], float64[:,:,::1], float64, float64)",
    nogil=True,
)
def beyond_stage_m(
    place_m: AnyFloats,
    turn_rad: AnyFloats,
    end_rad: AnyFloats,
    start_rad: AnyFloats,
    steer_rad: float,
    next_part: AnyInts,
    part: AnyInts,
    walk_m: AnyFloats,
    half_width_m: float,
    half_depth_m: float,
) -> NDArray[np.float32]:  # pragma: no cover - compiled
    """How far N nodes that follow P nodes are outside of a stage, (P, N), as a mean over M places of each.

    The others end at `place_m` (P, 2). Each node moves by `walk_m` (N, M, 2), rotated as in `turned_costs`.
    """
    n_a, n_b, n_places = len(end_rad), len(start_rad), walk_m.shape[1]
    beyond = np.zeros((n_a, n_b), np.float32)
    for i in range(n_a):
        for j in range(n_b):
            turned = turn_rad[i]
            if next_part[i] != part[j]:
                turned = (turned + end_rad[i] - start_rad[j] + np.pi) % (2 * np.pi) - np.pi
                turned -= min(max(turned, -steer_rad), steer_rad)
            cosine, sine = np.cos(turned), np.sin(turned)
            total = 0.0
            for k in range(n_places):
                x = place_m[i, 0] + cosine * walk_m[j, k, 0] + sine * walk_m[j, k, 1]
                z = place_m[i, 1] + cosine * walk_m[j, k, 1] - sine * walk_m[j, k, 0]
                total += max(0.0, abs(x) - half_width_m, abs(z) - half_depth_m)
            beyond[i, j] = total / n_places
    return beyond
