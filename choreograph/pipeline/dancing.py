"""A song to a dance: analyse the song, resolve the constraints, let an engine plan, render."""

from __future__ import annotations

import reprlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.characters.gltf_character import GltfCharacter, read_character
from choreograph.choreography.constraints import Ban, Constraints, Keep, MotifPin, Pin, make_constraints
from choreograph.choreography.engine import DanceRequest, check_settings
from choreograph.choreography.engines import ENGINES, engine_name
from choreograph.choreography.genres import left_out_notes
from choreograph.choreography.graph.costs import BUILTIN_COSTS, Cost, Transition
from choreograph.choreography.slots import KeptDance, check_pins_in_gaps, kept_dance, resolve
from choreograph.choreography.song_analysis import analyse_song
from choreograph.core.arguments import as_list, as_texts, check_function, check_kind, unexpected
from choreograph.core.errors import ParameterError
from choreograph.core.files import as_path, check_apart
from choreograph.core.numerics import default_numerics, one_thread
from choreograph.core.progress import ProgressReport, counted, substage
from choreograph.core.timebase import STORE_FPS
from choreograph.formats.bvh import BvhOptions
from choreograph.library.repertoire import Repertoire
from choreograph.library.words import dance_bounds_s
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion
from choreograph.motion.motion_beats import motion_beat_times_s
from choreograph.music.song import Song, check_span
from choreograph.pipeline.arguments import as_config, as_costs, as_repertoire, as_song, as_weights
from choreograph.pipeline.keeping import ExistingDance, Unlike, fill, read_existing
from choreograph.pipeline.saving import SavedParts, check_options, save_dance
from choreograph.plan import Plan
from choreograph.render.filled_gaps import Loop, looped
from choreograph.render.rendering import render
from choreograph.settings import (
    Blending,
    DanceConfig,
    Density,
    EngineName,
    MotifDraw,
    Planner,
    Selection,
    StyleWindow,
    TimeMaps,
    Transitions,
    Warping,
)


@dataclass(frozen=True, eq=False)
class Dance:
    """A finished dance: the motion, the plan that explains it, and notes on what was unusual.

    Raises `ParameterError` if a field is of another type.
    """

    motion: Motion
    plan: Plan
    notes: tuple[str, ...] = ()  # one line each
    song_path: Path | None = None  # for the sound of pages and videos; None: they are silent
    unmet: tuple[str, ...] = ()  # what was asked for and is not danced, one line each; also in notes

    def __post_init__(self) -> None:
        check_kind("the motion of a dance", self.motion, Motion)
        check_kind("the plan of a dance", self.plan, Plan)
        if self.song_path is not None:
            object.__setattr__(self, "song_path", as_path("the song of a dance", self.song_path))
        for name in ("notes", "unmet"):
            object.__setattr__(self, name, as_texts(f"{name} of a dance", getattr(self, name)))

    @cached_property
    @default_numerics()
    def motion_beats_s(self) -> NDArray[np.float64]:
        """Motion beats of the finished dance in seconds, (Q,)."""
        return motion_beat_times_s(body_pos_m(self.motion.resampled(STORE_FPS)), STORE_FPS)

    @cached_property
    @default_numerics()
    def loop(self) -> Loop:
        """The dance cut to whole bars, ending where it begins; `ParameterError` if it has not two bars."""
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
        report: ProgressReport | None = None,
    ) -> None:
        """Write the dance; the suffix says what: see `pipeline.saving.output_formats`.

        bvh and npz hold the motion, glb the motion on a body, json the plan, html the page that plays it
        with its song, mp4 a video, png a strip of poses on the beats. `click` mixes a click on every count
        into the sound of a video, higher on count 1. `character`, a .glb, .gltf or .vrm file or what
        `read_character` made of one, dances in a glb, fbx or html; `bvh` says how a bvh is written. With
        `loop` a motion file holds the `loop` of the dance.

        Raises `ParameterError` for another suffix, an option that the format does not use, a folder that does
        not exist, a character whose bones cannot be found or that a page cannot show, or a loop without two
        bars, `FormatError` if the song or the character cannot be read.
        """
        path = as_path("a file to write", path)
        check_kind("click", click, bool)
        check_kind("loop", loop, bool)
        check_function("report", report)
        if isinstance(character, str | Path):
            check_apart([path], [character])
            character = read_character(character)
        for what, given, kind in (("a character", character, GltfCharacter), ("bvh", bvh, BvhOptions)):
            if not (given is None or isinstance(given, kind)):
                raise unexpected(f"{what} as {kind.__name__}", given)
        check_options(path, {"click": click, "character": character, "bvh": bvh, "loop": loop})
        motion = self.loop.motion if loop else self.motion
        parts = SavedParts(
            motion, self.plan, lambda: self.motion_beats_s, self.song_path, click, character, bvh
        )
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


