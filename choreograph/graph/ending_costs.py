"""The cost that lets a dance begin and end in poses that can be held."""

from __future__ import annotations

import numpy as np

from choreograph.features.phrasing import held_times_s
from choreograph.features.song_features import SongFeatures
from choreograph.graph.costs import Cost, Floats
from choreograph.graph.layers import Layer, PoseBank
from choreograph.motion.body import BODY_JOINTS
from choreograph.timebase import NET_FPS, NODE_FRAMES

_ANKLES = tuple(BODY_JOINTS.index(f"{side}_ankle") for side in ("left", "right"))


class Stillness(Cost):
    """Restlessness of the poses that are held before the first count and after the last (ours).

    Mean joint speed in m/s, plus ten times the height of one foot over the other in metres.
    """

    def __init__(self, poses: PoseBank) -> None:
        self._poses = poses

    def node(self, layer: Layer, song_features: SongFeatures) -> Floats | None:
        first_s, last_s = held_times_s(song_features.opening_s, song_features.closing_s)
        held_s = [first_s] if song_features.opening_s > 0 else []
        held_s += [last_s] if song_features.closing_s < song_features.duration_s else []
        here = [at_s for at_s in held_s if layer.second <= at_s < layer.second + 1]
        if not here:
            return None
        return np.sum([self._restlessness(layer, at_s) for at_s in here], axis=0)

    def _restlessness(self, layer: Layer, at_s: float) -> Floats:
        frame = (at_s - layer.second) * NET_FPS
        low = min(int(frame), NODE_FRAMES - 1)
        slope = layer.source_frames[:, low + 1] - layer.source_frames[:, low]
        pose_m, velocity_m_s = self._poses.poses_m(
            layer.clip, layer.source_frames[:, low] + (frame - low) * slope
        )
        speed_m_s = np.linalg.norm(velocity_m_s, axis=-1).mean(axis=1) * slope
        lifted_m = np.ptp(pose_m[:, _ANKLES, 1], axis=1)
        return speed_m_s + 10.0 * lifted_m
