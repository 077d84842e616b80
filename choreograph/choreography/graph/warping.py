"""Warping of clips to the music: by counts, or by subsequence DTW of tempo-densities."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from choreograph.choreography.graph.warp_kernels import dtw_batch, smooth_batch
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats, frame_weights
from choreograph.core.timebase import (
    CLIP_FRAMES,
    MAX_SLOPE,
    MIN_SLOPE,
    NET_FPS,
    NODE_FRAMES,
    SEGMENT_FRAMES,
    SEGMENT_S,
)
from choreograph.music.count_grids import MAX_SHIFT_S, SongGrid, TakeGrids

# Subsequence dynamic time warping of tempo-densities, many candidates in one call.


def subsequence_dtw(query: ArrayLike, targets: ArrayLike) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Find `query` inside each of `targets`, at between half and double speed.

    Steps (query, target) are (1, 1), (1, 2) and (2, 1), which keep the slope between `MIN_SLOPE` and
    `MAX_SLOPE`. A step (2, 1) pays its cell twice, once for each query frame, so that slowing down is not
    cheaper than it should be (the paper does not specify this).

    Parameters
    ----------
    query : float array (Tq,) or (K, Tq)    target tempo-density, motion frames
    targets : float array (Tt,) or (K, Tt)  tempo-densities of the clips, motion frames

    Returns
    -------
    source_frames : float array (K, Tq)   strictly increasing, in [0, Tt - 1], with half frames where a
        query frame falls between two target frames
    cost : float array (K,)               mean squared difference along the path
    Both without the first axis if query and target have none.

    Raises
    ------
    ParameterError   if shapes do not match, a value is not finite, or the target is too short for the
        query at half speed: Tt - 1 < (Tq - 1) / 2

    References
    ----------
    ChoreoGraph, section 3.2
    Müller, Fundamentals of Music Processing (2015), section 7.2
    """
    q = np.asarray(query, np.float32)
    t = np.asarray(targets, np.float32)
    if q.ndim not in (1, 2) or t.ndim not in (1, 2):
        raise ParameterError(f"expected densities (T,) or (K, T), got {q.shape} and {t.shape}")
    single = q.ndim == 1 and t.ndim == 1
    n = max(len(a) if a.ndim == 2 else 1 for a in (q, t))
    if any(a.ndim == 2 and len(a) != n for a in (q, t)):
        raise ParameterError(f"expected as many queries as targets, got {q.shape} and {t.shape}")
    # Copies, because a kernel is compiled again for arrays that cannot be written.
    q = np.array(np.broadcast_to(q, (n, q.shape[-1])), order="C")  # (K, Tq)
    t = np.array(np.broadcast_to(t, (n, t.shape[-1])), order="C")  # (K, Tt)
    if q.shape[1] < 2 or 2 * (t.shape[1] - 1) < q.shape[1] - 1:
        raise ParameterError(
            f"expected a query of at least 2 frames and a target that holds it at half speed, got "
            f"{q.shape[1]} and {t.shape[1]} frames"
        )
    if not (np.isfinite(q).all() and np.isfinite(t).all()):
        raise ParameterError("expected finite tempo-densities, got nan or infinity")
    source_frames, cost = dtw_batch(q, t)
    return (source_frames[0], cost[0]) if single else (source_frames, cost)


# Smooth time maps from the steps of a DTW path.


# In frames⁴: tempo changes over about 2π·⁴√40000 frames ≈ 4.4 s, faster only to match a beat.
STIFFNESS = 40_000.0
ANCHOR_WEIGHT = 400.0  # a matched beat outweighs the path around it
SNAP_FRAMES = 4.0  # 0.2 s: beats further apart are not matched


