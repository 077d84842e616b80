"""Plans a scene around the dance of its leader: what each dancer dances when, and where."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from choreograph.characters.character import GltfCharacter
from choreograph.choreography.scenes import (
    Relation,
    Scheduled,
    borders_s,
    dancer_parts,
    formation_places,
    pair_of,
    parse_schedule,
    values_at,
)
from choreograph.choreography.stage_paths import (
    LEAST_GAP_M,
    MARGIN_M,
    StageBody,
    StagePaths,
    formation_knots,
    least_gap_m,
    plan_paths,
)
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats
from choreograph.core.progress import ProgressReport
from choreograph.motion.motion import Motion
from choreograph.motion.retargeting import leg_length_m
from choreograph.motion.skeleton import Skeleton
from choreograph.music.song_features import Places, SongFeatures
from choreograph.plan.plan import Plan
from choreograph.plan.scenes import HEIGHTS, DancerPart, PlannedDancer, ScenePlan
from choreograph.render.scene import DancedParts, of_height, on_stage

_USUAL_FLESH_M = 0.125  # of the mannequin, around its bones
_USUAL_GIRTH = 1.25  # a body up to this is as wide as the mannequin
_HEIGHTS = (1.0, 0.96, 1.04, 0.98, 1.02, 0.94)  # of the bodies of pairs, from the leader's on
_HIDDEN_BARS = 2
_MOST_TRIES = 6  # to keep the finished bodies apart, whose feet may stay behind
_USUAL_BAR_S = 2.0  # of a song without bars
_PLACING = "placing the dancers"


def dancer_names(n: int) -> tuple[str, ...]:
    """The names of dancers that have no others."""
    return tuple(f"dancer {number + 1}" for number in range(n))


@dataclass(frozen=True, eq=False)
class SceneRequest:
    """The dancers that are asked for, with their formations and relations by part of the song."""

    names: tuple[str, ...]
    formations: tuple[Scheduled[str], ...]
    places: dict[str, tuple[Floats, bool]]  # (N, 2) of each formation, and whether they are in metres
    relations: tuple[Scheduled[Relation], ...]

    @classmethod
    def of(cls, names: Sequence[str], formation: Sequence[str], relation: Sequence[str]) -> SceneRequest:
        """Read the texts `VALUE` or `WHEN=VALUE` of both. Raises as `choreograph.scene`."""
        formations = parse_schedule("formation", formation, "v")
        relations = [
            Scheduled(entry.when, Relation.parse(entry.value))
            for entry in parse_schedule("relation", relation, "unison")
        ]
        places = {entry.value: formation_places(entry.value, len(names)) for entry in formations}
        return cls(tuple(names), tuple(formations), places, tuple(relations))

    @property
    def is_free(self) -> bool:
        """Whether dancers have dances of their own in some part of the song."""
        return any(entry.value.kind == "free" for entry in self.relations)

    @property
    def n_dances(self) -> int:
        """How many dances are made: one for each dancer if they are free, else that of the leader."""
        return len(self.names) if self.is_free else 1


@dataclass(frozen=True)
class BodySize:
    """How large a dancer is, relative to the mannequin of the repertoire."""

    height: float
    girth: float = 1.0  # how far its skin is from its bones


@dataclass(frozen=True, eq=False)
class PlannedScene:
    """A plan, and what it looks like."""

    plan: ScenePlan
    motions: tuple[Motion, ...]  # of the dancers, as `render_scene` makes them
    notes: tuple[str, ...]  # one line each


def plan_scene(
    request: SceneRequest,
    dances: Sequence[tuple[Motion, Plan]],
    features: SongFeatures,
    sizes: Sequence[BodySize],
    report: ProgressReport | None = None,
) -> PlannedScene:
    """Plan a scene around `n_dances` dances, the leader's first, with the sizes (N,) of the dancers.

    Raises `ParameterError` for a part of the song that the song does not have.
    """
    leader, names = dances[0][1], request.names
    plans = tuple(plan for _, plan in dances)
    if len(names) == 1:
        parts = (DancerPart(0.0, leader.duration_s, 0),)
        motion = dances[0][0]
        at_m = motion.root_pos_m[0]
        alone = PlannedDancer(names[0], 1.0, parts, (0.0,), (at_m[0],), (at_m[2],))
        return PlannedScene(ScenePlan(plans, (alone,)), (motion,), ())
    found, end_s = Places.of_song(features), leader.duration_s
    starts_s = borders_s(features, (request.formations, request.relations), found)
    related = values_at("relation", request.relations, starts_s, found, end_s)
    formed = values_at("formation", request.formations, starts_s, found, end_s)
    knots = formation_knots(starts_s, formed, request.places, leader.music_beats_s, end_s)
    all_parts = [
        dancer_parts(
            index, len(names), related, [*starts_s, end_s], leader.music_beats_s, leader.opening_s
        )
        for index in range(len(names))
    ]  # fmt: skip
    bodies = _bodies(all_parts, sizes, dances, report)
    bars_s = np.diff(features.counts.downbeat_times_s)
    bar_s = float(np.median(bars_s)) if len(bars_s) else _USUAL_BAR_S
    symmetric = all(one.kind == "mirror" for one in related)
    times_s = tuple(knot.time_s for knot in knots)
    margin_m = MARGIN_M
    for tried in range(_MOST_TRIES):
        if report is not None:
            report(_PLACING, tried, _MOST_TRIES)
        paths = plan_paths(
            bodies, knots, symmetric=symmetric, hidden_s=_HIDDEN_BARS * bar_s, margin_m=margin_m
        )
        dancers = tuple(
            PlannedDancer(
                name, sizes[index].height, all_parts[index], times_s,
                tuple(paths.places_m[:, index, 0].tolist()), tuple(paths.places_m[:, index, 1].tolist()),
            )
            for index, name in enumerate(names)
        )  # fmt: skip
        made = [
            on_stage(DancedParts(body.motion, body.contacts), replace(dancer, height=1.0))
            for body, dancer in zip(bodies, dancers, strict=True)
        ]
        gap_m = least_gap_m(made, [size.girth for size in sizes])
        if gap_m >= LEAST_GAP_M:
            break
        margin_m += LEAST_GAP_M - gap_m + 0.01
    return PlannedScene(ScenePlan(plans, dancers), tuple(made), _notes(paths, gap_m))


def sizes_of(n: int, characters: Sequence[GltfCharacter], skeleton: Skeleton) -> list[BodySize]:
    """The sizes of the bodies, with heights relative to the skeleton. Those of characters have their steps.

    A character whose skin is more than 1.25 times as far from its bones as that of the mannequin, because it
    is large or wide, is as much wider where dancers are kept apart. All others are as wide as the mannequin.

    Raises `ParameterError` for a character that is far larger or smaller.
    """
    if not characters:
        return [BodySize(_HEIGHTS[pair_of(index, n) % len(_HEIGHTS)]) for index in range(n)]
    sizes = [character.leg_m / leg_length_m(skeleton) for character in characters]
    for character, size in zip(characters, sizes, strict=True):
        if not HEIGHTS[0] <= size <= HEIGHTS[1]:
            raise ParameterError(
                f"{character.document.name}: expected a character of {HEIGHTS[0]:g} to {HEIGHTS[1]:g} times "
                f"the size of the takes, got {size:.2f}: is it in centimetres?"
            )
    girths = [character.flesh_m / _USUAL_FLESH_M for character in characters]
    bodies = [
        BodySize(round(size, 4), round(girth, 2) if girth > _USUAL_GIRTH else 1.0)
        for size, girth in zip(sizes, girths, strict=True)
    ]
    return [bodies[index % len(bodies)] for index in range(n)]


def _notes(paths: StagePaths, gap_m: float) -> tuple[str, ...]:
    notes = []
    if paths.widened > 1.0:
        wider = f"{paths.widened:.2f} times as wide"
        notes.append(f"the places were made {wider}, so that bodies stay {LEAST_GAP_M:g} m apart")
    if gap_m < LEAST_GAP_M:
        notes.append(
            f"bodies come as near as {max(gap_m, 0.0):.2f} m, not {LEAST_GAP_M:g} m: ask for fewer dancers, "
            "fewer changes of formation, or wider places"
        )
    return tuple(notes)


def _bodies(
    all_parts: Sequence[tuple[DancerPart, ...]],
    sizes: Sequence[BodySize],
    dances: Sequence[tuple[Motion, Plan]],
    report: ProgressReport | None,
) -> list[StageBody]:
    """The dancers before they go anywhere. Those with the same parts and size are one object."""
    motions, known = [motion for motion, _ in dances], {}
    made: dict[tuple[tuple[DancerPart, ...], BodySize], StageBody] = {}
    for index, (parts, size) in enumerate(zip(all_parts, sizes, strict=True)):
        if report is not None:
            report("dancing together", index, len(all_parts))
        if parts not in known:
            known[parts] = DancedParts.of(parts, motions, dances[0][1])
        if (parts, size) not in made:
            one = known[parts]
            made[parts, size] = StageBody(of_height(one.motion, size.height), one.contacts, size.girth)
    return [made[pair] for pair in zip(all_parts, sizes, strict=True)]
