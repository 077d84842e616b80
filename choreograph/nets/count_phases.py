"""The torch modules of the networks that estimate counts: their trunk, and the ones for motion and for music.

`nets.music_counts` estimates the beats of songs with the trained network for music.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

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
from choreograph.music.mel import MEL_BANDS
from choreograph.nets.configs import config_from_preset
from choreograph.nets.inference import EPSILON
from choreograph.nets.music_counts import (
    KERNEL,
    N_ACTIVATIONS,
    N_OUTPUTS,
    MusicCountsConfig,
    curves_from,
)
from choreograph.nets.stored import StoredNet

# Sizes and training lengths of the network for motion: `small` (two CPU cores) and `tiny` (tests).


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


_MOTION_PRESETS = {
    "small": MotionCountsConfig(),
    "tiny": MotionCountsConfig(width=16, n_blocks=4, batch_size=4, window_s=8.0, steps=60),
}


def motion_counts_config(preset: str, **changes: Any) -> MotionCountsConfig:
    """The preset with fields changed. Raises `ParameterError` for an unknown name or field."""
    return config_from_preset(_MOTION_PRESETS, preset, changes)


# The trunk of the two networks: residual blocks of dilated convolutions over time.
#
# It is that of temporal convolutional networks for beat tracking (Davies and Böck, *Temporal convolutional
# networks for musical audio beat tracking*, 2019). The dilation doubles from block to block, so that a few
# blocks have a context of many seconds on both sides of every frame. A take of any length is one input.


class Trunk(nn.Module):
    """Maps features (B, F, T) to features (B, width, T), with a context of `n_seen` frames."""

    def __init__(self, n_features: int, width: int, n_blocks: int, dropout: float) -> None:
        super().__init__()
        self.into = nn.Conv1d(n_features, width, KERNEL, padding=KERNEL // 2)
        self.blocks = nn.ModuleList(_Block(width, 2**i, dropout) for i in range(n_blocks))
        self.norm = _ChannelNorm(width)

    def forward(self, x: Tensor) -> Tensor:
        """Maps features (B, F, T), which are 0 outside the frames, to (B, width, T)."""
        x = self.into(x)
        for block in self.blocks:
            x = block(x)
        result: Tensor = self.norm(x)
        return result

    @property
    def n_seen(self) -> int:
        """Frames that one output frame depends on."""
        result: int = 1 + (KERNEL - 1) * (1 + sum(2**i for i in range(len(self.blocks))))
        return result


class _Block(nn.Module):
    def __init__(self, width: int, dilation: int, dropout: float) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            _ChannelNorm(width),
            nn.Conv1d(width, width, KERNEL, padding=KERNEL // 2 * dilation, dilation=dilation),
            nn.GELU(),
            nn.Dropout1d(dropout),
            nn.Conv1d(width, width, 1),
        )

    def forward(self, x: Tensor) -> Tensor:
        result: Tensor = x + self.layers(x)
        return result


class _ChannelNorm(nn.Module):
    """Normalises the channels of each frame to mean 0 and variance 1."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.scale = nn.Parameter(torch.ones(width, 1))
        self.shift = nn.Parameter(torch.zeros(width, 1))

    def forward(self, x: Tensor) -> Tensor:
        centred = x - x.mean(dim=1, keepdim=True)
        deviation = torch.rsqrt(centred.square().mean(dim=1, keepdim=True) + EPSILON)
        return centred * deviation * self.scale + self.shift


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
            curves = curves_from(self(body, torch.ones(body.shape[:2]))[0].numpy(), NET_FPS)
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


# The network for music: small convolutions over bands and frames, and then the trunk.


class MusicCountsNet(StoredNet):
    """Log-mel at 60 fps to activations and phases at 30 fps, which `nets.music_counts.MusicCounts` uses."""

    config_class = MusicCountsConfig

    def __init__(self, config: MusicCountsConfig) -> None:
        super().__init__()
        self.config = config
        first, second = config.front_channels
        # (B, 1, T, 96) to (B, first, T / 2, 32), then a quarter of the bands.
        self.front = nn.Sequential(
            nn.Conv2d(1, first, (5, 5), stride=(2, 3), padding=(2, 1)),
            nn.ELU(),
            nn.MaxPool2d((1, 2)),
            nn.Conv2d(first, second, (3, 3), padding=(1, 1)),
            nn.ELU(),
            nn.MaxPool2d((1, 2)),
        )
        self.trunk = Trunk(second * (MEL_BANDS // 12), config.width, config.n_blocks, config.dropout)
        self.head = nn.Conv1d(config.width, N_ACTIVATIONS + N_OUTPUTS, 1)

    def forward(self, mel: Tensor) -> tuple[Tensor, Tensor]:
        """Normalised log-mel (B, T, 96), T even, to logits of activations (B, 2, T / 2) and phase vectors
        (B, N_OUTPUTS, T / 2), as `nets.count_phases` has them."""
        bands = self.front(mel[:, None]).transpose(2, 3).flatten(1, 2)  # (B, C * 8, T / 2)
        curves = self.head(self.trunk(bands))
        return curves[:, :N_ACTIVATIONS], curves[:, N_ACTIVATIONS:]
