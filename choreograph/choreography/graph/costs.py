"""The built-in costs of nodes and of edges, and the register of all costs.

A cost is one class. It declares its default weight, its label, its unit and a sentence, and contains its
formula once. Tables, help, checks and the studio are derived from `BUILTIN_COSTS`. Costs that depend on the
path are in `path_costs`, and those of motifs in `motif_costs`. The built-in costs use only what a cost of a
user can use, too.

The formula of a cost of edges that is compiled is a function of one edge. `Cost.edge` evaluates it for
arrays of nodes, and `kernels` compiles it into the loops of a search.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.graph.cost import Cost, CostContext, WeightedCost, resolve_weights
from choreograph.choreography.graph.layers import Layer, PoseBank
from choreograph.choreography.graph.motif_costs import MotifTransition, Signature
from choreograph.choreography.graph.path_costs import FormCost, FrontCost, StageCost, Variety
from choreograph.choreography.selection import energy_mismatch, steps_mismatch
from choreograph.core.arguments import unexpected
from choreograph.core.errors import ParameterError
from choreograph.core.kernel_cache import njit
from choreograph.core.numerics import AnyFloats, AnyInts
from choreograph.core.plugins import Group, installed, installed_names
from choreograph.core.timebase import CLIP_FRAMES, NET_FPS, NODE_FRAMES
from choreograph.motion.body import BODY_JOINTS
from choreograph.music.count_grids import held_times_s
from choreograph.music.song_features import SongFeatures
from choreograph.settings import DanceConfig

F32 = NDArray[np.float32]
_STILL_M_S = np.float32(0.1)  # the velocities of slower bodies hardly differ
OVERLAP_FRAMES = NODE_FRAMES // 4  # a shorter step back is not a repeat: both sides may have the beat
_ANKLES = tuple(BODY_JOINTS.index(f"{side}_ankle") for side in ("left", "right"))
_HALF = np.float32(0.5)


class Genre(Cost):
    """‖S_x(clip) - S_m(second)‖₂: distance of a clip's style from the music's (equation 5).

    It tells genres apart. Within a genre, it prefers the same clips in all parts of a song, so it is not
    named style as in ChoreoGraph. Raise its weight for clips that are nearer to the genre of the music.
    """

    default_weight = 1.0
    sentence = "The style of the take differs from that of the music."
    also_called = ("style",)

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

    default_weight = 2.0
    sentence = "The take is left before its movement is complete."
    is_compiled = True
    min_jump_cost = 1.0

    def edge(self, previous: Layer, next: Layer, song_features: SongFeatures) -> AnyFloats:
        cost = np.ones((previous.n_nodes, next.n_nodes), np.float32)
        here, there = previous.successors_in(next)
        cost[here, there] = self.staying(previous, next, here, there)
        return cost

    def staying(self, previous: Layer, next: Layer, here: AnyInts, there: AnyInts) -> AnyFloats:
        """The costs (M,) of going from nodes `here` (M,) to their successors `there` (M,)."""
        last = np.nan_to_num(previous.warp.last_beat[here], nan=0.0)
        first = np.nan_to_num(next.warp.first_beat[there], nan=float(NODE_FRAMES))
        gap = NODE_FRAMES - last + first  # frames, at most two seconds
        by_beats = 1.0 / (1.0 + np.exp(-(NODE_FRAMES - gap) / 5.0))
        return np.where(previous.warp.time_map_id[here] >= 0, 0.0, by_beats)


# A squared distance is the difference of sums. Below this share of them, it is their rounding error, which
# depends on the number of rows that are multiplied at once.
_ROUNDING = np.float32(2e-6)


@njit(
    "float32[:,::1](float32[:,::1], float32[::1], float32[::1], float32)",
    nogil=True,
)
def distances_from_product(
    product: F32, sq_a: F32, sq_b: F32, scale: np.float32
) -> F32:  # pragma: no cover - compiled
    """√(scale · (|a|² + |b|² - 2 a·b)), replacing the products a·b, (P, N) float32. 0 within rounding."""
    n_a, n_b = product.shape
    for i in range(n_a):
        for j in range(n_b):
            product[i, j] = distance_from_product(product[i, j], sq_a[i], sq_b[j], scale)
    return product


@njit(inline="always")
def distance_from_product(
    product: Any, sq_a: Any, sq_b: Any, scale: Any
) -> Any:  # pragma: no cover - compiled
    """The formula of `Transition`, and of the difference in `Velocity`: one of `distances_from_product`."""
    both = sq_a + sq_b
    d = both - np.float32(2.0) * product
    return np.sqrt(d * scale) if d > _ROUNDING * both else np.float32(0.0)


def rms_distances(a: AnyFloats, b: AnyFloats) -> AnyFloats:
    """Root mean square joint distances (P, N) of poses (P, 21, 3) and (N, 21, 3)."""

    (flat_a, sq_a), (flat_b, sq_b) = flat_poses(a), flat_poses(b)
    scale = np.float32(1.0 / a.shape[1])
    distances_m: AnyFloats = distances_from_product(flat_a @ flat_b.T, sq_a, sq_b, scale)
    return distances_m


def flat_poses(poses: AnyFloats) -> tuple[F32, F32]:
    """Poses (N, 21, 3) as vectors (N, 63), and the squares (N,) of their lengths."""
    flat = np.ascontiguousarray(poses, np.float32).reshape(len(poses), -1)
    return flat, np.einsum("nd,nd->n", flat, flat)


def rms_speed_m_s(velocity_m_s: AnyFloats) -> NDArray[np.float32]:
    """Root mean square joint speeds (N,) of velocities (N, 21, 3)."""
    speed_m_s: NDArray[np.float32] = np.sqrt(
        np.einsum("njd,njd->n", velocity_m_s, velocity_m_s) / velocity_m_s.shape[1], dtype=np.float32
    )
    return speed_m_s


class Transition(Cost):
    """Root mean square joint distance in metres, with the next body aligned to the previous one.

    It is the paper's ‖·‖₂ over all joints, divided by √21 so that it is in metres for any number of joints.
    It is measured at the border of the two seconds, where consecutive nodes of a segment have the distance 0.
    The first node costs nothing. Raise its weight if poses differ too much where takes change.
    """

    default_weight = 3.0
    sentence = "The poses differ where one take follows another."
    unit = "m"
    is_compiled = True
    min_jump_cost = 0.0

    def edge(self, previous: Layer, next: Layer, song_features: SongFeatures) -> AnyFloats:
        return rms_distances(previous.last_pose_m, next.first_pose_m)


class Velocity(Cost):
    """Root mean square difference of joint velocities at the border, divided by the mean speed (ours).

    It is 0 if both bodies move in the same way, and up to 2 if one rests or they move in opposite directions.
    Without the division, it would be least where both rest. Takes would change there, and dances would rest
    more than their dancers do. Raise its weight if the motion stops or turns where takes change.
    """

    default_weight = 3.0
    sentence = "The speeds of the joints differ where one take follows another."
    is_compiled = True
    min_jump_cost = 0.0

    def edge(self, previous: Layer, next: Layer, song_features: SongFeatures) -> AnyFloats:
        difference_m_s = rms_distances(previous.last_velocity_m_s, next.first_velocity_m_s)
        before_m_s, after_m_s = map(rms_speed_m_s, (previous.last_velocity_m_s, next.first_velocity_m_s))
        changes: AnyFloats = relative_change(difference_m_s, before_m_s[:, None], after_m_s)
        return changes


def relative_change(difference_m_s: Any, before_m_s: Any, after_m_s: Any) -> Any:
    """The formula of `Velocity`: a difference of velocities by the mean of two speeds, arrays or numbers."""
    return difference_m_s / (_HALF * (before_m_s + after_m_s) + _STILL_M_S)


class Rhythm(Cost):
    """Share of unmatched beats of the warped node, plus the mismatch of tempo-densities (ours).

    The paper's costs do not measure the result of the warp, and select clips that cannot be warped to the
    beat. A node that is aligned by the counts of its take costs only the uncertainty of counts that were
    estimated from the motion. Raise its weight if takes without counts miss the beats of the song.
    """

    default_weight = 14.0
    sentence = "Motion beats miss the beats of the music."

    def node(self, layer: Layer, song_features: SongFeatures) -> AnyFloats:
        by_density = layer.warp.unmatched_beat + layer.warp.density_mismatch
        return np.where(layer.warp.time_map_id >= 0, layer.count_uncertainty, by_density)


class Accents(Cost):
    """Share of unmatched motion and music beats of a node that is aligned by the counts of its take (ours).

    Dancers rarely come to rest on the count itself. With a high weight, dances stop on every beat. Raise its
    weight for motion that rests on the beats.
    """

    default_weight = 0.0
    sentence = "Motion beats are not on the counts."

    def node(self, layer: Layer, song_features: SongFeatures) -> AnyFloats:
        return np.where(layer.warp.time_map_id >= 0, layer.warp.unmatched_beat, 0.0)


class Bars(Cost):
    """Share of the second's beats whose number in the bar differs from the take's (ours).

    It is 0 if the bars coincide. A take of another metre differs in most beats. Raise its weight if count 1
    of the dance is not on count 1 of the song.
    """

    default_weight = 6.0
    sentence = "Count 1 of the take is not on count 1 of the music."

    def node(self, layer: Layer, song_features: SongFeatures) -> AnyFloats:
        return layer.warp.off_bar


class Phrasing(Cost):
    """Mismatch of a change of takes with the figures of both, 0 … 1 (ours).

    It is 0 where a figure of one take ends and one of the other begins, and 1 inside figures and off count 1.
    Raise its weight for takes that change only between figures.
    """

    default_weight = 4.0
    sentence = "The take changes inside of a figure or a bar."
    is_compiled = True
    min_jump_cost = 0.0

    def edge(self, previous: Layer, next: Layer, song_features: SongFeatures) -> AnyFloats:
        penalties = previous.warp.leave_penalty, next.warp.enter_penalty
        leave, enter = (np.asarray(penalty, np.float32) for penalty in penalties)
        cost: AnyFloats = mean_penalty(leave[:, None], enter)
        cost[previous.successors_in(next)] = 0.0
        return cost

    def min_edge_costs(self, previous: Layer, next: Layer, song_features: SongFeatures) -> AnyFloats:
        least: AnyFloats = 0.5 * (previous.warp.leave_penalty.min() + next.warp.enter_penalty)
        return least


def mean_penalty(leave: Any, enter: Any) -> Any:
    """The formula of `Phrasing` where the take changes: the penalties may be arrays or numbers."""
    return _HALF * (leave + enter)


class Energy(Cost):
    """Mismatch of the size of motion with the loudness of the song (ours).

    Large motion has a cost where the song is softer than its mean, and small motion where it is louder. In a
    song of constant loudness, the cost is 0. Raise its weight for a dance that follows the loudness more
    closely.
    """

    default_weight = 2.0
    sentence = "The motion is larger or smaller than the music is loud."

    def node(self, layer: Layer, song_features: SongFeatures) -> AnyFloats:
        louder = float(song_features.energy[layer.second] - song_features.energy.mean())
        return energy_mismatch(louder, layer.liveliness)


class StepsCost(Cost):
    """Mismatch of the density of steps with the density of onsets (ours).

    Both are ranks from 0 to 1: of the clip in its genre, and of the second in its song. Raise its weight for
    more steps where the music has more onsets.
    """

    name = "steps"
    default_weight = 0.5
    sentence = "There are more or fewer steps than the music has onsets."

    def node(self, layer: Layer, song_features: SongFeatures) -> AnyFloats:
        return steps_mismatch(float(song_features.onset_density[layer.second]), layer.steps)


class Pace(Cost):
    """Change of playback speed from the recording, in octaves, averaged over quarters of the second.

    This cost is ours. In the paper, every warp within the slope limits is free, and the dances are hectic. At
    1.5 times the speed, feet slide 1.5 times as fast, and accelerations are more than doubled. Raise its
    weight for takes that are played nearer to their recorded speed.
    """

    default_weight = 0.3
    sentence = "The take is played faster or slower than it was danced."
    unit = "octaves"

    def node(self, layer: Layer, song_features: SongFeatures) -> AnyFloats:
        slopes = np.diff(layer.source_frames[:, :: NODE_FRAMES // 4], axis=1) / (NODE_FRAMES // 4)  # (N, 4)
        octaves: AnyFloats = np.abs(np.log2(slopes)).mean(axis=1)
        return octaves


class RepeatCost(Cost):
    """1 for an edge that goes back in the same take by less than a clip's length (ours).

    A step back of up to a quarter of a second is free, since both sides may contain the same beat. Raise its
    weight if the dance repeats the same movement at once.
    """

    name = "repeat"
    default_weight = 8.0
    sentence = "The take jumps back to what was just danced."
    is_compiled = True
    min_jump_cost = 0.0

    def edge(self, previous: Layer, next: Layer, song_features: SongFeatures) -> AnyFloats:
        ends, starts = (np.ascontiguousarray(x) for x in (previous.take_frames[:, 1], next.take_frames[:, 0]))
        again: AnyFloats = _all_repeats(previous.take, ends, next.take, starts)
        return again


@njit(
    "float32[:,::1](int32[::1], float64[::1], int32[::1], float64[::1])",
    nogil=True,
)
def _all_repeats(
    take_a: AnyInts, end_a: AnyFloats, take_b: AnyInts, start_b: AnyFloats
) -> F32:  # pragma: no cover - compiled
    """1 where an edge `repeats`, (P, N)."""
    again = np.zeros((len(take_a), len(take_b)), np.float32)
    for i in range(len(take_a)):
        for j in range(len(take_b)):
            if repeats(take_a[i], end_a[i], take_b[j], start_b[j]):
                again[i, j] = 1.0
    return again


@njit(inline="always")
def repeats(take_a: Any, end_a: Any, take_b: Any, start_b: Any) -> Any:  # pragma: no cover - compiled
    """The formula of `RepeatCost`: whether b, in the same take as a, starts before the frame where a ends."""
    return (take_a == take_b) & (OVERLAP_FRAMES < end_a - start_b < CLIP_FRAMES)


class Seed(Cost):
    """A random number, 0 … 1, of each continuous part of a take in the song (ours).

    It follows from the seed of the dance. Of takes and parts that are nearly as good, each seed prefers
    others. Half of it is 0 or 1 for the whole take, and the other half is random for the part. Raise its
    weight for dances that differ more from seed to seed.
    """

    default_weight = 0.6
    sentence = "A random preference, which another seed changes."

    def __init__(self, seed: int) -> None:
        self._seed = seed

    @classmethod
    def for_dance(cls, context: CostContext) -> Seed:
        return cls(context.seed)

    def node(self, layer: Layer, song_features: SongFeatures) -> AnyFloats:
        part = np.where(layer.warp.time_map_id >= 0, 2 * layer.warp.time_map_id, 2 * layer.warp.segment + 1)
        of_part = _random_numbers(part.astype(np.uint64), self._seed)
        of_take = _random_numbers(layer.take.astype(np.uint64), self._seed + 2**32) < 0.5
        return 0.5 * (of_take + of_part)


def _random_numbers(keys: NDArray[np.uint64], seed: int) -> NDArray[np.float64]:
    """A number in [0, 1) for each key (N,), always the same for the same key and seed (SplitMix64)."""
    mixed = keys + _offset_of(seed)
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        mixed = (mixed ^ (mixed >> np.uint64(shift))) * np.uint64(factor)
    return (mixed ^ (mixed >> np.uint64(31))) / 2.0**64


@lru_cache(maxsize=64)
def _offset_of(seed: int) -> np.uint64:
    """The number that a seed adds to keys. To make a generator takes longer than to mix a layer's keys."""
    offset: np.uint64 = np.random.default_rng(seed).integers(0, 2**63, dtype=np.uint64)
    return offset


