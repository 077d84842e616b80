"""Makes a scene: several dancers to one song, planned together on one stage."""

from __future__ import annotations

import reprlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from choreograph.characters.gltf_character import GltfCharacter, read_character
from choreograph.choreography.formations import formation_places
from choreograph.choreography.relations import Relation, dancer_parts, pair_of
from choreograph.choreography.schedule import Scheduled, borders_s, parse_schedule, value_at
from choreograph.choreography.song_analysis import analyse_song
from choreograph.choreography.stage_paths import (
    LEAST_GAP_M,
    MARGIN_M,
    StageBody,
    StagePaths,
    formation_knots,
    least_gap_m,
    plan_paths,
)
from choreograph.core.arguments import (
    as_list,
    as_texts,
    check_function,
    check_kind,
    check_text,
    is_whole,
    unexpected,
)
from choreograph.core.errors import ParameterError
from choreograph.core.files import as_path
from choreograph.core.numerics import default_numerics
from choreograph.core.progress import ProgressReport, counted
from choreograph.library.repertoire import Repertoire
from choreograph.motion.cameras import CameraMode
from choreograph.motion.motion import Motion
from choreograph.motion.retargeting import leg_length_m
from choreograph.motion.skeleton import Skeleton
from choreograph.music.places import Places
from choreograph.music.song import Song
from choreograph.music.song_features import SongFeatures
from choreograph.pipeline.dancing import DEFAULTS, Dance
from choreograph.pipeline.session import Session
from choreograph.render.rendering import render
from choreograph.render.scene import DancedParts, of_height, on_stage, render_scene
from choreograph.scene_plan import HEIGHTS, MOST_DANCERS, DancerPart, PlannedDancer, ScenePlan
from choreograph.settings import DanceConfig, DanceSettings, as_config

_HEIGHTS = (1.0, 0.96, 1.04, 0.98, 1.02, 0.94)  # of the bodies of pairs, from the leader's on
_HIDDEN_BARS = 2
_MOST_TRIES = 6  # to keep the finished bodies apart, whose feet may stay behind
_USUAL_BAR_S = 2.0  # of a song without bars
_STEPS = 100


@dataclass(frozen=True, eq=False)
class Dancer:
    """One body of a scene, with its dance.

    Raises `ParameterError` if a field is of another type.

    Examples
    --------
    >>> dancer = cg.scene(cg.example_songs()["house"], dancers=2, duration_s=4).dancers[1]
    >>> dancer.name, dancer.dance.motion
    ('dancer 2', <Motion: 240 frames at 60 fps (4.0 s), 24 joints>)
    """

    name: str  # unique in the scene
    dance: Dance  # the motion on the stage, and the plan of the dance that it is made from
    character: GltfCharacter | None = None  # that dances instead of the mannequin

    def __post_init__(self) -> None:
        check_text("the name of a dancer", self.name)
        check_kind("the dance of a dancer", self.dance, Dance)
        if self.character is not None:
            check_kind("the character of a dancer", self.character, GltfCharacter)


