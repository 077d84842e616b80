"""The graph engine: the best path through a graph of warped clips, and its transitions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.constraints import Constraints, TakePin
from choreograph.choreography.enforcement import AvoidRepeating, KeptBorders, Repairs
from choreograph.choreography.engine import Check, DanceRequest, EngineResult
from choreograph.choreography.graph.candidates import AllowedNodes, take_ranks
from choreograph.choreography.graph.cost import Cost, CostContext, WeightedCost, resolve_weights
from choreograph.choreography.graph.costs import BUILTIN_COSTS, built_in, installed_costs
from choreograph.choreography.graph.layer_source import make_layers, song_grid
from choreograph.choreography.graph.layers import Layer
from choreograph.choreography.graph.motif_costs import MotifTransition, Signature
from choreograph.choreography.graph.phrase_returns import PhraseReturns
from choreograph.choreography.graph.planners import Path, plan_exact, plan_greedy, plan_motion_graph
from choreograph.choreography.graph.segments import LayerSource
from choreograph.choreography.material import SectionGoal
from choreograph.core.arguments import as_stage_m
from choreograph.core.errors import NoPathError, ParameterError, RepertoireError
from choreograph.core.progress import counted, substage
from choreograph.core.timebase import CLIP_S, NET_FPS
from choreograph.library.repertoire import Repertoire
from choreograph.library.vocabulary import ALL_GENRES
from choreograph.motion.motion import Motion
from choreograph.music.count_grids import FEWEST_COUNTS
from choreograph.music.danced_span import REACH_S, join_times_s
from choreograph.plan.joins import take_motions, time_transitions
from choreograph.plan.plan import Plan, PlannedSecond
from choreograph.plan.runs import Run, TransitionTiming, runs_of_seconds
from choreograph.settings import TRANSITION_LENGTHS_S, DanceConfig, settings_of

_OF_MOTIFS = (Signature, MotifTransition)
_COST_DECIMALS = 4  # of a cost in a plan. Further decimals differ between CPUs


class GraphEngine:
    """Seconds of warped takes, and the path through a graph of them (ChoreoGraph, section 3)."""

    name = "graph"
    settings = settings_of(name) | {"costs"}

    def check(
        self,
        repertoire: Repertoire,
        config: DanceConfig,
        constraints: Constraints,
        costs: Sequence[Cost],
    ) -> None:
        """As `Engine.check`. It needs clips, and plans seconds instead of a whole sequence of motifs."""
        if config.planner == "motion-graph" and (constraints.genre or constraints.signature):
            raise ParameterError(
                "expected the planner exact or greedy for a genre or signature, got motion-graph, which "
                "follows none"
            )
        if constraints.motifs:
            raise ParameterError(
                "expected the mixer or rollout engine for a whole sequence of motifs, or motifs with their "
                "times, got the graph engine, which dances seconds"
            )
        if config.bound and config.planner != "exact":
            raise ParameterError(f"expected the planner exact for a bound, got {config.planner}")
        cost_weights(config, costs)
        if repertoire.n_clips == 0:
            raise RepertoireError(
                f"{repertoire.path}: expected takes of {CLIP_S} s or more, got only shorter ones: "
                "there is no clip"
            )
        if config.density != "repertoire" and repertoire.density != "learned":
            raise RepertoireError(
                f"{repertoire.path}: expected learned tempo-densities, got {repertoire.density} ones: "
                "build it again with `choreograph build-db --density learned`, or --published"
            )
        if constraints.need_motifs:
            _ = repertoire.vocabulary

    def plan(self, request: DanceRequest) -> EngineResult:
        """The cheapest path found, with transitions. Words replace it where it violates pins and bans."""
        constraints, config, repertoire = request.constraints, request.config, request.repertoire
        notes: tuple[str, ...] = ()
        if repertoire.n_clips < config.candidates and config.planner != "motion-graph":
            clips = counted(repertoire.n_clips, "clip")
            notes = (f"{clips}, fewer than {config.candidates} candidates: all are used",)
        if note := _unaligned_note(request):
            notes = (*notes, note)
        goals, goal_notes = _goals(request)
        costs_later = request.likely is not None and not constraints.constrains_motifs and not config.bound
        path, weights = _search_path(request if costs_later else replace(request, likely=None), goals)
        plan = _to_plan(path, weights, request, with_costs=not costs_later)
        if plan.least_cost is not None:
            costs = f"the plan costs {plan.total_cost:.1f}, and no plan costs less than {plan.least_cost:.1f}"
            notes = (*notes, costs)
        if config.warping == "counts":
            goal_notes = (*goal_notes, *request.material.metre_notes)
        costs_of = partial(_costs_of, path) if costs_later else None
        result = EngineResult(plan, (*notes, *goal_notes), costs_of=costs_of)
        if not constraints.constrains_motifs:
            return result
        return replace(result, check=Check(constraints.bounds_s, partial(_with_words, result, request, None)))


def _unaligned_note(request: DanceRequest) -> str:
    """A note if settings of the DTW were changed although takes are aligned by counts, else empty text."""
    config, repertoire = request.config, request.repertoire
    default = DanceConfig()
    changed = [name for name in ("density", "time_maps") if getattr(config, name) != getattr(default, name)]
    counted = bool((repertoire.take_tempi.n_counts >= FEWEST_COUNTS).any())
    by_counts = config.warping == "counts" and len(request.song_features.counts) >= FEWEST_COUNTS
    if not changed or not counted or not by_counts:
        return ""
    names = " and ".join(name.replace("_", " ") for name in changed)
    them = "it" if changed == ["density"] else "them"
    return f"no effect of {names}, because takes are aligned by counts: choose the warping dtw to use {them}"


def _with_words(
    result: EngineResult,
    request: DanceRequest,
    repairs: Repairs | None,
    motion: Motion,
    embeddings: NDArray[np.float32],
) -> EngineResult:
    """The result with words in place of its seconds where its `motion` violates pins and bans."""
    constraints = request.constraints
    if repairs is None:
        repairs = Repairs(result.plan, motion, constraints, request.repertoire)
    words = repairs.words(embeddings)
    if words is None:
        return replace(result, motion=motion, check=None)
    laid = replace(result, plan=replace(result.plan, words=words))
    return replace(laid, check=Check(constraints.bounds_s, partial(_with_words, laid, request, repairs)))


def cost_weights(config: DanceConfig, costs: Sequence[Cost]) -> dict[str, float]:
    """The weight of every cost that may be used, with those of the user's `costs` and of installed ones.

    Raises `ParameterError` if two costs share a name, or a weight belongs to no cost.
    """
    every: list[Cost | type[Cost]] = [*BUILTIN_COSTS, *costs, *installed_costs(config.weights, costs)]
    names = [cost.name for cost in every]
    if len(set(names)) != len(names):
        raise ParameterError(
            f"expected a different name for each cost, but two share one among {', '.join(names)}: give "
            "yours its own `name`"
        )
    given = {"front": 0.0, **config.weights} if config.front == "free" else config.weights
    return resolve_weights(given, every)


def with_transitions_on_counts(plan: Plan, request: DanceRequest) -> Plan:
    """The plan with every transition on the downbeat or beat near its second, each as long as necessary.

    Transitions into and out of a pinned take are not moved.
    """
    repertoire, pins = request.repertoire, request.constraints.requested.take_pins
    runs = runs_of_seconds(plan)
    joins_s = join_times_s(request.song_features.counts, len(plan.seconds) + 1)
    fixed = [False, *(any(_borders_pin(pin, *pair) for pin in pins) for pair in pairwise(runs))]
    timings = time_transitions(
        runs, [float(joins_s[round(run.start_s)]) for run in runs],
        {take.name: take.duration_s for take in repertoire.takes}, take_motions(repertoire),
        fps=plan.fps, blending=plan.blending, fixed=fixed,
        report=substage(request.report, "timing transitions"), memory=request.memory,
    )  # fmt: skip
    by_second = {round(run.start_s): timing for run, timing in zip(runs, timings, strict=True)}
    seconds = []
    for second in plan.seconds:
        timing = by_second.get(second.second, TransitionTiming(second.second))
        transition_s = second.transition_s if timing.transition_s is None else timing.transition_s
        seconds.append(replace(second, start_s=round(timing.start_s, 5), transition_s=transition_s))
    return replace(plan, seconds=tuple(seconds))


def _borders_pin(pin: TakePin, before: Run, after: Run) -> bool:
    """Whether the transition lies at or in a pinned take's time, and is not from that take to itself."""
    near = pin.start_s - REACH_S < after.start_s < pin.end_s + REACH_S
    return near and not before.take == after.take == pin.take