class Stillness(Cost):
    """Motion in the poses that are held before the first count and after the last (ours).

    It is the mean joint speed in m/s, plus ten times the height of one foot over the other in metres. Raise
    its weight if the dancer moves or stands on one foot in the held poses.
    """

    default_weight = 4.0
    sentence = "The dancer moves, or stands on one foot, in a held pose."
    unit = "m/s"

    def __init__(self, poses: PoseBank) -> None:
        self._poses = poses

    @classmethod
    def for_dance(cls, context: CostContext) -> Stillness:
        return cls(context.poses)

    def node(self, layer: Layer, song_features: SongFeatures) -> AnyFloats | None:
        first_s, last_s = held_times_s(song_features.opening_s, song_features.closing_s)
        held_s = [first_s] if song_features.opening_s > 0 else []
        held_s += [last_s] if song_features.closing_s < song_features.duration_s else []
        here = [at_s for at_s in held_s if layer.second <= at_s < layer.second + 1]
        if not here:
            return None
        restless: AnyFloats = np.sum([self._restlessness(layer, at_s) for at_s in here], axis=0)
        return restless

    def _restlessness(self, layer: Layer, at_s: float) -> AnyFloats:
        frame = (at_s - layer.second) * NET_FPS
        low = min(int(frame), NODE_FRAMES - 1)
        slope = layer.source_frames[:, low + 1] - layer.source_frames[:, low]
        pose_m, velocity_m_s = self._poses.poses_m(
            layer.source, layer.source_frames[:, low] + (frame - low) * slope
        )
        speed_m_s = np.linalg.norm(velocity_m_s, axis=-1).mean(axis=1) * slope
        lifted_m = np.ptp(pose_m[:, _ANKLES, 1], axis=1)
        restlessness: AnyFloats = speed_m_s + 10.0 * lifted_m
        return restlessness


