"""The graph of a dance: clips selected, allowed and warped for every second of the song."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.constraints import TakePin
from choreograph.choreography.engine import DanceRequest
from choreograph.choreography.genres import song_metre_at
from choreograph.choreography.graph.cost import Cost, WeightedCost
from choreograph.choreography.graph.costs import Energy, Steps
from choreograph.choreography.graph.layers import Layer
from choreograph.choreography.graph.motif_costs import (
    MOTIF_COSTS,
    Signature,
    node_motifs,
    song_words_s,
    words_between,
)
from choreograph.choreography.graph.returns import WALK_AT, FormCost, Returns
from choreograph.choreography.graph.segments import ClipBeats, ClipTable, LayerSource, warp_segments
from choreograph.choreography.graph.warping import CountedClips
from choreograph.choreography.kept_analysis import kept_spans
from choreograph.choreography.material import SectionGoal
from choreograph.choreography.selection import (
    ClipPriorities,
    clip_signature_mismatch,
    draw_clips,
    energy_mismatch,
    select_clips,
    steps_mismatch,
)
from choreograph.core.arguments import as_stage_m
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import AnyFloats
from choreograph.core.progress import substage
from choreograph.core.timebase import CLIP_FRAMES, NET_FPS, SEGMENT_S, frames_to_seconds
from choreograph.library.repertoire import Repertoire
from choreograph.music.count_grids import FEWEST_COUNTS, SongGrid, TakeGrids
from choreograph.music.danced_span import REACH_S, join_times_s
from choreograph.music.song_features import SongFeatures
from choreograph.render.runs import MAX_STEER_RAD

_OTHER_GENRE = 20.0  # per second, more than differences of other costs, but less than a user's cost may be


class AllowedNodes(Cost):
    """Infinite for nodes that a request excludes, high for nodes of another genre than the likely one."""

    name = "constraints"

    def __init__(self, of_take: AnyFloats, motif_banned: NDArray[np.bool_]) -> None:
        self.of_take = of_take  # (S, takes) cost of each take in each second
        self.motif_banned = np.append(motif_banned, False)  # (K + 1,) the last one for no motif: index -1

    @classmethod
    def of(cls, request: DanceRequest, goals: Sequence[SectionGoal]) -> AllowedNodes | None:
        """The cost for a dance whose parts have these goals, or None if nothing is excluded.

        Raises `ParameterError` if two pinned takes share a second, or a pinned take has no clip.
        """
        constraints, repertoire = request.constraints, request.repertoire
        n_seconds = request.song_features.n_seconds
        allowed = constraints.take_allowed
        cost = np.tile(np.where(allowed, 0.0, np.inf), (n_seconds, 1))
        with_clips = np.isin(np.arange(len(allowed)), repertoire.clip_take)
        for goal in goals:
            others = allowed & ~goal.takes_among(allowed & with_clips)
            cost[goal.first_second :] = np.where(allowed, 0.0, np.inf)
            cost[goal.first_second :, others] = np.inf if goal.requested else _OTHER_GENRE
        for second, pin in _pinned_seconds(constraints.requested.take_pins, n_seconds).items():
            take = repertoire.take_index(pin.take)
            if not (repertoire.clip_take == take).any():
                raise ParameterError(
                    f"expected pins of takes of 8 s or more, the length of a clip, got {pin}"
                )
            cost[second] = np.where(np.arange(len(allowed)) == take, 0.0, np.inf)
        if not cost[:, with_clips].any() and not constraints.motif_banned.any():
            return None
        return cls(cost, constraints.motif_banned)

    def node(self, layer: Layer, song_features: SongFeatures) -> NDArray[np.floating]:
        banned = self.motif_banned[layer.motifs].any(axis=1)
        return np.where(banned, np.inf, self.of_take[layer.second, layer.take])


def _pinned_seconds(pins: tuple[TakePin, ...], n_seconds: int) -> dict[int, TakePin]:
    """The pin of each pinned second."""
    owner: dict[int, TakePin] = {}
    for pin in pins:
        for second in range(int(pin.start_s), int(np.ceil(pin.end_s))):
            other = owner.setdefault(second, pin)
            if other.take != pin.take:
                raise ParameterError(
                    "expected one pinned take in a second, since the graph engine dances whole ones, but "
                    f"{other} and {pin} share second {second}: move one, or use the mixer"
                )
    # Transitions move to beats. Another take in the seconds beside a pin would extend into it.
    for pin in pins:
        for second in (int(pin.start_s - REACH_S), int(pin.end_s + REACH_S)):
            if 0 <= second < n_seconds:
                owner.setdefault(second, pin)
    return owner


# The clips of the repertoire that are candidates in each second of a dance.


_OTHER_METRE = 2.0  # style loss added to clips of another metre than the song's
_EFFORT = 0.5  # style loss of the quietest clip where the song is loudest. Genres are 1 or more apart

Mask = NDArray[np.bool_]


def candidate_clips(
    request: DanceRequest,
    goals: Sequence[SectionGoal],
    costs: Sequence[WeightedCost],
    allowed: AllowedNodes | None,
    returns: Returns | None,
) -> NDArray[np.int64]:
    """The candidates of each second, (S, K). Where music returns, they are those of its first time."""
    repertoire = request.repertoire

    def may_dance(second: int) -> Mask:
        if allowed is None:
            return np.ones(repertoire.n_clips, bool)
        allowed_here: Mask = np.isfinite(allowed.of_take[second, repertoire.clip_take])
        return allowed_here

    if request.config.selection == "style":
        chosen = _nearest_in_style(request, goals, costs, may_dance)
    else:
        chosen = _drawn(request, goals, may_dance)
    if returns is not None:
        firsts_s = [goal.first_second for goal in goals]
        goal_at = np.searchsorted(firsts_s, np.arange(len(chosen)), "right")
        for second, first in enumerate(returns.first_seconds(len(chosen))):
            same_request = np.array_equal(may_dance(second), may_dance(first))
            if goal_at[second] == goal_at[first] and same_request:
                chosen[second] = chosen[first]
    return chosen


def _drawn(
    request: DanceRequest, goals: Sequence[SectionGoal], may_dance: Callable[[int], Mask]
) -> NDArray[np.int64]:
    """Random clips. With selection by genre, at least half are of the music's genre and metre."""
    config, repertoire, n_seconds = request.config, request.repertoire, request.song_features.n_seconds
    rng = np.random.default_rng(config.seed)
    return draw_clips(
        ClipPriorities(repertoire.clip_take, n_seconds, rng), n_seconds,
        candidates=config.candidates, may_dance=may_dance,
        suits=_suits(request, goals) if config.selection == "genre" else None,
    )  # fmt: skip


