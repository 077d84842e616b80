"""The bar pointer, which decodes counts from curves of beat and bar phase.

A pointer runs through the bar at a tempo that changes slowly. A network estimates from motion or music, for
each frame, where in the beat and where in the bar the frame is. The counts are the best path of the pointer
through all frames. The path bridges stretches without evidence, and it decides between tempi and metres by
all frames together.

The model is that of Whiteley, Cemgil and Godsill, *Bayesian modelling of temporal structure in musical audio*
(2006), with a constant tempo within a beat as in Krebs, Böck and Widmer, *An efficient state-space model for
joint tempo and meter tracking* (2015). Unlike theirs, it observes phases with a concentration (a von Mises
likelihood) instead of onset strength.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from choreograph.core.counts import MAX_METRE, NO_COUNTS, Counts
from choreograph.core.errors import ParameterError
from choreograph.core.kernel_cache import njit
from choreograph.core.numerics import Floats, Indices, interpolate_frames
from choreograph.core.timebase import frame_times_s, frames_to_seconds, times_to_frames

METRES = (3, 4)
_BREAK_LOG_RATIO = 0.2  # of two intervals between which the tempo is not continued
# Length of the curves from which the uncertainty of a count is computed. Errors occur in long stretches.
_UNCERTAINTY_S = 8.0


@dataclass(frozen=True, eq=False)
class PhaseCurves:
    """The estimated phase at every frame, as vectors.

    The direction of a vector is a phase (0 on the beat, or on count 1). Its length is the concentration of a
    von Mises distribution around it, or 0 if nothing is known. With a length of 3, half of the errors are
    below 1/15 turn.
    """

    beat: Floats  # (T, 2) cos and sin of the phase in the beat, times concentration
    bar: Floats  # (T, M, 2) the same for the phase in the bar, if the metre is the right one
    fps: float
    metres: tuple[int, ...] = METRES  # (M,) counts in the bar

    def __post_init__(self) -> None:
        n_frames, n_metres = len(self.beat), len(self.metres)
        if np.shape(self.beat) != (n_frames, 2) or np.shape(self.bar) != (n_frames, n_metres, 2):
            raise ParameterError(
                f"expected phase vectors of beats (T, 2) and of bars (T, {n_metres}, 2), got "
                f"{np.shape(self.beat)} and {np.shape(self.bar)}"
            )
        if not (np.isfinite(self.beat).all() and np.isfinite(self.bar).all()):
            raise ParameterError("expected finite phase vectors, got nan or infinity")
        if not (np.isfinite(self.fps) and self.fps > 0):
            raise ParameterError(f"expected a positive frame rate, got {self.fps}")
        if not n_metres or not all(1 <= metre <= MAX_METRE for metre in self.metres):
            raise ParameterError(f"expected metres from 1 to {MAX_METRE}, got {self.metres}")


@dataclass(frozen=True)
class PointerConfig:
    """The motion of the pointer."""

    bpm: tuple[float, float] = (50.0, 220.0)  # slowest and fastest tempo
    tempo_std: float = 0.02  # of the relative change of the beat interval from beat to beat
    break_cost: float = 12.0  # nats, of a change to any tempo, metre and number
    observations_per_s: float = 4.0  # neighbouring frames have similar errors: so many count in a second
    grid_fps: float = 120.0  # of the grid of the path's beats. Time grows with its square
    frames_at_once: int = 4096  # of the grid, after which the beginning that all paths share is found

    def __post_init__(self) -> None:
        low, high = self.bpm
        if not 10.0 <= low < high <= 400.0:
            raise ParameterError(f"expected tempi from 10 to 400 BPM, the slowest first, got {self.bpm}")
        if min(self.tempo_std, self.observations_per_s) <= 0 or self.break_cost < 0:
            raise ParameterError(
                "expected a tempo_std and observations_per_s above 0 and a break_cost of 0 or more, got "
                f"{self.tempo_std}, {self.observations_per_s} and {self.break_cost}"
            )
        if not 20.0 <= self.grid_fps <= 1000.0:
            raise ParameterError(f"expected a grid of 20 to 1000 fps, got {self.grid_fps}")


@dataclass(frozen=True, eq=False)
class DecodedCounts:
    """Counts, and their agreement with the curves."""

    counts: Counts
    beat_agreement: Floats  # (T,) -1 … 1, cosine between the curve's and the counts' phase in the beat
    bar_agreement: Floats  # (T,) the same for the bar, in the metre of the counts there


def decode_counts(
    curves: PhaseCurves, config: PointerConfig | None = None, *, source: str = ""
) -> DecodedCounts:
    """The counts that agree best with phase curves.

    The score of a path is the sum over frames of the log likelihood of both phases, the bar's for the metre
    in which it counts, relative to a uniform phase, minus the costs of changes. The counts of the best path
    are then moved off the grid of its frames, to where they agree best with the curves and an even tempo.

    Returns counts in seconds from the first frame, all of them within the frames, with the metre of most of
    them. After a break, the numbers may be in another metre. Their confidence is left at 0. There are no
    counts without frames.
    """
    config = config or PointerConfig()
    n_frames = len(curves.beat)
    if n_frames == 0:
        return DecodedCounts(NO_COUNTS, np.zeros(0), np.zeros(0))
    beat, bar = (_on_grid(vectors, curves.fps, config.grid_fps) for vectors in (curves.beat, curves.bar))
    weight = config.observations_per_s / config.grid_fps
    concentration = np.linalg.norm(bar, axis=2)  # (T', M)
    # Minus the logarithm of the modified Bessel function, which normalises a von Mises density.
    metre_gain = -(np.log(scipy.special.i0e(concentration)) + concentration)
    column, number = _states(curves.metres)
    first, last = (round(60.0 * config.grid_fps / bpm) for bpm in reversed(config.bpm))
    bounds, states = best_bar_sequence(
        weight * beat, weight * bar, weight * metre_gain, first, last - first + 1, column, number,
        np.array(curves.metres), 0.5 / config.tempo_std**2, config.break_cost, config.frames_at_once,
    )  # fmt: skip
    bounds_s = frames_to_seconds(bounds, config.grid_fps)  # (Q + 1,) the first at or before 0
    metres = np.array(curves.metres)[column[states]]
    bounds_s = _evened(curves, bounds_s, number[states], metres, config)
    return DecodedCounts(
        _counts_within(bounds_s[:-1], number[states], metres, n_frames / curves.fps, source),
        *_agreements(curves, bounds_s, number[states], column[states]),
    )


def count_uncertainty(decoded: DecodedCounts, fps: float) -> Floats:
    """The disagreement of phase curves at `fps` with each count decoded from them, (Q,) from 0 to 1.

    It is (1 - c) / 2, where c is the mean cosine between the phases of the curves and of the counts, in beat
    and bar, over the 8 s around the count or the part of them that exists. Without evidence it is ½.
    """
    agreement = 0.5 * (decoded.beat_agreement + decoded.bar_agreement)
    total = np.append(0.0, np.cumsum(agreement))
    around_s = decoded.counts.times_s[:, None] + [-_UNCERTAINTY_S / 2, _UNCERTAINTY_S / 2]  # (Q, 2)
    first, stop = np.clip(np.round(times_to_frames(around_s, fps)).astype(int), 0, len(agreement)).T
    uncertainty: Floats = np.clip(0.5 - 0.5 * (total[stop] - total[first]) / (stop - first), 0.0, 1.0)
    return uncertainty


def _on_grid(vectors: Floats, fps: float, grid_fps: float) -> Floats:
    """Vectors (T, ...) of frames, interpolated linearly at the rate of the grid over the same span."""
    n_grid = max(1, round(len(vectors) * grid_fps / fps))
    return interpolate_frames(vectors, times_to_frames(frame_times_s(n_grid, grid_fps), fps))


def _states(metres: Sequence[int]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The column of the metre and the number in the bar of every state, (S,) each."""
    column = np.repeat(np.arange(len(metres)), metres)
    return column, np.concatenate([np.arange(1, metre + 1) for metre in metres])


