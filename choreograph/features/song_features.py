"""`SongFeatures`: what the engine knows about a song, second by second."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class SongFeatures:
    """A song as the planner hears it; S is the number of started seconds."""

    name: str
    duration_s: float
    beat_times_s: NDArray[np.float64]  # (Q,)
    style: NDArray[np.float32]  # (S, 32) embedding of the 4 s from each second
    beat_count: NDArray[np.float32]  # (S,) motion beats expected in those 4 s
    density: NDArray[np.float32]  # (S, 80) tempo-density wanted in those 4 s, 20 fps

    @property
    def n_seconds(self) -> int:
        """Number of seconds S, the last one possibly shorter."""
        return len(self.style)

    def beats_between(self, start_s: float, stop_s: float) -> NDArray[np.float64]:
        """Beats in [start_s, stop_s), in seconds of the song."""
        low, high = np.searchsorted(self.beat_times_s, [start_s, stop_s])
        return self.beat_times_s[low:high]