@dataclass(frozen=True, eq=False)
class Scene:
    """Several dancers on one stage.

    Raises `ParameterError` if a field is of another type.

    Examples
    --------
    >>> scene = cg.scene(cg.example_songs()["house"], dancers=3, formation="v", duration_s=8)
    >>> scene
    <Scene: 3 dancers to 'house', 8.0 s>
    >>> [dancer.name for dancer in scene.dancers]
    ['dancer 1', 'dancer 2', 'dancer 3']
    >>> scene.save("house.html")
    """

    dancers: tuple[Dancer, ...]  # the leader first
    plan: ScenePlan  # that is rendered again by `render_scene`
    notes: tuple[str, ...] = ()  # on what is unusual, one line each
    song_path: Path | None = None  # for the sound of pages and videos

    def __post_init__(self) -> None:
        object.__setattr__(self, "dancers", as_list("dancers of a scene", self.dancers, "Dancer", Dancer))
        check_kind("the plan of a scene", self.plan, ScenePlan)
        object.__setattr__(self, "notes", as_texts("notes of a scene", self.notes))
        if self.song_path is not None:
            object.__setattr__(self, "song_path", as_path("the song of a scene", self.song_path))
        if len(self.dancers) != len(self.plan.dancers):
            raise unexpected(f"the {counted(len(self.plan.dancers), 'dancer')} of the plan", self.dancers)

    @property
    def motions(self) -> tuple[Motion, ...]:
        """The motions of the dancers, of one length and rate."""
        return tuple(dancer.dance.motion for dancer in self.dancers)

    @default_numerics()
    def save(
        self,
        path: str | Path,
        *,
        click: bool = False,
        camera: CameraMode | None = None,
        report: ProgressReport | None = None,
    ) -> None:
        """Write the scene to a file. The suffix selects the format.

        .glb, .fbx, .usda and .usdc hold all bodies, .html is a page with all dancers, .mp4 a video, .png
        pictures on the beats, and .json the plan. Formats of one body, such as .bvh and .npz, get a file for
        each dancer, NAME-1.bvh and so on.

        Parameters
        ----------
        path : the file to write
        click : mix a click on every count into the sound of a video
        camera : "front", "follow" or "cuts", which changes at phrases, in a page, video, GLB or USD file. It
            shows all dancers, but for close shots of one of them
        report : called with the name of the stage, the work done so far, and all the work

        Raises `ParameterError` for another suffix, a folder that does not exist, or a character or camera
        that the format cannot hold. Raises `FormatError` if the song cannot be read.
        """
        from choreograph.pipeline.scene_saving import save_scene

        path = as_path("a file to write", path)
        check_kind("click", click, bool)
        check_function("report", report)
        save_scene(self, path, with_clicks=click, camera=camera, report=report)

    def __repr__(self) -> str:
        song = reprlib.repr(self.plan.dances[0].song)
        return f"<Scene: {counted(len(self.dancers), 'dancer')} to {song}, {self.plan.duration_s:.1f} s>"


@default_numerics()
def scene(
    song: str | Path | Song,
    repertoire: str | Path | Repertoire | None = None,
    *,
    dancers: int | Sequence[str] = 4,
    formation: str | Sequence[str] = "v",
    relation: str | Sequence[str] = "unison",
    genre: str | Sequence[str] | None = None,
    characters: Sequence[str | Path | GltfCharacter] = (),
    start_s: float | None = None,
    duration_s: float | None = None,
    config: DanceConfig = DEFAULTS,
    report: ProgressReport | None = None,
    **settings: Unpack[DanceSettings],
) -> Scene:
    """Make a scene of several dancers for a song.

    The dance of the leader is made as by `dance`. The others dance it in a relation, and all go to the places
    of the formation at the borders of phrases. No two bodies come nearer than 0.6 m, or a note says how near.

    Parameters
    ----------
    song, repertoire, start_s, duration_s, config, report, settings : as of `dance`
    dancers : the number of dancers, 1 to 32, or their names
    formation : line, v, circle, pairs, or a .json file with a place [x, z] in metres for each dancer. In a
        list, "WHEN=FORMATION" is for a part of the song, such as "chorus=line" or "bar 9-bar 17=circle"
    relation : unison, mirror, canon:N with N counts from pair to pair, call-and-response, or free, in which
        each dancer has a dance with a seed of its own. In a list, "WHEN=RELATION" is for a part of the song
    genre : the genre to dance, or one for each dancer in free relation. They take turns if there are fewer
    characters : files, or results of `read_character`. Dancers take turns if there are fewer. They keep their
        own sizes, and their steps are as long

    Raises as `dance`, and `ParameterError` for another formation or relation, or a part that the song does
    not have.

    Examples
    --------
    >>> scene = cg.scene(cg.example_songs()["house"], dancers=2, relation="mirror", duration_s=8)
    >>> scene.motions[1]
    <Motion: 480 frames at 60 fps (8.0 s), 24 joints>
    """
    names = _names(dancers)
    formations = parse_schedule("formation", _texts("formation", formation), "v")
    relations = [
        Scheduled(entry.when, Relation.parse(entry.value))
        for entry in parse_schedule("relation", _texts("relation", relation), "unison")
    ]
    checked = {entry.value: formation_places(entry.value, len(names)) for entry in formations}
    genres = _genres(genre, relations)
    bodies = as_list("characters", characters, "paths or characters", str | Path | GltfCharacter)
    known = [one if isinstance(one, GltfCharacter) else read_character(one) for one in bodies]
    check_function("report", report)
    config = as_config(config)
    session = Session(song, repertoire, start_s=start_s, duration_s=duration_s)

    def danced(index: int) -> Dance:
        seed = int(settings.get("seed", config.seed)) + index  # a wrong type is refused by `dance` before
        own: Any = {**settings, "seed": seed} if index else settings
        return session.dance(
            genre=genres[index % len(genres)] if genres else None, config=config, report=report, **own
        )

    dances = [danced(0)]
    if any(entry.value.kind == "free" for entry in relations):
        dances += [danced(index) for index in range(1, len(names))]
    beats = settings.get("beats", config.beats)
    features, _ = analyse_song(
        session.song, session.repertoire, beats=beats, genre=genres[0] if genres else None,
        keep=settings.get("cache", config.cache), memory=session._memory,
    )  # fmt: skip
    heights = _heights(len(names), known, dances[0].motion.skeleton)
    plan, notes = _planned(dances, features, names, heights, formations, checked, relations)
    motions = render_scene(plan, [one.motion for one in dances])
    notes = tuple(dict.fromkeys((*(note for one in dances for note in one.notes), *notes)))
    return _scene_of(plan, motions, known, notes, session.song.path)


