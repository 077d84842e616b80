"""The graph of a dance: clips selected and warped for every second of the song."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from choreograph.constraints.likely_genre import song_metre_at
from choreograph.engines.allowed_nodes import AllowedNodes
from choreograph.engines.base import DanceRequest
from choreograph.engines.section_goals import SectionGoal
from choreograph.features.phrasing import join_times_s
from choreograph.graph import (
    MOTIF_COSTS,
    ClipTable,
    Energy,
    LayerSource,
    Signature,
    Steps,
    WeightedCost,
    node_motifs,
    song_words_s,
    words_between,
)
from choreograph.motifs.span_motifs import SpanMotifLookup
from choreograph.progress import substage
from choreograph.repertoire import Repertoire
from choreograph.selection import clip_signature_mismatch, energy_mismatch, select_clips, steps_mismatch
from choreograph.timebase import NET_FPS, SEGMENT_S, frames_to_seconds
from choreograph.warping import ClipBeats, CountedClips, SongGrid, TakeGrids, warp_segments

_RANDOM_LOSS = 1e6  # above any style loss: with a random share of it added, style does not count
_OTHER_METRE = 2.0  # style loss added to clips of another metre than the song's
_FEEL = 0.5  # style loss of the quietest clip where the song is loudest; genres are 1 or more apart
_TIE_BREAK_S = 4.0  # takes start with up to so much usage, by the seed: another seed, another dance


def make_layers(
    request: DanceRequest,
    costs: Sequence[WeightedCost],
    allowed: AllowedNodes | None,
    goals: Sequence[SectionGoal],
) -> LayerSource:
    """The layers of every second: clips selected, warped onto the music, and labelled with motifs."""
    features, config, repertoire = request.song_features, request.config, request.repertoire
    clips = ClipTable(
        repertoire.clip_take,
        repertoire.clip_start_frame,
        np.array([take.name for take in repertoire.takes]),
        np.array([take.credits.genre for take in repertoire.takes]),
        repertoire.clip_style,
        repertoire.clip_motion.step_ranks,
    )
    joins_s = _joins_s(request)
    segments = warp_segments(
        _select(request, goals, costs, allowed), features.density, features.beat_times_s,
        repertoire.clip_motion.density, repertoire.clip_motion.speed, _clip_beats(repertoire),
        counted=_counted_clips(request, joins_s), as_recorded=config.warping == "none",
        smoothed=config.time_maps == "smooth",
        report=substage(request.report, "warping"),
    )  # fmt: skip
    motifs, n_motifs = None, 0
    if any(isinstance(w.cost, (AllowedNodes, *MOTIF_COSTS)) for w in costs) and repertoire.has_vocabulary:
        vocabulary = repertoire.vocabulary
        lookup = SpanMotifLookup(
            repertoire.body_pos_m, NET_FPS, repertoire.word_net().embed, vocabulary.motifs
        )
        motifs = node_motifs(segments, clips, song_words_s(features), lookup.motifs_of)
        n_motifs = vocabulary.n_motifs
    tie_break_s = _TIE_BREAK_S * np.random.default_rng(config.seed).random(len(repertoire.takes))
    return LayerSource(
        segments, clips, repertoire.clip_motion, tie_break_s=tie_break_s, motifs=motifs, n_motifs=n_motifs,
        goal_starts=[goal.first_second for goal in goals], join_times_s=joins_s,
    )  # fmt: skip


def _joins_s(request: DanceRequest) -> NDArray[np.float64]:
    """Where takes may change around each second, (S + 5,)."""
    n_borders = request.song_features.n_seconds + SEGMENT_S + 1
    if request.config.transitions == "seconds":
        return np.arange(n_borders, dtype=np.float64)
    return join_times_s(request.song_features.counts, n_borders)


def _counted_clips(request: DanceRequest, joins_s: NDArray[np.float64]) -> CountedClips | None:
    """The clips of takes with counts; None if there are none, or counts are not to be used."""
    if request.config.warping != "counts":
        return None
    repertoire = request.repertoire
    takes = range(len(repertoire.takes))
    grids = TakeGrids(
        [repertoire.counts(take) for take in takes],
        [repertoire.figures(take) for take in takes],
        [repertoire.motion_beats_s(take) for take in takes],
    )
    song = SongGrid.of(request.song_features.counts, request.song_features.duration_s)
    if song is None or not grids.counted.any():
        return None
    return CountedClips.of(repertoire.clip_take, repertoire.clip_start_frame, grids, song, joins_s)


def _select(
    request: DanceRequest,
    goals: Sequence[SectionGoal],
    costs: Sequence[WeightedCost],
    allowed: AllowedNodes | None,
) -> NDArray[np.int64]:
    """The candidates of each second (S, K)."""
    features, config, repertoire = request.song_features, request.config, request.repertoire
    mismatch = _signature_mismatch(request, goals, costs)
    other_metre = _other_metre(request)
    feel = _feel_mismatch(request, costs)

    def penalty(second: int) -> NDArray[np.floating]:
        may_dance = True if allowed is None else allowed.takes[second, repertoire.clip_take]
        random_loss = np.zeros(repertoire.n_clips)
        if config.selection == "random":
            rng = np.random.default_rng([config.seed, second])
            random_loss = _RANDOM_LOSS * rng.random(repertoire.n_clips)
        return np.where(
            may_dance, mismatch[second] + random_loss + other_metre[second] + feel(second), np.inf
        )

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
    """What is added to the loss of clips (N,) whose take has not the metre of each second."""
    repertoire, features = request.repertoire, request.song_features
    metre = np.array([repertoire.counts(take).metre for take in range(len(repertoire.takes))])
    of_clip = metre[repertoire.clip_take]
    confidence = features.counts.confidence if request.config.warping == "counts" else 0.0
    metre_at = song_metre_at(features)
    added = {
        of_song: _OTHER_METRE * confidence * ((of_clip > 0) & (of_song > 0) & (of_clip != of_song))
        for of_song in np.unique(metre_at)
    }
    return [added[of_song] for of_song in metre_at]


def _feel_mismatch(
    request: DanceRequest, costs: Sequence[WeightedCost]
) -> Callable[[int], NDArray[np.floating]]:
    """How far each clip (N,) is from a second in energy and in density of steps, as far as these matter."""
    repertoire, features = request.repertoire, request.song_features
    weights = {type(w.cost): w.weight for w in costs}
    energy, steps = (_FEEL * (weights.get(cost, 0.0) > 0) for cost in (Energy, Steps))

    def mismatch(second: int) -> NDArray[np.floating]:
        louder = float(features.energy[second : second + SEGMENT_S].mean() - features.energy.mean())
        density = float(features.onset_density[second])
        return energy * energy_mismatch(louder, repertoire.clip_motion.liveliness_ranks) + (
            steps * steps_mismatch(density, repertoire.clip_motion.step_ranks)
        )

    return mismatch


def _clip_beats(repertoire: Repertoire) -> ClipBeats:
    beats = [repertoire.clip_motion_beats(clip) for clip in range(repertoire.n_clips)]
    stops = np.cumsum([len(b) for b in beats])
    starts = stops - [len(b) for b in beats]
    return ClipBeats(np.concatenate(beats), np.stack([starts, stops], axis=1))
