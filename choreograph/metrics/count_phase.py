"""Phase of motion beats within the count: where, from beat to beat, a body comes to rest.

Conventions: motion beats and music beats in seconds, increasing. A phase is from 0 (on the beat) to 1 (the
next beat), so 0.9 is just early. A histogram (`N_BINS`,) of shares has its first bin centred on the beat and
is circular: the last bin is next to the first.

Dancers rest where their genre's technique has them rest, which is rarely on the beat itself, so a dance is
compared with experts of its genre, not with the beat. The distance is the earth mover's on the circle, in
beats: how far motion beats would have to be moved on average, at most ½ beat, ¼ from all in one place to
uniform. χ² would call a shift by one bin as far as one by half a beat, and would depend on where bins end.

A distance between finite samples is never 0. So its chance level is of as many uniformly random phases, and
its floor the distance between halves of the experts' dances. Both depend on few dances where there are few.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from choreograph.errors import ParameterError
from choreograph.metrics.counts import beat_positions
from choreograph.metrics.references import halves

Floats = NDArray[np.float64]

N_BINS = 8  # of 60 to 90 ms at a dance's tempo, no finer than motion beats are detected


def validate(phases: ArrayLike) -> None:
    """Raise `ParameterError` unless phases (Q,) are from 0 to 1."""
    given = np.asarray(phases, np.float64)
    if given.ndim != 1 or not ((given >= 0) & (given <= 1)).all():
        raise ParameterError(f"expected phases (Q,) from 0 to 1, got an array of {given.shape}")


def phases(motion_beats_s: ArrayLike, beats_s: ArrayLike) -> Floats:
    """Phases (Q',) of the motion beats between the first and the last of the music beats."""
    position = beat_positions(motion_beats_s, beats_s)
    position = position[(position >= 0) & (position <= np.size(beats_s) - 1)]
    return position % 1.0


def phase_histogram(phases: ArrayLike, *, n_bins: int = N_BINS) -> Floats:
    """Shares (n_bins,) of the phases (Q,) by bin, the first centred on the beat; nan without phases."""
    validate(phases)
    given = np.asarray(phases, np.float64)
    if len(given) == 0:
        return np.full(n_bins, np.nan)
    nearest_bin = np.floor(given * n_bins + 0.5).astype(int) % n_bins
    return np.bincount(nearest_bin, minlength=n_bins) / len(given)


def phase_distance(a: ArrayLike, b: ArrayLike) -> float:
    """Earth mover's distance on the circle between two histograms (K,) of shares, in beats, 0 … ½.

    What flows over each border between bins is the difference of the cumulative shares, up to a constant
    that circles all round; its best value is their median (Werman et al., 1986). nan if a share is.

    Raises `ParameterError` unless both have the same number of bins and sum to 1.
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


def chance_distance(
    n_phases: int, reference: ArrayLike, rng: np.random.Generator, *, rounds: int = 200
) -> float:
    """Mean distance of `n_phases` uniformly random phases to a reference histogram (K,); nan for none."""
    if n_phases < 1:
        return float("nan")
    n_bins = np.size(reference)
    drawn = rng.multinomial(n_phases, np.full(n_bins, 1.0 / n_bins), size=rounds) / n_phases  # (rounds, K)
    return float(np.mean([phase_distance(shares, reference) for shares in drawn]))


def halves_distance(
    dances: Sequence[ArrayLike], songs: Sequence[str], rng: np.random.Generator, *, rounds: int = 50
) -> float:
    """Mean distance between random halves of dances' phases, split by song; nan with fewer than 2 songs."""
    known = [(np.asarray(d), song) for d, song in zip(dances, songs, strict=True) if np.size(d)]
    if len({song for _, song in known}) < 2:
        return float("nan")
    distances = []
    for _ in range(rounds):
        parts = halves([song for _, song in known], rng)
        sides = [phase_histogram(np.concatenate([known[i][0] for i in part])) for part in parts]
        distances.append(phase_distance(*sides))
    return float(np.mean(distances))


def evaluate(
    danced_phases: ArrayLike,
    expert_dances: Sequence[ArrayLike],
    expert_songs: Sequence[str],
    rng: np.random.Generator,
) -> dict[str, float]:
    """Distance of danced phases (Q,) to the experts', given by dance, with chance and the experts' halves.

    `phase_nearness` is how far the dance is on the way from chance (0) to the halves (1); nan where the
    experts' halves are no nearer to each other than chance is to them: they have no common phase then.
    """
    together = np.concatenate([np.zeros(0), *(np.asarray(dance) for dance in expert_dances)])
    reference, n_danced = phase_histogram(together), np.size(danced_phases)
    distance = phase_distance(phase_histogram(danced_phases), reference)
    chance = chance_distance(n_danced, reference, rng) if len(together) else float("nan")
    halved = halves_distance(expert_dances, expert_songs, rng)
    return {
        "phase_distance": distance,
        "phase_distance_chance": chance,
        "phase_distance_halves": halved,
        "phase_nearness": (chance - distance) / (chance - halved) if chance > halved else float("nan"),
    }
