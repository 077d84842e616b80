"""A cost that keeps a dance from repeating what others of the same song do."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from choreograph.features.song_features import SongFeatures
from choreograph.graph import Cost, Layer
from choreograph.plan import Plan
from choreograph.timebase import NET_FPS

_SAME_S = 0.5  # parts of a take nearer than this look the same


class Unlike(Cost):
    """1 for what an earlier dance danced in this second: the same take within half a second."""

    def __init__(self, earlier: Sequence[Plan]) -> None:
        self._earlier = [plan for plan in earlier if plan.seconds]

    def node(self, layer: Layer, song_features: SongFeatures) -> NDArray[np.floating]:
        same = np.zeros(layer.n_nodes, bool)
        start_s = layer.take_frames[:, 0] / NET_FPS
        for plan in self._earlier:
            there = plan.seconds[layer.second]
            same |= (layer.take_names == there.take) & (abs(start_s - there.source_times_s[0]) < _SAME_S)
        return same.astype(np.float64)