@default_numerics()
def render_scene_plan(
    plan: ScenePlan,
    repertoire: Repertoire,
    *,
    characters: Sequence[GltfCharacter] = (),
    song_path: Path | None = None,
    report: ProgressReport | None = None,
) -> Scene:
    """The scene of a plan, exactly as planned. Raises as `render` for each of its dances.

    Examples
    --------
    >>> repertoire = cg.starter_repertoire()
    >>> scene = cg.scene(cg.example_songs()["house"], repertoire, dancers=2, duration_s=4)
    >>> again = cg.render_scene_plan(scene.plan, repertoire)
    >>> bool((again.motions[1].root_pos_m == scene.motions[1].root_pos_m).all())
    True
    """
    check_kind("the plan of a scene", plan, ScenePlan)
    check_function("report", report)
    characters = as_list("characters", characters, "GltfCharacter", GltfCharacter)
    ScenePlan.from_json(plan.to_json())  # as valid as that of a file
    motions = [render(one, repertoire) for one in plan.dances]
    return _scene_of(plan, render_scene(plan, motions), characters, (), song_path)


def _scene_of(
    plan: ScenePlan,
    motions: Sequence[Motion],
    characters: Sequence[GltfCharacter],
    notes: tuple[str, ...],
    song_path: Path | None,
) -> Scene:
    dancers = tuple(
        Dancer(
            planned.name,
            Dance(motion, plan.dances[planned.parts[0].dance], song_path=song_path),
            characters[index % len(characters)] if characters else None,
        )
        for index, (planned, motion) in enumerate(zip(plan.dancers, motions, strict=True))
    )
    return Scene(dancers, plan, notes, song_path)


def _names(dancers: object) -> tuple[str, ...]:
    if is_whole(dancers):
        if not 1 <= int(dancers) <= MOST_DANCERS:
            raise unexpected(f"1 to {MOST_DANCERS} dancers", dancers)
        return tuple(f"dancer {number + 1}" for number in range(int(dancers)))
    names = as_texts("dancers, or a number of them,", dancers)
    if not 1 <= len(names) <= MOST_DANCERS or len(set(names)) < len(names) or not all(names):
        raise unexpected(f"1 to {MOST_DANCERS} dancers of different names", names)
    return names


def _texts(what: str, given: object) -> tuple[str, ...]:
    return (given,) if isinstance(given, str) else as_texts(what, given)


def _genres(genre: object, relations: Sequence[Scheduled[Relation]]) -> tuple[str, ...]:
    genres = () if genre is None else _texts("genre", genre)
    if len(genres) > 1 and not any(entry.value.kind == "free" for entry in relations):
        raise ParameterError(
            f"expected one genre unless dancers are free, got {len(genres)}: add the relation free"
        )
    return genres


