"""The graph engine: clips selected and warped for every second, a graph of them, and the path through it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.blending.transition_search import REACH_S
from choreograph.config import TRANSITION_LENGTHS_S, DanceConfig, resolve_weights
from choreograph.constraints.likely_genre import genre_note, likely_genre
from choreograph.constraints.resolve import ResolvedConstraints, resolve, target_goal
from choreograph.constraints.spec import Constraints, TakePin
from choreograph.engines.enforce_motifs import enforce_motifs
from choreograph.engines.rendering import render, with_searched_transitions
from choreograph.errors import NoPathError, ParameterError
from choreograph.features.song_features import SongFeatures
from choreograph.graph import (
    BUILTIN_COSTS,
    MOTIF_COSTS,
    ClipTable,
    Cost,
    Layer,
    LayerSource,
    MotifTransition,
    Signature,
    WeightedCost,
    node_motifs,
    plan_exact,
    plan_greedy,
    song_words_s,
)
from choreograph.motifs.goals import MotifGoal
from choreograph.motifs.span_motifs import SpanMotifLookup
from choreograph.motifs.vocabulary import ALL_GENRES
from choreograph.motifs.words import dance_bounds_s
from choreograph.motion.motion import Motion
from choreograph.plan import Plan, PlannedSecond
from choreograph.progress import ProgressReport
from choreograph.repertoire import Repertoire
from choreograph.selection import clip_signature_mismatch, select_clips
from choreograph.timebase import NET_FPS, frames_to_seconds
from choreograph.warping import ClipBeats, warp_segments

_ANY = 1e6  # above any loss: with a random share of it added, style does not count
_WHIM_S = 4.0  # takes begin up to so tired, by the seed: another seed, another dance


@dataclass(frozen=True, eq=False)
class OwnCosts:
    """Costs of the user's and the weight of every cost by name."""

    costs: tuple[Cost, ...]
    weights: Mapping[str, float]


def weigh(weights: Mapping[str, float], costs: Sequence[Cost]) -> OwnCosts:
    """The weights of all costs that may take part.

    Raises `ParameterError` if two costs share a name, or a weight belongs to no cost.
    """
    names = [*(cost.name for cost in (*BUILTIN_COSTS, *MOTIF_COSTS)), *(cost.name for cost in costs)]
    if len(set(names)) != len(names):
        raise ParameterError(f"two costs share a name among {', '.join(names)}: give yours its own `name`")
    return OwnCosts(tuple(costs), resolve_weights(weights, names))


def dance_by_graph(
    song_features: SongFeatures,
    repertoire: Repertoire,
    config: DanceConfig,
    constraints: Constraints,
    own: OwnCosts,
    *,
    start_s: float,
    report: ProgressReport | None,
) -> tuple[Plan, Motion, tuple[str, ...]]:
    """The cheapest dance of seconds, with words where motifs are pinned or banned; and notes."""
    bounds_s = dance_bounds_s(song_features.beat_times_s, song_features.duration_s)
    resolved = resolve(constraints, repertoire, bounds_s, song_features.duration_s)
    notes: tuple[str, ...] = ()
    if repertoire.n_clips < config.candidates and config.planner != "motion-graph":
        notes = (f"{repertoire.n_clips} clips, fewer than {config.candidates} candidates: all take part",)
    costs = [*(cost() for cost in BUILTIN_COSTS), *own.costs]
    goal, more = _goal(song_features, repertoire, config, constraints, own)
    if goal is not None:
        costs += [Signature(goal, song_features), MotifTransition(goal, song_features)]
    weights = {cost.name: own.weights[cost.name] for cost in costs}
    weighted = [WeightedCost(cost, weights[cost.name]) for cost in costs]
    allowed = Allowed.of(constraints, resolved, repertoire, len(song_features.style))
    if allowed is not None:
        weighted.append(WeightedCost(allowed, 1.0))
    try:
        nodes, priced = _planned(song_features, repertoire, config, weighted, allowed, report)
    except NoPathError as error:
        if allowed is None:
            raise
        raise NoPathError(f"{error}; asked for: {constraints}") from error
    plan = _to_plan(nodes, priced, song_features, repertoire, config, weights, start_s)
    if report is not None:
        report("rendering", 0, 0)
    if config.transitions == "beats":
        take_pins = [pin for pin in constraints.pins if isinstance(pin, TakePin)]
        plan = with_searched_transitions(plan, repertoire, take_pins)
    motion = render(plan, repertoire)
    if resolved.motifs or resolved.motif_banned.any():
        plan, motion = enforce_motifs(plan, motion, resolved, repertoire)
    return plan, motion, (*notes, *more)


