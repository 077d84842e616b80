"""From a song and a repertoire to a dance: the engine's stages in order."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from choreograph.audio.song import Song, load_song
from choreograph.blending.assembly import assemble
from choreograph.blending.feet import lock_feet
from choreograph.blending.runs import to_runs
from choreograph.config import DanceConfig, resolve_weights
from choreograph.errors import ParameterError, RepertoireError
from choreograph.features.contacts import foot_contacts
from choreograph.features.motion_beats import motion_beat_times_s
from choreograph.features.music import Music
from choreograph.graph import (
    BUILTIN_COSTS,
    ClipTable,
    Cost,
    Layer,
    LayerSource,
    Variety,
    WeightedCost,
    plan_exact,
    plan_greedy,
)
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion
from choreograph.pipeline.hearing import hear
from choreograph.pipeline.saving import Report, save
from choreograph.plan import Plan, PlannedSecond
from choreograph.repertoire import Repertoire
from choreograph.selection import cast_takes, phrase_of_seconds, select_clips, take_losses
from choreograph.timebase import NET_FPS, STORE_FPS
from choreograph.warping import ClipBeats, warp_segments


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

    def save(self, path: str | Path, *, report: Report | None = None) -> None:
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
    config: DanceConfig | None = None,
    weights: Mapping[str, float] | None = None,
    costs: Sequence[Cost] = (),
    start_s: float = 0.0,
    duration_s: float | None = None,
    report: Report | None = None,
) -> Dance:
    """Make a dance for a song.

    Parameters
    ----------
    song : path of any audio file, or a loaded `Song`
    repertoire : the takes to dance with
    config : planner, candidates, blending, rate, seed (default `DanceConfig()`)
    weights : cost name -> weight, over those of `config`; 0 leaves a cost out
    costs : costs of your own beside the built-in ones; weight 1 unless given
    start_s, duration_s : the part of the song file to dance to
    report : called with the stage's name, how much is done, of how much

    Raises
    ------
    FormatError      the song cannot be read
    RepertoireError  the repertoire is damaged, or holds no clip
    ParameterError   an unknown weight, planner or blending; a cost that misbehaves
    NoPathError      the costs forbid every dance

    References
    ----------
    ChoreoGraph, section 3; the differences stand with `plan_exact`, `smooth_time_maps`, `Rhythm`,
    `Velocity` and `assemble`.
    """
    config = config or DanceConfig()
    if not isinstance(song, Song):
        song = load_song(song, start_s=start_s, duration_s=duration_s)
    all_costs = [*(cost() for cost in BUILTIN_COSTS), *costs]
    names = [cost.name for cost in all_costs]
    if len(set(names)) != len(names):
        raise ParameterError(f"two costs share a name among {', '.join(names)}: give yours its own `name`")
    resolved = resolve_weights({**config.weights, **(weights or {})}, names)
    weighted = [WeightedCost(cost, resolved[cost.name]) for cost in all_costs]
    if repertoire.n_clips == 0:
        raise RepertoireError(
            f"{repertoire.path}: the repertoire has no clip: its takes are shorter than 8 s"
        )
    if report is not None:
        report("hearing", 0, 0)
    music, notes = hear(song, repertoire, beats=config.beats)
    if repertoire.n_clips < config.candidates and config.planner != "motion-graph":
        notes = (
            *notes,
            f"{repertoire.n_clips} clips, fewer than {config.candidates} candidates: all take part",
        )
    nodes, priced = _planned(music, repertoire, config, weighted, report)
    plan = _to_plan(nodes, priced, music, repertoire, config, resolved, start_s)
    if report is not None:
        report("rendering", 0, 0)
    return Dance(render(plan, repertoire), plan, notes, song.path)


def render(plan: Plan, repertoire: Repertoire) -> Motion:
    """The motion of a plan: seconds sampled from their takes, joined, feet locked.

    Raises `RepertoireError` if the plan names a take that the repertoire does not have,
    `ParameterError` if it wants a take beyond its end.
    """
    indices = {entry.take: repertoire.take_index(entry.take) for entry in plan.seconds}
    for entry in plan.seconds:
        length = repertoire.takes[indices[entry.take]].duration_s
        if entry.source_times_s[0] < 0 or entry.source_times_s[-1] > length + 0.1:
            raise ParameterError(
                f"second {entry.second} of the plan wants {entry.source_times_s[0]:.2f} to "
                f"{entry.source_times_s[-1]:.2f} s of take {entry.take!r}, which lasts {length:.2f} s"
            )
    runs = to_runs([e.take for e in plan.seconds], [e.source_times_s for e in plan.seconds])
    motion, _ = assemble(
        runs,
        lambda take, start_s, stop_s: repertoire.motion(indices[take], start_s, stop_s),
        fps=plan.fps,
        duration_s=plan.duration_s,
        blending=plan.blending,
    )
    return lock_feet(motion, foot_contacts(body_pos_m(motion), motion.fps))


def _planned(
    music: Music,
    repertoire: Repertoire,
    config: DanceConfig,
    costs: list[WeightedCost],
    report: Report | None,
) -> tuple[Sequence[Layer], Sequence[dict[str, float]]]:
    """Select, warp, build the graph and plan."""
    clips = ClipTable(
        repertoire.clip_take,
        repertoire.clip_start_frame,
        np.array([take.name for take in repertoire.takes]),
        np.array([take.credits.genre for take in repertoire.takes]),
        repertoire.clip_style,
    )
    chosen, cast = _selected(music, repertoire, config, costs)
    segments = warp_segments(
        chosen, music.density, music.beat_times_s, repertoire.clip_density,
        repertoire.clip_speed, _clip_beats(repertoire), report=_stage(report, "warping"),
    )  # fmt: skip
    source = LayerSource(segments, clips, repertoire, cast)
    if config.planner == "motion-graph":
        from choreograph.graph.motion_graph import plan_motion_graph

        path = plan_motion_graph(source, costs, music)
    else:
        planner = plan_exact if config.planner == "exact" else plan_greedy
        path = planner(source, costs, music, report=_stage(report, "planning"))
    return path.nodes, path.costs


def _selected(
    music: Music, repertoire: Repertoire, config: DanceConfig, costs: list[WeightedCost]
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """The candidates of each second (S, K), and the takes cast in it (S, takes)."""
    known = (music.style, music.beat_count, repertoire.clip_style, repertoire.clip_beat_count)
    beat_weight = repertoire.selection_beat_weight
    losses = take_losses(
        *known, repertoire.clip_take, n_takes=len(repertoire.takes), beat_weight=beat_weight
    )  # fmt: skip
    phrases = phrase_of_seconds(music.beat_times_s, len(music.style))
    cast = cast_takes(losses, phrases, rng=np.random.default_rng(config.seed))
    wanted = next(w.weight for w in costs if w.cost.name == Variety.name)
    chosen = select_clips(
        *known, candidates=config.candidates, beat_weight=beat_weight,
        penalty=lambda second: wanted * ~cast[second, repertoire.clip_take],
    )  # fmt: skip
    return chosen, cast


def _stage(report: Report | None, name: str) -> Callable[[int, int], None] | None:
    return None if report is None else lambda done, total: report(name, done, total)


def _clip_beats(repertoire: Repertoire) -> ClipBeats:
    beats = [repertoire.clip_motion_beats(clip) for clip in range(repertoire.n_clips)]
    stops = np.cumsum([len(b) for b in beats])
    starts = stops - [len(b) for b in beats]
    return ClipBeats(np.concatenate(beats), np.stack([starts, stops], axis=1))


def _to_plan(
    nodes: Sequence[Layer],
    priced: Sequence[dict[str, float]],
    music: Music,
    repertoire: Repertoire,
    config: DanceConfig,
    weights: dict[str, float],
    start_s: float,
) -> Plan:
    seconds = []
    for node, costs in zip(nodes, priced, strict=True):
        clip, take = int(node.clip[0]), int(node.take[0])
        clip_start_s = repertoire.clip_start_s(clip)
        times: NDArray[np.float64] = clip_start_s + node.source_frames[0].astype(np.float64) / NET_FPS
        seconds.append(
            PlannedSecond(
                second=node.second,
                take=repertoire.takes[take].name,
                clip=clip,
                clip_start_s=clip_start_s,
                segment_second=node.second - int(node.offset[0]),
                offset=int(node.offset[0]),
                source_times_s=tuple(float(t) for t in times.round(5)),
                costs=costs,
                credits=repertoire.takes[take].credits,
            )
        )
    return Plan(
        song=music.name,
        duration_s=music.duration_s,
        start_s=start_s,
        repertoire=repertoire.path.name,
        planner=config.planner,
        blending=config.blending,
        seed=config.seed,
        fps=config.fps,
        weights=weights,
        music_beats_s=tuple(float(beat) for beat in music.beat_times_s),
        seconds=tuple(seconds),
    )
