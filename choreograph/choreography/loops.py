"""Loop points: spans of whole bars of a motion or a song after which it can begin again without a jump."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.core.counts import Counts
from choreograph.core.numerics import Floats, interpolate_frames
from choreograph.motion.body import ground_pos_m, to_root_frame
from choreograph.music.form import CountDistances

_LENGTHS = (1, 2, 4, 8, 16, 32)  # in bars, or in counts if bars are not known
_AFTER_S = 0.1  # poses so long after the start and after the end of a loop must agree as well
_REACH = 4  # counts around the ends of a loop in a song whose bars are not known


@dataclass(frozen=True)
class LoopPoints:
    """A span that can be repeated."""

    start_s: float
    """When it begins, in seconds."""

    end_s: float
    """When it ends, in seconds."""

    n_counts: int
    """Its length in counts."""

    distance: float
    """Distance of its end from its start, as in the matrix of distances in which it was found."""


def best_loops(distances: Floats, counts: Counts) -> tuple[LoopPoints, ...]:
    """For each length, the loop whose end is nearest to its start, by length.

    Loops last 1, 2, 4, 8, 16 or 32 bars, from count 1 to count 1, or so many counts if bars are not known.

    Parameters
    ----------
    distances : float array (Q, Q)   of the instants of two counts
    counts : Counts (Q,)
    """
    starts = np.flatnonzero(counts.numbers == 1) if counts.has_bars else np.arange(len(counts))
    loops = []
    for length in _LENGTHS:
        if length >= len(starts):
            break
        first, last = starts[:-length], starts[length:]
        away = distances[first, last]
        best = int(np.argmin(away))
        start, end = int(first[best]), int(last[best])
        times_s = counts.times_s
        loops.append(LoopPoints(float(times_s[start]), float(times_s[end]), end - start, float(away[best])))
    return tuple(loops)


def pose_distances(body_pos_m: NDArray[np.floating], fps: float, times_s: Floats) -> Floats:
    """Distances of the poses at times (Q,) together with those shortly after, (Q, Q) in metres.

    A distance is the mean over the joints. Each pose is seen from its own place and heading on the floor, and
    the one after it from the same place. `body_pos_m` is (T, 21, 3).
    """
    pos_m = np.asarray(body_pos_m, np.float64)
    at_m = interpolate_frames(pos_m, times_s * fps)  # (Q, 21, 3)
    after_m = interpolate_frames(pos_m, (times_s + _AFTER_S) * fps)
    moved_m = to_root_frame(at_m, after_m - ground_pos_m(at_m)[:, None])
    poses_m = np.concatenate([to_root_frame(at_m), moved_m], axis=1)  # (Q, 42, 3)
    return np.stack([np.linalg.norm(poses_m - one_m, axis=-1).mean(axis=-1) for one_m in poses_m])


def song_distances(features: NDArray[np.floating], counts: Counts) -> Floats:
    """Distances of the music around two counts, (Q, Q), relative to the median distance of two counts.

    It is the mean over the counts of a bar before and of one after. `features` are the spectral features
    (B, 87) of `form.song_form`, of which row q begins at count q.
    """
    n, reach = min(len(counts), len(features)), counts.metre or _REACH
    away = CountDistances(features[:n]).rows(0, n)
    padded = np.pad(away, reach, mode="edge")
    steps = range(2 * reach)  # from a bar before to the last count of a bar after
    around: Floats = np.mean([padded[step : step + n, step : step + n] for step in steps], axis=0)
    missing = len(counts) - n  # the last count ends the last interval
    return np.pad(around, (0, missing), mode="edge")
