"""The takes that may be danced in each second, and the clips of them that are candidates."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.constraints import TakePin
from choreograph.choreography.engine import DanceRequest
from choreograph.choreography.genres import song_metre_at
from choreograph.choreography.graph.cost import Cost, WeightedCost
from choreograph.choreography.graph.costs import Energy, StepsCost
from choreograph.choreography.graph.layers import Layer, PhraseReturns
from choreograph.choreography.graph.motif_costs import Signature, words_between
from choreograph.choreography.material import SectionGoal
from choreograph.choreography.selection import (
    ClipPriorities,
    clip_signature_mismatch,
    draw_clips,
    energy_mismatch,
    select_clips,
    steps_mismatch,
)
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import AnyFloats, AnyInts
from choreograph.core.timebase import NET_FPS, SEGMENT_S, frames_to_seconds
from choreograph.music.count_grids import REACH_S
from choreograph.music.song_features import SongFeatures

FIRST, IF_TOO_FEW, NEVER = 0, 1, 2  # ranks of `take_ranks`

_OTHER_GENRE = 20.0  # per second, more than differences of other costs, but less than a user's cost may be


class AllowedNodes(Cost):
    """Infinite for nodes that a request excludes, high for nodes of another genre than the likely one."""

    name = "constraints"
    sentence = "The take is not of the genre that is likely here."

    def __init__(
        self, of_take: AnyFloats, motif_banned: NDArray[np.bool_], beside_pins: AnyFloats | None = None
    ) -> None:
        self.of_take = of_take  # (S, takes) cost of each take in each second
        self.beside_pins = of_take if beside_pins is None else beside_pins  # the same without pins
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
        pins = _pinned_seconds(constraints.requested.take_pins, n_seconds)
        beside_pins = cost.copy() if pins else cost
        for second, pin in pins.items():
            take = repertoire.take_index(pin.take)
            if not (repertoire.clip_take == take).any():
                raise ParameterError(
                    f"expected pins of takes of 8 s or more, the length of a clip, got {pin}"
                )
            cost[second] = np.where(np.arange(len(allowed)) == take, 0.0, np.inf)
        if not cost[:, with_clips].any() and not constraints.motif_banned.any():
            return None
        return cls(cost, constraints.motif_banned, beside_pins)

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


_FEWEST_OF_METRE = 64  # clips of the music's metre without which others are selected beside them
_SHARE_OF_METRE = 0.75  # of the seconds of a part that have its metre, at least
_SURE_OF_METRE = 0.5  # confidence of the counts


def take_ranks(
    request: DanceRequest,
    goals: Sequence[SectionGoal],
    allowed: AllowedNodes | None,
    *,
    of_music_alone: bool,
) -> NDArray[np.int8]:
    """In what order takes (S, takes) are selected from: `FIRST`, `IF_TOO_FEW`, or `NEVER` and above.

    With `of_music_alone`, takes of another genre than the likely one, and of another metre than that of the
    part of the song, are selected only if there are too few others. The cost of another genre is so high
    that it is hardly ever danced. Takes that are excluded by a pin keep their order, because a session has
    already warped them.
    """

    def ranked(cost: AnyFloats) -> NDArray[np.int8]:
        ranks = np.full(cost.shape, FIRST, np.int8)
        ranks[cost > 0] = IF_TOO_FEW if of_music_alone else FIRST
        ranks[np.isinf(cost)] = NEVER
        return ranks

    if allowed is None:
        ranks = np.full((request.song_features.n_seconds, len(request.repertoire.takes)), FIRST, np.int8)
    else:
        ranks = ranked(allowed.of_take)
        never = ranks == NEVER
        ranks[never] += ranked(allowed.beside_pins)[never]
    if of_music_alone:
        ranks[_of_other_metre(request, goals, ranks == FIRST)] = IF_TOO_FEW
    return ranks


def _of_other_metre(request: DanceRequest, goals: Sequence[SectionGoal], first: Mask) -> Mask:
    """The takes (S, takes) among the `first` ones that are of another metre than the part of the song.

    None are where the metre of the music changes or is not sure, nor where there are too few clips of it.
    """
    repertoire, n_seconds = request.repertoire, request.song_features.n_seconds
    is_other = np.zeros(first.shape, bool)
    counts = request.material.counts
    if request.config.warping != "counts" or counts.confidence < _SURE_OF_METRE:
        return is_other
    metre_at = song_metre_at(replace(request.song_features, counts=counts))
    n_clips = np.bincount(repertoire.clip_take, minlength=first.shape[1])  # (takes,)
    starts = [goal.first_second for goal in goals] or [0]
    for start, stop in zip(starts, [*starts[1:], n_seconds], strict=True):
        metres, seconds = np.unique(metre_at[start:stop], return_counts=True)
        if (
            not len(metres)
            or metres[seconds.argmax()] == 0
            or seconds.max() < _SHARE_OF_METRE * seconds.sum()
        ):
            continue
        of_metre = np.isin(repertoire.take_tempi.metre, (0, metres[seconds.argmax()]))
        enough = (first[start:stop] & of_metre) @ n_clips >= _FEWEST_OF_METRE
        is_other[start:stop] = first[start:stop] & ~of_metre & enough[:, None]
    return is_other


def candidate_clips(
    request: DanceRequest,
    goals: Sequence[SectionGoal],
    costs: Sequence[WeightedCost],
    ranks: NDArray[np.int8],
    returns: PhraseReturns | None,
) -> NDArray[np.int64]:
    """The candidates of each second, (S, K). Where music returns, they are those of its first time.

    `ranks` are `take_ranks`.
    """
    of_clip = request.repertoire.clip_take

    def rank(second: int) -> AnyInts:
        of_second: AnyInts = ranks[second, of_clip]
        return of_second

    if request.config.selection == "style":
        chosen = _nearest_in_style(request, goals, costs, rank)
    else:
        chosen = _drawn(request, goals, ranks, rank)
    if returns is not None:
        firsts_s = [goal.first_second for goal in goals]
        goal_at = np.searchsorted(firsts_s, np.arange(len(chosen)), "right")
        for second, first in enumerate(returns.first_seconds(len(chosen))):
            if goal_at[second] == goal_at[first] and np.array_equal(rank(second), rank(first)):
                chosen[second] = chosen[first]
    return chosen


def _drawn(
    request: DanceRequest,
    goals: Sequence[SectionGoal],
    ranks: NDArray[np.int8],
    rank: Callable[[int], AnyInts],
) -> NDArray[np.int64]:
    """Random clips. With selection by genre, at least half are of the music's genre and metre."""
    config, repertoire, n_seconds = request.config, request.repertoire, request.song_features.n_seconds
    rng = np.random.default_rng(config.seed)
    drawn = draw_clips(
        ClipPriorities(repertoire.clip_take, n_seconds, rng), n_seconds,
        candidates=_n_candidates(request, goals, ranks), rank=rank,
        suits=_suits(request, goals) if config.selection == "genre" else None,
    )  # fmt: skip
    return np.sort(drawn, axis=1)  # the same for every seed if all are drawn


