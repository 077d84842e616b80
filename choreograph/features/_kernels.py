"""Numba kernel of the beat tracker: the best sequence of beats through a song, by dynamic programming."""

from __future__ import annotations

import numpy as np
from numba import njit

_NONE = 0  # the first beat: no interval before it


@njit(cache=True, nogil=True)
def best_beat_sequence(strength, tempo_gain, gain_hop, first_period, change_penalty, new_tempo_penalty):
    """Frames of the beat sequence with the highest score over the whole song.

    A state is a beat at frame t whose interval back is p frames. It scores p times (strength[t] +
    tempo_gain there), so the total is a time average and a fast tempo gains nothing by having more
    beats. Changing p costs `change_penalty` · p · (relative change)², the first half frame free
    because the frame grid forces it; `new_tempo_penalty` buys any p, where another piece of music begins.

    strength (T,), tempo_gain (G, P): column i is the period first_period + i, row j the frames from
    j · gain_hop on. Returns int64 (Q,), at least one.
    """
    n_frames, n_periods = len(strength), tempo_gain.shape[1]
    last_period = first_period + n_periods - 1
    ring = np.full((last_period + 1, n_periods), -np.inf)  # scores of the latest frames
    best_columns = np.zeros(n_frames, np.int64)  # of the period with the highest score at each frame
    previous_period = np.zeros((n_frames, n_periods), np.uint8)  # the preceding period, or _NONE
    best_end, best_score, best_period = 0, -np.inf, first_period
    for t in range(n_frames):
        row = ring[t % (last_period + 1)]
        gains = tempo_gain[min(t // gain_hop, len(tempo_gain) - 1)]
        for i in range(n_periods):
            period = first_period + i
            gain = strength[t] + gains[i]
            if t < period:  # for a first beat only the part of its interval inside the song counts
                row[i] = (t + 1) * gain
                continue
            previous_scores = ring[(t - period) % (last_period + 1)]
            column = best_columns[t - period]
            best, best_previous = previous_scores[column] - new_tempo_penalty, first_period + column
            low = max(first_period, int(period * 0.85))
            high = min(last_period, int(period * 1.18) + 1)
            for previous in range(low, high + 1):
                change = max(abs(period - previous) - 0.5, 0.0) / period
                score = previous_scores[previous - first_period] - change_penalty * period * change * change
                if score > best:
                    best, best_previous = score, previous
            row[i] = best + period * gain
            previous_period[t, i] = best_previous
        best_columns[t] = row.argmax()
        for i in range(n_periods):
            remaining = n_frames - 1 - t
            if remaining < first_period + i and row[i] + remaining * gains[i] > best_score:
                best_end, best_score, best_period = t, row[i] + remaining * gains[i], first_period + i
    beats = [best_end]
    t, period = best_end, best_period
    while previous_period[t, period - first_period] != _NONE:
        best_previous = previous_period[t, period - first_period]
        t, period = t - period, int(best_previous)
        beats.append(t)
    return np.array(beats[::-1], np.int64)
