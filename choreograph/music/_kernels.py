"""Numba kernels of the dynamic programming of the beat tracker and of the bar pointer."""

from __future__ import annotations

import math

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
    n_states, last_period = len(state_metre), first_period + n_periods - 1
    n_ends = len(beat) + last_period  # the last interval may end after the last frame
    depth = last_period + 1
    scores = np.full((depth, n_periods, n_states), -np.inf)  # of the latest frames
    best_score = np.full(depth, -np.inf)  # over periods and states
    best_place = np.zeros(depth, np.int32)  # its period's index times S, plus its state
    sums = np.zeros((n_periods, 1 + len(metres)), np.complex128)
    metre_sums = np.zeros((n_periods, len(metres)))
    vectors = np.concatenate([beat[:, None], bar], axis=1)
    vectors = vectors[..., 0] + 1j * vectors[..., 1]  # (T, 1 + M)
    turn, previous = _places_in_bar(state_metre, state_number, metres)
    turns, newest = _phase_steps(first_period, n_periods, metres)
    reach = float(np.sqrt(break_cost / change_cost))  # relative change beyond which a break is cheaper
    paths = _Paths(first_period, n_states, depth)
    for first in range(1, n_ends, _BLOCK):
        came_from = np.empty((min(_BLOCK, n_ends - first), n_periods, n_states), np.int32)
        _extend_paths(
            first, vectors, metre_gain, turns, newest, first_period, state_metre, turn, previous, reach,
            change_cost, break_cost, sums, metre_sums, scores, best_score, best_place, came_from,
        )  # fmt: skip
        paths.extend(came_from.reshape(len(came_from), -1))
    ends = np.arange(len(beat), n_ends)
    end = int(ends[best_score[ends % depth].argmax()])
    intervals = paths.to(end, int(best_place[end % depth]))
    begin = intervals[0][0] - first_period - intervals[0][1] // n_states
    bounds = [begin, *(frame for frame, _ in intervals)]
    return np.array(bounds, np.int64), np.array([place % n_states for _, place in intervals], np.int64)


_BLOCK = 4096  # frames after which the beginning that all paths share is found