def _goals(request: DanceRequest) -> tuple[Sequence[SectionGoal], tuple[str, ...]]:
    """The goals that are requested, or those of likely genres if the motif costs take part, and notes.

    There is none if the style decides on no genre, because a mixture of all genres would be a waltz that
    contains tangos. Raises `ParameterError` if there is none although the user gave a weight of a motif cost.
    """
    config, material = request.config, request.material
    weights = cost_weights(config, request.costs)
    goals: Sequence[SectionGoal] = ()
    notes: tuple[str, ...] = ()
    steered = any(weights[cost.name] for cost in _OF_MOTIFS) and config.planner != "motion-graph"
    decided = all(goal.requested or goal.genre not in (None, ALL_GENRES) for goal in material.goals)
    if material.is_requested or (steered and decided):
        goals, notes = material.goals, material.notes
    given = [cost.name for cost in _OF_MOTIFS if config.weights.get(cost.name)]
    if given and not goals:
        raise ParameterError(
            "expected a genre or signature of the repertoire, and the planner exact or greedy, with a "
            f"weight of {given[0]!r}, got no genre to follow"
        )
    return goals, notes


def _returns(request: DanceRequest) -> PhraseReturns | None:
    """The phrases that return, or None if none does.

    Nothing is planned in held poses and in parts that are kept of another dance. There, nothing returns.
    """
    opening_s, closing_s = request.danced_span_s
    kept, grid = request.kept, song_grid(request)

    def is_planned(at_s: float) -> bool:
        return opening_s <= at_s <= closing_s and not (kept and kept.keeps(at_s, at_s))

    if grid is None:
        return None
    returns = PhraseReturns.of(request.song_features.form, grid, is_planned)
    return returns if len(returns.seconds) else None


