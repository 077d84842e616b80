"""Micro-timing: accents that dancers place just beside the count are landed on it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

MAX_SHIFT_S = 0.05  # of the take, and of the song it is danced to: beyond it a dance is off the count,
_MAX_SHIFT_COUNTS = 0.12  # as it is beyond this where counts are close together
_REACH_S = 0.12  # a motion beat further from a count belongs to something else
_ON_COUNTS = 0.5  # resultant length of the phases, from 0 (anywhere) to 1 (all at one phase)


def accents_lie_on_counts(motion_beats_s: Floats, counts_s: Floats) -> bool:
    """Whether a take's motion beats (M,) gather near its counts (Q,): whether it is danced in accents.

    So it is where the resultant length of their phases within the count is 0.5 or more, and their mean phase
    is within an eighth of the count. Dancers of ballroom reach 0.2 to 0.4: they come to rest where their
    technique has them rest, and landing that on the count would make them dance as nobody does.
    """
    inside = motion_beats_s[(motion_beats_s >= counts_s[0]) & (motion_beats_s <= counts_s[-1])]
    if len(inside) == 0:
        return False
    position = np.interp(inside, counts_s, np.arange(len(counts_s)))
    mean = np.exp(2j * np.pi * position).mean()
    return bool(abs(mean) >= _ON_COUNTS and abs(np.angle(mean)) <= np.pi / 4)


def accent_shifts_s(motion_beats_s: Floats, counts_s: Floats) -> Floats:
    """How much later (Q,) than each of its counts (Q,) a take is at its accent there, in the take's seconds.

    At most 0.05 s, and 0.12 of a count, to either side. 0 at counts without a motion beat (M,) within 0.12 s,
    and throughout if the take's accents do not lie on its counts. ChoreoGraph moves motion beats onto music
    beats by DTW alone (section 3.2).
    """
    if len(counts_s) < 2 or not accents_lie_on_counts(motion_beats_s, counts_s):
        return np.zeros(len(counts_s))
    distance_s = motion_beats_s[None, :] - counts_s[:, None]  # (Q, M)
    nearest = np.abs(distance_s).argmin(axis=1)[:, None]
    shift_s = np.take_along_axis(distance_s, nearest, axis=1)[:, 0]
    most_s = min(MAX_SHIFT_S, _MAX_SHIFT_COUNTS * float(np.median(np.diff(counts_s))))
    return np.where(np.abs(shift_s) <= _REACH_S, np.clip(shift_s, -most_s, most_s), 0.0)
