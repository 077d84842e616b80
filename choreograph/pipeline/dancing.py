"""Makes a dance for a song: analyses the song, resolves constraints, plans with an engine, and renders."""

from __future__ import annotations

import reprlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray

from choreograph.characters.character import GltfCharacter, read_character
from choreograph.choreography.constraints import Ban, Constraints, Keep, MotifPin, Pin, make_constraints
from choreograph.choreography.enforcement import AvoidRepeating
from choreograph.choreography.engine import DanceRequest, Engine, check_settings, engine_for, engine_named
from choreograph.choreography.graph.cost import Cost
from choreograph.choreography.graph.costs import check_weights_used
from choreograph.choreography.material import choose_material, missing_from_plan
from choreograph.choreography.slots import resolve
from choreograph.choreography.song_analysis import analyse_song
from choreograph.core.arguments import as_list, as_texts, check_function, check_kind, unexpected
from choreograph.core.cache import NO_MEMORY, Memory
from choreograph.core.counts import Figure
from choreograph.core.errors import ParameterError
from choreograph.core.files import as_path, check_apart
from choreograph.core.kernel_cache import compiled_ahead
from choreograph.core.long_songs import memory_returned
from choreograph.core.numerics import default_numerics, one_thread
from choreograph.core.progress import ProgressReport, counted, substage
from choreograph.core.settings import changed
from choreograph.core.timebase import STORE_FPS
from choreograph.formats.bvh import BvhOptions
from choreograph.formats.writer import TargetName
from choreograph.library.repertoire import Repertoire, as_repertoire
from choreograph.motion.body import body_pos_m
from choreograph.motion.cameras import CameraMode, plan_cameras
from choreograph.motion.motion import Motion
from choreograph.motion.motion_beats import motion_beat_times_s
from choreograph.music.song import Song, as_song, check_span
from choreograph.pipeline.keeping import (
    ExistingDance,
    check_same_song,
    kept_parts,
    moved_pins,
    part_of,
    read_existing,
)
from choreograph.pipeline.planning import FirstPart, fill, plan_and_render
from choreograph.pipeline.saving import SavedParts, check_options, save_dance
from choreograph.plan.plan import Plan
from choreograph.render.assembly import off_stage
from choreograph.render.filled_gaps import LoopedMotion, looped
from choreograph.settings import DanceConfig, DanceSettings, as_config, as_weights

DEFAULTS = DanceConfig()
SHORTEST_FIGURE_S = 0.25  # parts of a figure that are shorter say little of it