def _heights(n: int, characters: Sequence[GltfCharacter], skeleton: Skeleton) -> list[float]:
    """The heights of the bodies, relative to the skeleton: those of characters, whose steps then fit."""
    if not characters:
        return [_HEIGHTS[pair_of(index, n) % len(_HEIGHTS)] for index in range(n)]
    sizes = [character.leg_m / leg_length_m(skeleton) for character in characters]
    for character, size in zip(characters, sizes, strict=True):
        if not HEIGHTS[0] <= size <= HEIGHTS[1]:
            raise ParameterError(
                f"{character.document.name}: expected a character of {HEIGHTS[0]:g} to {HEIGHTS[1]:g} times "
                f"the size of the takes, got {size:.2f}: is it in centimetres?"
            )
    return [round(sizes[index % len(sizes)], 4) for index in range(n)]


def _planned(
    dances: Sequence[Dance],
    features: SongFeatures,
    names: Sequence[str],
    heights: Sequence[float],
    formations: Sequence[Scheduled[str]],
    places: dict[str, tuple[np.ndarray, bool]],
    relations: Sequence[Scheduled[Relation]],
) -> tuple[ScenePlan, tuple[str, ...]]:
    """The plan of a scene, and notes on it."""
    leader, n = dances[0].plan, len(names)
    plans = tuple(one.plan for one in dances)
    if n == 1:
        parts = (DancerPart(0.0, leader.duration_s, 0),)
        at_m = dances[0].motion.root_pos_m[0]
        return ScenePlan(plans, (PlannedDancer(names[0], 1.0, parts, (0.0,), (at_m[0],), (at_m[2],)),)), ()
    found, end_s = Places.of_song(features), leader.duration_s
    starts_s = borders_s(features, (formations, relations), found)
    bounds_s = [*starts_s, end_s]
    middles_s = [start_s + 0.01 for start_s in starts_s]
    related = [value_at(relations, time_s, found, end_s) for time_s in middles_s]
    formed = [value_at(formations, time_s, found, end_s) for time_s in middles_s]
    knots = formation_knots(starts_s, formed, places, leader.music_beats_s, end_s)
    all_parts = [
        dancer_parts(index, n, related, bounds_s, leader.music_beats_s, leader.opening_s)
        for index in range(n)
    ]
    bodies = _bodies(all_parts, heights, dances)
    bars_s = np.diff(features.counts.downbeat_times_s)
    bar_s = float(np.median(bars_s)) if len(bars_s) else _USUAL_BAR_S
    symmetric = all(one.kind == "mirror" for one in related)
    times_s = tuple(knot.time_s for knot in knots)
    margin_m = MARGIN_M
    for _ in range(_MOST_TRIES):
        paths = plan_paths(
            bodies, knots, symmetric=symmetric, hidden_s=_HIDDEN_BARS * bar_s, margin_m=margin_m
        )
        dancers = tuple(
            PlannedDancer(
                name, heights[index], all_parts[index], times_s,
                tuple(paths.places_m[:, index, 0].tolist()), tuple(paths.places_m[:, index, 1].tolist()),
            )
            for index, name in enumerate(names)
        )  # fmt: skip
        made = [
            on_stage(DancedParts(body.motion, body.contacts), replace(dancer, height=1.0))
            for body, dancer in zip(bodies, dancers, strict=True)
        ]
        gap_m = least_gap_m(made)
        if gap_m >= LEAST_GAP_M:
            break
        margin_m += LEAST_GAP_M - gap_m + 0.01
    return ScenePlan(plans, dancers), _notes(paths, gap_m)


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
    all_parts: Sequence[tuple[DancerPart, ...]], heights: Sequence[float], dances: Sequence[Dance]
) -> list[StageBody]:
    """The dancers before they go anywhere. Those with the same parts and height are one object."""
    motions, known = [one.motion for one in dances], {}
    made: dict[tuple[tuple[DancerPart, ...], float], StageBody] = {}
    for parts, height in zip(all_parts, heights, strict=True):
        if parts not in known:
            known[parts] = DancedParts.of(parts, motions, dances[0].plan)
        if (parts, height) not in made:
            one = known[parts]
            made[parts, height] = StageBody(of_height(one.motion, height), one.contacts)
    return [made[pair] for pair in zip(all_parts, heights, strict=True)]
