"""The graph of a dance: candidates warped and labelled for every second of the song."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.engine import DanceRequest
from choreograph.choreography.graph.candidates import FIRST, AllowedNodes, candidate_clips
from choreograph.choreography.graph.cost import WeightedCost
from choreograph.choreography.graph.motif_costs import MotifTransition, Signature, node_motifs, song_words_s
from choreograph.choreography.graph.path_costs import WALK_AT, FormCost
from choreograph.choreography.graph.phrase_returns import PhraseReturns
from choreograph.choreography.graph.segments import ClipTable, LayerSource
from choreograph.choreography.graph.warped_segments import ClipBeats, warp_segments
from choreograph.choreography.graph.warping import CountedClips
from choreograph.choreography.material import SectionGoal
from choreograph.core.arguments import as_stage_m
from choreograph.core.cache import DiskCache, digest, program
from choreograph.core.progress import substage
from choreograph.core.timebase import CLIP_FRAMES, NET_FPS, SEGMENT_S
from choreograph.library.repertoire import Repertoire
from choreograph.library.vocabulary import SpanMotifLookup
from choreograph.music.count_grids import FEWEST_COUNTS, SongGrid, TakeGrids
from choreograph.music.danced_span import join_times_s
from choreograph.plan.joins import MAX_STEER_RAD

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
def cached_spans(repertoire: Repertoire) -> Iterator[SpanMotifLookup]:
    """The motifs of spans of takes, with those of the user's cache, to which many new ones are added.

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
    if n_known + _FEWEST_NEW <= len(spans.known[0]) <= _MOST_SPANS:
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
