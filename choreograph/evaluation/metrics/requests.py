"""Requests: whether a requested genre is danced, at its tempi, and whether dances differ by seed.

Conventions: a dance consists of parts (N,), each with the genre of its take and a length. Lengths are in
seconds for dances of seconds, and 1 each for dances of words. Tempi are in counts per minute. Counts (Q,) are
those of the takes in seconds of the dance, increasing. A share of nothing is nan.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats
from choreograph.core.timebase import NET_FPS
from choreograph.motion.body import body_pos_at, to_root_frame

SAME_TEMPO = 0.04  # tempi that differ by less are the same, as in the evaluation of tempo trackers
_SMOOTHING = 5  # intervals between counts whose median is the tempo there


def genre_share(genres: Sequence[str], lengths: ArrayLike, genre: str) -> float:
    """Share of the length of the parts (N,) that is of a genre, 0 to 1. Higher is better.

    Chance is the share of the genre in the repertoire, which is the same function of its takes and lengths.

    Examples
    --------
    >>> cg.metrics.requests.genre_share(["waltz", "salsa", "waltz"], [3.0, 1.0, 4.0], "waltz")
    0.875
    """
    length = np.asarray(lengths, np.float64)
    if length.shape != (len(genres),) or not np.isfinite(length).all() or (length < 0).any():
        raise ParameterError(f"expected a length of 0 or more for each of {len(genres)} parts, got {length}")
    total = float(length.sum())
    if total == 0.0:
        return float("nan")
    return float(length[np.array([name == genre for name in genres])].sum()) / total


def outside_tempi_share(
    count_times_s: ArrayLike, low_bpm: ArrayLike, high_bpm: ArrayLike, *, tolerance: float = SAME_TEMPO
) -> float:
    """Share of the time between counts (Q,) at a tempo outside of a range, 0 to 1. Lower is better.

    The range is that of the tempi of the takes of the genre: one for the whole dance, or one for each
    interval between two counts, (Q - 1,). The tempo at an interval is the median over five intervals. A
    tempo outside by less than `tolerance` counts as inside. The result is nan with fewer than two counts.

    Examples
    --------
    >>> counts_s = np.concatenate([np.arange(0.0, 10.0, 0.5), np.arange(10.0, 20.0, 0.4)])  # 120, then 150
    >>> round(cg.metrics.requests.outside_tempi_share(counts_s, low_bpm=100.0, high_bpm=130.0), 2)
    0.49
    """
    times_s = np.asarray(count_times_s, np.float64)
    if times_s.ndim != 1 or not np.isfinite(times_s).all() or (np.diff(times_s) <= 0).any():
        raise ParameterError(f"expected increasing, finite counts in seconds, got shape {times_s.shape}")
    intervals_s = np.diff(times_s)
    low, high = (np.asarray(bound, np.float64) for bound in (low_bpm, high_bpm))
    if not all(bound.shape in ((), intervals_s.shape) for bound in (low, high)):
        raise ParameterError(
            f"expected one range of tempi, or {len(intervals_s)}, got {low.shape} and {high.shape}"
        )
    if not ((low >= 0).all() and (low <= high).all()):
        raise ParameterError("expected ranges of tempi of 0 or more, each from a lower to a higher one")
    if len(intervals_s) == 0:
        return float("nan")
    bpm = 60.0 / _running_median(intervals_s)
    outside = (bpm < low * (1.0 - tolerance)) | (bpm > high * (1.0 + tolerance))
    return float(intervals_s[outside].sum() / intervals_s.sum())


def joint_distance_m(body_pos_m: Floats, other_pos_m: Floats, fps: float) -> float:
    """Mean distance of the joints of two dances (T, 21, 3) and (T', 21, 3) at the same time, in metres.

    It is 0 for the same dance. Each pose is first moved to heading 0 above the origin, so that the place on
    the stage does not matter. The longer dance is cut. Chance is the distance of one of the dances to the
    other, shifted in time.

    Examples
    --------
    >>> pos_m = np.random.default_rng(0).normal(size=(40, 21, 3))
    >>> moved_m = pos_m + [3.0, 0.0, 1.0]
    >>> round(cg.metrics.requests.joint_distance_m(pos_m, moved_m, 20.0), 6)
    0.0
    """
    one, other = (to_root_frame(body_pos_at(pos_m, fps, NET_FPS)) for pos_m in (body_pos_m, other_pos_m))
    n_frames = min(len(one), len(other))
    return float(np.linalg.norm(one[:n_frames] - other[:n_frames], axis=-1).mean())


def _running_median(values: Floats) -> Floats:
    """Median of each value (N,) and the two on either side of it, which are fewer at the ends."""
    reach = _SMOOTHING // 2
    padded = np.pad(values, reach, constant_values=np.nan)
    medians: Floats = np.nanmedian(np.lib.stride_tricks.sliding_window_view(padded, _SMOOTHING), axis=1)
    return medians
