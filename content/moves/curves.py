"""Animation curves through keyframes on counts, follow-through, and counts against seconds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.signal import lfilter, lfilter_zi

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats

_OUTSIDE = 32  # counts of extrapolation at the tempo of the first and the last beat
_SAME_COUNT = 0.04  # closer keyframes are merged: the last written wins


def ease(u: Floats) -> Floats:
    """Minimum-jerk progress from 0 to 1 over u in [0, 1]: at rest, unaccelerated, at both ends."""
    u = np.clip(u, 0.0, 1.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u**2)


class Tempo:
    """Map between counts and seconds: count k is the k-th beat, with smooth interpolation."""

    def __init__(self, beat_times_s: NDArray[np.floating]) -> None:
        beats = np.asarray(beat_times_s, np.float64)
        if beats.ndim != 1 or len(beats) < 2 or not np.isfinite(beats).all() or (np.diff(beats) <= 0).any():
            raise ParameterError(f"expected increasing beat times, two or more, got shape {beats.shape}")
        ends = np.arange(1, _OUTSIDE + 1)
        before = beats[0] - ends[::-1] * (beats[1] - beats[0])
        after = beats[-1] + ends * (beats[-1] - beats[-2])
        times = np.concatenate([before, beats, after])
        counts = np.arange(len(times), dtype=np.float64) - _OUTSIDE
        self._to_count = PchipInterpolator(times, counts, extrapolate=True)
        self._to_time = PchipInterpolator(counts, times, extrapolate=True)

    def counts(self, times_s: Floats) -> Floats:
        """Fractional counts of times in seconds."""
        return self._to_count(times_s)

    def times_s(self, counts: Floats | float) -> Floats:
        """Times in seconds of fractional counts."""
        return self._to_time(counts)


@dataclass(frozen=True)
class Keyframe:
    """Value of a curve at a count, and how it gets there."""

    count: float
    value: tuple[float, ...]  # (D,)
    flow: float = 0.0  # 0 rests on the count, 1 passes through it
    hold: float = 0.0  # share of the time since the last keyframe in which it does not move yet


def evaluate(keys: list[Keyframe], counts: Floats) -> Floats:
    """The curve through `keys` at `counts` (T,), (T, D): piecewise quintic, with slope at keys that flow."""
    keys = _merged(keys)
    at = np.array([key.count for key in keys])  # (K,)
    values = np.array([key.value for key in keys])  # (K, D)
    if len(keys) == 1:
        return np.repeat(values, len(counts), axis=0)
    flow = np.array([key.flow for key in keys])
    hold = np.array([key.hold for key in keys])[1:] * (np.maximum(flow[1:], flow[:-1]) == 0)  # (K-1,)
    slope = np.zeros_like(values)
    slope[1:-1] = flow[1:-1, None] * (values[2:] - values[:-2]) / (at[2:] - at[:-2])[:, None]
    i = np.clip(np.searchsorted(at, counts, side="right") - 1, 0, len(at) - 2)  # (T,)
    gap = at[i + 1] - at[i]
    u = np.clip((counts - at[i]) / gap, 0.0, 1.0)
    u = np.clip((u - hold[i]) / (1.0 - hold[i]), 0.0, 1.0)[:, None]
    s = ease(u)
    start = u - 6 * u**3 + 8 * u**4 - 3 * u**5
    stop = -4 * u**3 + 7 * u**4 - 3 * u**5
    gap = gap[:, None]
    return values[i] * (1 - s) + values[i + 1] * s + gap * (slope[i] * start + slope[i + 1] * stop)


def _merged(keys: list[Keyframe]) -> list[Keyframe]:
    kept: list[Keyframe] = []
    for key in sorted(keys, key=lambda key: key.count):
        if kept and key.count - kept[-1].count < _SAME_COUNT:
            kept.pop()
        kept.append(key)
    return kept


def spring_follow(values: Floats, fps: float, *, frequency_hz: float, damping: float) -> Floats:
    """`values` (T, D) followed by a damped spring: it lags, overshoots a little, and settles."""
    w = 2.0 * np.pi * frequency_hz
    k = 2.0 * fps  # bilinear transform of w² / (s² + 2 ζ w s + w²)
    b = np.array([1.0, 2.0, 1.0]) * w * w
    drag = 2 * damping * w * k
    a = np.array([k * k + drag + w * w, 2 * (w * w - k * k), k * k - drag + w * w])
    start = lfilter_zi(b / a[0], a / a[0])[:, None] * values[:1]
    return lfilter(b, a, values, axis=0, zi=start)[0]


def spring_lag_s(frequency_hz: float, damping: float) -> float:
    """Lag of `spring_follow` for slow motion, in seconds."""
    return damping / (np.pi * frequency_hz)


def smooth_noise(times_s: Floats, rng: np.random.Generator, *, slow_s: float, fast_s: float) -> Floats:
    """Smooth noise (T,) of standard deviation about 1, with periods between `fast_s` and `slow_s`."""
    periods = np.exp(rng.uniform(np.log(fast_s), np.log(slow_s), 4))
    phases = rng.uniform(0, 2 * np.pi, 4)
    return np.sin(2 * np.pi * times_s[:, None] / periods + phases).sum(axis=1) / np.sqrt(2.0)