def smooth_time_maps(
    source_frames: NDArray[np.floating],
    *,
    clip_frames: int,
    motion_beats: NDArray[np.floating],
    beat_ranges: NDArray[np.integer],
    music_beats: NDArray[np.floating],
    stiffness: float = STIFFNESS,
    snap_frames: float = SNAP_FRAMES,
) -> NDArray[np.float64]:
    """Smooth, monotone time maps (K, Tq) near the DTW paths, with motion beats on music beats.

    Each map φ minimises Σ(φᵢ - pathᵢ)² + stiffness·Σ(φᵢ₋₁ - 2φᵢ + φᵢ₊₁)² + weight·Σ(φ(mₐ) - bₐ)²
    over the pairs (music beat mₐ, motion beat bₐ) that are within `snap_frames` of each other on the
    path. Then slopes are clamped to [0.5, 2]. The paper plays the path itself, whose speed alternates
    between half, normal and double from frame to frame.

    Parameters
    ----------
    source_frames : float array (K, Tq)   DTW paths, clip frames
    clip_frames : int                     frames of a clip. Maps stay in [0, clip_frames - 1]
    motion_beats : float array (Q,)       beats of all clips, increasing within each, clip frames
    beat_ranges : int array (K, 2)        candidate k has motion_beats[range[0]:range[1]]
    music_beats : float array (M,)        beats of the music segment, increasing, output frames

    Raises `ParameterError` for paths or ranges of another shape, or paths of fewer than three frames.
    """
    paths = np.ascontiguousarray(source_frames, np.float64)
    ranges = np.ascontiguousarray(beat_ranges, np.int64)
    if paths.ndim != 2 or paths.shape[1] < 3 or ranges.shape != (len(paths), 2):
        raise ParameterError(
            f"expected DTW paths (K, Tq) of at least 3 frames and ranges (K, 2), got {paths.shape} "
            f"and {ranges.shape}"
        )
    time_maps: NDArray[np.float64] = smooth_batch(
        paths, np.asarray(motion_beats, np.float64), ranges, np.asarray(music_beats, np.float64),
        float(snap_frames), float(stiffness), ANCHOR_WEIGHT, MIN_SLOPE, MAX_SLOPE, float(clip_frames - 1),
    )  # fmt: skip
    return time_maps


# The time maps of the candidates of one second, by their densities.


def warp_by_density(
    query: NDArray[np.float32],
    targets: NDArray[np.float32],
    music_frames: NDArray[np.floating],
    beat_frames: NDArray[np.float64],
    beat_ranges: NDArray[np.int64],
    *,
    as_recorded: bool,
    smoothed: bool,
) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
    """Time maps (K, 81) of one second's candidates, and the mismatch of densities along them (K, 4).

    `query` (80,) is the tempo-density of the music, and `targets` (K, 160) are those of the clips. With
    `as_recorded`, the maps are those of the clips' middle 4 s at their own speed. See `smooth_time_maps`.
    """
    if as_recorded:
        middle = (CLIP_FRAMES - SEGMENT_FRAMES) // 2
        maps = np.tile(np.arange(middle, middle + SEGMENT_FRAMES + 1, dtype=np.float64), (len(targets), 1))
    else:
        if smoothed:
            paths, _ = subsequence_dtw(query, targets)  # (K, 80)
            maps = smooth_time_maps(
                paths, clip_frames=CLIP_FRAMES - 1, motion_beats=beat_frames, beat_ranges=beat_ranges,
                music_beats=music_frames,
            )  # fmt: skip
        else:  # a frame of the clip is left for the end of the last frame
            paths, _ = subsequence_dtw(query, targets[:, :-1])
            maps = paths.astype(np.float64)
        # The end of the last frame, with the slope of the frame before it inside the clip.
        end = np.minimum(2 * maps[:, -1] - maps[:, -2], CLIP_FRAMES - 1)
        maps = np.concatenate([maps, end[:, None]], axis=1)  # (K, 81)
    return maps, _density_mismatch(query, targets, maps)


