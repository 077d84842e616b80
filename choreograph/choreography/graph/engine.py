"""The graph engine: the best path through a graph of warped clips, and its transitions.

`GraphEngine.plan` makes the layers of every second with `make_layers`, which selects, warps and labels clips.
A planner chooses the path through them by the weighted costs, and the path becomes a plan.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.constraints import Constraints, TakePin
from choreograph.choreography.enforcement import AvoidRepeating, KeptBorders, Repairs
from choreograph.choreography.engine import Check, DanceRequest, EngineResult
from choreograph.choreography.graph.candidates import FIRST, AllowedNodes, candidate_clips, take_ranks
from choreograph.choreography.graph.cost import Cost, CostContext, WeightedCost, resolve_weights
from choreograph.choreography.graph.costs import BUILTIN_COSTS, built_in, installed_costs
from choreograph.choreography.graph.layers import Layer, PhraseReturns
from choreograph.choreography.graph.motif_costs import MotifTransition, Signature, node_motifs, song_words_s
from choreograph.choreography.graph.path_costs import WALK_AT, FormCost
from choreograph.choreography.graph.planners import PlannedPath, plan_exact, plan_greedy, plan_motion_graph
from choreograph.choreography.graph.segments import ClipBeats, ClipTable, LayerSource, warp_segments
from choreograph.choreography.graph.warping import CountedClips
from choreograph.choreography.material import SectionGoal
from choreograph.core.arguments import as_stage_m
from choreograph.core.cache import DiskCache, digest, program
from choreograph.core.errors import NoPathError, ParameterError, RepertoireError
from choreograph.core.progress import counted, substage
from choreograph.core.timebase import CLIP_FRAMES, CLIP_S, NET_FPS, SEGMENT_S
from choreograph.library.repertoire import Repertoire
from choreograph.library.vocabulary import ALL_GENRES, SpanMotifLookup
from choreograph.motion.motion import Motion
from choreograph.music.count_grids import FEWEST_COUNTS, REACH_S, SongGrid, TakeGrids, join_times_s
from choreograph.plan.joins import MAX_STEER_RAD, take_motions, time_transitions
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
        shows_likely = not constraints.constrains_motifs and not config.bound
        path, weights = _search_path(request if shows_likely else replace(request, likely=None), goals)
        plan = _to_plan(path, weights, request)
        if plan.least_cost is not None:
            costs = f"the plan costs {plan.total_cost:.1f}, and no plan costs less than {plan.least_cost:.1f}"
            notes = (*notes, costs)
        if config.warping == "counts":
            goal_notes = (*goal_notes, *request.material.metre_notes)
        result = EngineResult(plan, (*notes, *goal_notes))
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


def _search_path(request: DanceRequest, goals: Sequence[SectionGoal]) -> tuple[PlannedPath, dict[str, float]]:
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

    def planned(ranks: NDArray[np.int8]) -> PlannedPath:
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


def _plan_path(source: LayerSource, costs: list[WeightedCost], request: DanceRequest) -> PlannedPath:
    def show(nodes: list[Layer]) -> None:
        if request.likely is not None:
            unreported = replace(request, report=None)
            request.likely(_to_plan(PlannedPath(tuple(nodes), ({},) * len(nodes)), {}, unreported))

    planner, report = request.config.planner, substage(request.report, "planning")
    if planner == "motion-graph":
        return plan_motion_graph(source, costs, request.song_features, report=report)
    if planner == "greedy":
        return plan_greedy(source, costs, request.song_features, report=report)
    with_bound = request.config.bound
    path: PlannedPath = plan_exact(
        source, costs, request.song_features, with_bound=with_bound, report=report, likely=show
    )
    return path


def _to_plan(path: PlannedPath, weights: dict[str, float], request: DanceRequest) -> Plan:
    """The plan of a path, with its transitions."""
    pairs = zip(path.nodes, path.costs, strict=True)
    seconds = [_planned_second(node, costs, request) for node, costs in pairs]
    least = None if path.least_total is None else round(path.least_total, _COST_DECIMALS)
    plan = request.new_plan(
        engine=GraphEngine.name, weights=weights, seconds=tuple(seconds), least_cost=least
    )
    return with_transitions_on_counts(plan, request) if request.config.transitions == "beats" else plan


def _planned_second(node: Layer, costs: dict[str, float], request: DanceRequest) -> PlannedSecond:
    """The planned second of a layer with one node. Its transition is at the start of the second."""
    repertoire = request.repertoire
    clip, take = int(node.warp.clip[0]), repertoire.takes[int(node.take[0])]
    clip_start_s = repertoire.clip_start_s(clip)
    times_s = clip_start_s + node.source_frames[0].astype(np.float64) / NET_FPS  # (21,)
    return PlannedSecond(
        second=node.second,
        take=take.name,
        clip=clip,
        clip_start_s=clip_start_s,
        segment_second=node.second - int(node.warp.offset[0]),
        offset=int(node.warp.offset[0]),
        source_times_s=tuple(float(time) for time in times_s.round(5)),
        start_s=float(node.second),
        transition_s=TRANSITION_LENGTHS_S[request.config.blending][0],
        costs={name: round(cost, _COST_DECIMALS) for name, cost in costs.items()},
        credits=take.credits,
    )


_FEW_TAKES = 512  # of which all have grids and usage, so that the dances of a session have the same
_CLIPS_AT_ONCE = 1024  # 220 MB of positions
_MOST_SPAN_BYTES = 64 << 20  # of the motifs of spans of all repertoires in the cache
_MOST_SPANS = 1 << 19  # of the takes of a repertoire: 5 MB
_FEWEST_NEW = 512  # spans, whose motifs take longer to compute than to write
_TIE_BREAK_S = 4.0  # takes start with random usage up to this, so that another seed gives another dance


def make_layers(
    request: DanceRequest,
    costs: Sequence[WeightedCost],
    ranks: NDArray[np.int8],
    goals: Sequence[SectionGoal],
) -> LayerSource:
    """The layers of every second: clips selected, warped onto the music, and labelled with motifs.

    `ranks` are `take_ranks`.
    """
    features, config, repertoire = request.song_features, request.config, request.repertoire
    of_form = [w.cost.returns for w in costs if isinstance(w.cost, FormCost) and w.weight]
    returns = of_form[0] if of_form else None
    candidates = candidate_clips(request, goals, costs, ranks, returns)
    used = np.unique(candidates)
    takes = _takes_of(repertoire, used)
    usage_column = np.zeros(len(repertoire.takes), np.int64)
    usage_column[takes] = np.arange(len(takes))
    clips = ClipTable(
        repertoire.clip_take,
        repertoire.clip_start_frame,
        usage_column,
        np.array([take.name for take in repertoire.takes]),
        np.array([take.credits.genre for take in repertoire.takes]),
        repertoire.clip_style,
        repertoire.clip_motion.step_ranks,
    )
    n_seconds = features.n_seconds
    joins_s = _joins_s(request)
    segments = warp_segments(
        candidates, features.density, features.beat_times_s,
        _clip_density(request), repertoire.clip_motion.speed, _clip_beats(repertoire, used),
        counted=_counted_clips(request, used, joins_s, returns), as_recorded=config.warping == "none",
        smoothed=config.time_maps == "smooth",
        report=substage(request.report, "warping"), memory=request.memory.of("segments", config.density),
    )  # fmt: skip
    motifs, n_motifs = None, 0
    of_motifs = AllowedNodes | Signature | MotifTransition
    if any(isinstance(w.cost, of_motifs) for w in costs) and repertoire.has_vocabulary:
        words_s = song_words_s(features)

        def labelled() -> NDArray[np.int16]:
            with cached_spans(repertoire) if config.cache else nullcontext(repertoire.span_motifs) as spans:
                return node_motifs(segments, clips, words_s, spans.motifs_of)

        motifs = request.memory.value(
            labelled,
            "node motifs", segments.inputs, segments.clip, words_s,
        )  # fmt: skip
        n_motifs = repertoire.vocabulary.n_motifs
    tie_break_s = _TIE_BREAK_S * np.random.default_rng(config.seed).random(len(repertoire.takes))[takes]
    return LayerSource(
        segments, clips, repertoire.clip_motion, tie_break_s=tie_break_s, motifs=motifs, n_motifs=n_motifs,
        goal_starts=[goal.first_second for goal in goals], join_times_s=joins_s,
        moments=returns.moments(n_seconds) if returns else None,
        returns=returns.returning(n_seconds) if returns else None,
        steer_rad=MAX_STEER_RAD if config.front == "audience" else 0.0,
        walk_at=WALK_AT if as_stage_m(config.stage) else (),
        may_dance=ranks == FIRST if (ranks != FIRST).any() and config.planner != "motion-graph" else None,
        memory=request.memory.of("layers"),
    )  # fmt: skip


@contextmanager
def cached_spans(repertoire: Repertoire, *, most_spans: int = _MOST_SPANS) -> Iterator[SpanMotifLookup]:
    """The motifs of spans of takes, with those of the user's cache, to which many new ones are added.

    None are written if there are more than `most_spans`.

    Most spans of two dances are the same. The key is that of the files' state, their motifs and the network.
    """
    spans, cache = repertoire.span_motifs, DiskCache.of_user("motifs", _MOST_SPAN_BYTES)
    net, embeddings = repertoire.word_net(), repertoire.vocabulary.motifs.embeddings
    files = [(str(path.resolve()), _state(path)) for path in repertoire.paths]
    key = digest(program(), "spans", files, embeddings, net.config, net.weights)
    known = cache.read(key)
    if known is not None:
        spans.add(*known)
    n_known = len(spans.known[0])
    yield spans
    if n_known + _FEWEST_NEW <= len(spans.known[0]) <= most_spans:
        cache.write(key, spans.known)


def _state(path: Path) -> tuple[int, int]:
    """The time of the last change of a file, and its size, or zeros if it is gone."""
    try:
        status = path.stat()
    except OSError:
        return 0, 0
    return status.st_mtime_ns, status.st_size


def _joins_s(request: DanceRequest) -> NDArray[np.float64]:
    """When takes may change around each second, (S + 5,)."""
    n_borders = request.song_features.n_seconds + SEGMENT_S + 1
    if request.config.transitions == "seconds":
        return np.arange(n_borders, dtype=np.float64)
    return join_times_s(request.song_features.counts, n_borders)


def song_grid(request: DanceRequest) -> SongGrid | None:
    """The grid of the beats on which takes are danced, or None if there are too few."""
    features, counts = request.song_features, request.material.counts
    return SongGrid.of(counts, features.duration_s, eased=counts is not features.counts)


def _counted_clips(
    request: DanceRequest,
    used: NDArray[np.int64],
    joins_s: NDArray[np.float64],
    returns: PhraseReturns | None,
) -> CountedClips | None:
    """The `used` clips of takes with counts, or None if there are none or counts are not used."""
    if request.config.warping != "counts":
        return None
    repertoire = request.repertoire
    song = song_grid(request)
    if song is None or not (repertoire.take_tempi.n_counts >= FEWEST_COUNTS).any():
        return None
    takes = _takes_of(repertoire, used)
    grids = request.memory.value(lambda: _take_grids(repertoire, takes), "take grids", takes)
    shifts = returns.shifts(len(joins_s), song) if returns else None
    return CountedClips.of(
        repertoire.clip_take, repertoire.clip_start_frame, grids, song, joins_s, shifts, used=used
    )


def _takes_of(repertoire: Repertoire, used: NDArray[np.int64]) -> NDArray[np.int64]:
    """The takes (M,) of the `used` clips, or all of them if there are few."""
    if len(repertoire.takes) <= _FEW_TAKES:
        return np.arange(len(repertoire.takes))
    return np.unique(repertoire.clip_take[used]).astype(np.int64)


def _take_grids(repertoire: Repertoire, takes: NDArray[np.int64]) -> TakeGrids:
    """The grids of these takes (M,), by the numbers that they have among all takes."""
    return TakeGrids(
        [repertoire.counts(take) for take in takes.tolist()],
        [repertoire.figures(take) for take in takes.tolist()],
        [repertoire.motion_beats_s(take) for take in takes.tolist()],
    ).among(takes, len(repertoire.takes))


def _clip_density(request: DanceRequest) -> Callable[[NDArray[np.integer]], NDArray[np.float32]]:
    """The tempo-densities (K, 160) of clips (K,), stored or estimated from each clip alone."""
    repertoire = request.repertoire
    if request.config.density != "clip":
        return repertoire.clip_motion.density
    from choreograph.nets.density import MotionDensity

    net = repertoire.net("motion_density")
    estimator = MotionDensity.from_arrays(net.weights, net.config)
    every = np.arange(repertoire.n_clips)
    densities = [
        estimator.clip_densities(repertoire.clip_motion.clip_pos_m(clips))
        for clips in np.array_split(every, -(-len(every) // _CLIPS_AT_ONCE))
    ]
    of_clip = np.concatenate(densities)  # (N, 160)
    return lambda clips: of_clip[clips]


def _clip_beats(repertoire: Repertoire, used: NDArray[np.int64]) -> ClipBeats:
    """The motion beats of the `used` clips (M,), in increasing order. Other clips have none."""
    takes, firsts = np.unique(repertoire.clip_take[used], return_index=True)
    ranges = np.zeros((repertoire.n_clips, 2), np.int64)
    frames, n_before = [], 0
    for take, clips in zip(takes.tolist(), np.split(used, firsts[1:]), strict=True):
        beats = repertoire.motion_beats_s(take) * NET_FPS
        starts = repertoire.clip_start_frame[clips]
        low, high = np.searchsorted(beats, [starts, starts + CLIP_FRAMES])
        ends = n_before + np.cumsum(high - low)
        ranges[clips, 0], ranges[clips, 1] = ends - (high - low), ends
        frames += [beats[i:j] - start for i, j, start in zip(low, high, starts, strict=True)]
        n_before = int(ends[-1])
    return ClipBeats(np.concatenate(frames), ranges)
