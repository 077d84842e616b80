"""Compiled loops of the warper, with rows of the cost table vectorised.

They release the GIL, so that `segments` can warp several seconds at once in its own threads. Some loops could
be shorter in numpy, but a median or a slice assignment takes seconds to compile, which delays the first dance
on a new machine.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.core.kernel_cache import njit

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

UNREACHED = np.float32(3.0e38)


@njit(
    "Tuple((float32[:,::1], float32[::1]))(float32[:,::1], float32[:,::1])",
    nogil=True,
    error_model="numpy",
)
def dtw_batch(queries: F32, targets: F32) -> tuple[F32, F32]:  # pragma: no cover - compiled
    """Subsequence DTW of queries (K, Tq) in targets (K, Tt), float32: source frames (K, Tq), costs (K,).

    Steps (query, target) are (1, 1), (1, 2), (2, 1), preferred in this order on ties. A step (2, 1) pays
    its last cell twice, once for each query frame. Backtracking recomputes the steps from the cost table:
    a second table for the steps would prevent vectorised rows.
    """
    n, n_query = queries.shape
    n_target = targets.shape[1]
    source_frames = np.empty((n, n_query), np.float32)
    costs = np.empty(n, np.float32)
    for k in range(n):
        target = targets[k]
        # One padding row and two padding columns in front, unreachable.
        table = np.full((n_query + 1, n_target + 2), UNREACHED, np.float32)
        for j in range(n_target):
            d = queries[k, 0] - target[j]
            table[1, j + 2] = d * d
        for i in range(1, n_query):
            q = queries[k, i]
            row, last, before = table[i + 1], table[i], table[i - 1]
            for j in range(n_target):
                d = q - target[j]
                c = d * d
                both = last[j + 1] + c
                target_twice = last[j] + c
                query_twice = before[j + 1] + (c + c)
                best = target_twice if target_twice < both else both
                row[j + 2] = query_twice if query_twice < best else best
        costs[k] = _backtrack(queries[k], target, table, source_frames[k]) / n_query
    return source_frames, costs


@njit(error_model="numpy", inline="always")
def _backtrack(
    query: F32, target: F32, table: F32, source_frames: F32
) -> float:  # pragma: no cover - compiled
    """Write the cheapest path to `source_frames`, from the cost table (1 + Tq, 2 + Tt). Returns its cost."""
    i, j = len(query) - 1, len(target) - 1
    for end in range(len(target) - 2, -1, -1):
        if table[i + 1, end + 2] <= table[i + 1, j + 2]:
            j = end
    cost: float = table[i + 1, j + 2]
    source_frames[i] = j
    while i > 0:
        d = query[i] - target[j]
        c = d * d
        both = table[i, j + 1] + c
        target_twice = table[i, j] + c
        query_twice = table[i - 1, j + 1] + (c + c)
        if query_twice < min(both, target_twice):
            source_frames[i - 1] = j - 0.5
            i -= 2
            j -= 1
        elif target_twice < both:
            i -= 1
            j -= 2
        else:
            i -= 1
            j -= 1
        source_frames[i] = j
    return cost


@njit(error_model="numpy", inline="always")
def _solve_banded(main: F64, first: F64, second: F64, rhs: F64) -> None:  # pragma: no cover - compiled
    """In-place LDLᵀ solve of a symmetric positive definite pentadiagonal system."""
    n = len(main)
    for i in range(n):
        pivot = main[i]
        if i + 1 < n:
            factor = first[i] / pivot
            main[i + 1] -= factor * first[i]
            rhs[i + 1] -= factor * rhs[i]
            if i + 2 < n:
                first[i + 1] -= factor * second[i]
        if i + 2 < n:
            factor = second[i] / pivot
            main[i + 2] -= factor * second[i]
            rhs[i + 2] -= factor * rhs[i]
    for i in range(n - 1, -1, -1):
        value = rhs[i]
        if i + 1 < n:
            value -= first[i] * rhs[i + 1]
        if i + 2 < n:
            value -= second[i] * rhs[i + 2]
        rhs[i] = value / main[i]


@njit(error_model="numpy", inline="always")
def _match_beats(
    path: F64, source_beats: F64, music_beats: F64, window: float, anchor_frame: F64, anchor_source: F64
) -> int:  # pragma: no cover - compiled
    """Match music beats to motion beats along the path and return the number of pairs.

    Pairs go to `anchor_frame` (output frames) and `anchor_source` (source frames). Beats match if each is the
    other's nearest and they are at most `window` output frames apart.
    """
    n = len(path)
    count = 0
    b = 0
    for m in range(len(music_beats)):
        frame = music_beats[m]
        if frame < 0 or frame > n - 1:
            continue
        low = min(int(frame), n - 2)
        slope = path[low + 1] - path[low]
        source_here = path[low] + (frame - low) * slope
        # The nearest motion beat in the source. The gap is in output frames, by the local slope.
        while b + 1 < len(source_beats) and abs(source_beats[b + 1] - source_here) <= abs(
            source_beats[b] - source_here
        ):
            b += 1
        if len(source_beats) == 0:
            break
        gap = abs(source_beats[b] - source_here) / max(slope, 0.25)
        if gap > window:
            continue
        if count > 0 and anchor_source[count - 1] == source_beats[b]:
            # Two music beats have the same nearest motion beat: the nearer one gets it.
            if gap < _gap_of(path, anchor_frame[count - 1], source_beats[b]):
                anchor_frame[count - 1] = frame
            continue
        anchor_frame[count] = frame
        anchor_source[count] = source_beats[b]
        count += 1
    return count


@njit(error_model="numpy", inline="always")
def _gap_of(path: F64, frame: float, source: float) -> float:  # pragma: no cover - compiled
    """Distance of a source frame from the path at an output frame, in output frames."""
    low = min(int(frame), len(path) - 2)
    slope = path[low + 1] - path[low]
    gap: float = abs(source - (path[low] + (frame - low) * slope)) / max(slope, 0.25)
    return gap


@njit(error_model="numpy", inline="always")
def _limit_slopes(
    path: F64, slopes: F64, min_slope: float, max_slope: float, last_source: float
) -> None:  # pragma: no cover - compiled
    """Clamp the path's slopes in place, preserving its mean, and keep it inside [0, last_source].

    Where the path would leave the clip, it follows the border at the minimum slope instead: shifting the
    whole path would move its beats off the music's.
    """
    n = len(path)
    mean = 0.0
    for i in range(n):
        mean += path[i]
    mean /= n
    for i in range(n - 1):
        slopes[i] = min(max(path[i + 1] - path[i], min_slope), max_slope)
    total = 0.0
    path[0] = 0.0
    for i in range(n - 1):
        path[i + 1] = path[i] + slopes[i]
        total += path[i + 1]
    shift = mean - total / n
    for i in range(n):
        lowest = min_slope * i
        highest = last_source - min_slope * (n - 1 - i)
        path[i] = min(max(path[i] + shift, lowest), highest)


@njit(
    "float64[:,::1](float64[:,::1], float64[::1], int64[:,::1], float64[::1], float64, float64, "
    "float64, float64, float64, float64)",
    nogil=True,
    error_model="numpy",
)
def smooth_batch(
    paths: F64,
    beats: F64,
    beat_ranges: NDArray[np.int64],
    music: F64,
    window: float,
    stiffness: float,
    anchor_weight: float,
    min_slope: float,
    max_slope: float,
    last_source: float,
) -> F64:  # pragma: no cover - compiled
    """Smooth time maps (K, Tq) of DTW paths. See `warping.smooth_time_maps` for the objective.

    Candidate k has the motion beats beats[beat_ranges[k, 0] : beat_ranges[k, 1]], in clip frames. All have
    the same music beats, in output frames.
    """
    n, n_frames = paths.shape
    maps = np.empty((n, n_frames), np.float64)
    main = np.empty(n_frames)
    first = np.empty(n_frames)
    second = np.empty(n_frames)
    rhs = np.empty(n_frames)
    slopes = np.empty(n_frames)
    anchor_frame = np.empty(len(music) + 1)
    anchor_source = np.empty(len(music) + 1)
    for k in range(n):
        clip_beats = beats[beat_ranges[k, 0] : beat_ranges[k, 1]]
        path = maps[k]
        for i in range(n_frames):
            path[i] = paths[k, i]
        # The first pass only smooths the staircase. The second matches beats along the smooth path.
        for iteration in range(2):
            _normal_equations(path, stiffness, main, first, second, rhs)
            if iteration == 1:
                count = _match_beats(path, clip_beats, music, window, anchor_frame, anchor_source)
                for a in range(count):
                    low = min(int(anchor_frame[a]), n_frames - 2)
                    w = anchor_frame[a] - low
                    main[low] += anchor_weight * (1 - w) * (1 - w)
                    main[low + 1] += anchor_weight * w * w
                    first[low] += anchor_weight * w * (1 - w)
                    rhs[low] += anchor_weight * (1 - w) * anchor_source[a]
                    rhs[low + 1] += anchor_weight * w * anchor_source[a]
            _solve_banded(main, first, second, rhs)
            for i in range(n_frames):
                path[i] = rhs[i]
            _limit_slopes(path, slopes, min_slope, max_slope, last_source)
    return maps


@njit(error_model="numpy", inline="always")
def _normal_equations(
    path: F64, stiffness: float, main: F64, first: F64, second: F64, rhs: F64
) -> None:  # pragma: no cover - compiled
    """Bands of I + stiffness · D₂ᵀD₂ (D₂: second differences) and the right-hand side `path`."""
    n = len(path)
    for i in range(n):
        main[i] = 1.0
        first[i] = 0.0
        second[i] = 0.0
        rhs[i] = path[i]
    for i in range(n - 2):
        main[i] += stiffness
        main[i + 1] += 4 * stiffness
        main[i + 2] += stiffness
        first[i] -= 2 * stiffness
        first[i + 1] -= 2 * stiffness
        second[i] += stiffness


def segment_beats(
    maps: F64, speeds: F32, music: NDArray[np.floating], near: float, far: float, prominence: float
) -> tuple[F32, F32, F32]:
    """Beats of each quarter of each warped segment, for time maps (K, Tq + 1).

    `speeds` (K, Tt) are the clips' mean joint speeds. Motion beats are found in the warped motion: a tempo
    change moves a minimum of speed, or flattens it. Returns three arrays (K, 4). The first is the share of
    music and motion beats without a partner. A beat counts 0 with a partner within `near` frames, and 1
    beyond `far`. The others are the first and last motion beat in frames of their quarter, nan where there is
    none.
    """
    unmatched, n_beats = np.zeros((2, len(maps), 4), np.float32)
    first, last = np.full((2, len(maps), 4), np.nan, np.float32)
    scratch = np.empty(maps.shape[1]), np.empty(maps.shape[1])
    beats = np.asarray(music, np.float64)
    _measure_beats(maps, speeds, beats, near, far, prominence, *scratch, unmatched, n_beats, first, last)
    unmatched /= np.maximum(n_beats, 1)
    return unmatched, first, last


@njit(
    "void(float64[:,::1], float32[:,::1], float64[::1], float64, float64, float64, float64[::1], "
    "float64[::1], float32[:,::1], float32[:,::1], float32[:,::1], float32[:,::1])",
    nogil=True,
    error_model="numpy",
)
def _measure_beats(
    maps: F64,
    speeds: F32,
    music: F64,
    near: float,
    far: float,
    prominence: float,
    speed: F64,
    played: F64,
    unmatched: F32,
    n_beats: F32,
    first: F32,
    last: F32,
) -> None:  # pragma: no cover - compiled
    """Write the measures of `segment_beats` (K, 4), of which `unmatched` is a sum, with the beats counted."""
    n_frames = maps.shape[1] - 1
    quarter = n_frames // 4
    for k in range(len(maps)):
        count = _played_beats(maps[k], speeds[k], prominence, speed, played)
        for p in range(count):
            q = min(int(played[p]) // quarter, 3)
            at = np.float32(played[p] - q * quarter)
            if np.isnan(first[k, q]):
                first[k, q] = at
            last[k, q] = at
            unmatched[k, q] += _unmatched(played[p], music, len(music), near, far)
            n_beats[k, q] += 1
        for m in range(len(music)):
            if 0 <= music[m] < n_frames:
                q = int(music[m]) // quarter
                unmatched[k, q] += _unmatched(music[m], played, count, near, far)
                n_beats[k, q] += 1


@njit(error_model="numpy", inline="always")
def _played_beats(
    time_map: F64, speed: F32, prominence: float, played: F64, beats: F64
) -> int:  # pragma: no cover - compiled
    """Minima of the speed of a clip played through `time_map`, in output frames. Returns their number.

    They are written to `beats`, and the speed to `played`, both as long as the map.
    """
    n = len(time_map)
    for i in range(n):
        low = min(int(time_map[i]), len(speed) - 2)
        weight = time_map[i] - low
        slope = (time_map[min(i + 1, n - 1)] - time_map[max(i - 1, 0)]) / (min(i + 1, n - 1) - max(i - 1, 0))
        played[i] = slope * (speed[low] + weight * (speed[low + 1] - speed[low]))
    deep = prominence * _median(played, beats)
    count = 0
    for i in range(1, n - 1):
        if not (played[i] < played[i - 1] and played[i] <= played[i + 1]):
            continue
        left = right = played[i]
        j = i - 1
        while j >= 0 and played[j] >= played[i]:
            left = max(left, played[j])
            j -= 1
        j = i + 1
        while j < n and played[j] >= played[i]:
            right = max(right, played[j])
            j += 1
        if min(left, right) - played[i] < deep:
            continue
        bend = played[i - 1] - 2 * played[i] + played[i + 1]
        beats[count] = i + 0.5 * (played[i - 1] - played[i + 1]) / max(bend, 1e-9)
        count += 1
    return count


@njit(error_model="numpy", inline="always")
def _median(values: F64, ordered: F64) -> float:  # pragma: no cover - compiled
    """The median, by sorting a copy to `ordered`, which is fast for the 80 frames of a segment."""
    n = len(values)
    for i in range(n):
        j = i
        while j > 0 and ordered[j - 1] > values[i]:
            ordered[j] = ordered[j - 1]
            j -= 1
        ordered[j] = values[i]
    median: float = 0.5 * (ordered[(n - 1) // 2] + ordered[n // 2])
    return median


@njit(error_model="numpy", inline="always")
def _unmatched(
    at: float, others: F64, count: int, near: float, far: float
) -> float:  # pragma: no cover - compiled
    gap = far
    for i in range(count):
        gap = min(gap, abs(others[i] - at))
    return max(0.0, (gap - near) / (far - near))