@default_numerics()
def dance(
    song: str | Path | Song,
    repertoire: str | Path | Repertoire | None = None,
    *,
    engine: EngineName | None = None,
    planner: Planner | None = None,
    candidates: int | None = None,
    selection: Selection | None = None,
    warping: Warping | None = None,
    density: Density | None = None,
    time_maps: TimeMaps | None = None,
    blending: Blending | None = None,
    transitions: Transitions | None = None,
    lock_feet: bool | None = None,
    hold_ends: bool | None = None,
    keep_on_stage: bool | None = None,
    motif_draw: MotifDraw | None = None,
    style_strength: float | None = None,
    style_window: StyleWindow | None = None,
    fps: float | None = None,
    seed: int | None = None,
    beats: str | Path | None = None,
    genre: str | None = None,
    signature: Sequence[float] | NDArray[np.floating] | None = None,
    motifs: Sequence[int] | Sequence[MotifPin] = (),
    pins: Sequence[Pin] = (),
    bans: Sequence[Ban] = (),
    keep: Sequence[Keep] = (),
    existing: str | Path | Dance | None = None,
    style_song: str | Path | Song | None = None,
    config: DanceConfig | None = None,
    weights: Mapping[str, float] | None = None,
    costs: Sequence[Cost] = (),
    start_s: float | None = None,
    duration_s: float | None = None,
    report: ProgressReport | None = None,
) -> Dance:
    """Make a dance for a song.

    Parameters
    ----------
    song : path of any audio file, or a loaded `Song`
    repertoire : the takes to dance with, opened or as a path; by default the built-in ones
    engine : "graph" (seconds of takes), "mixer" (motion words of takes) or "rollout" (a network); default
        `config`'s, or "mixer" if `motifs` has one for every word
    planner, candidates, selection, warping, density, time_maps, blending, transitions, lock_feet, hold_ends,
        keep_on_stage, motif_draw, style_strength, style_window, fps, seed, beats : settings, as in
        `DanceConfig`; those given here replace `config`'s. `beats` is a tracker's name or the path of a file
        of beats (`music.beats`), with times in the song file
    genre : whose signature and motif transitions the dance follows; by default the genre whose takes are
        nearest to the song in style. With weights 0 of "signature" and "motif_transition" a graph dance
        follows none
    signature : (K,) shares of the motifs that the dance should have
    motifs : of the dance's words from the first on, or with their times
    pins : each a `MotifPin` or a `TakePin`, in seconds of the dance
    bans : takes, genres and motifs that must not be danced
    keep : stretches of the `existing` dance that are kept to the bit; the gaps between them, of 2 s or more,
        are danced anew
    existing : a dance to the same part of the song, as made by `dance` or as the path of a .bvh, .npz or plan
    style_song : another song, whose style the rollout engine's motion takes on
    config : all settings in one object; default `DanceConfig()`. `choreograph.settings.published_dance()`
        makes the one of the method as published
    weights : cost name -> weight, replacing those of `config`; 0 leaves a cost out; graph engine only
    costs : custom costs beside the built-in ones; weight 1 unless given; graph engine only
    start_s, duration_s : the part of the song to dance to; by default that of the `existing` dance if its
        plan is known, else all of it
    report : called with the stage's name, how much is done, of how much

    Raises
    ------
    FormatError      the song cannot be read
    RepertoireError  the repertoire is damaged, or lacks clips, motifs or networks that are needed
    ParameterError   an argument of the wrong type or value; an unknown genre, take, motif or weight; a
                     setting that the engine does not use; constraints that contradict each other; a cost
                     that misbehaves
    NoPathError      the costs or constraints forbid every dance

    References
    ----------
    ChoreoGraph, section 3; the differences stand with `plan_exact`, `smooth_time_maps`, `Rhythm`,
    `Velocity` and `assemble`. Rhythm is a Dancer, sections 4 and 5.2.5; the differences stand with
    `search_words`, `Signature` and `enforce_motifs`.
    """
    settings = {
        "planner": planner, "candidates": candidates, "selection": selection, "warping": warping,
        "density": density, "time_maps": time_maps, "blending": blending, "transitions": transitions,
        "lock_feet": lock_feet, "hold_ends": hold_ends, "keep_on_stage": keep_on_stage,
        "motif_draw": motif_draw, "style_strength": style_strength, "style_window": style_window, "fps": fps,
        "seed": seed, "beats": beats,
    }  # fmt: skip
    requested = make_constraints(genre=genre, signature=signature, motifs=motifs, pins=pins, bans=bans)
    config, costs = as_config(config), as_costs(costs)
    beside = {"costs": bool(costs), "style_song": style_song is not None}
    config = _configured(config, settings, weights, engine, requested, beside)
    check_span(0.0 if start_s is None else start_s, duration_s)
    check_function("report", report)
    keep = as_list("keep", keep, "Keep", Keep)
    repertoire = as_repertoire(repertoire)
    if existing is None and keep:
        raise ParameterError("expected an existing dance beside the stretches to keep, got none")
    known = None if existing is None else _as_existing(existing, repertoire)
    if known is not None and fps is None:
        config = replace(config, fps=known.motion.fps)
    ENGINES[config.engine].check(repertoire, config, requested, costs)
    loaded = _part_of(song, start_s, duration_s, known.plan if known else None)
    style = None if style_song is None else as_song("a style song", style_song)
    kept = None if known is None else (known, keep)
    return _danced(loaded, repertoire, config, requested, costs, style, kept, report)


