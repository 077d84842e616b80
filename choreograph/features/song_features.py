"""`SongFeatures`: the features of a song that the engines plan from, per second."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.counts import Counts
from choreograph.features.sections import Sections


@dataclass(frozen=True, eq=False)
class SongFeatures:
    """Features of a song; S is its number of seconds, rounded up."""

    name: str
    duration_s: float
    counts: Counts  # the beats, numbered in their bars
    style: NDArray[np.float32]  # (S, 32) embedding of the 4 s from each second
    beat_count: NDArray[np.float32]  # (S,) motion beats expected in those 4 s
    density: NDArray[np.float32]  # (S, 80) target tempo-density of those 4 s, 20 fps
    sections: Sections
    energy: NDArray[np.float32]  # (S,) loudness, 0 … 1 from 6 dB below its loud level
    opening_s: float  # the first count that is danced; before it the first pose is held
    closing_s: float  # the last one
    onset_density: NDArray[np.float32]  # (S,) of the 4 s from each second, as a rank in the song, 0 … 1

    @property
    def beat_times_s(self) -> NDArray[np.float64]:
        """The beats in seconds, (Q,)."""
        return self.counts.times_s

    @property
    def n_seconds(self) -> int:
        """Number of seconds S; the last may be shorter."""
        return len(self.style)