def _density_mismatch(
    query: NDArray[np.float32], targets: NDArray[np.float32], maps: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Mean squared difference of densities along the smoothed maps, per quarter, (K, 4)."""
    low, high, weights = frame_weights(maps[:, :-1], targets.shape[1])
    weight = weights.astype(np.float32)
    rows = np.arange(len(targets))[:, None]
    warped = targets[rows, low] * (1 - weight) + targets[rows, high] * weight  # (K, 80)
    mismatch: NDArray[np.float32] = (
        ((warped - query) ** 2).reshape(len(maps), SEGMENT_S, NODE_FRAMES).mean(axis=2)
    )
    return mismatch


# Time maps that align the counts of a take with the beats of a song, count k + d with beat k.
#
# The tempo of a take with counts is known. One whole number, the shift d, determines how the take is danced
# to the song. Its bars coincide with those of the song for every shift that moves count 1 to a downbeat. All
# seconds of a take with one shift have one continuous time map, however many clips it spans. ChoreoGraph
# warps every clip by tempo-density instead (section 3.2, `segments`).


NO_TIME_MAP = -1
_MAX_SHIFTS = 9  # tried around the middle of a clip: two bars of four to each side
_ON_BEAT = 1e-9  # of a beat, by which rounding moves one across a border
_SHIFTS_PER_TAKE = 1 << 20  # above the number of counts of any song or take


@dataclass(frozen=True, eq=False)
class CountMaps:
    """Time maps of one second's candidates, of which K' of the K have one."""

    candidates: NDArray[np.int64]  # (K',) which of the candidates
    time_maps: Floats  # (K', 81) clip frames at the 80 output frames and the end
    time_map_id: NDArray[np.int64]  # (K',) one number for each take and shift
    off_bar: Floats  # (K', 4) share of each quarter's beats whose number is not the take's
    phrase_penalty: Floats  # (K', 5) of the quarters' borders: see `TakeGrids.phrase_penalty_at`


@dataclass(frozen=True, eq=False)
class CountedClips:
    """The clips of a repertoire, with the data that aligns them with the beats of a song."""

    take: NDArray[np.integer]  # (N,)
    start_s: Floats  # (N,) in their takes
    middle_index: Floats  # (N,) fractional count index of the start of their middle 4 s
    takes: TakeGrids
    song: SongGrid
    join_times_s: Floats  # (S + 5,) where takes may change, around every second of the song
    later_counts: Floats  # (S,) by which a second begins later in the bar than the one whose clips it has

    @classmethod
    def of(
        cls,
        take: NDArray[np.integer],
        start_frame: NDArray[np.integer],
        takes: TakeGrids,
        song: SongGrid,
        join_times_s: Floats,
        later_counts: Floats | None = None,
        *,
        used: NDArray[np.int64] | None = None,
    ) -> CountedClips:
        """Clips by their takes (N,) and first frames (N,) at 20 fps, or those among them that are `used`."""
        clips = np.arange(len(take)) if used is None else used
        start_s, middle_index = start_frame / NET_FPS, np.full(len(take), np.nan)
        middle_s = start_s[clips] + (CLIP_FRAMES - SEGMENT_FRAMES) / 2 / NET_FPS
        middle_index[clips] = takes.index_at(take[clips], middle_s)
        later_counts = np.zeros(len(join_times_s)) if later_counts is None else later_counts
        return cls(take, start_s, middle_index, takes, song, join_times_s, later_counts)


def count_time_maps(second: int, clip: NDArray[np.integer], clips: CountedClips) -> CountMaps:
    """Align clips (K,) of counted takes with the beats of the 4 s from `second`.

    A shift must keep the 4 s inside the clip, its tempo in [0.5, 2], and its counts within 4 counts of the
    part of the take that has counts. Of these, each clip gets the shift for which most numbers in the bar
    agree with the song's. Ties go to the shift nearest to the clip's middle 4 s, which its style vector
    describes. Clips without such a shift, and clips of takes without counts, get no map.
    """
    takes, song = clips.takes, clips.song
    candidates = np.flatnonzero(takes.counted[clips.take[clip]])
    counted = clip[candidates]  # (K',)
    take, start_s, wanted = clips.take[counted], clips.start_s[counted], clips.middle_index[counted]
    wanted = wanted + clips.later_counts[second]
    index = song.index_at(second + np.arange(SEGMENT_FRAMES + 1) / NET_FPS)  # (81,)
    beats = np.arange(*np.ceil(index[[0, -1]] - _ON_BEAT).astype(int))  # (Q,) inside the 4 s
    nearest = np.round(wanted - index[0])  # (K',)
    # All shifts of all clips at once, the shifts of the first step first.
    steps = np.arange(-_MAX_SHIFTS + 1, _MAX_SHIFTS)  # (D,)
    tried = (nearest + steps[:, None]).astype(np.int64).ravel()  # (D K',)
    take_tried, start_tried_s, wanted_tried = (np.tile(of, len(steps)) for of in (take, start_s, wanted))
    ends = index[[0, -1]] + tried[:, None]  # (D K', 2)
    ends_s = takes.count_s(take_tried, ends) - start_tried_s[:, None]
    inside = (ends_s[:, 0] >= 0) & (ends_s[:, 1] <= (CLIP_FRAMES - 1) / NET_FPS)
    inside &= takes.reaches(take_tried, ends)
    off_bar = _off_bar(song, takes, take_tried, beats, tried).mean(axis=1) if len(beats) else 0.0
    # A bar that fits is worth more than any distance from the middle.
    cost = np.where(inside, 100.0 * off_bar + np.abs(tried + index[0] - wanted_tried), np.inf)
    cost = cost.reshape(len(steps), -1)  # (D, K')
    best = cost.min(axis=0)
    first = np.argmin(cost, axis=0)
    shift = np.where(np.isfinite(best), (nearest + steps[first]).astype(np.int64), 0)
    counts_s = takes.count_s(take, index + shift[:, None])  # (K', 81)
    maps = (counts_s + _accent_shift_s(song, takes, take, index, shift) - start_s[:, None]) * NET_FPS
    # The limits apply to the tempo. A shifted accent may exceed them a little.
    slopes = np.diff(counts_s, axis=1) * NET_FPS
    fits = np.isfinite(best) & (slopes.min(axis=1) >= MIN_SLOPE) & (slopes.max(axis=1) <= MAX_SLOPE)
    fits &= (maps[:, 0] >= 0.0) & (maps[:, -1] <= CLIP_FRAMES - 1)
    off_bar = _per_quarter(_off_bar(song, takes, take, beats, shift), beats, index)
    time_map_id = take.astype(np.int64) * _SHIFTS_PER_TAKE + shift + _SHIFTS_PER_TAKE // 2
    joins = np.round(song.index_at(clips.join_times_s[second : second + 5])).astype(np.int64)  # (5,)
    phrase_penalty = takes.phrase_penalty_at(take, joins + shift[:, None])
    return CountMaps(candidates[fits], maps[fits], time_map_id[fits], off_bar[fits], phrase_penalty[fits])


def _accent_shift_s(
    song: SongGrid,
    takes: TakeGrids,
    take: NDArray[np.integer],
    index: Floats,
    shift: NDArray[np.int64],
) -> Floats:
    """Delay (K', T) in take seconds of accents behind their counts, at fractional beat indices (T,).

    With it, accents lie on beats. No count is moved by more than 0.05 s of the song.
    """
    first = int(np.floor(index[0]))
    beats = np.arange(first, int(np.floor(index[-1])) + 2)  # (Q,)
    accent_s, count_period_s = takes.accents_at(take, beats + shift[:, None])  # (K', Q)
    most_s = MAX_SHIFT_S * count_period_s / song.period_s[beats]
    at_beats_s = np.clip(accent_s, -most_s, most_s)
    low = np.floor(index).astype(np.int64) - first
    since = index - np.floor(index)
    eased = since**2 * (3.0 - 2.0 * since)  # so that no count makes a corner in the shift
    return at_beats_s[:, low] + eased * (at_beats_s[:, low + 1] - at_beats_s[:, low])


def _off_bar(
    song: SongGrid,
    takes: TakeGrids,
    take: NDArray[np.integer],
    beats: NDArray[np.int64],
    shift: NDArray[np.int64],
) -> Floats:
    """1 where the number of a beat differs from that of the take's count, 0 if one is unknown, (K', Q)."""
    numbers = takes.number_at(take, beats + shift[:, None])
    wanted = song.numbers[beats]
    off_bar: Floats = ((numbers != wanted) & (numbers > 0) & (wanted > 0)).astype(np.float64)
    return off_bar


def _per_quarter(off_bar: Floats, beats: NDArray[np.int64], index: Floats) -> Floats:
    """Means (K', 4) over the beats of each quarter of the segment, 0 in a quarter without beats."""
    borders = np.searchsorted(beats, index[:: SEGMENT_FRAMES // 4] - _ON_BEAT)  # (5,)
    means = np.zeros((len(off_bar), 4))
    for quarter, (low, high) in enumerate(pairwise(borders)):
        if high > low:
            means[:, quarter] = off_bar[:, low:high].mean(axis=1)
    return means
