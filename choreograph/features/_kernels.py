"""Numba kernel of the beat tracker: the best chain of beats through a song."""

from __future__ import annotations

import numpy as np
from numba import njit

_NONE = 0  # no beat before this one


@njit(cache=True, nogil=True)
def beat_chain(strength, tempo_gain, gain_hop, first_period, change_penalty):
    """Frames of the beats that score most over the whole song.

    A state is a beat at frame t whose interval back is p frames; it earns p times (strength[t] +
    tempo_gain there), so that a song's total is a time average and no tempo earns by its number of
    beats. Changing p by more than half a frame, which the grid makes us do, costs
    `change_penalty` · p · (relative change)².

    strength (T,), tempo_gain (G, P): column i is the period first_period + i, row j the frames from
    j · gain_hop on. Returns int64 (Q,), at least one.
    """
    n_frames, n_periods = len(strength), tempo_gain.shape[1]
    last_period = first_period + n_periods - 1
    ring = np.full((last_period + 1, n_periods), -np.inf)  # scores of the latest frames
    before = np.zeros((n_frames, n_periods), np.uint8)  # the period before, or _NONE
    best_end, best_score, best_period = 0, -np.inf, first_period
    for t in range(n_frames):
        row = ring[t % (last_period + 1)]
        gains = tempo_gain[min(t // gain_hop, len(tempo_gain) - 1)]
        for i in range(n_periods):
            period = first_period + i
            gain = strength[t] + gains[i]
            if t < period:  # a first beat pays for the part of its interval inside the song
                row[i] = (t + 1) * gain
                continue
            then = ring[(t - period) % (last_period + 1)]
            best, chosen = -np.inf, _NONE
            low = max(first_period, int(period * 0.85))
            high = min(last_period, int(period * 1.18) + 1)
            for previous in range(low, high + 1):
                change = max(abs(period - previous) - 0.5, 0.0) / period
                score = then[previous - first_period] - change_penalty * period * change * change
                if score > best:
                    best, chosen = score, previous
            row[i] = best + period * gain
            before[t, i] = chosen
        for i in range(n_periods):
            rest = n_frames - 1 - t
            if rest < first_period + i and row[i] + rest * gains[i] > best_score:
                best_end, best_score, best_period = t, row[i] + rest * gains[i], first_period + i
    beats = [best_end]
    t, period = best_end, best_period
    while before[t, period - first_period] != _NONE:
        chosen = before[t, period - first_period]
        t, period = t - period, int(chosen)
        beats.append(t)
    return np.array(beats[::-1], np.int64)
