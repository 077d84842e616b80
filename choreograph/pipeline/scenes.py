"""Makes a scene: several dancers to one song, planned together on one stage. Writes it to files."""

from __future__ import annotations

import reprlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from choreograph.characters.character import GltfCharacter, read_character
from choreograph.choreography.constraints import parse_ban
from choreograph.choreography.song_analysis import analyse_song
from choreograph.core.arguments import (
    as_list,
    as_texts,
    check_function,
    check_kind,
    check_text,
    is_whole,
    unexpected,
)
from choreograph.core.counts import Figure, counts_later_s
from choreograph.core.errors import ParameterError
from choreograph.core.files import as_path, atomic_path, check_apart
from choreograph.core.numerics import default_numerics
from choreograph.core.progress import ProgressReport, counted
from choreograph.formats import formats_using, output_formats
from choreograph.formats.glb import as_dance, scene_document, with_camera
from choreograph.formats.usd import export_stage, scene_stage
from choreograph.library.repertoire import Repertoire
from choreograph.motion.cameras import CameraMode, CameraPath, plan_cameras
from choreograph.motion.motion import Motion
from choreograph.music.song import Song
from choreograph.pipeline.dancing import DEFAULTS, SHORTEST_FIGURE_S, Dance, dance, danced_figures
from choreograph.pipeline.saving import (
    SavedParts,
    check_options,
    check_outputs,
    format_of,
    save_dance,
    save_document,
)
from choreograph.pipeline.scene_planning import SceneRequest, dancer_names, plan_scene, sizes_of
from choreograph.pipeline.session import Session
from choreograph.plan.joins import take_motions
from choreograph.plan.plan import Plan
from choreograph.plan.scenes import MOST_DANCERS, DancerPart, PlannedRequest, ScenePlan
from choreograph.render.rendering import render, with_edit
from choreograph.render.scene import render_scene
from choreograph.settings import DanceConfig, DanceSettings, as_config, as_weights


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

    name: str
    """Its name, unique in the scene."""

    dance: Dance
    """The motion on the stage, and the plan of the dance that it is made from."""

    character: GltfCharacter | None = None
    """The character that dances instead of the mannequin, or None."""

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

    dancers: tuple[Dancer, ...]
    """The dancers, the leader first."""

    plan: ScenePlan
    """The plan, which `render_scene_plan` renders again."""

    notes: tuple[str, ...] = ()
    """What was unusual, one line each."""

    song_path: Path | None = None
    """File of the song, for the sound of pages and videos, or None."""

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
    A character is taken to be as wide as the mannequin, and wider if its skin is more than 1.25 times as far
    from its bones.

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
    request = SceneRequest.of(_names(dancers), _texts("formation", formation), _texts("relation", relation))
    genres = _genres(genre, request)
    bodies = as_list("characters", characters, "paths or characters", str | Path | GltfCharacter)
    if len(bodies) > len(request.names):
        raise _too_many("character", len(bodies), len(request.names))
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

    dances = [danced(index) for index in range(request.n_dances)]
    beats = settings.get("beats", config.beats)
    features, _ = analyse_song(
        session.song, session.repertoire, beats=beats, genre=genres[0] if genres else None,
        keep=settings.get("cache", config.cache), memory=session._memory,
    )  # fmt: skip
    sizes = sizes_of(len(request.names), known, dances[0].motion.skeleton)
    made = plan_scene(request, [(one.motion, one.plan) for one in dances], features, sizes, report)
    given: dict[str, Any] = dict(settings)
    if "weights" in given:
        given["weights"] = {**config.weights, **as_weights(given["weights"])}
    used = replace(config, **given)
    asked = [(genres[index % len(genres)] if genres else None, (), used) for index in range(len(dances))]
    plan = replace(made.plan, requests=planned_requests(made.plan.dances, asked))
    notes = tuple(dict.fromkeys((*(note for one in dances for note in one.notes), *made.notes)))
    figures = [one.figures for one in dances]
    return scene_of(plan, made.motions, known, notes, session.song.path, figures)


def planned_requests(
    plans: Sequence[Plan], asked: Sequence[tuple[str | None, Sequence[str], DanceConfig]]
) -> tuple[PlannedRequest, ...]:
    """How to make those dances again that networks generate, from genre, bans and settings of each dance.

    A dance in the style of a song without a file has no request, and cannot be made again.
    """
    return tuple(
        PlannedRequest.of(index, genre, bans, replace(config, engine=plan.engine, seed=plan.seed))
        for index, (plan, (genre, bans, config)) in enumerate(zip(plans, asked, strict=True))
        if not replace(plan, edits=()).from_takes
        and not (isinstance(config.style_song, Song) and config.style_song.path is None)
    )