@dataclass(frozen=True, eq=False)
class Dance:
    """A finished dance: the motion, the plan that explains it, and notes on what was unusual.

    Raises `ParameterError` if a field is of another type.

    Examples
    --------
    >>> dance = cg.dance(cg.example_songs()["house"], duration_s=8)
    >>> dance.motion
    <Motion: 480 frames at 60 fps (8.0 s), 24 joints>
    >>> dance.plan.engine
    'graph'
    >>> dance.save("dance.bvh")
    """

    motion: Motion
    """The rendered dance."""

    plan: Plan
    """The takes that are danced, with their times and costs."""

    notes: tuple[str, ...] = ()
    """What was unusual, one line each."""

    song_path: Path | None = None
    """File of the song, for the sound of pages and videos, which are silent without it."""

    unmet: tuple[str, ...] = ()
    """What was requested and is not danced, one line each. These lines are in the notes, too."""

    figures: tuple[Figure, ...] = ()
    """The figures that are danced, in seconds of the dance, which say what the hands do."""

    def __post_init__(self) -> None:
        check_kind("the motion of a dance", self.motion, Motion)
        check_kind("the plan of a dance", self.plan, Plan)
        if self.song_path is not None:
            object.__setattr__(self, "song_path", as_path("the song of a dance", self.song_path))
        object.__setattr__(self, "figures", as_list("figures of a dance", self.figures, "Figure", Figure))
        for name in ("notes", "unmet"):
            object.__setattr__(self, name, as_texts(f"{name} of a dance", getattr(self, name)))

    @cached_property
    @default_numerics()
    def motion_beats_s(self) -> NDArray[np.float64]:
        """Motion beats of the finished dance in seconds, (Q,)."""
        return motion_beat_times_s(body_pos_m(self.motion.resampled(STORE_FPS)), STORE_FPS)

    @cached_property
    @default_numerics()
    def loop(self) -> LoopedMotion:
        """The dance cut to whole bars, ending where it begins. Raises `ParameterError` below two bars."""
        return looped(self.motion, self.plan.danced_bars_s)

    @default_numerics()
    def save(
        self,
        path: str | Path,
        *,
        click: bool = False,
        character: str | Path | GltfCharacter | None = None,
        bvh: BvhOptions | None = None,
        loop: bool = False,
        camera: CameraMode | None = None,
        target: TargetName | None = None,
        report: ProgressReport | None = None,
    ) -> None:
        """Write the dance to a file. The suffix selects the format.

        .bvh and .npz hold the motion, .glb, .fbx, .usda and .usdc a body that moves, .vrma the motion of a
        VRM avatar, .vmd that of MikuMikuDance, .json the plan, .html a page, .mp4 a video, .png poses.

        Parameters
        ----------
        path : the file to write
        click : mix a click on every count into the sound of a video, higher on count 1
        character : of a .glb, .fbx or .html: a .glb, .gltf or .vrm file, or the result of `read_character`
        bvh : how a .bvh is written
        loop : write the `loop` of the dance to a motion file
        camera : "front", "follow" or "cuts", which changes at phrases, in a page, video, GLB or USD file
        target : the program that a .glb or .vmd is for, which decides names, rest pose, root motion and loop
        report : called with the name of the stage, the work done so far, and all the work

        Raises `ParameterError` for another suffix, an option that the format does not use, a folder that does
        not exist, a character whose bones cannot be found or that a page cannot show, or a loop without two
        bars. Raises `FormatError` if the song or the character cannot be read.
        """
        path = as_path("a file to write", path)
        check_kind("click", click, bool)
        check_kind("loop", loop, bool)
        check_function("report", report)
        if isinstance(character, str | Path):
            check_apart([path], [character])
            character = read_character(character)
        given = {"character": character, "bvh": bvh, "camera": camera, "target": target}
        kinds = (("a character", GltfCharacter), ("bvh", BvhOptions), ("camera", str), ("target", str))
        for (what, kind), value in zip(kinds, given.values(), strict=True):
            if not (value is None or isinstance(value, kind)):
                raise unexpected(f"{what} as {kind.__name__}", value)
        check_options(path, {**given, "click": click, "loop": loop})
        motion, from_s = (self.loop.motion, self.loop.start_s) if loop else (self.motion, 0.0)
        borders_s = [border - from_s for border in self.plan.phrase_borders_s if border > from_s]
        parts = SavedParts(
            motion, self.plan, lambda: self.motion_beats_s, self.song_path, click, character, bvh,
            camera=None if camera is None else plan_cameras([motion], camera, borders_s),
            target=target, loops=loop, figures=figures_from(self.figures, from_s), from_s=from_s,
        )  # fmt: skip
        save_dance(path, parts, report)

    def __repr__(self) -> str:
        plan, takes = self.plan, counted(len(self.plan.takes_s()), "take")
        return (
            f"<Dance to {reprlib.repr(plan.song)}: {plan.duration_s:.1f} s at {self.motion.fps:g} fps, "
            f"{plan.engine} engine, {takes}>"
        )

    def _repr_html_(self) -> str:
        """The page that plays the dance, for notebooks."""
        with TemporaryDirectory() as folder:
            page = Path(folder) / "dance.html"
            self.save(page)
            text = page.read_text(encoding="utf-8")
        return (
            f'<iframe srcdoc="{escape(text)}" style="width:100%;height:640px;border:0" '
            'allow="autoplay; fullscreen"></iframe>'
        )


class DanceArguments(DanceSettings, total=False):
    """The keywords of `dance`, for functions that pass them on."""

    genre: str | None
    signature: Sequence[float] | NDArray[np.floating[Any]] | None
    motifs: Sequence[int] | Sequence[MotifPin]
    pins: Sequence[Pin]
    bans: Sequence[Ban]
    keep: Sequence[Keep]
    existing: str | Path | Dance | None
    costs: Sequence[Cost]
    start_s: float | None
    duration_s: float | None
    config: DanceConfig
    report: ProgressReport | None


