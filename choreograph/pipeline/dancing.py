"""From a song and a repertoire to a dance: one door to all engines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from choreograph.audio.song import Song, load_song
from choreograph.config import DanceConfig
from choreograph.constraints.likely_genre import choose_goal
from choreograph.constraints.spec import Ban, Constraints, MotifPin, Pin, make_constraints
from choreograph.engines.graph import dance_by_graph, weigh
from choreograph.engines.mixer import dance_by_mixer, sequence_notes
from choreograph.errors import ParameterError, RepertoireError
from choreograph.features.motion_beats import motion_beat_times_s
from choreograph.features.song_features import SongFeatures
from choreograph.graph import Cost
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion
from choreograph.pipeline.saving import save
from choreograph.plan import Plan
from choreograph.progress import ProgressReport
from choreograph.repertoire import Repertoire
from choreograph.song_analysis import analyse_song
from choreograph.timebase import STORE_FPS


@dataclass(frozen=True, eq=False)
class Dance:
    """A finished dance: the motion, why it is so, and what was odd about the input."""

    motion: Motion
    plan: Plan
    notes: tuple[str, ...] = ()  # one line each
    song_path: Path | None = None  # for what is heard in pages and videos; None: they are silent

    @cached_property
    def motion_beats_s(self) -> NDArray[np.float64]:
        """Motion beats of the finished dance in seconds, (Q,)."""
        return motion_beat_times_s(body_pos_m(self.motion.resampled(STORE_FPS)), STORE_FPS)

    def save(self, path: str | Path, *, report: ProgressReport | None = None) -> None:
        """Write the dance; the suffix says what: see `pipeline.saving.OUTPUT_FORMATS`.

        bvh and npz hold the motion, json the plan, html the page that plays it with its song, mp4 a
        video, png a strip of poses on the beats. Raises `ParameterError` for another suffix or a
        folder that does not exist, `FormatError` if the song can no longer be read.
        """
        save(self, path, report)


def dance(
    song: str | Path | Song,
    repertoire: Repertoire,
    *,
    engine: str | None = None,
    genre: str | None = None,
    signature: Sequence[float] | NDArray[np.floating] | None = None,
    motifs: Sequence[int] | Sequence[MotifPin] = (),
    pins: Sequence[Pin] = (),
    bans: Sequence[Ban] = (),
    style_song: str | Path | Song | None = None,
    config: DanceConfig | None = None,
    weights: Mapping[str, float] | None = None,
    costs: Sequence[Cost] = (),
    start_s: float = 0.0,
    duration_s: float | None = None,
    report: ProgressReport | None = None,
) -> Dance:
    """Make a dance for a song.

    Parameters
    ----------
    song : path of any audio file, or a loaded `Song`
    repertoire : the takes to dance with
    engine : "graph" (seconds of takes), "mixer" (motion words of takes) or "rollout" (a network); default
        `config`'s, or "mixer" if `motifs` has one for every word
    genre : whose signature and transitions the dance should have; by default that whose takes are nearest to
        the song in style. Weights 0 of "signature" and "motif_transition" let a graph dance follow none
    signature : (K,) shares of the motifs that the dance should have
    motifs : of the dance's words from the first on, or with their times
    pins : `MotifPin`s and `TakePin`s, in seconds of the dance; what they say is danced, whatever it costs
    bans : takes, genres and motifs that are not danced
    style_song : another song, whose colour the rollout's motion takes on
    config : engine, planner, candidates, blending, rate, seed (default `DanceConfig()`)
    weights : cost name -> weight, over those of `config`; 0 leaves a cost out; of the graph engine
    costs : costs of your own beside the built-in ones; weight 1 unless given; of the graph engine
    start_s, duration_s : the part of the song file to dance to
    report : called with the stage's name, how much is done, of how much

    Raises
    ------
    FormatError      the song cannot be read
    RepertoireError  the repertoire is damaged, or lacks clips, motifs or networks that are needed
    ParameterError   an unknown engine, genre, take, motif, weight, planner or blending; wishes that
                     contradict each other; a cost that misbehaves
    NoPathError      the costs or wishes forbid every dance

    References
    ----------
    ChoreoGraph, section 3; the differences stand with `plan_exact`, `smooth_time_maps`, `Rhythm`,
    `Velocity` and `assemble`. Rhythm is a Dancer, sections 4 and 5.2.5; the differences stand with
    `search_words`, `Signature` and `enforce_motifs`.
    """
    constraints = make_constraints(genre=genre, signature=signature, motifs=motifs, pins=pins, bans=bans)
    config = _with_engine(config or DanceConfig(), engine, constraints)
    if config.engine == "graph":
        config = replace(config, weights={**config.weights, **(weights or {})})
        own_costs = weigh(config.weights, costs)
    elif costs or weights:
        raise ParameterError(f"costs and weights are of the graph engine, got the {config.engine} engine")
    _check_repertoire(repertoire, config, constraints)
    if style_song is not None and config.engine != "rollout":
        raise ParameterError(f"a style song is of the rollout engine, got the {config.engine} engine")
    if not isinstance(song, Song):
        song = load_song(song, start_s=start_s, duration_s=duration_s)
    if style_song is not None and not isinstance(style_song, Song):
        style_song = load_song(style_song)
    if report is not None:
        report("hearing", 0, 0)
    song_features, notes = analyse_song(song, repertoire, beats=config.beats)
    if config.engine == "graph":
        plan, motion, more = dance_by_graph(
            song_features, repertoire, config, constraints, own_costs, start_s=start_s, report=report
        )
    elif config.engine == "mixer":
        plan, motion, more = dance_by_mixer(
            song_features, repertoire, config, constraints, start_s=start_s, report=report
        )
    else:
        plan, motion, more = _dance_by_rollout(
            song, song_features, repertoire, config, constraints, style_song, start_s, report
        )
    return Dance(motion, plan, (*notes, *more), song.path)


def _dance_by_rollout(
    song: Song,
    song_features: SongFeatures,
    repertoire: Repertoire,
    config: DanceConfig,
    constraints: Constraints,
    style_song: Song | None,
    start_s: float,
    report: ProgressReport | None,
) -> tuple[Plan, Motion, tuple[str, ...]]:
    from choreograph.engines.rollout import roll  # torch takes a second to import

    goal, notes = choose_goal(song_features, repertoire, constraints)
    plan, motion, _ = roll(
        song, song_features, repertoire, config, constraints, signature=goal.signature, transitions=goal.transitions,
        style_song=style_song, start_s=start_s, report=report,
    )  # fmt: skip
    return plan, motion, (*notes, *sequence_notes(constraints, len(plan.words)))


def _with_engine(config: DanceConfig, engine: str | None, constraints: Constraints) -> DanceConfig:
    """The settings with the engine that is asked for; a whole motif sequence asks for one of words."""
    if engine is None and constraints.motifs and config.engine == "graph":
        engine = "mixer"
    config = replace(config, engine=engine or config.engine)
    steered = constraints.genre is not None or constraints.signature is not None
    if config.engine == "graph" and config.planner == "motion-graph" and steered:
        raise ParameterError(
            "the motion-graph planner follows no genre or signature: expected exact or greedy"
        )
    if config.engine == "graph" and constraints.motifs:
        raise ParameterError(
            "the graph engine dances seconds, not a whole sequence of motifs: expected the mixer or rollout "
            "engine, or motifs with their times"
        )
    return config


def _check_repertoire(repertoire: Repertoire, config: DanceConfig, constraints: Constraints) -> None:
    """Raise `RepertoireError` before any work if the repertoire lacks what the dance needs."""
    if config.engine == "graph" and repertoire.n_clips == 0:
        raise RepertoireError(
            f"{repertoire.path}: the repertoire has no clip: its takes are shorter than 8 s"
        )
    if config.engine == "rollout":
        repertoire.rollout_net()
    if config.engine != "graph" or constraints.of_motifs:
        _ = repertoire.vocabulary