def _search_path(request: DanceRequest, goals: Sequence[SectionGoal]) -> tuple[Path, dict[str, float]]:
    """The path of the planner, and the weights of its costs."""
    features, config = request.song_features, request.config
    context = CostContext(
        seed=config.seed, stage_m=as_stage_m(config.stage), poses=request.repertoire.clip_motion,
        returns=_returns(request), goals=[(part.first_second, part.goal) for part in goals],
        song_features=features,
    )  # fmt: skip
    installed = installed_costs(config.weights, request.costs)
    costs = [*built_in(context), *request.costs, *installed]
    known = cost_weights(config, request.costs)
    weights = {cost.name: known[cost.name] for cost in costs}
    weighted = [WeightedCost(cost, weights[cost.name]) for cost in costs]
    if request.kept is not None:
        weighted.append(WeightedCost(KeptBorders(request.kept, features.duration_s), 1.0))
    allowed = AllowedNodes.of(request, goals)
    if allowed is not None:
        weighted.append(WeightedCost(allowed, 1.0))
    # A cost of the user may outweigh the genre, so it is given takes of every genre.
    own = [*(c for c in request.costs if not isinstance(c, AvoidRepeating)), *installed]
    ranks = take_ranks(request, goals, allowed, of_music_alone=False)
    first = ranks
    if config.selection == "genre" and not own:
        first = take_ranks(request, goals, allowed, of_music_alone=True)

    def planned(ranks: NDArray[np.int8]) -> Path:
        return _plan_path(make_layers(request, weighted, ranks, goals), weighted, request)

    try:
        try:
            return planned(first), weights
        except NoPathError:
            if np.array_equal(first, ranks):
                raise
            return planned(ranks), weights
    except NoPathError as error:
        if not str(request.constraints.requested):
            raise
        raise NoPathError(f"{error} (requested: {request.constraints.requested})") from error


def _plan_path(source: LayerSource, costs: list[WeightedCost], request: DanceRequest) -> Path:
    def show(nodes: list[Layer]) -> None:
        if request.likely is not None:
            unreported = replace(request, report=None)
            request.likely(_to_plan(Path(tuple(nodes), tuple), {}, unreported, with_costs=False))

    planner, report = request.config.planner, substage(request.report, "planning")
    if planner == "motion-graph":
        return plan_motion_graph(source, costs, request.song_features, report=report)
    if planner == "greedy":
        return plan_greedy(source, costs, request.song_features, report=report)
    with_bound = request.config.bound
    path: Path = plan_exact(
        source, costs, request.song_features, with_bound=with_bound, report=report, likely=show
    )
    return path


def _to_plan(path: Path, weights: dict[str, float], request: DanceRequest, *, with_costs: bool) -> Plan:
    """The plan of a path, with its transitions."""
    of_seconds = _costs_of(path) if with_costs else [{}] * len(path.nodes)
    seconds = [
        _planned_second(node, costs, request) for node, costs in zip(path.nodes, of_seconds, strict=True)
    ]
    least = None if path.least_total is None else round(path.least_total, _COST_DECIMALS)
    plan = request.new_plan(
        engine=GraphEngine.name, weights=weights, seconds=tuple(seconds), least_cost=least
    )
    return with_transitions_on_counts(plan, request) if request.config.transitions == "beats" else plan


def _costs_of(path: Path) -> list[dict[str, float]]:
    """The costs of every second, by name, as they are stored in a plan."""
    return [{name: round(cost, _COST_DECIMALS) for name, cost in costs.items()} for costs in path.costs]


def _planned_second(node: Layer, costs: dict[str, float], request: DanceRequest) -> PlannedSecond:
    """The planned second of a layer with one node. Its transition is at the start of the second."""
    repertoire = request.repertoire
    clip, take = int(node.clip[0]), repertoire.takes[int(node.take[0])]
    clip_start_s = repertoire.clip_start_s(clip)
    times_s = clip_start_s + node.source_frames[0].astype(np.float64) / NET_FPS  # (21,)
    return PlannedSecond(
        second=node.second,
        take=take.name,
        clip=clip,
        clip_start_s=clip_start_s,
        segment_second=node.second - int(node.offset[0]),
        offset=int(node.offset[0]),
        source_times_s=tuple(float(time) for time in times_s.round(5)),
        start_s=float(node.second),
        transition_s=TRANSITION_LENGTHS_S[request.config.blending][0],
        costs=costs,
        credits=take.credits,
    )