@default_numerics()
def render_scene_plan(
    plan: ScenePlan,
    repertoire: Repertoire,
    *,
    characters: Sequence[GltfCharacter] = (),
    song_path: Path | None = None,
    report: ProgressReport | None = None,
) -> Scene:
    """The scene of a plan, exactly as planned.

    Dances of takes are rendered. Those that a network has generated are made again, to the song at
    `song_path`.

    Raises as `render` for each of its dances, as `dance` for those that are made again, and `ParameterError`
    if they need a song and none is given, or another song or repertoire than that of the plan.

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
    requests = {request.dance: request for request in plan.requests}
    motions = [
        _made_again(one, requests[index], repertoire, song_path, report)
        if index in requests
        else render(one, repertoire)
        for index, one in enumerate(plan.dances)
    ]
    figures = [danced_figures(one, repertoire) for one in plan.dances]
    return scene_of(plan, render_scene(plan, motions), characters, (), song_path, figures)


def _made_again(
    plan: Plan,
    request: PlannedRequest,
    repertoire: Repertoire,
    song_path: Path | None,
    report: ProgressReport | None,
) -> Motion:
    """The motion of a dance of a network, with the edits of its plan. Raises as `render_scene_plan`."""
    if song_path is None:
        raise ParameterError(
            f"expected the song {plan.song!r} beside the plan, to which the {plan.engine} engine makes its "
            "dances again, got none"
        )
    config = request.config()
    made = dance(
        song_path, repertoire, genre=request.genre, bans=[parse_ban(ban) for ban in request.bans],
        engine=config.engine, config=config, start_s=plan.start_s, duration_s=plan.duration_s, report=report,
    )  # fmt: skip
    if _motifs(made.plan) != _motifs(plan):
        raise ParameterError(
            f"expected the song {plan.song!r} and the repertoire {plan.repertoire} of the plan, got "
            f"{song_path} and {repertoire.path.name}, to which another dance is made"
        )
    motion, read_motion = made.motion, take_motions(repertoire)
    for edit in plan.edits:
        motion = with_edit(motion, plan, edit, read_motion)
    return motion


def _motifs(plan: Plan) -> list[tuple[int, int, str]]:
    """What a dance of words is told by: the end of each word in ms, its motif and take."""
    return [(round(1000 * word.end_s), word.motif, word.take) for word in plan.words]


def scene_of(
    plan: ScenePlan,
    motions: Sequence[Motion],
    characters: Sequence[GltfCharacter],
    notes: tuple[str, ...],
    song_path: Path | None,
    figures: Sequence[Sequence[Figure]],
) -> Scene:
    """The scene of a plan, with the motions of its dancers, who have these characters in turn.

    `figures` are those of each dance of the plan.
    """
    leader = plan.dances[0]
    dancers = tuple(
        Dancer(
            planned.name,
            Dance(
                motion,
                plan.dances[planned.parts[0].dance],
                song_path=song_path,
                figures=figures_of_parts(planned.parts, figures, leader),
            ),
            characters[index % len(characters)] if characters else None,
        )
        for index, (planned, motion) in enumerate(zip(plan.dancers, motions, strict=True))
    )
    return Scene(dancers, plan, notes, song_path)


def figures_of_parts(
    parts: Sequence[DancerPart], of_dances: Sequence[Sequence[Figure]], plan: Plan
) -> tuple[Figure, ...]:
    """The figures that a dancer of a scene dances, in order, from those of each of its dances.

    Where a pose is held, the figure before goes on. `plan` is that of the leader's dance, with the counts.
    """
    found: list[Figure] = []
    for part in parts:
        if part.held:
            if found and found[-1].end_s >= part.start_s - SHORTEST_FIGURE_S:
                found[-1] = replace(found[-1], end_s=part.end_s)
            continue
        for figure in of_dances[part.dance]:
            later_s = np.array([figure.start_s, figure.end_s])
            if part.delay_counts:
                later_s = counts_later_s(plan.music_beats_s, later_s, part.delay_counts)
            start_s, end_s = max(float(later_s[0]), part.start_s), min(float(later_s[1]), part.end_s)
            if end_s > start_s:
                found.append(replace(figure, start_s=start_s, end_s=end_s))
    return tuple(found)


def _names(dancers: object) -> tuple[str, ...]:
    if is_whole(dancers):
        if not 1 <= int(dancers) <= MOST_DANCERS:
            raise unexpected(f"1 to {MOST_DANCERS} dancers", dancers)
        return dancer_names(int(dancers))
    names = as_texts("dancers, or a number of them,", dancers)
    if not 1 <= len(names) <= MOST_DANCERS or len(set(names)) < len(names) or not all(names):
        raise unexpected(f"1 to {MOST_DANCERS} dancers of different names", names)
    return names


def _texts(what: str, given: object) -> tuple[str, ...]:
    return (given,) if isinstance(given, str) else as_texts(what, given)


def _too_many(what: str, given: int, n_dancers: int) -> ParameterError:
    return ParameterError(
        f"expected a {what} for each of {counted(n_dancers, 'dancer')} at most, got {given}: leave out "
        "others, or add dancers"
    )


def _genres(genre: object, request: SceneRequest) -> tuple[str, ...]:
    genres = () if genre is None else _texts("genre", genre)
    if len(genres) > 1 and not request.is_free:
        raise ParameterError(
            f"expected one genre unless dancers are free, got {len(genres)}: add the relation free"
        )
    if len(genres) > request.n_dances:
        raise _too_many("genre", len(genres), request.n_dances)
    return genres


# Scenes are written to files. The suffix of a name selects the format.


def scene_paths(path: str | Path, n_dancers: int, *, characters: bool = False) -> tuple[Path, ...]:
    """The files that a scene writes for a path: the path itself, or NAME-1.bvh and so on for each dancer."""
    path = Path(path)
    format = format_of(path)
    one_each = characters and format in formats_using("character", in_scenes=True)
    if n_dancers == 1 or (output_formats()[format].together and not one_each):
        return (path,)
    return tuple(path.with_name(f"{path.stem}-{number + 1}{path.suffix}") for number in range(n_dancers))


def check_scene_outputs(paths: Sequence[str | Path], n_dancers: int, *, characters: bool = False) -> None:
    """Raise `ParameterError` before any work if a format is unknown or a folder does not exist."""
    check_outputs(paths)
    check_apart([one for path in paths for one in scene_paths(path, n_dancers, characters=characters)], ())


def save_scene(
    scene: Scene,
    path: Path,
    *,
    with_clicks: bool = False,
    camera: CameraMode | None = None,
    report: ProgressReport | None = None,
) -> None:
    """Write a scene to `path` by its suffix. Raises as `Scene.save`."""
    n_dancers, suffix = len(scene.dancers), format_of(path)
    characters = any(dancer.character is not None for dancer in scene.dancers)
    check_scene_outputs([path], n_dancers, characters=characters)
    if camera is not None:
        check_text("camera", camera)
    check_options(path, {"camera": camera})
    plan = scene.plan.dances[0]
    filmed = None if camera is None else plan_cameras(scene.motions, camera, plan.phrase_borders_s)
    paths = scene_paths(path, n_dancers, characters=characters)
    check_apart(paths, [scene.song_path] if scene.song_path is not None else [])
    if suffix == "json":
        with atomic_path(path) as temporary:
            temporary.write_text(scene.plan.to_json(), encoding="utf-8")
    elif len(paths) == n_dancers:
        used = "character" in output_formats()[suffix].uses
        for dancer, own in zip(scene.dancers, paths, strict=True):
            parts = _parts(scene, dancer, with_clicks and suffix == "mp4", filmed)
            save_dance(own, replace(parts, character=dancer.character if used else None), report)
    elif suffix in ("glb", "fbx"):
        names = [dancer.name for dancer in scene.dancers]
        document = scene_document(scene.motions, names)
        save_document(path, as_dance(document if filmed is None else with_camera(document, filmed)))
    elif suffix in ("usda", "usdc"):
        names = [dancer.name for dancer in scene.dancers]
        with atomic_path(path) as temporary:
            export_stage(scene_stage(scene.motions, names, filmed), temporary)
    else:
        parts = _parts(scene, scene.dancers[0], with_clicks, filmed)
        save_dance(path, replace(parts, others=scene.motions[1:]), report)


def _parts(scene: Scene, dancer: Dancer, with_clicks: bool, filmed: CameraPath | None) -> SavedParts:
    """What is saved of one dancer."""
    dance = dancer.dance
    return SavedParts(
        dance.motion, dance.plan, lambda: dance.motion_beats_s, scene.song_path, with_clicks, camera=filmed,
        figures=dance.figures,
    )  # fmt: skip