def dance(
    song: str | Path | Song,
    repertoire: str | Path | Repertoire | None = None,
    *,
    genre: str | None = None,
    signature: Sequence[float] | NDArray[np.floating[Any]] | None = None,
    motifs: Sequence[int] | Sequence[MotifPin] = (),
    pins: Sequence[Pin] = (),
    bans: Sequence[Ban] = (),
    keep: Sequence[Keep] = (),
    existing: str | Path | Dance | None = None,
    costs: Sequence[Cost] = (),
    start_s: float | None = None,
    duration_s: float | None = None,
    config: DanceConfig = DEFAULTS,
    report: ProgressReport | None = None,
    **settings: Unpack[DanceSettings],
) -> Dance:
    """Make a dance for a song.

    Parameters
    ----------
    song : path of any audio file, or a loaded `Song`
    repertoire : the takes to dance with, opened or as a path, by default the built-in ones
    genre : the genre to dance, by its own takes or motifs alone. By default, each part of the song has the
        genre that suits its style, tempo and metre
    signature : (K,) shares of the motifs that the dance should have, by takes that have them
    motifs : the motifs of the words of the dance, or motifs with their times. A whole sequence begins with
        the first word on the count on which takes dance it. It is danced by the mixer, unless another engine
        is given
    pins : each a `MotifPin` or a `TakePin`, in seconds of the dance
    bans : takes, genres and motifs that must not be danced
    keep : spans of the `existing` dance that are kept exactly. Gaps of 2 s or more are planned again
    existing : a dance to the same part of the song, as made by `dance` or as a .bvh, .npz or plan file
    costs : custom costs beside those of the engine, with the weight 1 unless given
    start_s, duration_s : the part of the song to dance to, by default that of the plan of the `existing`
        dance, or the whole song
    config : all settings in one object, such as one of `choreograph.pipeline.published.published_dance`
    report : called with the name of the stage, the work done so far, and all the work
    **settings : single settings, which replace those of `config`: any field of `DanceConfig`, such as
        `engine`, `seed`, `fps` and `beats`. `weights` adds to those of `config`

    Raises
    ------
    FormatError      the song cannot be read
    RepertoireError  the repertoire is damaged, or lacks clips, motifs or networks that are needed
    ParameterError   an argument has a wrong type or value, the engine does not use a setting, a name is
                     unknown, constraints contradict each other, or a cost returns unusable values
    NoPathError      the costs or constraints forbid every dance

    References
    ----------
    ChoreoGraph, section 3. Rhythm is a Dancer, sections 4 and 5.2.5. The page "What differs from the papers"
    of the documentation (docs/how-it-works/papers.md) lists part by part what is done differently.

    Examples
    --------
    >>> dance = cg.dance(cg.example_songs()["house"], duration_s=8, seed=1)
    >>> dance
    <Dance to 'house': 8.0 s at 60 fps, graph engine, ...>
    >>> dance.save("house.bvh")
    """
    return dance_with(
        NO_MEMORY, song, repertoire, genre=genre, signature=signature, motifs=motifs, pins=pins, bans=bans,
        keep=keep, existing=existing, costs=costs, start_s=start_s, duration_s=duration_s, config=config,
        report=report, **settings,
    )  # fmt: skip


@default_numerics()
def dance_with(
    memory: Memory,
    song: str | Path | Song,
    repertoire: str | Path | Repertoire | None = None,
    first: FirstPart | None = None,
    **arguments: Unpack[DanceArguments],
) -> Dance:
    """As `dance`, with a memory for this repertoire. A `first` part is shown once it is rendered."""
    given: dict[str, Any] = {**(dance.__kwdefaults__ or {}), **arguments}
    names = ("genre", "signature", "motifs", "pins", "bans")
    requested = make_constraints(**{name: given.pop(name) for name in names})
    report, start_s, duration_s = (given.pop(name) for name in ("report", "start_s", "duration_s"))
    costs = as_list("costs", given.pop("costs"), "Cost", Cost)
    keep = as_list("keep", given.pop("keep"), "Keep", Keep)
    existing = given.pop("existing")
    config = _configured(as_config(given.pop("config")), given, requested, costs)
    check_span(0.0 if start_s is None else start_s, duration_s)
    check_function("report", report)
    repertoire = as_repertoire(repertoire)
    known = _as_existing(existing, keep, repertoire)
    if known is not None and "fps" not in given:
        config = replace(config, fps=known.motion.fps)
    engine = engine_named(config.engine)
    engine.check(repertoire, config, requested, costs)
    loaded = part_of(song, start_s, duration_s, known.plan if known else None, keep=config.cache)
    style = None if config.style_song is None else as_song("a style song", config.style_song)
    kept = None if known is None else (known, keep)
    kernels = compiled_ahead("choreograph.music", type(engine).__module__.rpartition(".")[0])
    with kernels, memory_returned(loaded.duration_s):
        return _danced(
            engine, loaded, repertoire, config, requested, costs, style, kept, report, memory, first
        )


def _configured(
    config: DanceConfig, settings: Mapping[str, Any], requested: Constraints, costs: Sequence[Cost]
) -> DanceConfig:
    """`config` with the settings that were given and the engine that makes the dance.

    Raises `ParameterError` for an unknown name, a value out of range and anything that the engine does not
    use.
    """
    given: dict[str, Any] = dict(settings)
    if "weights" in given:
        weights = as_weights(given["weights"])
        check_weights_used(given.get("planner", config.planner), weights)
        given["weights"] = {**config.weights, **weights}
    config = changed(config, given, other_names=DanceArguments.__annotations__)
    if "engine" not in given:
        config = replace(config, engine=engine_for(config, requested))
    used = {*given, "costs"} if costs else set(given)
    check_settings(engine_named(config.engine), config, used)
    return config