def _counts_within(
    times_s: Floats, numbers: NDArray[np.int64], metres: NDArray[np.int64], duration_s: float, source: str
) -> Counts:
    values, n_of = np.unique(metres, return_counts=True)
    inside = (times_s >= 0) & (times_s < duration_s)
    return Counts(times_s[inside], numbers[inside], int(values[n_of.argmax()]), source)


def _agreements(
    curves: PhaseCurves, bounds_s: Floats, numbers: NDArray[np.int64], columns: NDArray[np.int64]
) -> tuple[Floats, Floats]:
    """Cosines between the curves' and the counts' phases, of beat and bar, (T,) each, or 0 where unknown."""
    interval, in_beat = _place(bounds_s, len(curves.beat), curves.fps)
    metre = np.array(curves.metres)[columns[interval]]
    in_bar = (numbers[interval] - 1 + in_beat) / metre
    bar = curves.bar[np.arange(len(in_bar)), columns[interval]]  # (T, 2)
    return _cosine(curves.beat, in_beat), _cosine(bar, in_bar)


def _place(bounds_s: Floats, n_frames: int, fps: float) -> tuple[NDArray[np.int64], Floats]:
    """The interval of each frame, and the position in it (0 … 1), (T,) each."""
    frames_s = frame_times_s(n_frames, fps)
    interval = np.clip(np.searchsorted(bounds_s, frames_s, side="right") - 1, 0, len(bounds_s) - 2)
    return interval, (frames_s - bounds_s[interval]) / np.diff(bounds_s)[interval]