def _suits(request: DanceRequest, goals: Sequence[SectionGoal]) -> Callable[[int], Mask]:
    """Which clips (N,) are of the metre of a second, and of the genre of its goal if it has one."""
    repertoire = request.repertoire
    genre_of_clip = np.array([take.credits.genre for take in repertoire.takes])[repertoire.clip_take]
    other_metre = _other_metre(request)
    genres: list[str | None] = [None] * request.song_features.n_seconds
    for goal in goals:
        genres[goal.first_second :] = [goal.genre] * (len(genres) - goal.first_second)

    def suits(second: int) -> Mask:
        same_metre, genre = other_metre[second] == 0, genres[second]
        suited: Mask = same_metre if genre is None else same_metre & (genre_of_clip == genre)
        return suited

    return suits


def _nearest_in_style(
    request: DanceRequest,
    goals: Sequence[SectionGoal],
    costs: Sequence[WeightedCost],
    may_dance: Callable[[int], Mask],
) -> NDArray[np.int64]:
    """The clips with the least style loss (the paper's selection) and mismatch with other requests."""
    features, config, repertoire = request.song_features, request.config, request.repertoire
    mismatch = _signature_mismatch(request, goals, costs)
    other_metre = _other_metre(request)
    effort = _effort_mismatch(request, costs)

    def penalty(second: int) -> AnyFloats:
        loss = mismatch[second] + _OTHER_METRE * other_metre[second] + effort(second)
        return np.where(may_dance(second), loss, np.inf)

    return select_clips(
        features.style, features.beat_count, repertoire.clip_style, repertoire.clip_beat_count,
        candidates=config.candidates, beat_weight=repertoire.selection_beat_weight, penalty=penalty,
    )  # fmt: skip


