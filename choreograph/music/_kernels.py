"""Numba kernels of the dynamic programming of the beat tracker and of the bar pointer."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.core.kernel_cache import njit
from choreograph.core.numerics import Floats, Indices

Complexes = NDArray[np.complex128]

_NONE = 0  # the first beat, which has no interval before it


@njit(nogil=True)
def best_beat_sequence(
    strength: Floats,
    tempo_gain: Floats,
    gain_hop: int,
    first_period: int,
    change_penalty: float,
    new_tempo_penalty: float,
) -> Indices:
    """Frames of the beat sequence with the highest score over the whole song.

    A state is a beat at frame t whose interval to the previous beat is p frames. Its score is p times
    (strength[t] + tempo_gain there). So the total is a time average, and a fast tempo has no advantage from
    more beats. A change of p costs `change_penalty` · p · (relative change)², the first half frame free
    because the frame grid forces it. For `new_tempo_penalty`, p may change to any value, as at the start of
    another piece of music.

    Shapes are strength (T,) and tempo_gain (G, P). Column i of the latter is the period first_period + i, and
    row j the frames from j · gain_hop on. Returns int64 (Q,), at least one frame.
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
            if t < period:  # of the interval of a first beat, only the part inside the song counts
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


@njit(nogil=True)
def best_bar_sequence(
    beat: Floats,
    bar: Floats,
    metre_gain: Floats,
    first_period: int,
    n_periods: int,
    state_metre: Indices,
    state_number: Indices,
    metres: Indices,
    change_cost: float,
    break_cost: float,
) -> tuple[Indices, Indices]:
    """The beats, and their numbers in the bar, of the path with the highest score over all frames.

    A state is a beat interval that ends at frame t, p frames long, whose beat has a number in a metre. It
    scores its frames' agreement with phases that run evenly through it: Σ beat · u(φ) + bar · u((number - 1 +
    φ) / metre) + metre_gain, with u the unit vector of a phase in turns. The next interval may differ in
    length at `change_cost` times its squared relative change, the first half frame free because the frame
    grid forces it, and has the next number. For `break_cost`, it may have any length and any number.

    Shapes are beat (T, 2), bar (T, M, 2), metre_gain (T, M) and metres (M,). state_metre (S,) is the column
    of each state's metre, and state_number (S,) its number. Returns the bounds of the intervals (Q + 1,),
    from the first frame or before it to the last or after it, and the states of the intervals (Q,).
    """
    n_frames, n_metres, n_states = len(beat), bar.shape[1], len(state_metre)
    last_period = first_period + n_periods - 1
    n_ends = n_frames + last_period  # the last interval may end after the last frame
    depth = last_period + 1
    ring = np.full((depth, n_periods, n_states), -np.inf)  # scores of the latest frames
    best_score = np.full(depth, -np.inf)  # over periods and states
    best_state = np.zeros((n_ends, 2), np.int16)  # its period's index and its state
    from_period = np.full((n_ends, n_periods, n_states), -1, np.int16)  # -1: the first interval
    from_state = np.zeros((n_ends, n_periods, n_states), np.int8)
    turn, previous = _places_in_bar(state_metre, state_number, metres)
    gain = np.zeros(n_states)
    reach = np.sqrt(break_cost / change_cost)  # relative change beyond which a break is cheaper
    vectors = _vectors(beat, bar)
    turns, newest = _phase_steps(first_period, n_periods, metres)
    sums = np.zeros((n_periods, 1 + n_metres), np.complex128)
    metre_sums = np.zeros((n_periods, n_metres))
    end_score, end_t, end_p, end_s = -np.inf, 0, 0, 0
    for t in range(1, n_ends):
        row = t % depth
        ring[row] = -np.inf
        best_score[row] = -np.inf
        _slide(sums, metre_sums, vectors, metre_gain, turns, newest, t, first_period)
        for i in range(n_periods):
            p = first_period + i
            start = t - p
            if start >= n_frames:
                continue
            for s in range(n_states):
                m = state_metre[s]
                bar_sum = sums[i, 1 + m]
                gain[s] = sums[i, 0].real + metre_sums[i, m]
                gain[s] += bar_sum.real * turn[s, 0] + bar_sum.imag * turn[s, 1]
            if start <= 0:
                for s in range(n_states):
                    ring[row, i, s] = gain[s]
            else:
                back = start % depth
                low, high = max(0, i - int(reach * p) - 1), min(n_periods, i + int(reach * p) + 2)
                for s in range(n_states):
                    best = best_score[back] - break_cost
                    period, state = best_state[start, 0], best_state[start, 1]
                    for j in range(low, high):
                        change = max(abs(i - j) - 0.5, 0.0) / p
                        score = ring[back, j, previous[s]] - change_cost * change * change
                        if score > best:
                            best, period, state = score, j, previous[s]
                    ring[row, i, s] = best + gain[s]
                    from_period[t, i, s], from_state[t, i, s] = period, state
            for s in range(n_states):
                if ring[row, i, s] > best_score[row]:
                    best_score[row] = ring[row, i, s]
                    best_state[t, 0], best_state[t, 1] = i, s
                if t >= n_frames and ring[row, i, s] > end_score:
                    end_score, end_t, end_p, end_s = ring[row, i, s], t, i, s
    return _traced(end_t, end_p, end_s, from_period, from_state, first_period)


