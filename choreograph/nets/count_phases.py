"""Configurations, outputs and convolutional trunk of the two networks that estimate counts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor, nn

from choreograph.core.errors import ParameterError
from choreograph.music.bar_pointer import METRES, PhaseCurves
from choreograph.nets.configs import config_from_preset

# Sizes and training lengths of both networks: `small` (two CPU cores) and `tiny` (tests).


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


@dataclass(frozen=True)
class MusicCountsConfig:
    """Sizes and training settings of the network for counts of music, stored with its weights."""

    front_channels: tuple[int, int] = (8, 16)  # of the two convolutions over bands and frames
    width: int = 32  # channels of the trunk
    n_blocks: int = 9  # of the trunk: a context of 34 s on either side
    dropout: float = 0.1  # of the trunk
    excerpt_s: float = 30.0  # length of a training sample
    batch_size: int = 8  # samples of a step
    steps: int = 900  # of the training
    learning_rate: float = 3e-3  # at its highest
    weight_decay: float = 1e-3  # of AdamW, or 0 for Adam
    bar_weight: float = 1.0  # of the bar's phase, relative to the beat's
    activation_weight: float = 1.0  # of the activations, relative to the phases


_MUSIC_PRESETS = {
    "small": MusicCountsConfig(),
    "tiny": MusicCountsConfig((4, 4), 8, 4, excerpt_s=8.0, batch_size=4, steps=60),
}


def music_counts_config(preset: str = "small", **changes: Any) -> MusicCountsConfig:
    """A preset with fields changed. Raises `ParameterError` for an unknown name or field."""
    return config_from_preset(_MUSIC_PRESETS, preset, changes)


# Phases in beat and bar, as the networks output them.
#
# For every frame, a network outputs a vector for the beat and one for the bar of each metre, in the form of
# `music.bar_pointer.PhaseCurves`. The direction is the phase, and the length is the concentration. A vector v
# gives a phase φ the von Mises density exp(v · u(φ)) / (2π I₀(|v|)), so the network learns its confidence
# with its phases. The vector of a metre that the take does not have should be 0, so the length of a vector
# is evidence for its metre.


N_OUTPUTS = 2 + 2 * len(METRES)  # of a network, per frame


def curves_from(outputs: Tensor, fps: float) -> PhaseCurves:
    """Phase curves from a network's outputs (N_OUTPUTS, T)."""
    vectors = outputs.detach().cpu().double().numpy().reshape(1 + len(METRES), 2, -1)
    return PhaseCurves(vectors[0].T, vectors[1:].transpose(2, 0, 1), fps)


# The trunk of the two networks: residual blocks of dilated convolutions over time.
#
# It is that of temporal convolutional networks for beat tracking (Davies and Böck, *Temporal convolutional
# networks for musical audio beat tracking*, 2019). The dilation doubles from block to block, so that a few
# blocks have a context of many seconds on both sides of every frame. A take of any length is one input.


KERNEL = 5


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
        deviation = torch.rsqrt(centred.square().mean(dim=1, keepdim=True) + 1e-5)
        return centred * deviation * self.scale + self.shift
