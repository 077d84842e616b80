"""Selection at random among the clips that suit the music: as varied as what suits it (ours)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import ParameterError

Mask = NDArray[np.bool_]

_SUITABLE_SHARE = 0.5  # of the candidates, at least


class Alignments:
    """Random numbers of clips that stay the same for as long as a take is danced on.

    The clip of a take that begins a second later, a second later, has the number that this one has: so that
    a take that is drawn can be danced to its end, however few candidates are drawn.

    Raises `ParameterError` if there are no clips.
    """

    def __init__(self, clip_take: NDArray[np.integer], n_seconds: int, rng: np.random.Generator) -> None:
        if len(clip_take) == 0:
            raise ParameterError("expected clips to draw from, got none: every take is shorter than 8 s")
        n_clips = np.bincount(clip_take)  # of each take
        first_clip = np.cumsum(n_clips) - n_clips
        first_slot = first_clip + n_seconds * np.arange(len(n_clips))
        in_take = np.arange(len(clip_take)) - first_clip[clip_take]
        self._slots = first_slot[clip_take] + in_take + n_seconds - 1  # (N,) in the first second
        self._numbers = rng.random(len(clip_take) + n_seconds * len(n_clips))

    def numbers(self, second: int) -> NDArray[np.float64]:
        """A number from 0 to 1 for each clip (N,)."""
        return self._numbers[self._slots - second]


def draw_clips(
    alignments: Alignments,
    n_seconds: int,
    *,
    candidates: int,
    may_dance: Callable[[int], Mask],
    suits: Callable[[int], Mask] | None = None,
) -> NDArray[np.int64]:
    """Clips drawn at random for each second, of which at least half suit it, as far as there are so many.

    Parameters
    ----------
    alignments : the random numbers that clips are drawn by, least first
    candidates : int                        K; all clips if there are fewer
    may_dance : second -> bool array (N,)   a clip that may not is drawn only where too few may
    suits : second -> bool array (N,)       as of the genre that suits the music; None: all are alike

    Returns
    -------
    int array (S, min(K, N)), suitable ones first.

    Raises
    ------
    ParameterError   if `candidates` is less than 1
    """
    if candidates < 1:
        raise ParameterError(f"expected at least 1 candidate, got {candidates}")
    chosen = []
    for second in range(n_seconds):
        may = may_dance(second)
        numbers = alignments.numbers(second) + ~may  # (N,)
        k = min(candidates, len(numbers))
        suitable = np.zeros(0, np.int64)
        if suits is not None:
            suitable = np.flatnonzero(suits(second) & may)
            suitable = suitable[np.argsort(numbers[suitable])[: round(_SUITABLE_SHARE * k)]]
            numbers[suitable] = np.inf
        others = np.argpartition(numbers, k - 1)[: k - len(suitable)]
        chosen.append(np.concatenate([suitable, others]))
    return np.stack(chosen)
