"""The part of a song that is danced, and the instants at which takes may change."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.core.counts import Counts
from choreograph.core.numerics import Floats
from choreograph.core.timebase import MUSIC_FPS
from choreograph.music.beats import onset_strength

_PICK_UP_S = 0.5  # danced at full speed before the first count, which prepares it
_EASE_IN_S = 0.4  # from the first held pose to full speed, before that
_EASE_OUT_S = 0.3  # from full speed to the last held pose, before the last count
_SETTLE_S = 0.08  # the same after the last count
REACH_S = 0.5  # largest distance of a change of takes from its second
FIRST_HOLD_S = 0.7  # least time before the first count, in which the dance sets off and prepares it
LAST_HOLD_S = 0.3  # least time for which the last pose is held
_STRONG = 0.3  # of the song's usual strength at beats. Weaker ones do not start or end a dance
_GOES_ON = 0.6  # of it, from which beats after the last strong downbeat are danced, too
_SOUNDING = 0.1  # of the strength of its strongest beats. Weaker ones do not enter the usual strength
_BAR_OF = 4  # beats that must be strong, on average, where the dance starts
_NEAR_FRAMES = 3  # 50 ms, within which an onset counts as on the beat


def dance_span_s(counts: Counts, log_mel: NDArray[np.floating], duration_s: float) -> tuple[float, float]:
    """The times of the first and the last count of a song that are danced, in seconds.

    They are strong beats. A dance begins with the first one, as a pick-up if it is not on a downbeat. It ends
    on the last downbeat, or later if the song goes on at its usual strength, as in an excerpt. At least 0.7 s
    at the beginning and 0.3 s at the end remain, in which the dance sets off and holds its last pose. An
    introduction or an ending without beats is not danced. A song without beats is danced from 0 to its end.
    """
    beats = np.flatnonzero((counts.times_s >= FIRST_HOLD_S) & (counts.times_s <= duration_s - LAST_HOLD_S))
    if len(beats) < 2 * _BAR_OF:
        return 0.0, duration_s
    strength = _strength_at(counts.times_s[beats], log_mel)
    usual = float(np.median(strength[strength >= _SOUNDING * np.percentile(strength, 95)]))
    enough = _STRONG * usual
    # Mean of a beat and the three before it. One loud beat does not make up for three silent ones.
    ahead = np.convolve(np.minimum(strength, usual), np.ones(_BAR_OF) / _BAR_OF)
    starts = np.flatnonzero((ahead[_BAR_OF - 1 : len(beats)] >= enough) & (strength[: 1 - _BAR_OF] >= enough))
    ends = np.flatnonzero(strength >= enough)
    first = starts[0] if len(starts) else 0
    closes = ends[(counts.numbers[beats[ends]] == 1) | (strength[ends] >= _GOES_ON * usual)]
    last = closes[-1] if len(closes) else ends[-1]
    if last - first < _BAR_OF:
        return 0.0, duration_s
    return float(counts.times_s[beats[first]]), float(counts.times_s[beats[last]])


def setting_off_s(opening_s: float) -> tuple[float, float]:
    """From when to when a dance goes from its first held pose to full speed: 0.4 s, and 0.5 s early.

    With less time before the first count, it sets off at the start of the song.
    """
    ease_s = min(_EASE_IN_S, opening_s)
    stop_s = opening_s - min(_PICK_UP_S, opening_s - ease_s)
    return stop_s - ease_s, stop_s


def coming_to_rest_s(opening_s: float, closing_s: float) -> tuple[float, float]:
    """The span from full speed to the last held pose: 0.38 s, but not before `opening_s`."""
    return max(opening_s, closing_s - _EASE_OUT_S), closing_s + _SETTLE_S


def held_times_s(opening_s: float, closing_s: float) -> tuple[float, float]:
    """The times whose poses are held before the first and after the last count, half-way through an ease."""
    first, last = setting_off_s(opening_s), coming_to_rest_s(opening_s, closing_s)
    return 0.5 * sum(first), 0.5 * sum(last)


def _strength_at(times_s: Floats, log_mel: NDArray[np.floating]) -> Floats:
    """Greatest onset strength within 50 ms of each time, (Q,)."""
    strength = onset_strength(log_mel)
    frames = np.round(times_s * MUSIC_FPS).astype(np.int64)[:, None]
    near = frames + np.arange(-_NEAR_FRAMES, _NEAR_FRAMES + 1)
    strongest: Floats = strength[np.clip(near, 0, len(strength) - 1)].max(axis=1)
    return strongest


def join_times_s(counts: Counts, n_borders: int) -> Floats:
    """The instants (B,) near seconds 0 … B - 1 at which takes may change.

    It is the downbeat within half a second, else the nearest beat, else the second itself. No two seconds
    share an instant.
    """
    seconds = np.arange(n_borders, dtype=np.float64)
    joins = seconds.copy()
    for instants in (counts.times_s, counts.downbeat_times_s):  # downbeats replace beats
        border = np.round(instants).astype(np.int64)
        for second in np.unique(border[(border >= 0) & (border < n_borders)]):
            near = instants[border == second]
            joins[second] = near[np.argmin(np.abs(near - second))]
    return joins
