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

The phase of a motion beat is from 0 (on the beat) to 1 (the next beat), so 0.9 is just early. A histogram
(`N_BINS`,) of shares has its first bin centred on the beat and is circular: the last bin is next to the
first. Dancers rest where their genre's technique has them rest, which is rarely on the beat itself, so a
dance is compared with experts of its genre, not with the beat. The distance is the earth mover's on the
circle, in beats. It says how far motion beats would have to be moved on average. It is at most 0.5 beat, and
0.25 between beats at one place and uniform ones. The χ² distance of a shift by one bin would equal that of
half a beat, and would depend on where bins end.

A distance between finite samples is never 0. So a dance is compared with one half of the experts' dances,
which are split by song. The chance level (uniformly random phases) and the floor (the other half of the
experts) are compared with the same half, with as many phases each, over many splits. All three are large if
there are few dances.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats, default_numerics
from choreograph.evaluation.metrics.frechet import halves

Numbers = NDArray[np.int64]

WITHIN_BEATS = 0.15
MIN_SHIFT_S = 1.0  # of the chance level
SAME_TEMPO = 0.04  # tempi that differ by less are the same, as in the evaluation of tempo trackers
_TEMPO_INTERVALS = 5  # intervals between counts whose median is the tempo there
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
    >>> round(cg.metrics.counts.outside_tempi_share(counts_s, low_bpm=100.0, high_bpm=130.0), 2)
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


def _running_median(values: Floats) -> Floats:
    """Median of each value (N,) and the two on either side of it, which are fewer at the ends."""
    reach = _TEMPO_INTERVALS // 2
    padded = np.pad(values, reach, constant_values=np.nan)
    medians: Floats = np.nanmedian(np.lib.stride_tricks.sliding_window_view(padded, _TEMPO_INTERVALS), axis=1)
    return medians


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


# Phase of motion beats within the count, the place between two beats where a body rests.


PHASE_ROUNDS = 50  # splits of the experts
_PHASE_NAMES = ("phase_distance", "phase_distance_chance", "phase_distance_halves", "phase_nearness")
N_BINS = 8  # of 60 to 90 ms at a dance's tempo, no finer than motion beats are detected


def validate_phases(phases: ArrayLike) -> None:
    """Raise `ParameterError` unless phases (Q,) are from 0 to 1.

    Examples
    --------
    >>> cg.metrics.counts.validate_phases([0.0, 0.5])
    >>> cg.metrics.counts.validate_phases([1.5])
    Traceback (most recent call last):
        ...
    choreograph.core.errors.ParameterError: expected phases (Q,) from 0 to 1, got an array of (1,)
    """
    given = np.asarray(phases, np.float64)
    if given.ndim != 1 or not ((given >= 0) & (given <= 1)).all():
        raise ParameterError(f"expected phases (Q,) from 0 to 1, got an array of {given.shape}")


def phases(motion_beats_s: ArrayLike, beats_s: ArrayLike) -> Floats:
    """Phases (Q',) of the motion beats between the first and the last of the music beats.

    Examples
    --------
    >>> cg.metrics.counts.phases([0.5, 1.1, 9.0], beats_s=[0.0, 0.5, 1.0, 1.5])
    array([0. , 0.2])
    """
    position = beat_positions(motion_beats_s, beats_s)
    position = position[(position >= 0) & (position <= np.size(beats_s) - 1)]
    return position % 1.0


def phase_histogram(phases: ArrayLike, *, n_bins: int = N_BINS) -> Floats:
    """Shares (n_bins,) of the phases (Q,) by bin. The first bin is centred on the beat. nan without phases.

    Examples
    --------
    >>> cg.metrics.counts.phase_histogram([0.0, 0.98, 0.5, 0.51], n_bins=4)
    array([0.5, 0. , 0.5, 0. ])
    """
    validate_phases(phases)
    given = np.asarray(phases, np.float64)
    if len(given) == 0:
        return np.full(n_bins, np.nan)
    nearest_bin = np.floor(given * n_bins + 0.5).astype(int) % n_bins
    return np.bincount(nearest_bin, minlength=n_bins) / len(given)


def phase_distance(a: ArrayLike, b: ArrayLike) -> float:
    """Earth mover's distance on the circle between two histograms (K,) of shares, in beats, 0 to 0.5.

    Lower is better. What flows over each border between bins is the difference of the cumulative shares, up
    to a constant that flows round the whole circle. Its best value is the median of the differences (Werman
    et al., 1986). The result is nan if a share is nan. Raises `ParameterError` unless both histograms have
    the same number of bins and sum to 1.

    Examples
    --------
    >>> on_beat, between = [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]
    >>> distance = cg.metrics.counts.phase_distance
    >>> distance(on_beat, on_beat), distance(on_beat, between), distance(on_beat, [0.25] * 4)
    (0.0, 0.5, 0.25)
    """
    shares = [np.asarray(h, np.float64) for h in (a, b)]
    if shares[0].ndim != 1 or shares[0].shape != shares[1].shape:
        raise ParameterError(f"expected two histograms (K,), got {shares[0].shape} and {shares[1].shape}")
    if any(np.isnan(h).any() for h in shares):
        return float("nan")
    if any((h < 0).any() or abs(h.sum() - 1.0) > 1e-6 for h in shares):
        raise ParameterError("expected histograms of shares that sum to 1, got others: counts, not shares?")
    flow = np.cumsum(shares[0] - shares[1])
    return float(np.abs(flow - np.median(flow)).mean())


@default_numerics()
def evaluate_phases(
    danced_phases: ArrayLike,
    expert_dances: Sequence[ArrayLike],
    expert_songs: Sequence[str],
    rng: np.random.Generator,
    *,
    rounds: int = PHASE_ROUNDS,
) -> dict[str, float]:
    """Mean distances to a random half of the phases of the experts, each of whose dances is to a song.

    Distances are those of the danced phases (Q,), of uniformly random ones (`_chance`) and of the other half
    (`_halves`). Lower is better. `phase_nearness` is 0 at chance and 1 at the distance of the halves. It is
    nan if the halves are no nearer to each other than chance, because those experts share no phase. All
    values are nan without danced phases, or with dances of experts to fewer than two songs.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> early = [rng.normal(0.8, 0.03, 80) for _ in range(5)]  # all rest just before the beat
    >>> scores = cg.metrics.counts.evaluate_phases(early[0], early[1:], ["a", "b", "c", "d"], rng)
    >>> scores["phase_nearness"] > 0.9
    True
    """
    validate_phases(danced_phases)
    danced = np.asarray(danced_phases, np.float64)
    known = [
        (np.asarray(d, np.float64), s) for d, s in zip(expert_dances, expert_songs, strict=True) if np.size(d)
    ]
    if len(danced) == 0 or len({song for _, song in known}) < 2:
        return dict.fromkeys(_PHASE_NAMES, float("nan"))
    found = []
    for _ in range(rounds):
        one, other = (
            np.concatenate([known[i][0] for i in half]) for half in halves([song for _, song in known], rng)
        )
        n = min(len(danced), len(one))
        samples = (
            rng.choice(danced, n, replace=False),
            rng.uniform(0, 1, n),
            rng.choice(one, n, replace=False),
        )
        reference = phase_histogram(other)
        found.append([phase_distance(phase_histogram(sample), reference) for sample in samples])
    distance, chance, halved = np.mean(found, axis=0)  # (3,) from (rounds, 3)
    nearness = (chance - distance) / (chance - halved) if chance > halved else float("nan")
    return dict(zip(_PHASE_NAMES, map(float, (distance, chance, halved, nearness)), strict=True))