def _goal(
    song_features: SongFeatures,
    repertoire: Repertoire,
    config: DanceConfig,
    constraints: Constraints,
    own: OwnCosts,
) -> tuple[MotifGoal | None, tuple[str, ...]]:
    """What motifs are priced by: what is asked for, or the likely genre; None if nothing says. And notes.

    Raises `ParameterError` if nothing says, though the user weighed a cost of motifs.
    """
    if any(own.weights[cost.name] for cost in MOTIF_COSTS) and config.planner != "motion-graph":
        if constraints.genre is not None or constraints.signature is not None:
            return target_goal(constraints, repertoire), ()
        genre = (
            likely_genre(song_features, repertoire, constraints) if repertoire.has_vocabulary else ALL_GENRES
        )
        # All takes together are nobody's dance: a waltz of a mixed library would hold a share of its tangos.
        if genre != ALL_GENRES:
            return target_goal(constraints, repertoire, genre), (genre_note(genre),)
    weighed = [cost.name for cost in MOTIF_COSTS if config.weights.get(cost.name)]
    if weighed:
        raise ParameterError(
            f"a weight of {weighed[0]!r} was given, but there is no genre to follow: ask for a genre or "
            "signature that the repertoire knows, with the exact or greedy planner"
        )
    return None, ()


class Allowed(Cost):
    """Forbids what the user banned, and all but the pinned takes where some are pinned."""

    name = "asked"

    def __init__(self, takes: NDArray[np.bool_], motif_banned: NDArray[np.bool_]) -> None:
        self.takes = takes  # (S, takes) which may be danced when
        self.motif_banned = np.append(motif_banned, False)  # (K + 1,) the last one for no motif: index -1

    @classmethod
    def of(
        cls, constraints: Constraints, resolved: ResolvedConstraints, repertoire: Repertoire, n_seconds: int
    ) -> Allowed | None:
        """For a dance of so many seconds; None if nothing is forbidden."""
        takes = np.tile(resolved.take_allowed, (n_seconds, 1))
        owner: dict[int, TakePin] = {}
        pins = [pin for pin in constraints.pins if isinstance(pin, TakePin)]
        for pin in pins:
            for second in range(int(pin.start_s), int(np.ceil(pin.end_s))):
                other = owner.setdefault(second, pin)
                if other.take != pin.take:
                    raise ParameterError(
                        f"pins {other} and {pin} share second {second}, but the graph engine dances whole "
                        "seconds: move one, or use the mixer"
                    )
        # Joins move to beats: a take that danced a little longer, or earlier, would be within the pin.
        for pin in pins:
            for second in (int(pin.start_s - REACH_S), int(pin.end_s + REACH_S)):
                if 0 <= second < n_seconds:
                    owner.setdefault(second, pin)
        for second, pin in owner.items():
            take = repertoire.take_index(pin.take)
            if not (repertoire.clip_take == take).any():
                raise ParameterError(f"pin {pin}: the take is shorter than the 8 s of a clip")
            takes[second] = np.arange(takes.shape[1]) == take
        if takes.all() and not resolved.motif_banned.any():
            return None
        return cls(takes, resolved.motif_banned)

    def node(self, layer: Layer, song_features: SongFeatures) -> NDArray[np.floating]:
        fine = self.takes[layer.second, layer.take] & ~self.motif_banned[layer.motifs].any(axis=1)
        return np.where(fine, 0.0, np.inf)


