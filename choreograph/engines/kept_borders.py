"""What is kept of another dance, as engines see it: where its gaps begin and end, and in which poses."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from choreograph.constraints.kept import KeptDance
from choreograph.constraints.resolve import ResolvedConstraints
from choreograph.engines.candidates import Candidates
from choreograph.engines.word_bank import AROUND_S
from choreograph.features.song_features import SongFeatures
from choreograph.graph import Cost, Layer
from choreograph.motifs.words import poses_at
from choreograph.motion.body import body_pos_m
from choreograph.motion.pose import clips_to_root_frame, to_root_frame

Floats = NDArray[np.float64]

_POSE_WEIGHT = 6.0  # a metre: twice the default of `transition`, since a gap has but two ends
_VELOCITY_WEIGHT = 0.6  # a metre a second


@dataclass(frozen=True)
class Border:
    """Where a gap begins, or ends."""

    at_s: float
    begins: bool


def gap_borders(kept: KeptDance, duration_s: float) -> list[Border]:
    """Where gaps begin after what is kept, and end before it."""
    ends = [Border(k.end_s, True) for k in kept.stretches if k.end_s < duration_s]
    starts = [Border(k.start_s, False) for k in kept.stretches if k.start_s > 0]
    return sorted(ends + starts, key=lambda border: border.at_s)


class KeptBorders(Cost):
    """Distance in pose and velocity of nodes at a gap's borders from the existing dance there.

    Nodes are compared on the whole second nearest to a border, where the existing dance has just been left or
    is about to begin.
    """

    name = "kept_borders"
    min_jump_cost = 0.0

    def __init__(self, kept: KeptDance, duration_s: float) -> None:
        body, fps = body_pos_m(kept.motion), kept.motion.fps
        self._at: dict[tuple[int, bool], tuple[Floats, Floats]] = {}
        for border in gap_borders(kept, duration_s):
            second = round(border.at_s)
            poses = poses_at(body, fps, second + AROUND_S)  # (3, 21, 3)
            velocity = (poses[2] - poses[0]) / (AROUND_S[2] - AROUND_S[0])
            of_layer = second if border.begins else second - 1
            self._at[of_layer, border.begins] = to_root_frame(poses[1]), to_root_frame(poses[1], velocity)

    def node(self, layer: Layer, song_features: SongFeatures) -> Floats | None:
        cost = np.zeros(layer.n_nodes)
        for begins in (True, False):
            if (layer.second, begins) not in self._at:
                continue
            pose_m, velocity_m_s = self._at[layer.second, begins]
            poses = layer.first_pose_m if begins else layer.last_pose_m
            velocities = layer.first_velocity_m_s if begins else layer.last_velocity_m_s
            cost += _POSE_WEIGHT * _rms(poses - pose_m) + _VELOCITY_WEIGHT * _rms(velocities - velocity_m_s)
        return cost if cost.any() else None


def with_border_costs(
    candidates: list[Candidates], kept: KeptDance, constraints: ResolvedConstraints
) -> list[Candidates]:
    """The words for each slot (N,), the dearer the farther from the existing dance at a gap's borders."""
    body, fps, bounds_s = body_pos_m(kept.motion), kept.motion.fps, constraints.bounds_s
    dearer = list(candidates)
    for border in gap_borders(kept, float(bounds_s[-1])):
        nearest = int(np.abs(bounds_s - border.at_s).argmin())
        slot = nearest if border.begins else nearest - 1
        if not 0 <= slot < len(dearer):
            continue
        here = dearer[slot]
        poses = clips_to_root_frame(poses_at(body, fps, bounds_s[nearest] + AROUND_S))  # (3, 21, 3)
        own = here.first_m if border.begins else here.last_m
        distance_m = np.sqrt(np.square(own - poses).sum(axis=-1).mean(axis=(1, 2)))
        dearer[slot] = replace(here, cost_m=here.cost_m + distance_m)
    return dearer


def _rms(vectors: NDArray[np.floating]) -> Floats:
    """Root mean square lengths (N,) of vectors (N, 21, 3)."""
    return np.sqrt(np.square(vectors).sum(axis=-1).mean(axis=-1))