class _Paths:
    """Where the best path to each interval comes from, without the beginning that all paths share.

    An interval is the frame at which it ends and its place, the index of its period times S plus its state.
    """

    def __init__(self, first_period: int, n_states: int, depth: int) -> None:
        self._first_period, self._n_states, self._depth = first_period, n_states, depth
        self._shared: list[tuple[int, int]] = []
        self._came_from: list[NDArray[np.int32]] = []  # rows (P S,) of the places before, -1 for none
        self._first = 1  # the frame of the first row, which is the last of `_shared` if there are any

    def extend(self, came_from: NDArray[np.int32]) -> None:
        """Add the rows (T', P S) of the next frames. The latest `depth` frames are those that may go on."""
        self._came_from.extend(came_from)
        alive = np.zeros((len(self._came_from), came_from.shape[1]), np.bool_)
        alive[-self._depth :] = True
        for row in range(len(alive) - 1, 0, -1):
            places = np.flatnonzero(alive[row])
            alone = len(places) == 1 and not alive[max(row - self._depth, 0) : row].any()
            if alone and row < len(alive) - self._depth:
                self._shared = self.to(row + self._first, int(places[0]))
                del self._came_from[:row]
                self._first += row
                return
            before = self._came_from[row][places]
            if (before < 0).any():  # a path begins here
                return
            alive[row - self._first_period - places // self._n_states, before] = True

    def to(self, frame: int, place: int) -> list[tuple[int, int]]:
        """The intervals of the path that ends with this one."""
        intervals = []
        while place >= 0 and not (self._shared and frame <= self._first):
            intervals.append((frame, place))
            before = self._came_from[frame - self._first][place]
            frame, place = frame - self._first_period - place // self._n_states, int(before)
        return self._shared + intervals[::-1]


def _places_in_bar(state_metre: Indices, state_number: Indices, metres: Indices) -> tuple[Floats, Indices]:
    """Where each state begins within its bar, (S, 2) unit vectors, and the state before it (S,)."""
    metre, states = metres[state_metre], np.arange(len(state_metre))
    angle = 2 * np.pi * (state_number - 1) / metre
    previous = np.where(state_number > 1, states - 1, states + metre - 1)
    return np.array([(math.cos(a), math.sin(a)) for a in angle]), previous


def _phase_steps(first_period: int, n_periods: int, metres: Indices) -> tuple[Complexes, Complexes]:
    """The phases in beat and bars that run through each interval, (P, 1 + M) unit complex numbers each.

    Returns their rotation from frame to frame, and the inverse of the phase in the last frame of the
    interval.
    """
    periods = first_period + np.arange(n_periods)[:, None]  # (P, 1)
    angle = 2 * np.pi / (periods * np.append(1, metres))
    return np.exp(1j * angle), np.exp(-1j * angle * (periods - 1))


@njit(
    "void(int64, complex128[:,::1], float64[:,::1], complex128[:,::1], complex128[:,::1], int64, "
    "int64[::1], float64[:,::1], int64[::1], float64, float64, float64, complex128[:,::1], "
    "float64[:,::1], float64[:,:,::1], float64[::1], int32[::1], int32[:,:,::1])",
    nogil=True,
    error_model="numpy",
)
def _extend_paths(
    first: int,
    vectors: Complexes,
    metre_gain: Floats,
    turns: Complexes,
    newest: Complexes,
    first_period: int,
    state_metre: Indices,
    turn: Floats,
    previous: Indices,
    reach: float,
    change_cost: float,
    break_cost: float,
    sums: Complexes,
    metre_sums: Floats,
    scores: Floats,
    best_score: Floats,
    best_place: NDArray[np.int32],
    came_from: NDArray[np.int32],
) -> None:  # pragma: no cover - compiled
    """Continue the best paths of `best_bar_sequence` through the frames from `first` on.

    Sets the places before those of each frame, `came_from` (T', P, S), and updates the arrays before it.
    `sums` (P, 1 + M) are those of the vectors over the phases that run through the interval that ends at the
    frame, for each of its lengths, and `metre_sums` (P, M) those of `metre_gain`. From frame to frame, one
    frame leaves at phase 0, all phases rotate, and one frame enters.
    """
    n_frames, n_columns = vectors.shape
    depth, n_periods, n_states = scores.shape
    for t in range(first, first + len(came_from)):
        row = t % depth
        best_score[row] = -np.inf
        for i in range(n_periods):
            p = first_period + i
            start = t - p
            for m in range(n_columns):
                if 0 < start <= n_frames:
                    sums[i, m] -= vectors[start - 1, m]
                    if m > 0:
                        metre_sums[i, m - 1] -= metre_gain[start - 1, m - 1]
                sums[i, m] *= turns[i, m]
                if t - 1 < n_frames:
                    sums[i, m] += vectors[t - 1, m] * newest[i, m]
                    if m > 0:
                        metre_sums[i, m - 1] += metre_gain[t - 1, m - 1]
            back = start % depth
            low, high = max(0, i - int(reach * p) - 1), min(n_periods, i + int(reach * p) + 2)
            for s in range(n_states):
                best, place = 0.0, -1
                if start >= n_frames:
                    best = -np.inf
                elif start > 0:
                    best, place = best_score[back] - break_cost, best_place[back]
                    for j in range(low, high):
                        change = max(abs(i - j) - 0.5, 0.0) / p
                        score = scores[back, j, previous[s]] - change_cost * change * change
                        if score > best:
                            best, place = score, j * n_states + previous[s]
                m = state_metre[s]
                of_bar = sums[i, 1 + m]
                gain = sums[i, 0].real + metre_sums[i, m]
                gain += of_bar.real * turn[s, 0] + of_bar.imag * turn[s, 1]
                scores[row, i, s] = best + gain
                came_from[t - first, i, s] = place
                if best + gain > best_score[row]:
                    best_score[row], best_place[row] = best + gain, i * n_states + s
