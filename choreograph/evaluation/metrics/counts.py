"""Counts: whether a dance's counts lie on the song's beats, and its count 1 on the downbeat.

Conventions: danced counts (N,) and music beats (Q,) in seconds, increasing, both with their numbers in the
bar (1 on the downbeat, 0 where bars are not known). The unit "beat" is the interval between the two music
beats around a count, so an error is a phase from -0.5 to 0.5 beat. It is negative if the count is early. A
count of random phase is within `WITHIN_BEATS` of a beat with probability 0.30. Counts more than half a beat
before the first or after the last music beat cannot be compared with a beat and are left out.

The counts of a take are known from its annotation or data set. They are not detected in the motion, so these
metrics do not depend on a motion-beat detector. They depend on the given beats. A dance at half the tempo has
every count on a beat, so compare `counts_per_beat` with the shares. Metrics that cannot be measured are nan:
all without counts or with fewer than two music beats, and those of bars if the bars of one side are unknown.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats, default_numerics

Numbers = NDArray[np.int64]

WITHIN_BEATS = 0.15
MIN_SHIFT_S = 1.0  # of the chance level
_DRIFT_COUNTS = 8  # fewer counts make no drift


def validate(
    danced_s: ArrayLike, danced_numbers: ArrayLike, beats_s: ArrayLike, beat_numbers: ArrayLike
) -> None:
    """Raise `ParameterError` unless times are finite and increasing, each with a whole number, 0 or more.

    Examples
    --------
    >>> beats_s, numbers = np.arange(16) / 2, np.tile([1, 2, 3, 4], 4)
    >>> cg.metrics.counts.validate(beats_s, numbers, beats_s, numbers)
    >>> cg.metrics.counts.validate(beats_s, numbers[1:], beats_s, numbers)
    Traceback (most recent call last):
        ...
    choreograph.core.errors.ParameterError: expected a number in the bar, ..., got (15,)
    """
    for name, times, numbers in (
        ("danced counts", danced_s, danced_numbers),
        ("music beats", beats_s, beat_numbers),
    ):
        _checked_times(times, name)
        given = np.asarray(numbers)
        if given.shape != np.shape(times) or (given < 0).any() or (given != np.round(given)).any():
            raise ParameterError(
                f"expected a number in the bar, 0 or more, for each of {np.shape(times)} {name}, got "
                f"{given.shape}"
            )


def count_error_s(danced_s: ArrayLike, beats_s: ArrayLike) -> float:
    """Mean distance from a danced count to its nearest beat, in seconds. 0 is perfect.

    Examples
    --------
    >>> beats_s = np.arange(16) / 2
    >>> round(cg.metrics.counts.count_error_s(beats_s + 0.1, beats_s), 3)
    0.1
    """
    danced, beats = _checked_times(danced_s, "danced counts"), _checked_times(beats_s, "music beats")
    position = beat_positions(danced, beats)
    nearest = np.round(position[_judged(position, len(beats))]).astype(int).clip(0, len(beats) - 1)
    return _mean(np.abs(danced[_judged(position, len(beats))] - beats[nearest]))


def count_error_beats(danced_s: ArrayLike, beats_s: ArrayLike) -> float:
    """Mean distance from a danced count to its nearest beat, in beats, 0 to 0.5. 0.25 is chance.

    Examples
    --------
    >>> beats_s = np.arange(16) / 2
    >>> cg.metrics.counts.count_error_beats(beats_s, beats_s)
    0.0
    >>> round(cg.metrics.counts.count_error_beats(beats_s + 0.1, beats_s), 3)
    0.2
    """
    return _mean(np.abs(signed_errors_beats(danced_s, beats_s)))


def counts_within(danced_s: ArrayLike, beats_s: ArrayLike, *, within_beats: float = WITHIN_BEATS) -> float:
    """Share of the danced counts within `within_beats` of a beat, 0 to 1. Twice `within_beats` is chance.

    Examples
    --------
    >>> beats_s = np.arange(16) / 2
    >>> [cg.metrics.counts.counts_within(beats_s + late_s, beats_s) for late_s in (0.0, 0.05, 0.1)]
    [1.0, 1.0, 0.0]
    >>> round(cg.metrics.counts.counts_within(np.arange(2000) * 0.00317, beats_s), 1)  # counts of any phase
    0.3
    """
    return _mean(np.abs(signed_errors_beats(danced_s, beats_s)) <= within_beats + 1e-9)


def downbeat_share(
    danced_s: ArrayLike,
    danced_numbers: ArrayLike,
    beats_s: ArrayLike,
    beat_numbers: ArrayLike,
    *,
    within_beats: float = WITHIN_BEATS,
) -> float:
    """Share of the danced counts 1 within `within_beats` of a downbeat, 0 to 1. 0.30 / metre is chance.

    Examples
    --------
    >>> beats_s, numbers = np.arange(16) / 2, np.tile([1, 2, 3, 4], 4)
    >>> cg.metrics.counts.downbeat_share(beats_s, numbers, beats_s, numbers)
    1.0
    >>> cg.metrics.counts.downbeat_share(beats_s, np.roll(numbers, 1), beats_s, numbers)  # one beat late
    0.0
    """
    number, error = _numbers_under_ones(danced_s, danced_numbers, beats_s, beat_numbers)
    return _mean((number == 1) & (np.abs(error) <= within_beats + 1e-9))


def downbeat_nearest(
    danced_s: ArrayLike, danced_numbers: ArrayLike, beats_s: ArrayLike, beat_numbers: ArrayLike
) -> float:
    """Share of the danced counts 1 whose nearest beat is a downbeat, 0 to 1. 1 / metre is chance.

    The distance to that beat does not matter.

    Examples
    --------
    >>> beats_s, numbers = np.arange(16) / 2, np.tile([1, 2, 3, 4], 4)
    >>> cg.metrics.counts.downbeat_nearest(beats_s + 0.2, numbers, beats_s, numbers)
    1.0
    """
    number, _ = _numbers_under_ones(danced_s, danced_numbers, beats_s, beat_numbers)
    return _mean(number == 1)


def counts_per_beat(danced_s: ArrayLike, beats_s: ArrayLike) -> float:
    """Danced counts per beat, the median from count to count. 0.5 is a dance at half the tempo.

    Examples
    --------
    >>> beats_s = np.arange(16) / 2
    >>> [cg.metrics.counts.counts_per_beat(danced_s, beats_s) for danced_s in (beats_s, beats_s[::2])]
    [1.0, 0.5]
    """
    position = beat_positions(danced_s, beats_s)
    steps = np.diff(position[_judged(position, np.size(beats_s))])
    return float(1.0 / np.median(steps)) if len(steps) else float("nan")


def count_drift(danced_s: ArrayLike, beats_s: ArrayLike) -> float:
    """How fast the counts move against the beats, in beats per minute of the dance. 0 is perfect.

    It is the slope of a line through the errors. Errors are unwrapped from count to count, so that one that
    grows beyond half a beat keeps growing. The result is nan with fewer than eight counts.

    Examples
    --------
    >>> beats_s = np.arange(120) / 2  # 120 BPM
    >>> round(cg.metrics.counts.count_drift(beats_s / 1.01, beats_s), 2)  # a dance at 121.2 BPM
    1.2
    """
    danced = _checked_times(danced_s, "danced counts")
    position = beat_positions(danced, beats_s)
    inside = _judged(position, np.size(beats_s))
    if np.count_nonzero(inside) < _DRIFT_COUNTS:
        return float("nan")
    error = position[inside] - np.round(position[inside])
    followed = np.unwrap(error, period=1.0)
    return float(abs(np.polyfit(danced[inside] / 60.0, followed, 1)[0]))


def signed_errors_beats(danced_s: ArrayLike, beats_s: ArrayLike) -> Floats:
    """Errors of all judged counts in beats, (N',) from -0.5 to 0.5. Early counts have negative errors.

    Examples
    --------
    >>> cg.metrics.counts.signed_errors_beats([0.45, 1.1], beats_s=[0.0, 0.5, 1.0, 1.5]).round(3)
    array([-0.1,  0.2])
    """
    position = beat_positions(danced_s, beats_s)
    position = position[_judged(position, np.size(beats_s))]
    return position - np.round(position)


def beat_positions(times_s: ArrayLike, beats_s: ArrayLike) -> Floats:
    """Times as positions in the sequence of beats, (N,), counted from 0.

    2.5 is half way from beat 2 to beat 3. Times before the first and after the last beat are
    placed by the tempo there. All are nan with fewer than two beats.

    Examples
    --------
    >>> cg.metrics.counts.beat_positions([0.25, 1.0, 2.0], beats_s=[0.0, 0.5, 1.0])
    array([0.5, 2. , 4. ])
    """
    times, beats = np.asarray(times_s, np.float64), _checked_times(beats_s, "music beats")
    if len(beats) < 2:
        return np.full(times.shape, np.nan)
    before = np.clip(np.searchsorted(beats, times, side="right") - 1, 0, len(beats) - 2)
    return before + (times - beats[before]) / (beats[before + 1] - beats[before])


@default_numerics()
def evaluate(
    danced_s: ArrayLike, danced_numbers: ArrayLike, beats_s: ArrayLike, beat_numbers: ArrayLike
) -> dict[str, float]:
    """All metrics of this module by name. Raises `ParameterError` as `validate` does.

    Examples
    --------
    >>> beats_s, numbers = np.arange(16) / 2, np.tile([1, 2, 3, 4], 4)
    >>> scores = cg.metrics.counts.evaluate(beats_s, numbers, beats_s, numbers)
    >>> scores["counts_within"], scores["downbeat_share"], scores["count_error_s"]
    (1.0, 1.0, 0.0)
    """
    validate(danced_s, danced_numbers, beats_s, beat_numbers)
    return {
        "count_error_s": count_error_s(danced_s, beats_s),
        "count_error_beats": count_error_beats(danced_s, beats_s),
        "counts_within": counts_within(danced_s, beats_s),
        "downbeat_share": downbeat_share(danced_s, danced_numbers, beats_s, beat_numbers),
        "downbeat_nearest": downbeat_nearest(danced_s, danced_numbers, beats_s, beat_numbers),
        "counts_per_beat": counts_per_beat(danced_s, beats_s),
        "count_drift": count_drift(danced_s, beats_s),
    }


@default_numerics()
def evaluate_chance(
    danced_s: ArrayLike,
    danced_numbers: ArrayLike,
    beats_s: ArrayLike,
    beat_numbers: ArrayLike,
    *,
    duration_s: float,
    rng: np.random.Generator,
    rounds: int = 100,
) -> dict[str, float]:
    """Mean of every score after circular shifts of the beats, with their numbers, by a second or more.

    `duration_s` is that of the song. `counts_per_beat` and `count_drift` are left out, because a shift does
    not change them. A score that is nan in every round is nan.

    Examples
    --------
    >>> beats_s, numbers = np.arange(32) / 2, np.tile([1, 2, 3, 4], 8)
    >>> given, rng = (beats_s, numbers, beats_s, numbers), np.random.default_rng(0)
    >>> chance = cg.metrics.counts.evaluate_chance(*given, duration_s=16.0, rng=rng, rounds=400)
    >>> round(chance["counts_within"], 1)
    0.3
    """
    validate(danced_s, danced_numbers, beats_s, beat_numbers)
    if not (np.isfinite(duration_s) and duration_s > 0) or rounds < 1:
        raise ParameterError(f"expected a duration and rounds above 0, got {duration_s} s and {rounds}")
    rows = []
    for shift_s in rng.uniform(MIN_SHIFT_S, max(MIN_SHIFT_S, duration_s - MIN_SHIFT_S), rounds):
        shifted_s, first = np.unique((np.asarray(beats_s) + shift_s) % duration_s, return_index=True)
        rows.append(evaluate(danced_s, danced_numbers, shifted_s, np.asarray(beat_numbers)[first]))
    names = [name for name in rows[0] if name not in ("counts_per_beat", "count_drift")]
    return {name: _mean(np.array([row[name] for row in rows])) for name in names}


def uniform_chance(metre: int) -> dict[str, float]:
    """Exact scores of counts of random phase against a steady beat of that metre.

    Raises `ParameterError` unless the metre is 1 or more.

    Examples
    --------
    >>> chance = cg.metrics.counts.uniform_chance(4)
    >>> chance["counts_within"], chance["downbeat_nearest"]
    (0.3, 0.25)
    """
    if metre < 1:
        raise ParameterError(f"expected a metre of 1 or more, got {metre}")
    within = 2.0 * WITHIN_BEATS
    return {
        "count_error_beats": 0.25, "counts_within": within, "downbeat_share": within / metre,
        "downbeat_nearest": 1.0 / metre,
    }  # fmt: skip


def _numbers_under_ones(
    danced_s: ArrayLike, danced_numbers: ArrayLike, beats_s: ArrayLike, beat_numbers: ArrayLike
) -> tuple[Numbers, Floats]:
    """Number of the beat nearest to each judged count 1, and its error in beats, or none without bars."""
    validate(danced_s, danced_numbers, beats_s, beat_numbers)
    numbers = np.asarray(beat_numbers, np.int64)
    position = beat_positions(danced_s, beats_s)
    ones = _judged(position, len(numbers)) & (np.asarray(danced_numbers) == 1)
    if not (numbers == 1).any():
        return np.zeros(0, np.int64), np.zeros(0)
    nearest = np.round(position[ones])
    return numbers[nearest.astype(int).clip(0, len(numbers) - 1)], position[ones] - nearest


def _judged(position: Floats, n_beats: int) -> NDArray[np.bool_]:
    """Whether positions are at most half a beat outside the beats. False for nan."""
    return (position >= -0.5) & (position <= n_beats - 0.5)


def _checked_times(times_s: ArrayLike, name: str) -> Floats:
    times = np.asarray(times_s, np.float64)
    if times.ndim != 1 or not np.isfinite(times).all() or (np.diff(times) <= 0).any():
        raise ParameterError(f"expected increasing, finite {name} in seconds, got shape {times.shape}")
    return times


def _mean(values: NDArray[np.floating] | NDArray[np.bool_]) -> float:
    """Mean of the values that are not nan, or nan if there are none."""
    known = values[~np.isnan(values)] if values.dtype.kind == "f" else values
    return float(known.mean()) if len(known) else float("nan")
