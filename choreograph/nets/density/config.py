"""Sizes and training lengths of the tempo-density networks: `paper`, `small` (one CPU core), `tiny` (tests).

The paper gives layer counts, the hidden vector of 4096 and the content of 1024; other widths are ours.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from choreograph.errors import ParameterError
from choreograph.nets.presets import check_training, config_from_preset

DENSITY_LOSSES = ("paper", "locatable")
HIDDEN_FRAMES = 4  # of the hidden vector


@dataclass(frozen=True)
class DensityConfig:
    """Everything that shapes and trains both tempo-density networks; stored beside their weights."""

    width: int = 32  # of the transformer layers
    conv_channels: tuple[int, int, int, int, int] = (32, 32, 48, 64, 128)  # hidden vector: 4 x the last
    content_dim: int = 128
    loss: str = "locatable"  # "paper": equation 2 alone, which does not determine the density
    reconstruction_weight: float = 1.0  # of equation 2
    content_weight: float = 0.1  # equation 2's lambda
    equivariance_weight: float = 1.0
    location_weight: float = 1.0
    temperature: float = 0.1  # of the location term: of squared differences of unit-variance curves
    velocities: bool = True  # of joints are inputs beside positions; the paper's are positions alone
    skips: bool = (
        True  # from each convolution block to the deconvolution block of its rate; the paper has none
    )
    unit_variance: bool = True  # of every density over its segment; the paper leaves its scale open
    augmented: bool = True  # clips and music of the samples; the paper warps clips in time alone
    mirrored_share: float = 0.5  # of the augmented motion; 0 where left and right must stay distinct
    batch_size: int = 16
    steps: int = 1500
    learning_rate: float = 2e-3
    weight_decay: float = 1e-3
    music_channels: tuple[int, int, int, int, int] = (32, 32, 48, 64, 64)
    music_batch_size: int = 16
    music_steps: int = 1500
    music_learning_rate: float = 1e-3
    synchronise: bool = True  # targets with motion beats warped onto music beats; False: the paper's raw ones
    epochs: int = 0  # times that the takes are gone through, by both networks, instead of steps; 0: steps
    schedule: str = "cosine"  # of the learning rate: see `nets.training.train`

    @property
    def hidden_dim(self) -> int:
        """Size of the hidden vector."""
        return HIDDEN_FRAMES * self.conv_channels[-1]

    def __post_init__(self) -> None:
        if self.loss not in DENSITY_LOSSES:
            raise ParameterError(
                f"expected a density loss among {', '.join(DENSITY_LOSSES)}, got {self.loss!r}"
            )
        check_training(self.epochs, self.schedule)
        if self.width < 4 or self.width % 4:
            raise ParameterError(f"expected a width divisible by the 4 attention heads, got {self.width}")
        if min(self.steps, self.music_steps) < 1 or min(self.batch_size, self.music_batch_size) < 2:
            raise ParameterError(
                "expected steps of 1 or more and batches of 2 or more, got "
                f"{self.steps}, {self.music_steps}, {self.batch_size} and {self.music_batch_size}"
            )


_PRESETS = {
    "paper": DensityConfig(
        width=256,
        conv_channels=(64, 128, 256, 512, 1024),
        content_dim=1024,
        batch_size=64,
        steps=50_000,
        learning_rate=3e-4,
        music_channels=(64, 128, 256, 512, 512),
        music_batch_size=64,
        music_steps=20_000,
        music_learning_rate=3e-4,
    ),
    "small": DensityConfig(),
    "tiny": DensityConfig(
        width=16,
        conv_channels=(16, 16, 16, 24, 32),
        content_dim=32,
        batch_size=8,
        steps=300,
        music_channels=(8, 16, 16, 16, 16),
        music_batch_size=8,
        music_steps=80,
        synchronise=False,  # saves tracking the beats of every take
    ),
}


def density_config(preset: str, **changes: Any) -> DensityConfig:
    """The preset's configuration with fields changed; `ParameterError` for an unknown name or field."""
    return config_from_preset(_PRESETS, preset, changes)
