"""Counts: whether a dance's counts lie on the song's beats, and its count 1 on the downbeat.

Conventions: danced counts (N,) and music beats (Q,) in seconds, increasing, both with their numbers in the
bar (1 on the downbeat, 0 where bars are not known). The unit "beat" is the interval between the two music
beats around a count, so an error is a phase: from -½ to ½ beat, negative if the count is early. A count of
random phase is within `WITHIN_BEATS` of a beat with probability 0.30. Counts more than half a beat before
the first or after the last music beat have nothing to be held against and are left out.

Where a take's counts lie is known from its annotation or data set, not detected in the motion, so these
metrics do not depend on a motion-beat detector. They depend on the beats given. A dance at half the tempo has
every count on a beat: read `counts_per_beat` with the shares. What cannot be measured is nan: all of them
without counts or with fewer than two music beats, the bars' where one side's bars are not known.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import default_numerics

Floats = NDArray[np.float64]
Numbers = NDArray[np.int64]

WITHIN_BEATS = 0.15
MIN_SHIFT_S = 1.0  # of the chance level
_DRIFT_COUNTS = 8  # fewer counts make no drift


def validate(
    danced_s: ArrayLike, danced_numbers: ArrayLike, beats_s: ArrayLike, beat_numbers: ArrayLike
) -> None:
    """Raise `ParameterError` unless times are finite and increasing, each with a whole number, 0 or more."""
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
    """Mean distance from a danced count to its nearest beat, in seconds."""
    danced, beats = _checked_times(danced_s, "danced counts"), _checked_times(beats_s, "music beats")
    position = beat_positions(danced, beats)
    nearest = np.round(position[_judged(position, len(beats))]).astype(int).clip(0, len(beats) - 1)
    return _mean(np.abs(danced[_judged(position, len(beats))] - beats[nearest]))


def count_error_beats(danced_s: ArrayLike, beats_s: ArrayLike) -> float:
    """Mean distance from a danced count to its nearest beat, in beats, 0 … ½; ¼ by chance."""
    return _mean(np.abs(signed_errors_beats(danced_s, beats_s)))


def counts_within(danced_s: ArrayLike, beats_s: ArrayLike, *, within_beats: float = WITHIN_BEATS) -> float:
    """Share of the danced counts within `within_beats` of a beat, 0 … 1; twice that by chance."""
    return _mean(np.abs(signed_errors_beats(danced_s, beats_s)) <= within_beats + 1e-9)


def downbeat_share(
    danced_s: ArrayLike,
    danced_numbers: ArrayLike,
    beats_s: ArrayLike,
    beat_numbers: ArrayLike,
    *,
    within_beats: float = WITHIN_BEATS,
) -> float:
    """Share of the danced counts 1 within `within_beats` of a downbeat; by chance 0.30 / metre."""
    number, error = _numbers_under_ones(danced_s, danced_numbers, beats_s, beat_numbers)
    return _mean((number == 1) & (np.abs(error) <= within_beats + 1e-9))


def downbeat_nearest(
    danced_s: ArrayLike, danced_numbers: ArrayLike, beats_s: ArrayLike, beat_numbers: ArrayLike
) -> float:
    """Share of the danced counts 1 whose nearest beat is a downbeat, however far; by chance 1 / metre."""
    number, _ = _numbers_under_ones(danced_s, danced_numbers, beats_s, beat_numbers)
    return _mean(number == 1)


def counts_per_beat(danced_s: ArrayLike, beats_s: ArrayLike) -> float:
    """Danced counts to a beat, the median from count to count: 1, or ½ for a dance at half the tempo."""
    position = beat_positions(danced_s, beats_s)
    steps = np.diff(position[_judged(position, np.size(beats_s))])
    return float(1.0 / np.median(steps)) if len(steps) else float("nan")


def count_drift(danced_s: ArrayLike, beats_s: ArrayLike) -> float:
    """How fast the counts move against the beats, in beats per minute of dance, 0 or more.

    The slope of a line through the errors, which are followed from count to count: one that grows through
    half a beat grows on. nan with fewer than eight counts.
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
    """Error of every judged count in beats, (N',) from -½ to ½, below 0 if the count is early."""
    position = beat_positions(danced_s, beats_s)
    position = position[_judged(position, np.size(beats_s))]
    return position - np.round(position)


def beat_positions(times_s: ArrayLike, beats_s: ArrayLike) -> Floats:
    """Times as positions in the sequence of beats, (N,): 2.5 is half way from beat 2 to beat 3, from 0.

    Before the first and after the last beat at the tempo there; nan with fewer than two beats.
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
    """All metrics of this module by name."""
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

    `duration_s` is the song's. Left out are `counts_per_beat` and `count_drift`, which a shift does not
    change. A score that is nan in every round is nan.
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
    """Scores of counts of random phase against a steady beat of that metre, exactly.

    Raises `ParameterError` unless the metre is 1 or more.
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
    """Number of the beat nearest to each judged count 1, and its error in beats; none without bars."""
    validate(danced_s, danced_numbers, beats_s, beat_numbers)
    numbers = np.asarray(beat_numbers, np.int64)
    position = beat_positions(danced_s, beats_s)
    ones = _judged(position, len(numbers)) & (np.asarray(danced_numbers) == 1)
    if not (numbers == 1).any():
        return np.zeros(0, np.int64), np.zeros(0)
    nearest = np.round(position[ones])
    return numbers[nearest.astype(int).clip(0, len(numbers) - 1)], position[ones] - nearest


def _judged(position: Floats, n_beats: int) -> NDArray[np.bool_]:
    """Whether positions are at most half a beat outside the beats; nan is not."""
    return (position >= -0.5) & (position <= n_beats - 0.5)


def _checked_times(times_s: ArrayLike, name: str) -> Floats:
    times = np.asarray(times_s, np.float64)
    if times.ndim != 1 or not np.isfinite(times).all() or (np.diff(times) <= 0).any():
        raise ParameterError(f"expected increasing, finite {name} in seconds, got shape {times.shape}")
    return times


def _mean(values: NDArray) -> float:
    """Mean of the values that are not nan; nan if there are none."""
    known = values[~np.isnan(values)] if values.dtype.kind == "f" else values
    return float(known.mean()) if len(known) else float("nan")
