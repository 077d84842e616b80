"""Which clips of the repertoire take part in the graph of a dance, second by second."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from choreograph.constraints.likely_genre import song_metre_at
from choreograph.engines.allowed_nodes import AllowedNodes
from choreograph.engines.base import DanceRequest
from choreograph.engines.section_goals import SectionGoal
from choreograph.graph import Energy, Signature, Steps, WeightedCost, words_between
from choreograph.selection import (
    Alignments,
    clip_signature_mismatch,
    draw_clips,
    energy_mismatch,
    select_clips,
    steps_mismatch,
)
from choreograph.timebase import NET_FPS, SEGMENT_S, frames_to_seconds

_OTHER_METRE = 2.0  # style loss added to clips of another metre than the song's
_FEEL = 0.5  # style loss of the quietest clip where the song is loudest; genres are 1 or more apart

Floats = NDArray[np.floating]
Mask = NDArray[np.bool_]


def candidate_clips(
    request: DanceRequest,
    goals: Sequence[SectionGoal],
    costs: Sequence[WeightedCost],
    allowed: AllowedNodes | None,
) -> NDArray[np.int64]:
    """The clips that take part in each second, (S, K)."""
    repertoire = request.repertoire

    def may_dance(second: int) -> Mask:
        if allowed is None:
            return np.ones(repertoire.n_clips, bool)
        return allowed.takes[second, repertoire.clip_take]

    if request.config.selection == "style":
        return _nearest_in_style(request, goals, costs, may_dance)
    return _drawn(request, goals, may_dance)


def _drawn(
    request: DanceRequest, goals: Sequence[SectionGoal], may_dance: Callable[[int], Mask]
) -> NDArray[np.int64]:
    """Clips drawn at random; with selection by genre at least half are of the music's genre and metre."""
    config, repertoire, n_seconds = request.config, request.repertoire, request.song_features.n_seconds
    rng = np.random.default_rng(config.seed)
    return draw_clips(
        Alignments(repertoire.clip_take, n_seconds, rng), n_seconds,
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
        return same_metre if genre is None else same_metre & (genre_of_clip == genre)

    return suits


def _nearest_in_style(
    request: DanceRequest,
    goals: Sequence[SectionGoal],
    costs: Sequence[WeightedCost],
    may_dance: Callable[[int], Mask],
) -> NDArray[np.int64]:
    """The clips of the least style loss (the paper's selection), and of what else is asked for."""
    features, config, repertoire = request.song_features, request.config, request.repertoire
    mismatch = _signature_mismatch(request, goals, costs)
    other_metre = _other_metre(request)
    feel = _feel_mismatch(request, costs)

    def penalty(second: int) -> Floats:
        loss = mismatch[second] + _OTHER_METRE * other_metre[second] + feel(second)
        return np.where(may_dance(second), loss, np.inf)

    return select_clips(
        features.style, features.beat_count, repertoire.clip_style, repertoire.clip_beat_count,
        candidates=config.candidates, beat_weight=repertoire.selection_beat_weight, penalty=penalty,
    )  # fmt: skip


def _signature_mismatch(
    request: DanceRequest, goals: Sequence[SectionGoal], costs: Sequence[WeightedCost]
) -> list[NDArray[np.float64]]:
    """How little of each clip (N,) the signature of each second's goal wants; 0 without a signature."""
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
    """How surely each clip (N,) is of another metre than each second of the song, 0 to 1."""
    repertoire, features = request.repertoire, request.song_features
    metre = np.array([repertoire.counts(take).metre for take in range(len(repertoire.takes))])
    of_clip = metre[repertoire.clip_take]
    confidence = features.counts.confidence if request.config.warping == "counts" else 0.0
    metre_at = song_metre_at(features)
    other = {
        of_song: confidence * ((of_clip > 0) & (of_song > 0) & (of_clip != of_song))
        for of_song in np.unique(metre_at)
    }
    return [other[of_song] for of_song in metre_at]


def _feel_mismatch(request: DanceRequest, costs: Sequence[WeightedCost]) -> Callable[[int], Floats]:
    """How far each clip (N,) is from a second in energy and in density of steps, as far as these matter."""
    repertoire, features = request.repertoire, request.song_features
    weights = {type(w.cost): w.weight for w in costs}
    energy, steps = (_FEEL * (weights.get(cost, 0.0) > 0) for cost in (Energy, Steps))

    def mismatch(second: int) -> Floats:
        louder = float(features.energy[second : second + SEGMENT_S].mean() - features.energy.mean())
        density = float(features.onset_density[second])
        return energy * energy_mismatch(louder, repertoire.clip_motion.liveliness_ranks) + (
            steps * steps_mismatch(density, repertoire.clip_motion.step_ranks)
        )

    return mismatch
