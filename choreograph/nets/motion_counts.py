"""The network that estimates counts from motion, and the confidence of its counts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from choreograph.core.counts import FROM_MOTION, Counts
from choreograph.core.numerics import Floats, interpolate_frames
from choreograph.core.timebase import NET_FPS, frame_times_s
from choreograph.motion.body import BODY_JOINTS, checked_body_pos_m
from choreograph.music.bar_pointer import (
    DecodedCounts,
    PhaseCurves,
    PointerConfig,
    count_uncertainty,
    decode_counts,
)
from choreograph.nets.count_phases import (
    N_OUTPUTS,
    MotionCountsConfig,
    Trunk,
    curves_from,
)
from choreograph.nets.stored import StoredNet

# Confidence of decoded counts: the share of them that is expected to be right.
#
# It is a logistic function of features of a take and its curves, fitted to takes outside the training data.


N_CONFIDENCE = 5
_STEADY_S = 5.0  # over which the curves should keep a constant phase to the counts


def confidence_features(curves: PhaseCurves, decoded: DecodedCounts) -> Floats:
    """Features of a take from which the confidence in its counts is computed, (N_CONFIDENCE,).

    They are 1, the agreement of the phases of beat and of bar with the counts, both weighted by
    concentration, the concentration of the beat, and the steadiness of its phase relative to the counts.
    """
    if not len(decoded.beat_agreement):
        return np.append(1.0, np.zeros(N_CONFIDENCE - 1))
    beat = np.linalg.norm(curves.beat, axis=1)  # (T,)
    bar = np.linalg.norm(curves.bar, axis=2).max(axis=1)
    return np.array(
        [
            1.0,
            np.average(decoded.beat_agreement, weights=beat + 1e-6),
            np.average(decoded.bar_agreement, weights=bar + 1e-6),
            np.log1p(beat).mean(),
            _steadiness(curves, decoded.counts),
        ]
    )


def _steadiness(curves: PhaseCurves, counts: Counts) -> float:
    """How constant the phase of the beat is relative to the counts, in windows of five seconds, 0 … 1.

    It is the magnitude of the mean beat vector, divided by the mean of the magnitudes. Motion without counts
    does not keep a phase for five seconds, although the best path agrees with it in places.
    """
    times_s = frame_times_s(len(curves.beat), curves.fps)
    if len(counts) < 2:
        return 0.0
    in_beats = np.interp(times_s, counts.times_s, np.arange(len(counts)))
    inside = (times_s >= counts.times_s[0]) & (times_s <= counts.times_s[-1])
    vectors = (curves.beat[:, 0] + 1j * curves.beat[:, 1]) * np.exp(-2j * np.pi * in_beats) * inside
    windows = np.array_split(vectors, max(1, round(len(vectors) / curves.fps / _STEADY_S)))
    return float(np.mean([abs(w.sum()) / max(np.abs(w).sum(), 1e-12) for w in windows]))


def confidence_of(features: Floats, weights: Floats) -> float:
    """The expected share of right counts, 0 to 1, from features (N_CONFIDENCE,)."""
    return float(1.0 / (1.0 + np.exp(-features @ weights)))


# The network that estimates counts from motion: body positions at 20 fps to curves of beat and bar phase.
#
# Its inputs are poses and joint velocities in the root frame, so that its output does not depend on the
# position on the floor or the heading.


_N_JOINTS = len(BODY_JOINTS)
N_FEATURES = _N_JOINTS * 7  # position, velocity, speed
# Dance songs keep their tempo, dancers do not stop counting, and errors of neighbouring frames are
# correlated.
POINTER = PointerConfig(bpm=(50.0, 220.0), tempo_std=0.002, break_cost=40.0, observations_per_s=1.0)
TEMPI = (0.85, 1.0, 1.18)  # at which the network reads a take. The mean of the three is more robust
_ACROSS = tuple(
    [BODY_JOINTS.index(f"{side}_{part}") for part in ("hip", "shoulder")] for side in ("left", "right")
)


class MotionCountsNet(StoredNet):
    """Body positions to phase curves, with the statistics that standardise its features."""

    config_class = MotionCountsConfig
    feature_mean: Tensor
    feature_std: Tensor
    confidence_weights: Tensor  # of `confidence_features`. Confidence is ½ until they are fitted

    def __init__(self, config: MotionCountsConfig) -> None:
        super().__init__()
        self.config = config
        self.feature_dropout = nn.Dropout1d(config.feature_dropout)
        self.trunk = Trunk(N_FEATURES, config.width, config.n_blocks, config.dropout)
        self.head = nn.Conv1d(config.width, N_OUTPUTS, 1)
        with torch.no_grad():  # without training, all vectors are 0
            for parameter in self.head.parameters():
                parameter.zero_()
        self.register_buffer("feature_mean", torch.zeros(N_FEATURES))
        self.register_buffer("feature_std", torch.ones(N_FEATURES))
        self.register_buffer("confidence_weights", torch.zeros(N_CONFIDENCE))

    def forward(self, body: Tensor, present: Tensor) -> Tensor:
        """Body positions (B, T, 21, 3) at 20 fps, and which frames exist (B, T), to (B, N_OUTPUTS, T)."""
        standard = (motion_features(body) - self.feature_mean) / self.feature_std
        features = self.feature_dropout((standard * present[..., None]).transpose(1, 2))
        result: Tensor = self.head(self.trunk(features))
        return result

    def curves(self, body_pos_m: NDArray[np.floating], tempi: Sequence[float] = TEMPI) -> PhaseCurves:
        """Phase curves of a take's body positions (T, 21, 3) at 20 fps. Raises `ParameterError` for others.

        They are the mean of the curves of the take at its own tempo, slower and faster.
        """
        pos_m = checked_body_pos_m(body_pos_m)
        read = [self._curves_at(pos_m, tempo) for tempo in tempi]
        beat, bar = (np.mean([getattr(c, name) for c in read], axis=0) for name in ("beat", "bar"))
        return PhaseCurves(beat, bar, NET_FPS)

    def _curves_at(self, pos_m: NDArray[np.float64], tempo: float) -> PhaseCurves:
        frames = np.arange(max(1, round(len(pos_m) / tempo))) * tempo
        body = torch.from_numpy(interpolate_frames(pos_m, frames).astype(np.float32))[None]
        self.eval()
        with torch.no_grad():
            curves = curves_from(self(body, torch.ones(body.shape[:2]))[0], NET_FPS)
        back = np.arange(len(pos_m)) / tempo
        return PhaseCurves(
            interpolate_frames(curves.beat, back), interpolate_frames(curves.bar, back), NET_FPS
        )

    def counts(self, body_pos_m: NDArray[np.floating]) -> Counts:
        """A take's counts, of body positions (T, 21, 3) at 20 fps. Raises `ParameterError` for others.

        Their confidence is the expected share of counts within 0.15 beat of the true counts.
        """
        curves = self.curves(body_pos_m)
        decoded = decode_counts(curves, POINTER, source=FROM_MOTION)
        features, weights = confidence_features(curves, decoded), self.confidence_weights.double().numpy()
        uncertainty = count_uncertainty(decoded, NET_FPS)
        return replace(decoded.counts, confidence=confidence_of(features, weights), uncertainty=uncertainty)


def motion_features(body: Tensor) -> Tensor:
    """Positions, velocities and speeds of joints in the root frame, (B, T, N_FEATURES)."""
    across = (body[:, :, _ACROSS[0]] - body[:, :, _ACROSS[1]]).sum(dim=2)  # (B, T, 3)
    length = torch.hypot(across[..., 0], across[..., 2]).clamp(min=1e-6)
    cos, sin = (across[..., 0] / length)[..., None], (across[..., 2] / length)[..., None]  # (B, T, 1)
    origin = body[:, :, :1] * body.new_tensor([1.0, 0.0, 1.0])
    velocity = torch.gradient(body, dim=1)[0] * NET_FPS if body.shape[1] > 1 else torch.zeros_like(body)
    parts = [_turned(body - origin, cos, sin), _turned(velocity, cos, sin)]
    return torch.cat([*(part.flatten(2) for part in parts), velocity.norm(dim=-1)], dim=2)


def _turned(vectors: Tensor, cos: Tensor, sin: Tensor) -> Tensor:
    """Vectors (B, T, J, 3) turned about Y so that left is +X."""
    x, y, z = vectors.unbind(dim=-1)
    return torch.stack([cos * x + sin * z, y, cos * z - sin * x], dim=-1)
