"""The trunk of the networks that count: residual blocks of dilated convolutions over time.

As temporal convolution networks that track beats in music (Davies and Böck, *Temporal convolutional networks
for musical audio beat tracking*, 2019): the dilation doubles from block to block, so that a few blocks see
many seconds on both sides of every frame, and every length of take is taken at once.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

KERNEL = 5


class Trunk(nn.Module):
    """Features (B, F, T) to features (B, width, T); every frame sees `n_seen` frames around it."""

    def __init__(self, n_features: int, width: int, n_blocks: int, dropout: float) -> None:
        super().__init__()
        self.into = nn.Conv1d(n_features, width, KERNEL, padding=KERNEL // 2)
        self.blocks = nn.ModuleList(_Block(width, 2**i, dropout) for i in range(n_blocks))
        self.norm = _ChannelNorm(width)

    def forward(self, x: Tensor) -> Tensor:
        """Features (B, F, T), 0 where there is no frame, to (B, width, T)."""
        x = self.into(x)
        for block in self.blocks:
            x = block(x)
        return self.norm(x)

    @property
    def n_seen(self) -> int:
        """Frames that one output frame depends on."""
        return 1 + (KERNEL - 1) * (1 + sum(2**i for i in range(len(self.blocks))))


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
        return x + self.layers(x)


class _ChannelNorm(nn.Module):
    """Each frame's channels to mean 0 and variance 1: whatever the length of the take."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.scale = nn.Parameter(torch.ones(width, 1))
        self.shift = nn.Parameter(torch.zeros(width, 1))

    def forward(self, x: Tensor) -> Tensor:
        centred = x - x.mean(dim=1, keepdim=True)
        deviation = torch.rsqrt(centred.square().mean(dim=1, keepdim=True) + 1e-5)
        return centred * deviation * self.scale + self.shift
