"""Transitions: how often a dance goes from one take to another, and whether it does so at borders.

Conventions: transitions (B,) are in seconds of the dance, increasing. Each is the instant at which one take
gives way to another. A bar border is a downbeat, a music beat (Q,) numbered 1. Figure borders (F,) are the
instants, in seconds of the dance, at which the outgoing or the incoming take of a transition is at the start
or end of one of its figures. Takes whose figures are not known have none. "At" is within `WITHIN_BEATS` beat.
A beat is the interval between the music beats around the transition.

The shares tell where transitions are. `physical` measures the speed and the jerk there. A share of nothing is
nan.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats, default_numerics
from choreograph.evaluation.metrics import counts
from choreograph.evaluation.metrics.counts import WITHIN_BEATS, beat_positions


def validate(transitions_s: ArrayLike, beats_s: ArrayLike, beat_numbers: ArrayLike) -> None:
    """Raise `ParameterError` unless transitions and beats increase and every beat has a number.

    Examples
    --------
    >>> cg.metrics.transitions.validate([1.0], beats_s=[0.0, 0.5], beat_numbers=[1, 2])
    >>> cg.metrics.transitions.validate([2.0, 1.0], beats_s=[0.0, 0.5], beat_numbers=[1, 2])
    Traceback (most recent call last):
        ...
    choreograph.core.errors.ParameterError: expected increasing, finite transitions in seconds, got shape (2,)
    """
    for name, times_s in (("transitions", transitions_s), ("music beats", beats_s)):
        times = np.asarray(times_s, np.float64)
        if times.ndim != 1 or not np.isfinite(times).all() or (np.diff(times) <= 0).any():
            raise ParameterError(f"expected increasing, finite {name} in seconds, got shape {times.shape}")
    if np.shape(beat_numbers) != np.shape(beats_s):
        raise ParameterError(
            f"expected a number in the bar for each beat {np.shape(beats_s)}, got {np.shape(beat_numbers)}"
        )


def transitions_per_minute(transitions_s: ArrayLike, duration_s: float) -> float:
    """Transitions per minute of a dance of `duration_s`. Nearer to real dances is better.

    Examples
    --------
    >>> cg.metrics.transitions.transitions_per_minute([2.0, 6.0, 9.0], duration_s=30.0)
    6.0
    """
    if not (np.isfinite(duration_s) and duration_s > 0):
        raise ParameterError(f"expected a duration above 0 s, got {duration_s}")
    return np.size(transitions_s) * 60.0 / duration_s


def mean_gap_s(transitions_s: ArrayLike) -> float:
    """Mean time from a transition to the next, in seconds. nan with fewer than two.

    Examples
    --------
    >>> cg.metrics.transitions.mean_gap_s([2.0, 6.0, 8.0])
    3.0
    """
    gaps_s = np.diff(np.asarray(transitions_s, np.float64))
    return float(gaps_s.mean()) if len(gaps_s) else float("nan")


def on_counts(transitions_s: ArrayLike, beats_s: ArrayLike) -> float:
    """Share of the transitions at a music beat, 0 to 1. Higher is better. 0.30 is chance.

    Examples
    --------
    >>> cg.metrics.transitions.on_counts([1.0, 2.25], beats_s=np.arange(16) / 2)
    0.5
    """
    position = beat_positions(transitions_s, beats_s)
    position = position[~np.isnan(position)]
    return _share(np.abs(position - np.round(position)) <= WITHIN_BEATS + 1e-9)


def at_bar_borders(transitions_s: ArrayLike, beats_s: ArrayLike, beat_numbers: ArrayLike) -> float:
    """Share of the transitions at a downbeat, 0 to 1. Higher is better. 0.30 / metre is chance.

    The result is nan without downbeats.

    Examples
    --------
    >>> beats_s, numbers = np.arange(16) / 2, np.tile([1, 2, 3, 4], 4)  # bars of 2 s
    >>> cg.metrics.transitions.at_bar_borders([2.0, 4.0, 4.5, 5.0], beats_s, numbers)
    0.5
    """
    validate(transitions_s, beats_s, beat_numbers)
    if not _has_bars(beat_numbers):
        return float("nan")
    return _share(_at_bars(transitions_s, beats_s, beat_numbers))


def at_figure_borders(transitions_s: ArrayLike, beats_s: ArrayLike, figure_borders_s: ArrayLike) -> float:
    """Share of the transitions at which one of the two takes is at a border of a figure, 0 to 1.

    Higher is better.

    Examples
    --------
    >>> borders_s = [2.0, 6.0]
    >>> cg.metrics.transitions.at_figure_borders([2.0, 4.0], np.arange(16) / 2, borders_s)
    0.5
    """
    return _share(_at_figures(transitions_s, beats_s, figure_borders_s))


def at_borders(
    transitions_s: ArrayLike, beats_s: ArrayLike, beat_numbers: ArrayLike, figure_borders_s: ArrayLike
) -> float:
    """Share of the transitions at the border of a bar or of a figure, 0 to 1. Higher is better.

    The result is nan if neither kind is known.

    Examples
    --------
    >>> beats_s, numbers = np.arange(16) / 2, np.tile([1, 2, 3, 4], 4)  # bars of 2 s
    >>> cg.metrics.transitions.at_borders([2.0, 3.0, 3.5], beats_s, numbers, [3.0]) > 0.6
    True
    """
    validate(transitions_s, beats_s, beat_numbers)
    if not _has_bars(beat_numbers) and np.size(figure_borders_s) == 0:
        return float("nan")
    figures = _at_figures(transitions_s, beats_s, figure_borders_s)
    return _share(_at_bars(transitions_s, beats_s, beat_numbers) | figures)


@default_numerics()
def evaluate(
    transitions_s: ArrayLike,
    duration_s: float,
    beats_s: ArrayLike,
    beat_numbers: ArrayLike,
    figure_borders_s: ArrayLike = (),
) -> dict[str, float]:
    """All metrics of this module by name. Raises `ParameterError` as `validate` does.

    Examples
    --------
    >>> beats_s, numbers = np.arange(16) / 2, np.tile([1, 2, 3, 4], 4)  # bars of 2 s
    >>> scores = cg.metrics.transitions.evaluate([2.0, 4.0], 8.0, beats_s, numbers)
    >>> scores["transitions_per_minute"], scores["transitions_at_bar_borders"]
    (15.0, 1.0)
    """
    validate(transitions_s, beats_s, beat_numbers)
    return {
        "transitions_per_minute": transitions_per_minute(transitions_s, duration_s),
        "transition_gap_s": mean_gap_s(transitions_s),
        "transitions_on_counts": on_counts(transitions_s, beats_s),
        "transitions_at_bar_borders": at_bar_borders(transitions_s, beats_s, beat_numbers),
        "transitions_at_figure_borders": at_figure_borders(transitions_s, beats_s, figure_borders_s),
        "transitions_at_borders": at_borders(transitions_s, beats_s, beat_numbers, figure_borders_s),
    }


def uniform_chance(metre: int) -> dict[str, float]:
    """Exact shares of transitions at random instants of a steady beat of that metre.

    Raises `ParameterError` unless the metre is 1 or more.

    Examples
    --------
    >>> cg.metrics.transitions.uniform_chance(4)
    {'transitions_on_counts': 0.3, 'transitions_at_bar_borders': 0.075}
    """
    of_counts = counts.uniform_chance(metre)
    return {
        "transitions_on_counts": of_counts["counts_within"],
        "transitions_at_bar_borders": of_counts["downbeat_share"],
    }


def _has_bars(beat_numbers: ArrayLike) -> bool:
    return bool((np.asarray(beat_numbers) == 1).any())


def _at_bars(transitions_s: ArrayLike, beats_s: ArrayLike, beat_numbers: ArrayLike) -> NDArray[np.bool_]:
    """Whether each transition is at a downbeat, (B,)."""
    downbeats_s = np.asarray(beats_s, np.float64)[np.asarray(beat_numbers) == 1]
    return _near(transitions_s, downbeats_s, beats_s)


def _at_figures(
    transitions_s: ArrayLike, beats_s: ArrayLike, figure_borders_s: ArrayLike
) -> NDArray[np.bool_]:
    """Whether each transition is at a border of a figure, (B,)."""
    borders_s = np.sort(np.asarray(figure_borders_s, np.float64))
    if borders_s.ndim != 1 or not np.isfinite(borders_s).all():
        raise ParameterError(f"expected finite figure borders (F,) in seconds, got shape {borders_s.shape}")
    return _near(transitions_s, borders_s, beats_s)


def _near(times_s: ArrayLike, borders_s: Floats, beats_s: ArrayLike) -> NDArray[np.bool_]:
    """Whether each time (B,) is within `WITHIN_BEATS` beat of any border (F,). False without beats."""
    times = np.asarray(times_s, np.float64)
    if np.size(beats_s) < 2:
        return np.zeros(len(times), bool)
    apart = beat_positions(borders_s, beats_s) - beat_positions(times, beats_s)[:, None]  # (B, F)
    result: NDArray[np.bool_] = np.any(np.abs(apart) <= WITHIN_BEATS + 1e-9, axis=1)
    return result


def _share(flags: NDArray[np.bool_]) -> float:
    return float(flags.mean()) if len(flags) else float("nan")
