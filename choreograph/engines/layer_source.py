"""The graph of a dance: clips selected and warped for every second of the song."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from choreograph.engines.allowed_nodes import AllowedNodes
from choreograph.engines.base import DanceRequest
from choreograph.graph import (
    MOTIF_COSTS,
    ClipTable,
    LayerSource,
    Signature,
    WeightedCost,
    node_motifs,
    song_words_s,
)
from choreograph.motifs.span_motifs import SpanMotifLookup
from choreograph.progress import substage
from choreograph.repertoire import Repertoire
from choreograph.selection import clip_signature_mismatch, select_clips
from choreograph.timebase import NET_FPS, frames_to_seconds
from choreograph.warping import ClipBeats, warp_segments

_RANDOM_LOSS = 1e6  # above any style loss: with a random share of it added, style does not count
_TIE_BREAK_S = 4.0  # takes start with up to so much usage, by the seed: another seed, another dance


def make_layers(
    request: DanceRequest, costs: Sequence[WeightedCost], allowed: AllowedNodes | None
) -> LayerSource:
    """The layers of every second: clips selected, warped onto the music, and labelled with motifs."""
    features, config, repertoire = request.song_features, request.config, request.repertoire
    clips = ClipTable(
        repertoire.clip_take,
        repertoire.clip_start_frame,
        np.array([take.name for take in repertoire.takes]),
        np.array([take.credits.genre for take in repertoire.takes]),
        repertoire.clip_style,
    )
    segments = warp_segments(
        _select(request, costs, allowed), features.density, features.beat_times_s, repertoire.clip_density,
        repertoire.clip_speed, _clip_beats(repertoire), as_recorded=config.warping == "none",
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
        segments, clips, repertoire, tie_break_s=tie_break_s, motifs=motifs, n_motifs=n_motifs
    )  # fmt: skip


def _select(
    request: DanceRequest, costs: Sequence[WeightedCost], allowed: AllowedNodes | None
) -> NDArray[np.int64]:
    """The candidates of each second (S, K)."""
    features, config, repertoire = request.song_features, request.config, request.repertoire
    mismatch = _signature_mismatch(request, costs)

    def penalty(second: int) -> NDArray[np.floating]:
        may_dance = True if allowed is None else allowed.takes[second, repertoire.clip_take]
        random_loss = np.zeros(repertoire.n_clips)
        if config.selection == "random":
            rng = np.random.default_rng([config.seed, second])
            random_loss = _RANDOM_LOSS * rng.random(repertoire.n_clips)
        return np.where(may_dance, mismatch + random_loss, np.inf)

    return select_clips(
        features.style, features.beat_count, repertoire.clip_style, repertoire.clip_beat_count,
        candidates=config.candidates, beat_weight=repertoire.selection_beat_weight, penalty=penalty,
    )  # fmt: skip


def _signature_mismatch(request: DanceRequest, costs: Sequence[WeightedCost]) -> NDArray[np.float64]:
    """How little of each clip (N,) the requested signature wants; 0 without a signature."""
    repertoire = request.repertoire
    mismatch = np.zeros(repertoire.n_clips)
    for w in costs:
        if isinstance(w.cost, Signature) and w.weight != 0:
            mismatch += w.weight * clip_signature_mismatch(
                repertoire.vocabulary,
                w.cost.goal.signature,
                repertoire.clip_take,
                frames_to_seconds(repertoire.clip_start_frame, NET_FPS),
                n_words=len(song_words_s(request.song_features)) - 1,
            )
    return mismatch


def _clip_beats(repertoire: Repertoire) -> ClipBeats:
    beats = [repertoire.clip_motion_beats(clip) for clip in range(repertoire.n_clips)]
    stops = np.cumsum([len(b) for b in beats])
    starts = stops - [len(b) for b in beats]
    return ClipBeats(np.concatenate(beats), np.stack([starts, stops], axis=1))
