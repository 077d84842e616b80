"""`MotionCounts`, a network for the beats and bars of takes without a song: its sizes and its inference."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from choreograph.core.counts import FROM_MOTION, Counts
from choreograph.core.errors import ParameterError
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
from choreograph.nets.inference import TrainedNet
from choreograph.nets.layers import Array, Shapes, conv1d, trunk, trunk_shapes
from choreograph.nets.music_counts import KERNEL, N_OUTPUTS, curves_from

# Sizes and training lengths of the network: `small` (two CPU cores) and `tiny` (tests).


@dataclass(frozen=True)
class MotionCountsConfig:
    """Sizes and training settings of the network for counts of motion, stored with its weights."""

    width: int = 48  # channels
    n_blocks: int = 6  # of dilations 1, 2, 4 and so on, with a context of 12.8 s at 20 fps
    dropout: float = 0.15  # of the trunk
    feature_dropout: float = 0.2  # of the inputs, so that the network does not depend on one joint
    bar_weight: float = 1.0  # of the bar's likelihood, relative to the beat's
    window_s: float = 16.0  # length of a training sample
    tempo_range: tuple[float, float] = (0.7, 1.4)  # of samples, relative to the take
    mirrored_share: float = 0.5  # of the samples, or 0 where left and right must stay distinct
    recorded_share: float = 0.65  # of the samples that are recorded takes, if there are built-in ones as well
    batch_size: int = 16  # samples of a step
    steps: int = 400  # of the training
    learning_rate: float = 3e-3  # at its highest
    weight_decay: float = 2e-2  # of AdamW, or 0 for Adam

    def __post_init__(self) -> None:
        if min(self.width, self.n_blocks, self.batch_size, self.steps) < 1 or self.window_s <= 0:
            raise ParameterError(
                "expected width, blocks, batch size and steps of 1 or more and a window above 0 s, got "
                f"{self.width}, {self.n_blocks}, {self.batch_size}, {self.steps} and {self.window_s}"
            )
        if not 0 < self.tempo_range[0] <= self.tempo_range[1]:
            raise ParameterError(f"expected a range of tempi above 0, got {self.tempo_range}")


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
ACROSS = tuple(
    [BODY_JOINTS.index(f"{side}_{part}") for part in ("hip", "shoulder")] for side in ("left", "right")
)


class MotionCounts(TrainedNet):
    """The trained `content.count_networks.MotionCountsNet`: body positions to phase curves and counts."""

    config_class = MotionCountsConfig

    @staticmethod
    def shapes(config: MotionCountsConfig) -> Shapes:
        """The shapes of all weights."""
        return trunk_shapes(N_FEATURES, config.width, config.n_blocks, KERNEL) | {
            "head.weight": (N_OUTPUTS, config.width, 1), "head.bias": (N_OUTPUTS,),
            "feature_mean": (N_FEATURES,), "feature_std": (N_FEATURES,),
            "confidence_weights": (N_CONFIDENCE,),
        }  # fmt: skip

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
        features = motion_features(interpolate_frames(pos_m, frames).astype(np.float32))
        standard = (features - self.weights["feature_mean"]) / self.weights["feature_std"]
        hidden = trunk(standard[None], self.weights, self.config.n_blocks)
        curves = curves_from(conv1d(hidden, self.weights, "head")[0].T, NET_FPS)
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
        features, weights = (
            confidence_features(curves, decoded),
            self.weights["confidence_weights"].astype(np.float64),
        )
        uncertainty = count_uncertainty(decoded, NET_FPS)
        return replace(decoded.counts, confidence=confidence_of(features, weights), uncertainty=uncertainty)


def motion_features(body_pos_m: Array) -> Array:
    """Positions, velocities and speeds of joints (T, 21, 3) in the root frame, (T, N_FEATURES)."""
    across = (body_pos_m[:, ACROSS[0]] - body_pos_m[:, ACROSS[1]]).sum(axis=1)  # (T, 3)
    length = np.maximum(np.hypot(across[:, 0], across[:, 2]), np.float32(1e-6))
    cos, sin = (across[:, 0] / length)[:, None], (across[:, 2] / length)[:, None]  # (T, 1)
    origin = body_pos_m[:, :1] * np.array([1.0, 0.0, 1.0], np.float32)
    velocity = (
        np.gradient(body_pos_m, axis=0) * np.float32(NET_FPS) if len(body_pos_m) > 1
        else np.zeros_like(body_pos_m)
    )  # fmt: skip
    parts = [_turned(body_pos_m - origin, cos, sin), _turned(velocity, cos, sin)]
    speed = np.sqrt(np.square(velocity).sum(axis=-1))
    return np.concatenate([*(part.reshape(len(part), -1) for part in parts), speed], axis=1)


def _turned(vectors: Array, cos: Array, sin: Array) -> Array:
    """Vectors (T, J, 3) turned about Y so that left is +X."""
    x, y, z = (vectors[..., axis] for axis in range(3))
    return np.stack([cos * x + sin * z, y, cos * z - sin * x], axis=-1)
