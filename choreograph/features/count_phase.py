"""Where in the beat and in the bar each instant lies: what a recurrent network dances by.

Continued before the first count and after the last at the tempo there, so that an introduction is counted in.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.counts import Counts

Floats = NDArray[np.float64]

COUNT_PHASE_DIM = 4  # cos and sin of the phase of the beat, then of the bar
_END_PERIODS = 8  # periods whose median continues counts beyond their ends
_BEYOND = 10_000  # periods that counts are continued by


def count_phase(counts: Counts, times_s: NDArray[np.floating]) -> NDArray[np.float32]:
    """Cos and sin of the phases of beat and bar (T, 4) at each time (T,); a phase that is not known is 0, 0.

    A beat's phase is 0 on the count, a bar's on count 1. Two counts are needed to know the phase of the beat,
    two counts 1 for that of the bar.
    """
    phases = np.zeros((len(times_s), 2, 2))
    for column, instants_s in enumerate((counts.times_s, counts.downbeat_times_s)):
        if len(instants_s) > 1:
            angle = 2 * np.pi * index_at(instants_s, times_s)
            phases[:, column] = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return phases.reshape(-1, COUNT_PHASE_DIM).astype(np.float32)


def index_at(instants_s: Floats, times_s: NDArray[np.floating]) -> Floats:
    """The fractional index among two or more increasing instants (Q,) at each time, below 0 before them."""
    return np.interp(times_s, *_continued(instants_s))


def time_at(instants_s: Floats, index: NDArray[np.floating]) -> Floats:
    """The time at each fractional index among two or more increasing instants (Q,): inverse to `index_at`."""
    times_s, indices = _continued(instants_s)
    return np.interp(index, indices, times_s)


def _continued(instants_s: Floats) -> tuple[Floats, Floats]:
    """Instants and their indices, with one more far before and far after them."""
    n, periods_s = len(instants_s), np.diff(instants_s)
    before_s = instants_s[0] - _BEYOND * np.median(periods_s[:_END_PERIODS])
    after_s = instants_s[-1] + _BEYOND * np.median(periods_s[-_END_PERIODS:])
    indices = np.concatenate([[-float(_BEYOND)], np.arange(n), [n - 1.0 + _BEYOND]])
    return np.concatenate([[before_s], instants_s, [after_s]]), indices
