"""How lively and how densely stepped clips are, as ranks in their genre."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from choreograph.features.contacts import step_counts
from choreograph.features.liveliness import Liveliness
from choreograph.repertoire.contents import middle_starts
from choreograph.timebase import NET_FPS, SEGMENT_FRAMES, SEGMENT_S

Ints = NDArray[np.integer]


def clip_liveliness(liveliness: Liveliness, take: Ints, start_frame: Ints) -> NDArray[np.float32]:
    """Mean rank (N,), 0 … 1, of the seconds of each clip's middle 4 s; clips by take (N,) and first frame."""
    start = middle_starts(start_frame).astype(np.float64)  # (N,) in their takes
    seconds = (start + second * NET_FPS for second in range(SEGMENT_S))
    return np.mean([liveliness.ranks(take, at, at + NET_FPS) for at in seconds], axis=0, dtype=np.float32)


def clip_steps(
    body_pos_m: Callable[[int], NDArray[np.floating]], take: Ints, start_frame: Ints, genres: NDArray[np.str_]
) -> NDArray[np.float32]:
    """Rank (N,), 0 … 1, of the steps in each clip's middle 4 s among the clips of its genre.

    `body_pos_m` gives a take's positions (T, 21, 3) at 20 fps; `genres` (takes,). Equal clips have their mean
    rank.
    """
    from scipy.stats import rankdata  # a third of a second to import

    steps = np.zeros(len(take))
    for index in np.unique(take):
        clips = np.flatnonzero(take == index)
        starts = middle_starts(start_frame[clips])
        steps[clips] = step_counts(body_pos_m(int(index)), NET_FPS, starts, SEGMENT_FRAMES)
    ranks = np.empty(len(take), np.float32)
    for name in np.unique(genres[take]):
        inside = genres[take] == name
        ranks[inside] = (rankdata(steps[inside]) - 0.5) / inside.sum()
    return ranks