# The register. A new cost has one line here. Its place is that in sums, in tables and in plans.
#
# Their weights were chosen on dances to training songs, in five folds, since the paper gives no numbers.
# Those of completeness, velocity and accents were chosen by the phase of motion beats within the count.
BUILTIN_COSTS: tuple[type[Cost], ...] = (
    Genre, Completeness, Transition, Velocity, Rhythm, Accents, Bars, Phrasing, Energy, StepsCost, FrontCost,
    Pace, Variety, RepeatCost, Seed, StageCost, Stillness, FormCost, Signature, MotifTransition,
)  # fmt: skip
DEFAULT_WEIGHTS = {cost.name: cost.default_weight for cost in BUILTIN_COSTS}
COST_GROUP = Group("choreograph.costs", tuple(DEFAULT_WEIGHTS))
# Of the planner motion-graph, which leaves out the other built-in costs.
_OF_WALK = (Transition, Seed, StageCost, Stillness, FormCost, Signature, MotifTransition)


def built_in(context: CostContext) -> list[Cost]:
    """The built-in costs of a dance, in order."""
    made = (kind.for_dance(context) for kind in BUILTIN_COSTS)
    return [cost for cost in made if cost is not None]


def cost_kinds() -> tuple[type[Cost], ...]:
    """The classes of all built-in costs, then of those that other packages add."""
    return (*BUILTIN_COSTS, *(type(cost) for cost in installed_costs(installed_names(COST_GROUP))))


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
    weights = resolve_weights(config.weights, every)
    return tuple(WeightedCost(cost, weights[cost.name]) for cost in every)


def is_of_walk(cost: Cost) -> bool:
    """Whether the planner motion-graph uses a cost. It uses those of the user."""
    return type(cost) not in BUILTIN_COSTS or isinstance(cost, _OF_WALK)


def check_weights_used(planner: str, weights: Mapping[str, float]) -> None:
    """Raise `ParameterError` for the weight of a cost that the planner leaves out."""
    given = sorted({cost.name for cost in BUILTIN_COSTS if cost not in _OF_WALK} & set(weights))
    if planner == "motion-graph" and given:
        raise ParameterError(
            f"expected the planner exact or greedy with a weight of {given[0]!r}, got motion-graph, which "
            "uses only transition, stillness and your own costs"
        )
