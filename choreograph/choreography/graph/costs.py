"""Costs of nodes and edges. The built-in ones use only what a user-defined cost can use, too."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from choreograph.choreography.graph.cost import (
    Cost,
    WeightedCost,
    random_numbers,
    revisits,
    rms_distances,
    rms_speed_m_s,
    turned_costs,
)
from choreograph.choreography.graph.layers import Layer
from choreograph.choreography.selection import energy_mismatch, steps_mismatch
from choreograph.core.arguments import unexpected
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import AnyFloats, AnyInts
from choreograph.core.plugins import installed
from choreograph.core.timebase import CLIP_FRAMES, NET_FPS, NODE_FRAMES, seconds_to_frames
from choreograph.motion.body import BODY_JOINTS
from choreograph.music.danced_span import held_times_s
from choreograph.music.song_features import SongFeatures
from choreograph.settings import COST_GROUP, DanceConfig, resolve_weights

USAGE_SCALE_S = 12.0  # of each of 15 takes in three minutes
TURNED_TAKE = 4.0  # of 1 - cos of the rotation at which a take is entered
_LAST_POSE = 6.0  # of 1 - cos of the heading of the last pose
STILL_M_S = 0.1  # the velocities of slower bodies hardly differ
OVERLAP_FRAMES = NODE_FRAMES // 4  # a shorter step back is not a repeat: both sides may have the beat
_LEFT_HIP, _RIGHT_HIP = (BODY_JOINTS.index(f"{side}_hip") for side in ("left", "right"))


class Genre(Cost):
    """‖S_x(clip) - S_m(second)‖₂: distance of a clip's style from the music's (equation 5).

    It tells genres apart. Within a genre, it prefers the same clips in all parts of a song, so it is not
    named style as in ChoreoGraph. Raise its weight for clips that are nearer to the genre of the music.
    """

    def node(self, layer: Layer, song_features: SongFeatures) -> AnyFloats:
        distance: AnyFloats = np.linalg.norm(layer.style - song_features.style[layer.second], axis=1)
        return distance


class Completeness(Cost):
    """1 for leaving a warped segment, and less for staying in it the longer an action has no beat.

    The cost of staying is σ((20 - V) / 5), where V is the number of frames from the last motion beat before
    the border to the first one after it (ChoreoGraph, section 3.3). In a second without a beat, the gap
    extends to its far end. Unlike in the paper, staying in a take that is aligned by its counts costs
    nothing. Its figures determine where an action is complete (`Phrasing`). If such takes were left where the
    body rests, dances would rest more than their dancers do. Raise its weight for longer passages of takes
    without counts.
    """

    min_jump_cost = 1.0

    def edge(self, previous: Layer, next: Layer, song_features: SongFeatures) -> AnyFloats:
        cost = np.ones((previous.n_nodes, next.n_nodes), np.float32)
        here, there = previous.successors_in(next)
        cost[here, there] = self.staying(previous, next, here, there)
        return cost

    def staying(self, previous: Layer, next: Layer, here: AnyInts, there: AnyInts) -> AnyFloats:
        """The costs (M,) of going from nodes `here` (M,) to their successors `there` (M,)."""
        last = np.nan_to_num(previous.last_beat[here], nan=0.0)
        first = np.nan_to_num(next.first_beat[there], nan=float(NODE_FRAMES))
        gap = NODE_FRAMES - last + first  # frames, at most two seconds
        by_beats = 1.0 / (1.0 + np.exp(-(NODE_FRAMES - gap) / 5.0))
        return np.where(previous.time_map_id[here] >= 0, 0.0, by_beats)


class Transition(Cost):
    """Root mean square joint distance in metres, with the next body aligned to the previous one.

    It is the paper's ‖·‖₂ over all joints, divided by √21 so that it is in metres for any number of joints.
    It is measured at the border of the two seconds, where consecutive nodes of a segment have the distance 0.
    The first node costs nothing. Raise its weight if poses differ too much where takes change.
    """

    min_jump_cost = 0.0

    def edge(self, previous: Layer, next: Layer, song_features: SongFeatures) -> AnyFloats:
        return rms_distances(previous.last_pose_m, next.first_pose_m)


class Velocity(Cost):
    """Root mean square difference of joint velocities at the border, divided by the mean speed (ours).

    It is 0 if both bodies move in the same way, and up to 2 if one rests or they move in opposite directions.
    Without the division, it would be least where both rest. Takes would change there, and dances would rest
    more than their dancers do. Raise its weight if the motion stops or turns where takes change.
    """

    min_jump_cost = 0.0

    def edge(self, previous: Layer, next: Layer, song_features: SongFeatures) -> AnyFloats:
        difference_m_s = rms_distances(previous.last_velocity_m_s, next.first_velocity_m_s)
        speed_m_s = 0.5 * (
            rms_speed_m_s(previous.last_velocity_m_s)[:, None] + rms_speed_m_s(next.first_velocity_m_s)
        )
        return difference_m_s / (speed_m_s + np.float32(STILL_M_S))


class Rhythm(Cost):
    """Share of unmatched beats of the warped node, plus the mismatch of tempo-densities (ours).

    The paper's costs do not measure the result of the warp, and select clips that cannot be warped to the
    beat. A node that is aligned by the counts of its take costs only the uncertainty of counts that were
    estimated from the motion. Raise its weight if takes without counts miss the beats of the song.
    """

    def node(self, layer: Layer, song_features: SongFeatures) -> AnyFloats:
        by_density = layer.unmatched_beat + layer.density_mismatch
        return np.where(layer.time_map_id >= 0, layer.count_uncertainty, by_density)


class Accents(Cost):
    """Share of unmatched motion and music beats of a node that is aligned by the counts of its take (ours).

    Dancers rarely come to rest on the count itself. With a high weight, dances stop on every beat. Raise its
    weight for motion that rests on the beats.
    """

    def node(self, layer: Layer, song_features: SongFeatures) -> AnyFloats:
        return np.where(layer.time_map_id >= 0, layer.unmatched_beat, 0.0)


class Bars(Cost):
    """Share of the second's beats whose number in the bar differs from the take's (ours).

    It is 0 if the bars coincide. A take of another metre differs in most beats. Raise its weight if count 1
    of the dance is not on count 1 of the song.
    """

    def node(self, layer: Layer, song_features: SongFeatures) -> AnyFloats:
        return layer.off_bar


class Phrasing(Cost):
    """Mismatch of a change of takes with the figures of both, 0 … 1 (ours).

    It is 0 where a figure of one take ends and one of the other begins, and 1 inside figures and off count 1.
    Raise its weight for takes that change only between figures.
    """

    min_jump_cost = 0.0

    def edge(self, previous: Layer, next: Layer, song_features: SongFeatures) -> AnyFloats:
        cost = 0.5 * (previous.leave_penalty[:, None] + next.enter_penalty).astype(np.float32)
        cost[previous.successors_in(next)] = 0.0
        return cost

    def min_edge_costs(self, previous: Layer, next: Layer, song_features: SongFeatures) -> AnyFloats:
        least: AnyFloats = 0.5 * (previous.leave_penalty.min() + next.enter_penalty)
        return least


class Energy(Cost):
    """Mismatch of the size of motion with the loudness of the song (ours).

    Large motion has a cost where the song is softer than its mean, and small motion where it is louder. In a
    song of constant loudness, the cost is 0. Raise its weight for a dance that follows the loudness more
    closely.
    """

    def node(self, layer: Layer, song_features: SongFeatures) -> AnyFloats:
        louder = float(song_features.energy[layer.second] - song_features.energy.mean())
        return energy_mismatch(louder, layer.liveliness)


class Steps(Cost):
    """Mismatch of the density of steps with the density of onsets (ours).

    Both are ranks from 0 to 1: of the clip in its genre, and of the second in its song. Raise its weight for
    more steps where the music has more onsets.
    """

    def node(self, layer: Layer, song_features: SongFeatures) -> AnyFloats:
        return steps_mismatch(float(song_features.onset_density[layer.second]), layer.steps)


class Front(Cost):
    """How far the dancer is turned from the audience in the dance, 0 … 1 (ours).

    It is the square of (1 - cos heading) / 2, so that the back costs much more than the side. The heading is
    followed along the path: takes that are joined at different headings turn everything that comes after
    them. A change of takes therefore also costs four times 1 - cos of the rotation at which the next take is
    danced. The last pose costs six times 1 - cos of its heading. Raise its weight if the dancer shows the
    back to the audience for too long.
    """

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
            previous.turn_rad, np.ascontiguousarray(previous.join_heading_rad[:, 1]),
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
    poses_m, _ = layer.bank.poses_m(layer.clip, layer.source_frames[:, last])
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


class Pace(Cost):
    """Change of playback speed from the recording, in octaves, averaged over quarters of the second.

    This cost is ours. In the paper, every warp within the slope limits is free, and the dances are hectic. At
    1.5 times the speed, feet slide 1.5 times as fast, and accelerations are more than doubled. Raise its
    weight for takes that are played nearer to their recorded speed.
    """

    def node(self, layer: Layer, song_features: SongFeatures) -> AnyFloats:
        slopes = np.diff(layer.source_frames[:, :: NODE_FRAMES // 4], axis=1) / (NODE_FRAMES // 4)  # (N, 4)
        octaves: AnyFloats = np.abs(np.log2(slopes)).mean(axis=1)
        return octaves


class Variety(Cost):
    """Recent use of the node's take along the path to it, in seconds, divided by 12 (ours).

    Without it, the cheapest path tends to stay in one long take. Raise its weight for more different takes in
    a dance.
    """

    of_path = True
    min_path_cost = 0.0

    min_jump_cost = 0.0

    def node(self, layer: Layer, song_features: SongFeatures) -> AnyFloats | None:
        if layer.second > 0 or layer.take_usage_s.shape[1] == 0:
            return None
        usage: AnyFloats = layer.take_usage_s[np.arange(layer.n_nodes), layer.usage_column] / USAGE_SCALE_S
        return usage

    def edge(self, previous: Layer, next: Layer, song_features: SongFeatures) -> AnyFloats | None:
        if previous.take_usage_s.shape[1] == 0:
            return None
        usage: AnyFloats = previous.take_usage_s[:, next.usage_column] * np.float32(1.0 / USAGE_SCALE_S)
        return usage

    def min_edge_costs(self, previous: Layer, next: Layer, song_features: SongFeatures) -> AnyFloats | float:
        if previous.take_usage_s.shape[1] == 0:
            return 0.0
        least: AnyFloats = previous.take_usage_s.min(axis=0)[next.usage_column] / USAGE_SCALE_S
        return least


class Repeat(Cost):
    """1 for an edge that goes back in the same take by less than a clip's length (ours).

    A step back of up to a quarter of a second is free, since both sides may contain the same beat. Raise its
    weight if the dance repeats the same movement at once.
    """

    min_jump_cost = 0.0

    def edge(self, previous: Layer, next: Layer, song_features: SongFeatures) -> AnyFloats:
        again: AnyFloats = revisits(
            previous.take, np.ascontiguousarray(previous.take_frames[:, 1]),
            next.take, np.ascontiguousarray(next.take_frames[:, 0]), OVERLAP_FRAMES, CLIP_FRAMES,
        )  # fmt: skip
        return again


class Seed(Cost):
    """A random number, 0 … 1, of each continuous part of a take in the song (ours).

    It follows from the seed of the dance. Of takes and parts that are nearly as good, each seed prefers
    others. Half of it is 0 or 1 for the whole take, and the other half is random for the part. Raise its
    weight for dances that differ more from seed to seed.
    """

    def __init__(self, seed: int) -> None:
        self._seed = seed

    def node(self, layer: Layer, song_features: SongFeatures) -> AnyFloats:
        part = np.where(layer.time_map_id >= 0, 2 * layer.time_map_id, 2 * layer.segment + 1)
        of_part = random_numbers(part.astype(np.uint64), self._seed)
        of_take = random_numbers(layer.take.astype(np.uint64), self._seed + 2**32) < 0.5
        return 0.5 * (of_take + of_part)


BUILTIN_COSTS: tuple[type[Cost], ...] = (
    Genre, Completeness, Transition, Velocity, Rhythm, Accents, Bars, Phrasing, Energy, Steps, Front, Pace,
    Variety, Repeat,
)  # fmt: skip


def installed_costs(weights: Collection[str], given: Iterable[Cost] = ()) -> tuple[Cost, ...]:
    """The costs of other packages that have a weight, without those of the same name as one `given`.

    Another package adds a subclass of `Cost` by an entry point of the group `choreograph.costs`, under the
    cost's name.
    """
    taken = {cost.name for cost in given}
    kinds = installed(COST_GROUP, _check_cost)
    return tuple(kind() for name, kind in kinds.items() if name in weights and name not in taken)


def _check_cost(name: str, kind: Any) -> None:
    """Raise unless the class of another package makes a cost of this name."""
    if not (isinstance(kind, type) and issubclass(kind, Cost) and kind.name == name):
        raise unexpected(f"a subclass of Cost with the name {name!r} of its entry point", kind)
    kind()


def own_costs(config: DanceConfig, costs: Sequence[Cost], engine: str) -> tuple[WeightedCost, ...]:
    """The costs of the user and of other packages with their weights, for an `engine` of motion words.

    Raises `ParameterError` if two share a name, one depends on the path, or a weight is that of another cost.
    """
    every = [*costs, *installed_costs(config.weights, costs)]
    names = [cost.name for cost in every]
    others = sorted(set(config.weights) - set(names))
    if others:
        raise ParameterError(
            f"expected weights of your own costs with the {engine} engine, got {others[0]!r}: the built-in "
            "costs belong to the graph engine"
        )
    if len(set(names)) != len(names):
        raise ParameterError(f"expected a different name for each cost, got {', '.join(names)}")
    of_path = [cost.name for cost in every if cost.of_path]
    if of_path:
        raise ParameterError(
            f"expected costs without of_path with the {engine} engine, got {of_path[0]!r}: use the graph "
            "engine"
        )
    weights = resolve_weights(config.weights, names)
    return tuple(WeightedCost(cost, weights[cost.name]) for cost in every)


def check_weights_used(planner: str, weights: Mapping[str, float]) -> None:
    """Raise `ParameterError` for the weight of a cost that the planner leaves out."""
    unused = {cost.name for cost in BUILTIN_COSTS} - {Transition.name}
    given = sorted(unused & set(weights))
    if planner == "motion-graph" and given:
        raise ParameterError(
            f"expected the planner exact or greedy with a weight of {given[0]!r}, got motion-graph, which "
            "uses only transition, stillness and your own costs"
        )