def _configured(
    config: DanceConfig,
    settings: Mapping[str, Any],
    weights: Mapping[str, float] | None,
    engine: EngineName | None,
    requested: Constraints,
    beside: Mapping[str, bool],
) -> DanceConfig:
    """`config` with the settings and weights that were given and the engine that dances.

    `beside` says which arguments that are no settings were given. Raises `ParameterError` for a value out of
    range and for anything that the engine does not use.
    """
    given = {name: value for name, value in settings.items() if value is not None}
    if weights is not None:
        given["weights"] = {**config.weights, **as_weights(weights)}
        _check_weights_used(given.get("planner", config.planner), as_weights(weights))
    config = replace(config, engine=engine_name(config, engine, requested), **given)
    used = {*given, *(name for name, is_given in beside.items() if is_given)}
    check_settings(ENGINES[config.engine], list(ENGINES.values()), config, used)
    return config


def _check_weights_used(planner: str, weights: Mapping[str, float]) -> None:
    """Raise `ParameterError` for the weight of a cost that the planner leaves out."""
    unused = {cost.name for cost in BUILTIN_COSTS} - {Transition.name}
    given = sorted(unused & set(weights))
    if planner == "motion-graph" and given:
        raise ParameterError(
            f"expected the planner exact or greedy beside a weight of {given[0]!r}, got motion-graph, which "
            "walks by transition, stillness and costs of yours alone"
        )


@one_thread()
def _danced(
    song: Song,
    repertoire: Repertoire,
    config: DanceConfig,
    requested: Constraints,
    costs: tuple[Cost, ...],
    style: Song | None,
    kept_of: tuple[ExistingDance, tuple[Keep, ...]] | None,
    report: ProgressReport | None,
) -> Dance:
    """The stages in order, with arguments that are checked."""
    if report is not None:
        report("analysing the song", 0, 0)
    song_features, notes = analyse_song(
        song, repertoire, beats=config.beats, genre=requested.genre,
        report=substage(report, "analysing the song"),
    )  # fmt: skip
    bounds_s = dance_bounds_s(song_features.beat_times_s, song_features.duration_s)
    resolved = resolve(requested, repertoire, bounds_s, song_features.duration_s)
    kept = None if kept_of is None else _kept(*kept_of, requested, song_features.duration_s, config)
    engine = ENGINES[config.engine]
    if kept is not None and kept.plan is not None and "costs" in engine.settings:
        costs = (*costs, Unlike([kept.plan]))
    request = DanceRequest(song, song_features, repertoire, config, resolved, costs, style, kept, report)
    if kept is None:
        result = engine.plan(request)
        motion = result.motion
        if motion is None:
            motion = render(result.plan, repertoire, report=substage(report, "rendering"))
    else:
        result, motion = fill(request, engine)
    left_out = left_out_notes(result.plan, repertoire, resolved, config)
    kept_notes = () if kept is None else kept.notes
    notes = (*notes, *kept_notes, *result.notes, *left_out, *result.unmet)
    return Dance(motion, result.plan, notes, song.path, result.unmet)


def _part_of(song: object, start_s: float | None, duration_s: float | None, existing: Plan | None) -> Song:
    """The part of a song to dance to: what is not given is as in the plan of an existing dance, if known."""
    begins_s = song.start_s if isinstance(song, Song) else 0.0
    if existing is not None and start_s is None:
        start_s = existing.start_s - begins_s
        if start_s < 0:
            raise ParameterError(
                f"expected a song from {existing.start_s:g} s of its file on, as in the existing dance, got "
                f"one from {begins_s:g} s on"
            )
    if existing is not None and duration_s is None:
        duration_s = existing.duration_s
    return as_song("a song", song, start_s=start_s or 0.0, duration_s=duration_s)


def _as_existing(existing: object, repertoire: Repertoire) -> ExistingDance:
    if isinstance(existing, Dance):
        return ExistingDance(existing.motion, existing.plan, existing.plan.song)
    if not isinstance(existing, str | Path):
        raise unexpected("an existing dance as a Dance or a path", existing)
    return read_existing(existing, repertoire)


def _kept(
    existing: ExistingDance,
    keep: tuple[Keep, ...],
    requested: Constraints,
    duration_s: float,
    config: DanceConfig,
) -> KeptDance:
    """What is kept of an existing dance; `ParameterError` if that does not fit the new one."""
    if existing.motion.fps != config.fps:
        raise ParameterError(
            f"expected the {existing.motion.fps:g} fps of the existing dance, which is kept as it is, got "
            f"{config.fps:g}: leave out fps"
        )
    kept = kept_dance(existing.motion, keep, duration_s, name=existing.name, plan=existing.plan)
    check_pins_in_gaps(requested, kept)
    return kept
