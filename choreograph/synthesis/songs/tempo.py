"""Beat times: tempo maps with steady parts and ramps, and swing, in closed form."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from choreograph.errors import ParameterError

_SLOWEST_BPM, _FASTEST_BPM = 20.0, 400.0


@dataclass(frozen=True)
class TempoMap:
    """Tempo at given beats; between two of them it changes linearly in time.

    Beat 0 is at 0 s. Before the first and after the last point the tempo is constant.
    """

    points: tuple[tuple[float, float], ...]  # (beat, BPM), beats increasing

    def __post_init__(self) -> None:
        beats = [beat for beat, _ in self.points]
        if not beats or any(b <= a for a, b in pairwise(beats)):
            raise ParameterError(f"expected a tempo map with increasing beats, got {beats}")
        for _, bpm in self.points:
            if not _SLOWEST_BPM <= bpm <= _FASTEST_BPM:
                raise ParameterError(
                    f"expected a tempo of {_SLOWEST_BPM:.0f} to {_FASTEST_BPM:.0f} BPM, got {bpm:g}"
                )

    @classmethod
    def steady(cls, bpm: float) -> TempoMap:
        """One tempo throughout."""
        return cls(((0.0, bpm),))

    @classmethod
    def ramp(cls, from_bpm: float, to_bpm: float, n_beats: float) -> TempoMap:
        """From one tempo to another over `n_beats`, linearly in time."""
        return cls(((0.0, from_bpm), (float(n_beats), to_bpm)))

    def seconds(self, beats: ArrayLike) -> NDArray[np.float64]:
        """Times of (fractional) beats in seconds; negative for beats before 0."""
        beats = np.asarray(beats, np.float64)
        return self._from_first_point(beats) - self._from_first_point(np.zeros(1))[0]

    def bpm_at(self, beats: ArrayLike) -> NDArray[np.float64]:
        """Tempo at (fractional) beats."""
        knots, bpm = self._arrays()
        # The square of the tempo is linear in beats when the tempo is linear in time.
        return np.sqrt(np.interp(np.asarray(beats, np.float64), knots, bpm**2))

    def _from_first_point(self, beats: NDArray[np.float64]) -> NDArray[np.float64]:
        knots, bpm = self._arrays()
        spans_s = 120.0 * np.diff(knots) / (bpm[1:] + bpm[:-1])
        starts_s = np.concatenate([[0.0], np.cumsum(spans_s)])
        piece = np.clip(np.searchsorted(knots, beats, side="right") - 1, 0, len(knots) - 1)
        here = self.bpm_at(np.maximum(beats, knots[0]))
        return starts_s[piece] + 120.0 * (beats - knots[piece]) / (bpm[piece] + here)

    def _arrays(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        points = np.asarray(self.points, np.float64)
        return points[:, 0], points[:, 1]


def apply_swing(beats: ArrayLike, swing: float, unit_beats: float = 0.5) -> NDArray[np.float64]:
    """Beats with every second unit delayed: 0 straight, 1 triplets (two thirds of the way).

    Each pair of units is warped piecewise linearly, so beats stay in place and times between two units
    move along.
    """
    beats = np.asarray(beats, np.float64)
    pair = 2.0 * unit_beats
    whole = np.floor(beats / pair + 1e-9)
    inside = beats / pair - whole  # 0 … 1 within the pair
    late = 0.5 + swing / 6.0
    return pair * (whole + np.interp(inside, [0.0, 0.5, 1.0], [0.0, late, 1.0]))


def beats_within(tempo: TempoMap, duration_s: float) -> float:
    """Number of beats in the first `duration_s` of the map."""
    low, high = 0.0, duration_s * _FASTEST_BPM / 60.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if tempo.seconds([middle])[0] < duration_s else (low, middle)
    return low


def checked_swing(swing: float) -> float:
    """The swing, if it is from 0 to 1; `ParameterError` otherwise."""
    if not 0.0 <= swing <= 1.0:
        raise ParameterError(f"expected a swing from 0 (straight) to 1 (triplets), got {swing:g}")
    return float(swing)


def tempo_map_from(
    bpm: float, ramp_to_bpm: float | None, tempo_map: Sequence[tuple[float, float]] | None, n_beats: float
) -> TempoMap:
    """The tempo map of a song's arguments; `tempo_map` takes precedence over `bpm`."""
    if tempo_map is not None:
        return TempoMap(tuple((float(beat), float(value)) for beat, value in tempo_map))
    return TempoMap.steady(bpm) if ramp_to_bpm is None else TempoMap.ramp(bpm, ramp_to_bpm, n_beats)