def _planned(
    song_features: SongFeatures,
    repertoire: Repertoire,
    config: DanceConfig,
    costs: list[WeightedCost],
    allowed: Allowed | None,
    report: ProgressReport | None,
) -> tuple[Sequence[Layer], Sequence[dict[str, float]]]:
    """Select, warp, build the graph and plan."""
    clips = ClipTable(
        repertoire.clip_take,
        repertoire.clip_start_frame,
        np.array([take.name for take in repertoire.takes]),
        np.array([take.credits.genre for take in repertoire.takes]),
        repertoire.clip_style,
    )
    chosen = _selected(song_features, repertoire, config, costs, allowed)
    segments = warp_segments(
        chosen, song_features.density, song_features.beat_times_s, repertoire.clip_density,
        repertoire.clip_speed, _clip_beats(repertoire), as_recorded=config.warping == "none",
        report=_stage(report, "warping"),
    )  # fmt: skip
    motifs, n_motifs = None, 0
    if any(isinstance(w.cost, (Allowed, *MOTIF_COSTS)) for w in costs) and repertoire.has_vocabulary:
        vocabulary = repertoire.vocabulary
        known = SpanMotifLookup(
            repertoire.body_pos_m, NET_FPS, repertoire.word_net().embed, vocabulary.motifs
        )
        motifs, n_motifs = (
            node_motifs(segments, clips, song_words_s(song_features), known.motifs_of), vocabulary.n_motifs,
        )  # fmt: skip
    tie_break_s = _WHIM_S * np.random.default_rng(config.seed).random(len(repertoire.takes))
    source = LayerSource(
        segments, clips, repertoire, tie_break_s=tie_break_s, motifs=motifs, n_motifs=n_motifs
    )
    if config.planner == "motion-graph":
        from choreograph.graph.motion_graph import plan_motion_graph

        path = plan_motion_graph(source, costs, song_features)
    else:
        planner = plan_exact if config.planner == "exact" else plan_greedy
        path = planner(source, costs, song_features, report=_stage(report, "planning"))
    return path.nodes, path.costs


def _selected(
    song_features: SongFeatures,
    repertoire: Repertoire,
    config: DanceConfig,
    costs: list[WeightedCost],
    allowed: Allowed | None,
) -> NDArray[np.int64]:
    """The candidates of each second (S, K)."""
    misfit = _signature_mismatch(song_features, repertoire, costs)

    def penalty(second: int) -> NDArray[np.floating]:
        fine = True if allowed is None else allowed.takes[second, repertoire.clip_take]
        drawn = np.zeros(repertoire.n_clips)
        if config.selection == "random":
            drawn = _ANY * np.random.default_rng([config.seed, second]).random(repertoire.n_clips)
        return np.where(fine, misfit + drawn, np.inf)

    return select_clips(
        song_features.style, song_features.beat_count, repertoire.clip_style, repertoire.clip_beat_count,
        candidates=config.candidates, beat_weight=repertoire.selection_beat_weight, penalty=penalty,
    )  # fmt: skip


def _signature_mismatch(
    song_features: SongFeatures, repertoire: Repertoire, costs: list[WeightedCost]
) -> NDArray[np.float64]:
    """How little of each clip a dance with the signature asked for wants; 0 without."""
    misfit = np.zeros(repertoire.n_clips)
    for w in costs:
        if isinstance(w.cost, Signature) and w.weight != 0:
            misfit += w.weight * clip_signature_mismatch(
                repertoire.vocabulary,
                w.cost.goal.signature,
                repertoire.clip_take,
                frames_to_seconds(repertoire.clip_start_frame, NET_FPS),
                n_words=len(song_words_s(song_features)) - 1,
            )
    return misfit


def _stage(report: ProgressReport | None, name: str) -> Callable[[int, int], None] | None:
    return None if report is None else lambda done, total: report(name, done, total)


def _clip_beats(repertoire: Repertoire) -> ClipBeats:
    beats = [repertoire.clip_motion_beats(clip) for clip in range(repertoire.n_clips)]
    stops = np.cumsum([len(b) for b in beats])
    starts = stops - [len(b) for b in beats]
    return ClipBeats(np.concatenate(beats), np.stack([starts, stops], axis=1))


def _to_plan(
    nodes: Sequence[Layer],
    priced: Sequence[dict[str, float]],
    song_features: SongFeatures,
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
                start_s=float(node.second),
                transition_s=TRANSITION_LENGTHS_S[config.blending][0],
                costs=costs,
                credits=repertoire.takes[take].credits,
            )
        )
    return Plan(
        song=song_features.name,
        duration_s=song_features.duration_s,
        start_s=start_s,
        repertoire=repertoire.path.name,
        planner=config.planner,
        blending=config.blending,
        seed=config.seed,
        fps=config.fps,
        weights=weights,
        music_beats_s=tuple(float(beat) for beat in song_features.beat_times_s),
        seconds=tuple(seconds),
    )
