"""Energy response: whether a dance is bigger where its song is louder, section by section.

Conventions: body positions (T, 21, 3) are in metres at `fps`. The sections of the song are given by their
bounds (S + 1,) in seconds and their loudness (S,) in dB. Motion size is measured in two ways, and travelling
does not count in either. Speed is the mean speed of 20 joints relative to the pelvis, in m/s. Space is the
volume of the convex hull of those joints, in litres. A section counts if at least `LEAST_S` seconds of it are
danced. Held poses at both ends are left out. The metrics are nan for songs of fewer than three sections, or
whose sections differ by less than `LEAST_RANGE_DB`. Average the correlations of many songs, or pool them by
`pooled_response`, because one song has few sections. Dances may change more than their size with the music.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats, default_numerics
from choreograph.core.timebase import NET_FPS
from choreograph.motion.body import BODY_JOINTS, body_pos_at, checked_body_pos_m

Sizes = tuple[Floats, Floats]  # speed in m/s and space in litres, one each per frame

LEAST_S = 3.0
LEAST_SECTIONS = 3
LEAST_RANGE_DB = 2.0
SILENCE_DB = -60.0  # below full scale. Sections below it count as equally silent
_PELVIS = BODY_JOINTS.index("pelvis")
_EVEN = 1e-9  # a spread below this is rounding


def validate(
    body_pos_m: Floats,
    fps: float,
    danced_s: tuple[float, float],
    bounds_s: Sequence[float] | Floats,
    loudness_db: Sequence[float] | Floats,
) -> None:
    """Raise `ParameterError` unless positions, rate, times, increasing bounds (S + 1,) and loudness (S,) fit.

    Examples
    --------
    >>> cg.metrics.energy_response.validate(np.zeros((60, 21, 3)), 20.0, (0.0, 3.0), [0.0, 3.0], [-10.0])
    >>> cg.metrics.energy_response.validate(np.zeros((60, 21, 3)), 20.0, (3.0, 0.0), [0.0, 3.0], [-10.0])
    Traceback (most recent call last):
        ...
    choreograph.core.errors.ParameterError: expected when the dance begins and ends in seconds, got (3.0, 0.0)
    """
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
    """Level (S,) of each section of the samples (N,) of a song: the root mean square in dB of full scale.

    Examples
    --------
    >>> samples = np.concatenate([np.ones(100), np.full(100, 0.1)])
    >>> cg.metrics.energy_response.section_loudness_db(samples, 100.0, bounds_s=[0.0, 1.0, 2.0]).round(2)
    array([  0., -20.])
    """
    levels = []
    for start_s, stop_s in pairwise(np.asarray(bounds_s, np.float64)):
        part = np.asarray(samples[round(start_s * rate_hz) : round(stop_s * rate_hz)], np.float64)
        power = float(np.square(part).mean()) if len(part) else 0.0
        levels.append(max(SILENCE_DB, 10.0 * np.log10(max(power, 1e-12))))
    return np.array(levels)


def motion_size(body_pos_m: Floats, fps: float) -> Sizes:
    """Speed (T',) in m/s and space (T',) in litres of each frame at 20 fps.

    Examples
    --------
    >>> pose_m = np.random.default_rng(0).normal(0.0, 0.3, (21, 3))
    >>> speed, space = cg.metrics.energy_response.motion_size(np.tile(pose_m, (40, 1, 1)), 20.0)  # held
    >>> speed.max(), bool(space.min() > 0)
    (np.float64(0.0), True)
    """
    pos = body_pos_at(body_pos_m, fps, NET_FPS)
    relative = np.delete(pos - pos[:, [_PELVIS]], _PELVIS, axis=1)  # (T', 20, 3)
    space = 1000.0 * np.array([_hull_m3(pose) for pose in relative])
    if len(pos) < 2:
        return np.zeros(len(pos)), space
    return np.linalg.norm(np.gradient(relative, axis=0), axis=-1).mean(axis=1) * NET_FPS, space


def _hull_m3(points_m: Floats) -> float:
    """Volume of the convex hull of points (N, 3), or 0 if they lie in a plane."""
    try:
        return float(ConvexHull(points_m).volume)
    except QhullError:
        return 0.0


def section_means(
    values: Floats, bounds_s: Sequence[float] | Floats, danced_s: tuple[float, float]
) -> Floats:
    """Means (S,) of values (T',) at 20 fps over the danced part of each section. nan if it is too short.

    Examples
    --------
    >>> values = np.repeat([1.0, 2.0], 80)  # two sections of 4 s
    >>> cg.metrics.energy_response.section_means(values, [0.0, 4.0, 8.0], danced_s=(0.0, 8.0))
    array([1., 2.])
    """
    times_s = np.arange(len(values)) / NET_FPS
    moving = (times_s >= danced_s[0]) & (times_s < danced_s[1])
    means = []
    for start_s, stop_s in pairwise(np.asarray(bounds_s, np.float64)):
        inside = values[moving & (times_s >= start_s) & (times_s < stop_s)]
        means.append(float(inside.mean()) if len(inside) >= LEAST_S * NET_FPS else float("nan"))
    return np.array(means)


def response(loudness_db: Sequence[float] | Floats, size: Sequence[float] | Floats) -> float:
    """Correlation of loudness (S,) and motion size (S,) over the sections of a song, -1 to 1.

    Higher is better. Sections whose size is nan are left out. The result is 0 for a dance of constant size,
    and nan for a song of fewer than three sections or a range below 2 dB.

    Examples
    --------
    >>> loudness_db = [-20.0, -15.0, -10.0]
    >>> [round(cg.metrics.energy_response.response(loudness_db, size), 2) for size in ([1, 2, 3], [3, 2, 1])]
    [1.0, -1.0]
    """
    loudness, sizes = _measurable(loudness_db, size)
    return _correlation(loudness, sizes) if len(loudness) else float("nan")


def soft_to_loud(loudness_db: Sequence[float] | Floats, size: Sequence[float] | Floats) -> float:
    """Motion size in the softest section divided by that in the loudest, 0 or more. Below 1 follows the song.

    The result is nan for songs that `response` cannot measure, and if the loudest section has no motion.

    Examples
    --------
    >>> cg.metrics.energy_response.soft_to_loud([-20.0, -15.0, -10.0], [1.0, 2.0, 4.0])
    0.25
    """
    loudness, sizes = _measurable(loudness_db, size)
    if len(loudness) == 0 or sizes[loudness.argmax()] <= 0:
        return float("nan")
    return float(sizes[loudness.argmin()] / sizes[loudness.argmax()])


def speed_response(
    body_pos_m: Floats, fps: float, bounds_s: Sequence[float] | Floats, loudness_db: Sequence[float] | Floats
) -> float:
    """Rank correlation (Spearman) of loudness (W,) and joint speed over windows of a song, -1 to 1.

    `bounds_s` (W + 1,) are the borders of the windows. Windows of 4 s average the steps of a bar or two.
    Speed is that of all joints over the floor, travelling included. Higher is better. The result is 0 for a
    dance of constant speed.

    Examples
    --------
    >>> speed = np.repeat([1.0, 2.0, 3.0], 80)[:, None]  # of windows of 4 s at 20 fps
    >>> pos_m = np.zeros((240, 21, 3)) + np.cumsum(speed, axis=0)[..., None] / 20
    >>> cg.metrics.energy_response.speed_response(pos_m, 20.0, [0, 4, 8, 12], [-30.0, -20.0, -10.0])
    1.0
    """
    validate(body_pos_m, fps, (0.0, len(body_pos_m) / fps), bounds_s, loudness_db)
    speed = np.array([speed_within_m_s(body_pos_m, fps, span_s) for span_s in pairwise(bounds_s)])
    known = np.isfinite(speed)
    ranks = [_ranks(np.asarray(values, np.float64)[known]) for values in (loudness_db, speed)]
    return round(_correlation(*ranks), 6)


def speed_within_m_s(body_pos_m: Floats, fps: float, span_s: tuple[float, float]) -> float:
    """Mean speed of all joints within a span of the dance, travelling included, in m/s, 0 or more.

    Divide that of a break, a silence or a softened part by that before it, or by that of the dance to the
    unchanged song. The result is nan for a span without two frames at 20 fps.

    Examples
    --------
    >>> speed = np.repeat([2.0, 0.5], 80)[:, None]  # of 4 s each at 20 fps
    >>> pos_m = np.zeros((160, 21, 3)) + np.cumsum(speed, axis=0)[..., None] / 20
    >>> round(cg.metrics.energy_response.speed_within_m_s(pos_m, 20.0, (4.0, 8.0)) / 3**0.5, 2)
    0.5
    """
    checked_body_pos_m(body_pos_m, fps)
    part = body_pos_at(body_pos_m, fps, NET_FPS)[round(span_s[0] * NET_FPS) : round(span_s[1] * NET_FPS)]
    if len(part) < 2:
        return float("nan")
    return float(np.linalg.norm(np.diff(part, axis=0), axis=-1).mean() * NET_FPS)


def _ranks(values: Floats) -> Floats:
    """Ranks (W,) of values (W,). Equal values have their mean rank."""
    ranks: Floats = (
        np.sum(values[:, None] > values, axis=1) - np.sum(values[:, None] < values, axis=1)
    ) / 2.0
    return ranks


def pooled_response(songs: Sequence[tuple[Floats, Floats]]) -> float:
    """Correlation over the sections of all songs, given as (loudness_db (S,), size (S,)), -1 to 1.

    The loudness of a song is centred and its motion size divided by the mean of the song, so that genres and
    tempi do not count. Songs that `response` cannot measure are left out. Higher is better.

    Examples
    --------
    >>> loudness_db, size = np.array([-20.0, -15.0, -10.0]), np.array([1.0, 2.0, 3.0])
    >>> songs = [(loudness_db, size), (loudness_db + 6, 10 * size)]
    >>> round(cg.metrics.energy_response.pooled_response(songs), 2)
    1.0
    """
    known = [pair for pair in (_measurable(*song) for song in songs) if len(pair[0]) and pair[1].mean() > 0]
    if not known:
        return float("nan")
    loudness = np.concatenate([loudness - loudness.mean() for loudness, _ in known])
    return _correlation(loudness, np.concatenate([size / size.mean() - 1.0 for _, size in known]))


@default_numerics()
def evaluate(
    body_pos_m: Floats,
    fps: float,
    danced_s: tuple[float, float],
    bounds_s: Sequence[float] | Floats,
    loudness_db: Sequence[float] | Floats,
) -> dict[str, float]:
    """All metrics of one dance by name. It is danced from the first to the second time of `danced_s`.

    Examples
    --------
    >>> size = np.repeat([1.0, 2.0, 3.0], 80)[:, None, None]  # three sections of 4 s at 20 fps
    >>> pos_m = size * np.random.default_rng(0).normal(0.0, 0.1, (240, 21, 3))
    >>> song = {"danced_s": (0, 12), "bounds_s": [0, 4, 8, 12], "loudness_db": [-20, -15, -10]}
    >>> round(cg.metrics.energy_response.evaluate(pos_m, 20.0, **song)["energy_response"], 1)
    1.0
    """
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
    """Means of the same metrics after rotations of the danced part in time, in `rounds` equal steps.

    Examples
    --------
    >>> size = np.repeat([1.0, 2.0, 3.0], 80)[:, None, None]  # three sections of 4 s at 20 fps
    >>> pos_m = size * np.random.default_rng(0).normal(0.0, 0.1, (240, 21, 3))
    >>> song = {"danced_s": (0, 12), "bounds_s": [0, 4, 8, 12], "loudness_db": [-20, -15, -10]}
    >>> chance = cg.metrics.energy_response.evaluate_chance(pos_m, 20.0, **song, rounds=11)
    >>> abs(chance["energy_response"]) < 0.3
    True
    """
    validate(body_pos_m, fps, danced_s, bounds_s, loudness_db)
    sizes = motion_size(body_pos_m, fps)
    turns = [turned_round(sizes, danced_s, (i + 1) / (rounds + 1)) for i in range(rounds)]
    drawn = [_scores(turned, danced_s, bounds_s, loudness_db) for turned in turns]
    return {name: _mean_of_known([scores[name] for scores in drawn]) for name in drawn[0]}


def turned_round(sizes: Sizes, danced_s: tuple[float, float], turn: float) -> Sizes:
    """`motion_size` with the danced part rotated by a share of its length, its end wrapped to its start.

    Examples
    --------
    >>> sizes = np.arange(4.0), np.arange(4.0)  # 0.2 s at 20 fps
    >>> cg.metrics.energy_response.turned_round(sizes, (0.0, 0.2), turn=0.25)[0]
    array([3., 0., 1., 2.])
    """
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


def _measurable(
    loudness_db: Sequence[float] | Floats, size: Sequence[float] | Floats
) -> tuple[Floats, Floats]:
    """Loudness and size of the sections that count, or none if they are too few or too alike."""
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
