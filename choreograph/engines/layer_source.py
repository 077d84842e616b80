"""The graph of a dance: clips selected and warped for every second of the song."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from choreograph.engines.allowed_nodes import AllowedNodes
from choreograph.engines.base import DanceRequest
from choreograph.engines.clip_selection import candidate_clips
from choreograph.engines.section_goals import SectionGoal
from choreograph.features.phrasing import join_times_s
from choreograph.graph import (
    MOTIF_COSTS,
    ClipTable,
    LayerSource,
    WeightedCost,
    node_motifs,
    song_words_s,
)
from choreograph.motifs.span_motifs import SpanMotifLookup
from choreograph.progress import substage
from choreograph.repertoire import Repertoire
from choreograph.timebase import NET_FPS, SEGMENT_S
from choreograph.warping import ClipBeats, CountedClips, SongGrid, TakeGrids, warp_segments

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
        candidate_clips(request, goals, costs, allowed), features.density, features.beat_times_s,
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


def _clip_beats(repertoire: Repertoire) -> ClipBeats:
    beats = [repertoire.clip_motion_beats(clip) for clip in range(repertoire.n_clips)]
    stops = np.cumsum([len(b) for b in beats])
    starts = stops - [len(b) for b in beats]
    return ClipBeats(np.concatenate(beats), np.stack([starts, stops], axis=1))