def _evened(
    curves: PhaseCurves, bounds_s: Floats, numbers: NDArray[np.int64], metres: NDArray[np.int64],
    config: PointerConfig,
) -> Floats:  # fmt: skip
    """Bounds (Q + 1,) shifted to maximise the likelihood of the beat's phases under a smooth tempo.

    The von Mises likelihood of a shift is nearly a Gaussian, and so is the change of the interval from beat
    to beat, so this is one linear system. A bound without evidence moves with its neighbours. Nothing is
    smoothed across a break.
    """
    interval, in_beat = _place(bounds_s, len(curves.beat), curves.fps)
    angle = -2 * np.pi * in_beat
    ahead = (curves.beat[:, 0] + 1j * curves.beat[:, 1]) * np.exp(1j * angle)  # by which the curve leads
    ahead *= config.observations_per_s / curves.fps
    n = len(bounds_s)
    sums = np.zeros(n, np.complex128)  # around every bound
    np.add.at(sums, interval, (1 - in_beat) * ahead)
    np.add.at(sums, interval + 1, in_beat * ahead)
    periods_s = np.diff(bounds_s)
    # Whether the tempo is continued at every bound except the ends.
    follows = (numbers[1:] == numbers[:-1] % metres[:-1] + 1) & (metres[1:] == metres[:-1])
    follows &= np.abs(np.log(periods_s[1:] / periods_s[:-1])) < _BREAK_LOG_RATIO
    period_s = np.gradient(bounds_s)  # (Q + 1,) around each bound
    weights = np.abs(sums) * (2 * np.pi / period_s) ** 2
    bands = np.zeros((3, n))
    bands[2] = weights + 1e-9 / period_s**2
    stiffness = np.where(follows, (config.tempo_std * period_s[1:-1]) ** -2.0, 0.0)  # (Q - 1,)
    curvature = np.diff(bounds_s, 2)
    right = weights * -np.angle(sums) / (2 * np.pi) * period_s
    for i, a in enumerate((1.0, -2.0, 1.0)):
        right[i : n - 2 + i] -= stiffness * a * curvature
        for j, b in enumerate((1.0, -2.0, 1.0)[i:], start=i):
            bands[2 - (j - i), j : n - 2 + j] += stiffness * a * b
    evened = bounds_s + scipy.linalg.solveh_banded(bands, right)
    return evened if (np.diff(evened) > 0).all() else bounds_s


def _cosine(vectors: Floats, turns: Floats) -> Floats:
    angle = 2 * np.pi * turns
    along = vectors[:, 0] * np.cos(angle) + vectors[:, 1] * np.sin(angle)
    cosine: Floats = along / np.maximum(np.linalg.norm(vectors, axis=1), 1e-12)
    return cosine


# The best path of the pointer, by dynamic programming in a compiled kernel.


Complexes = NDArray[np.complex128]


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
    frames_at_once: int,
) -> tuple[Indices, Indices]:
    """The beats, and their numbers in the bar, of the path with the highest score over all frames.

    A state is a beat interval that ends at frame t, p frames long, whose beat has a number in a metre. It
    scores its frames' agreement with phases that run evenly through it: Σ beat · u(φ) + bar · u((number - 1 +
    φ) / metre) + metre_gain, with u the unit vector of a phase in turns. The next interval may differ in
    length at `change_cost` times its squared relative change, the first half frame free because the frame
    grid forces it, and has the next number. For `break_cost`, it may have any length and any number. The
    beginning that all paths share is found every `frames_at_once` frames, and the paths to it are dropped.

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
    for first in range(1, n_ends, frames_at_once):
        came_from = np.empty((min(frames_at_once, n_ends - first), n_periods, n_states), np.int32)
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