@one_thread()
def _danced(
    engine: Engine,
    song: Song,
    repertoire: Repertoire,
    config: DanceConfig,
    requested: Constraints,
    costs: tuple[Cost, ...],
    style: Song | None,
    kept_of: tuple[ExistingDance, tuple[Keep, ...]] | None,
    report: ProgressReport | None,
    memory: Memory,
    first: FirstPart | None,
) -> Dance:
    """The stages in order, with checked arguments."""
    if report is not None:
        report("analysing the song", 0, 0)
    song_features, notes = analyse_song(
        song, repertoire, beats=config.beats, genre=requested.genre, keep=config.cache,
        report=substage(report, "analysing the song"), memory=memory,
    )  # fmt: skip
    if kept_of is not None and kept_of[0].plan is not None:
        check_same_song(kept_of[0].plan, song_features)
    song.forget_samples()
    material = choose_material(song_features, repertoire, requested)
    resolved = resolve(requested, repertoire, material, song_features.duration_s)
    kept = None if kept_of is None else kept_parts(*kept_of, requested, song_features.duration_s, config)
    if kept is not None and kept.plan is not None and "candidates" in engine.settings:
        costs = (*costs, AvoidRepeating([kept.plan]))
    request = DanceRequest(
        song, song_features, repertoire, config, resolved, material, costs, style, kept, report, memory,
    )  # fmt: skip
    if kept is None:
        result, motion = plan_and_render(engine, request, first)
    else:
        result, motion = fill(request, engine)
    left_out = missing_from_plan(result.plan, repertoire, material, requested, resolved.take_allowed, config)
    notes = (*notes, *moved_pins(result.plan, requested)) if kept is None else (*notes, *kept.notes)
    notes = (*notes, *result.notes, *left_out, *off_stage(motion, config.stage), *result.unmet)
    return Dance(motion, result.plan, notes, song.path, result.unmet, danced_figures(result.plan, repertoire))


def _as_existing(existing: object, keep: Sequence[Keep], repertoire: Repertoire) -> ExistingDance | None:
    if existing is None and keep:
        raise ParameterError("expected an existing dance beside the spans to keep, got none")
    if existing is None:
        return None
    if isinstance(existing, Dance):
        return ExistingDance(existing.motion, existing.plan, existing.plan.song)
    if not isinstance(existing, str | Path):
        raise unexpected("an existing dance as a Dance or a path", existing)
    return read_existing(existing, repertoire)


# The figures that a dance consists of, by the takes of its plan.


def danced_figures(plan: Plan, repertoire: Repertoire) -> tuple[Figure, ...]:
    """The figures of the takes that are danced, in seconds of the dance and in order.

    A figure of which a part is danced has the time of that part. Parts that follow each other are one.
    Takes without figures and dances of networks have none.
    """
    index_of = {take.name: index for index, take in enumerate(repertoire.takes)}
    found: list[Figure] = []
    for block in plan.blocks:
        take = index_of.get(block.source)
        length_s = block.source_end_s - block.source_start_s
        if take is None or block.kept or length_s <= 0.0:
            continue
        speed = (block.end_s - block.start_s) / length_s
        for figure in repertoire.figures(take):
            start_s = max(figure.start_s, block.source_start_s)
            end_s = min(figure.end_s, block.source_end_s)
            if end_s <= start_s:
                continue
            part = Figure(
                figure.name,
                block.start_s + speed * (start_s - block.source_start_s),
                block.start_s + speed * (end_s - block.source_start_s),
                figure.n_counts,
            )
            before = found[-1] if found else None
            same = before is not None and before.name == part.name
            if before is not None and same and part.start_s - before.end_s < SHORTEST_FIGURE_S:
                found[-1] = Figure(part.name, before.start_s, part.end_s, part.n_counts)
            else:
                found.append(part)
    return tuple(figure for figure in found if figure.end_s - figure.start_s >= SHORTEST_FIGURE_S)


def figures_from(figures: Sequence[Figure], start_s: float) -> tuple[Figure, ...]:
    """The figures of a part of a dance that begins at `start_s`, with times from there."""
    if start_s == 0.0:
        return tuple(figures)
    return tuple(
        replace(figure, start_s=max(0.0, figure.start_s - start_s), end_s=figure.end_s - start_s)
        for figure in figures
        if figure.end_s > start_s
    )