@njit(nogil=True)
def _vectors(beat: Floats, bar: Floats) -> Complexes:
    """The vectors of the beat (T, 2) and of the bars (T, M, 2) as complex numbers (T, 1 + M)."""
    vectors = np.empty((len(beat), 1 + bar.shape[1]), np.complex128)
    vectors[:, 0] = beat[:, 0] + 1j * beat[:, 1]
    vectors[:, 1:] = bar[:, :, 0] + 1j * bar[:, :, 1]
    return vectors


@njit(nogil=True)
def _places_in_bar(state_metre: Indices, state_number: Indices, metres: Indices) -> tuple[Floats, Indices]:
    """Where each state begins within its bar, (S, 2) unit vectors, and the state before it (S,)."""
    n_states = len(state_metre)
    turn = np.empty((n_states, 2))
    previous = np.empty(n_states, np.int64)
    for s in range(n_states):
        metre = metres[state_metre[s]]
        turn[s, 0] = np.cos(2 * np.pi * (state_number[s] - 1) / metre)
        turn[s, 1] = np.sin(2 * np.pi * (state_number[s] - 1) / metre)
        previous[s] = s - 1 if state_number[s] > 1 else s + metre - 1
    return turn, previous


@njit(nogil=True)
def _phase_steps(first_period: int, n_periods: int, metres: Indices) -> tuple[Complexes, Complexes]:
    """The phases in beat and bars that run through each interval, (P, 1 + M) unit complex numbers each.

    Returns their rotation from frame to frame, and the inverse of the phase in the last frame of the
    interval.
    """
    turns = np.empty((n_periods, 1 + len(metres)), np.complex128)
    newest = np.empty_like(turns)
    for i in range(n_periods):
        for m in range(1 + len(metres)):
            angle = 2 * np.pi / ((first_period + i) * (1 if m == 0 else metres[m - 1]))
            turns[i, m] = np.exp(1j * angle)
            newest[i, m] = np.exp(-1j * angle * (first_period + i - 1))
    return turns, newest


@njit(nogil=True)
def _slide(
    sums: Complexes,
    metre_sums: Floats,
    vectors: Complexes,
    metre_gain: Floats,
    turns: Complexes,
    newest: Complexes,
    t: int,
    first_period: int,
) -> None:
    """Update the sums over the interval that ends at frame t - 1 to frame t, for each of its lengths.

    `sums` (P, 1 + M) are those of the vectors over the phases that run through the interval. One frame leaves
    at phase 0, all phases rotate, and one frame enters. `metre_sums` (P, M) are those of `metre_gain`.
    """
    n_frames = len(vectors)
    for i in range(len(sums)):
        gone = t - first_period - i - 1
        for m in range(vectors.shape[1]):
            if 0 <= gone < n_frames:
                sums[i, m] -= vectors[gone, m]
                if m > 0:
                    metre_sums[i, m - 1] -= metre_gain[gone, m - 1]
            sums[i, m] *= turns[i, m]
            if t - 1 < n_frames:
                sums[i, m] += vectors[t - 1, m] * newest[i, m]
                if m > 0:
                    metre_sums[i, m - 1] += metre_gain[t - 1, m - 1]


@njit(nogil=True)
def _traced(
    t: int, i: int, s: int, from_period: NDArray[np.int16], from_state: NDArray[np.int8], first_period: int
) -> tuple[Indices, Indices]:
    """The path that ends at frame t with period i in state s: bounds (Q + 1,) and states (Q,)."""
    bounds, states = [t, t - first_period - i], [s]
    while from_period[t, i, s] >= 0:
        t, i, s = t - first_period - i, from_period[t, i, s], from_state[t, i, s]
        bounds.append(t - first_period - i)
        states.append(s)
    return np.array(bounds[::-1], np.int64), np.array(states[::-1], np.int64)
