"""Energy response: whether a dance is bigger where its song is louder, section by section.

Conventions: body positions (T, 21, 3) in metres at `fps`; the song's sections by their bounds (S + 1,) in
seconds and their loudness (S,) in dB. Motion size is measured in two ways, neither of which sees where the
dancer travels: speed is the mean of 20 joints' speed relative to the pelvis, in m/s; space the volume of
the convex hull of those joints, in litres. A section counts from `LEAST_S` danced seconds
on; held poses at both ends are left out. Songs whose sections differ by less than `LEAST_RANGE_DB`, or that
have fewer than three, tell nothing: nan. Read correlations over one song's few sections as a mean of many
songs, or pool them by `pooled_response`. Dances may change more than their size with the music.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import default_numerics
from choreograph.core.timebase import NET_FPS
from choreograph.motion.body import BODY_JOINTS, body_pos_at, checked_body_pos_m

Floats = NDArray[np.float64]
Sizes = tuple[Floats, Floats]  # speed in m/s and space in litres, one each per frame

LEAST_S = 3.0
LEAST_SECTIONS = 3
LEAST_RANGE_DB = 2.0
SILENCE_DB = -60.0  # below full scale; silence is no louder or softer than other silence
_PELVIS = BODY_JOINTS.index("pelvis")
_EVEN = 1e-9  # a spread below this is rounding


def validate(
    body_pos_m: Floats,
    fps: float,
    danced_s: tuple[float, float],
    bounds_s: Sequence[float] | Floats,
    loudness_db: Sequence[float] | Floats,
) -> None:
    """Raise `ParameterError` unless positions, rate, times, increasing bounds (S + 1,), loudness (S,) fit."""
    checked_body_pos_m(body_pos_m, fps)
    if not (np.isfinite(danced_s).all() and 0 <= danced_s[0] < danced_s[1]):
        raise ParameterError(f"expected when the dance begins and ends in seconds, got {danced_s}")
    bounds, loudness = np.asarray(bounds_s, np.float64), np.asarray(loudness_db, np.float64)
    if bounds.ndim != 1 or loudness.ndim != 1 or max(len(bounds) - 1, 0) != len(loudness):
        raise ParameterError(
            f"expected bounds (S + 1,) of sections and loudness (S,), got {bounds.shape}, {loudness.shape}"
        )
    if not (np.isfinite(bounds).all() and (np.diff(bounds) > 0).all() and np.isfinite(loudness).all()):
        raise ParameterError("expected increasing bounds in seconds and finite loudness in dB")


def section_loudness_db(
    samples: NDArray[np.floating], rate_hz: float, bounds_s: Sequence[float] | Floats
) -> Floats:
    """Level (S,) of each section of a song's samples (N,): their root mean square in dB of full scale."""
    levels = []
    for start_s, stop_s in pairwise(np.asarray(bounds_s, np.float64)):
        part = np.asarray(samples[round(start_s * rate_hz) : round(stop_s * rate_hz)], np.float64)
        power = float(np.square(part).mean()) if len(part) else 0.0
        levels.append(max(SILENCE_DB, 10.0 * np.log10(max(power, 1e-12))))
    return np.array(levels)


def motion_size(body_pos_m: Floats, fps: float) -> Sizes:
    """Speed (T',) in m/s and space (T',) in litres of each frame at 20 fps."""
    pos = body_pos_at(body_pos_m, fps, NET_FPS)
    relative = np.delete(pos - pos[:, [_PELVIS]], _PELVIS, axis=1)  # (T', 20, 3)
    space = 1000.0 * np.array([_hull_m3(pose) for pose in relative])
    if len(pos) < 2:
        return np.zeros(len(pos)), space
    return np.linalg.norm(np.gradient(relative, axis=0), axis=-1).mean(axis=1) * NET_FPS, space


def _hull_m3(points_m: Floats) -> float:
    """Volume of the convex hull of points (N, 3); 0 if they lie in a plane."""
    try:
        return float(ConvexHull(points_m).volume)
    except QhullError:
        return 0.0


def section_means(
    values: Floats, bounds_s: Sequence[float] | Floats, danced_s: tuple[float, float]
) -> Floats:
    """Means (S,) of values (T',) at 20 fps over the danced part of each section; nan if it is too short."""
    times_s = np.arange(len(values)) / NET_FPS
    moving = (times_s >= danced_s[0]) & (times_s < danced_s[1])
    means = []
    for start_s, stop_s in pairwise(np.asarray(bounds_s, np.float64)):
        inside = values[moving & (times_s >= start_s) & (times_s < stop_s)]
        means.append(float(inside.mean()) if len(inside) >= LEAST_S * NET_FPS else float("nan"))
    return np.array(means)