def _n_candidates(request: DanceRequest, goals: Sequence[SectionGoal], ranks: NDArray[np.int8]) -> int:
    """The number of candidates K: not more than may be danced, and half if all of them are of the genre."""
    wanted = request.config.candidates
    # Whether each goal is a genre, without whose takes there are others, and these are not selected.
    alone = [
        goal.genre is not None and not goal.takes.all()
        and bool((ranks[goal.first_second, ~goal.takes] != FIRST).all())
        for goal in goals
    ]  # fmt: skip
    if request.config.selection == "genre" and alone and all(alone):
        wanted = -(-wanted // 2)  # the others would be of other genres
    n_clips = np.bincount(request.repertoire.clip_take, minlength=ranks.shape[1])  # (takes,)
    most = int(((ranks == FIRST) @ n_clips).max())
    return min(wanted, max(1, most))


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
    rank: Callable[[int], AnyInts],
) -> NDArray[np.int64]:
    """The clips with the least style loss (the paper's selection) and mismatch with other requests."""
    features, config, repertoire = request.song_features, request.config, request.repertoire
    mismatch = _signature_mismatch(request, goals, costs)
    other_metre = _other_metre(request)
    effort = _effort_mismatch(request, costs)

    def penalty(second: int) -> AnyFloats:
        loss = mismatch[second] + _OTHER_METRE * other_metre[second] + effort(second)
        return np.where(rank(second) >= NEVER, np.inf, loss)

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
    energy, steps = (_EFFORT * (weights.get(cost, 0.0) > 0) for cost in (Energy, StepsCost))

    def mismatch(second: int) -> AnyFloats:
        louder = float(features.energy[second : second + SEGMENT_S].mean() - features.energy.mean())
        density = float(features.onset_density[second])
        return energy * energy_mismatch(louder, repertoire.clip_motion.liveliness_ranks) + (
            steps * steps_mismatch(density, repertoire.clip_motion.step_ranks)
        )

    return mismatch