def _signature_mismatch(
    request: DanceRequest, goals: Sequence[SectionGoal], costs: Sequence[WeightedCost]
) -> list[NDArray[np.float64]]:
    """Mismatch of each clip (N,) with the signature of each second's goal, 0 without a signature."""
    repertoire, n_seconds = request.repertoire, request.song_features.n_seconds
    weight = sum(w.weight for w in costs if isinstance(w.cost, Signature))
    mismatch = [np.zeros(repertoire.n_clips)] * n_seconds
    if weight == 0:
        return mismatch
    for goal, stop in zip(goals, [*(g.first_second for g in goals[1:]), n_seconds], strict=True):
        of_goal = weight * clip_signature_mismatch(
            repertoire.vocabulary,
            goal.goal.signature,
            repertoire.clip_take,
            frames_to_seconds(repertoire.clip_start_frame, NET_FPS),
            n_words=max(1, words_between(request.song_features, goal.first_second, stop)),
        )
        mismatch[goal.first_second : stop] = [of_goal] * (stop - goal.first_second)
    return mismatch


def _other_metre(request: DanceRequest) -> list[NDArray[np.float64]]:
    """Confidence, 0 to 1, that each clip (N,) is of another metre than each second of the song."""
    repertoire = request.repertoire
    features = replace(request.song_features, counts=request.material.counts)
    of_clip = repertoire.take_tempi.metre[repertoire.clip_take]
    confidence = features.counts.confidence if request.config.warping == "counts" else 0.0
    metre_at = song_metre_at(features)
    other = {
        of_song: confidence * ((of_clip > 0) & (of_song > 0) & (of_clip != of_song))
        for of_song in np.unique(metre_at)
    }
    return [other[of_song] for of_song in metre_at]


def _effort_mismatch(request: DanceRequest, costs: Sequence[WeightedCost]) -> Callable[[int], AnyFloats]:
    """Mismatch of each clip (N,) with a second in energy and in density of steps, if they have weights."""
    repertoire, features = request.repertoire, request.song_features
    weights = {type(w.cost): w.weight for w in costs}
    energy, steps = (_EFFORT * (weights.get(cost, 0.0) > 0) for cost in (Energy, Steps))

    def mismatch(second: int) -> AnyFloats:
        louder = float(features.energy[second : second + SEGMENT_S].mean() - features.energy.mean())
        density = float(features.onset_density[second])
        return energy * energy_mismatch(louder, repertoire.clip_motion.liveliness_ranks) + (
            steps * steps_mismatch(density, repertoire.clip_motion.step_ranks)
        )

    return mismatch


_FEW_TAKES = 512  # of which all have grids and usage, so that the dances of a session have the same
_CLIPS_AT_ONCE = 1024  # 220 MB of positions
_TIE_BREAK_S = 4.0  # takes start with random usage up to this, so that another seed gives another dance


def make_layers(
    request: DanceRequest,
    costs: Sequence[WeightedCost],
    allowed: AllowedNodes | None,
    goals: Sequence[SectionGoal],
) -> LayerSource:
    """The layers of every second: clips selected, warped onto the music, and labelled with motifs."""
    features, config, repertoire = request.song_features, request.config, request.repertoire
    of_form = [w.cost.returns for w in costs if isinstance(w.cost, FormCost) and w.weight]
    returns = of_form[0] if of_form else None
    candidates = candidate_clips(request, goals, costs, allowed, returns)
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
    if any(isinstance(w.cost, (AllowedNodes, *MOTIF_COSTS)) for w in costs) and repertoire.has_vocabulary:
        words_s = song_words_s(features)

        def labelled() -> NDArray[np.int16]:
            with kept_spans(repertoire, keep=config.cache) as spans:
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
        may_dance=np.isfinite(allowed.of_take) if allowed and config.planner != "motion-graph" else None,
        memory=request.memory.of("layers"),
    )  # fmt: skip


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
    request: DanceRequest, used: NDArray[np.int64], joins_s: NDArray[np.float64], returns: Returns | None
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
