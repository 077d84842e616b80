"""The torch modules of the networks that estimate counts: their trunk, and the ones for motion and for music.

They are trained here. `choreograph.nets.motion_counts` and `choreograph.nets.music_counts` estimate counts
with the trained networks.
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor, nn

from choreograph.core.timebase import NET_FPS
from choreograph.music.mel import MEL_BANDS
from choreograph.nets.configs import config_from_preset
from choreograph.nets.layers import EPSILON
from choreograph.nets.motion_counts import ACROSS, N_CONFIDENCE, N_FEATURES, MotionCounts, MotionCountsConfig
from choreograph.nets.music_counts import KERNEL, N_ACTIVATIONS, N_OUTPUTS, MusicCountsConfig
from choreograph.nets.stored import StoredNet

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


# The network that estimates counts from motion: body positions at 20 fps to curves of beat and bar phase.
#
# Its inputs are poses and joint velocities in the root frame, so that its output does not depend on the
# position on the floor or the heading.


_MOTION_PRESETS = {
    "small": MotionCountsConfig(),
    "tiny": MotionCountsConfig(width=16, n_blocks=4, batch_size=4, window_s=8.0, steps=60),
}


def motion_counts_config(preset: str, **changes: Any) -> MotionCountsConfig:
    """The preset with fields changed. Raises `ParameterError` for an unknown name or field."""
    return config_from_preset(_MOTION_PRESETS, preset, changes)


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

    def for_inference(self) -> MotionCounts:
        """The network with its present weights, which estimates counts."""
        return MotionCounts.from_arrays(*self.to_arrays())


def motion_features(body: Tensor) -> Tensor:
    """Positions, velocities and speeds of joints in the root frame, (B, T, N_FEATURES)."""
    across = (body[:, :, ACROSS[0]] - body[:, :, ACROSS[1]]).sum(dim=2)  # (B, T, 3)
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


_MUSIC_PRESETS = {
    "small": MusicCountsConfig(),
    "tiny": MusicCountsConfig((4, 4), 8, 4, excerpt_s=8.0, batch_size=4, steps=60),
}


def music_counts_config(preset: str = "small", **changes: Any) -> MusicCountsConfig:
    """A preset with fields changed. Raises `ParameterError` for an unknown name or field."""
    return config_from_preset(_MUSIC_PRESETS, preset, changes)


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
        (B, N_OUTPUTS, T / 2), as `nets.music_counts.curves_from` reads them."""
        bands = self.front(mel[:, None]).transpose(2, 3).flatten(1, 2)  # (B, C * 8, T / 2)
        curves = self.head(self.trunk(bands))
        return curves[:, :N_ACTIVATIONS], curves[:, N_ACTIVATIONS:]