def response(loudness_db: Sequence[float] | Floats, size: Sequence[float] | Floats) -> float:
    """Correlation of loudness (S,) and motion size (S,) over a song's sections; sections of size nan do not
    count. nan if the song tells nothing, 0 for a dance of one size.
    """
    loudness, sizes = _telling(loudness_db, size)
    return _correlation(loudness, sizes) if len(loudness) else float("nan")


def soft_to_loud(loudness_db: Sequence[float] | Floats, size: Sequence[float] | Floats) -> float:
    """Motion size in the softest section over that in the loudest; nan if the song tells nothing."""
    loudness, sizes = _telling(loudness_db, size)
    if len(loudness) == 0 or sizes[loudness.argmax()] <= 0:
        return float("nan")
    return float(sizes[loudness.argmin()] / sizes[loudness.argmax()])


def pooled_response(songs: Sequence[tuple[Floats, Floats]]) -> float:
    """Correlation over the sections of all songs that tell, given as (loudness_db (S,), size (S,)).

    Loudness is centred by song, size divided by the song's mean: genres and tempi do not count.
    """
    telling = [pair for pair in (_telling(*song) for song in songs) if len(pair[0]) and pair[1].mean() > 0]
    if not telling:
        return float("nan")
    loudness = np.concatenate([loudness - loudness.mean() for loudness, _ in telling])
    return _correlation(loudness, np.concatenate([size / size.mean() - 1.0 for _, size in telling]))


@default_numerics()
def evaluate(
    body_pos_m: Floats,
    fps: float,
    danced_s: tuple[float, float],
    bounds_s: Sequence[float] | Floats,
    loudness_db: Sequence[float] | Floats,
) -> dict[str, float]:
    """All metrics of one dance by name; it is danced from the first to the second of `danced_s`."""
    validate(body_pos_m, fps, danced_s, bounds_s, loudness_db)
    return _scores(motion_size(body_pos_m, fps), danced_s, bounds_s, loudness_db)


@default_numerics()
def evaluate_chance(
    body_pos_m: Floats,
    fps: float,
    danced_s: tuple[float, float],
    bounds_s: Sequence[float] | Floats,
    loudness_db: Sequence[float] | Floats,
    *,
    rounds: int = 100,
) -> dict[str, float]:
    """Means of the same metrics with the danced part turned round in time, in so many even steps."""
    validate(body_pos_m, fps, danced_s, bounds_s, loudness_db)
    sizes = motion_size(body_pos_m, fps)
    turns = [turned_round(sizes, danced_s, (i + 1) / (rounds + 1)) for i in range(rounds)]
    drawn = [_scores(turned, danced_s, bounds_s, loudness_db) for turned in turns]
    return {name: _mean_of_known([scores[name] for scores in drawn]) for name in drawn[0]}


def turned_round(sizes: Sizes, danced_s: tuple[float, float], turn: float) -> Sizes:
    """`motion_size` with the danced part later by a share of its length, its end wrapped to its start."""
    first, stop = (min(len(sizes[0]), round(time_s * NET_FPS)) for time_s in danced_s)
    speed, space = (values.copy() for values in sizes)
    for values in (speed, space):
        values[first:stop] = np.roll(values[first:stop], round(turn * (stop - first)))
    return speed, space


def _scores(
    sizes: Sizes,
    danced_s: tuple[float, float],
    bounds_s: Sequence[float] | Floats,
    loudness_db: Sequence[float] | Floats,
) -> dict[str, float]:
    speed, space = (section_means(values, bounds_s, danced_s) for values in sizes)
    return {
        "energy_response": response(loudness_db, speed),
        "energy_response_space": response(loudness_db, space),
        "soft_to_loud_speed": soft_to_loud(loudness_db, speed),
        "soft_to_loud_space": soft_to_loud(loudness_db, space),
    }


def _mean_of_known(values: Sequence[float]) -> float:
    known = [value for value in values if np.isfinite(value)]
    return float(np.mean(known)) if known else float("nan")


def _telling(loudness_db: Sequence[float] | Floats, size: Sequence[float] | Floats) -> tuple[Floats, Floats]:
    """Loudness and size of the sections that count; none if they are too few or too alike."""
    loudness, sizes = np.asarray(loudness_db, np.float64), np.asarray(size, np.float64)
    if loudness.shape != sizes.shape or loudness.ndim != 1:
        raise ParameterError(
            f"expected the loudness and motion size of each section, got {loudness.shape}, {sizes.shape}"
        )
    known = np.isfinite(sizes)
    loudness, sizes = loudness[known], sizes[known]
    if len(loudness) < LEAST_SECTIONS or np.ptp(loudness) < LEAST_RANGE_DB:
        return np.zeros(0), np.zeros(0)
    return loudness, sizes


def _correlation(a: Floats, b: Floats) -> float:
    a, b = a - a.mean(), b - b.mean()
    scale = float(np.sqrt(np.square(a).sum() * np.square(b).sum()))
    return float((a * b).sum() / scale) if scale > _EVEN else 0.0
