"""Phase of motion beats within the count, which is the place between two beats where a body rests.

Conventions: motion beats and music beats in seconds, increasing. A phase is from 0 (on the beat) to 1 (the
next beat), so 0.9 is just early. A histogram (`N_BINS`,) of shares has its first bin centred on the beat and
is circular: the last bin is next to the first.

Dancers rest where their genre's technique has them rest, which is rarely on the beat itself, so a dance is
compared with experts of its genre, not with the beat. The distance is the earth mover's on the circle, in
beats. It says how far motion beats would have to be moved on average. It is at most 0.5 beat, and 0.25
between beats at one place and uniform ones. The χ² distance of a shift by one bin would equal that of half a
beat, and would depend on where bins end.

A distance between finite samples is never 0. So a dance is compared with one half of the experts' dances,
which are split by song. The chance level (uniformly random phases) and the floor (the other half of the
experts) are compared with the same half, with as many phases each, over many splits. All three are large if
there are few dances.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats, default_numerics
from choreograph.evaluation.metrics.counts import beat_positions
from choreograph.evaluation.metrics.frechet import halves

ROUNDS = 50  # splits of the experts
_NAMES = ("phase_distance", "phase_distance_chance", "phase_distance_halves", "phase_nearness")
N_BINS = 8  # of 60 to 90 ms at a dance's tempo, no finer than motion beats are detected


def validate(phases: ArrayLike) -> None:
    """Raise `ParameterError` unless phases (Q,) are from 0 to 1.

    Examples
    --------
    >>> cg.metrics.count_phase.validate([0.0, 0.5])
    >>> cg.metrics.count_phase.validate([1.5])
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
    >>> cg.metrics.count_phase.phases([0.5, 1.1, 9.0], beats_s=[0.0, 0.5, 1.0, 1.5])
    array([0. , 0.2])
    """
    position = beat_positions(motion_beats_s, beats_s)
    position = position[(position >= 0) & (position <= np.size(beats_s) - 1)]
    return position % 1.0


def phase_histogram(phases: ArrayLike, *, n_bins: int = N_BINS) -> Floats:
    """Shares (n_bins,) of the phases (Q,) by bin. The first bin is centred on the beat. nan without phases.

    Examples
    --------
    >>> cg.metrics.count_phase.phase_histogram([0.0, 0.98, 0.5, 0.51], n_bins=4)
    array([0.5, 0. , 0.5, 0. ])
    """
    validate(phases)
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
    >>> distance = cg.metrics.count_phase.phase_distance
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
def evaluate(
    danced_phases: ArrayLike,
    expert_dances: Sequence[ArrayLike],
    expert_songs: Sequence[str],
    rng: np.random.Generator,
    *,
    rounds: int = ROUNDS,
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
    >>> scores = cg.metrics.count_phase.evaluate(early[0], early[1:], ["a", "b", "c", "d"], rng)
    >>> scores["phase_nearness"] > 0.9
    True
    """
    validate(danced_phases)
    danced = np.asarray(danced_phases, np.float64)
    known = [
        (np.asarray(d, np.float64), s) for d, s in zip(expert_dances, expert_songs, strict=True) if np.size(d)
    ]
    if len(danced) == 0 or len({song for _, song in known}) < 2:
        return dict.fromkeys(_NAMES, float("nan"))
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
    return dict(zip(_NAMES, map(float, (distance, chance, halved, nearness)), strict=True))
