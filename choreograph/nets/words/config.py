"""Sizes and training lengths of the motion-word network: `paper`, `small` (two CPU cores), `tiny` (tests).

The paper gives 184 dimensions and uses a network published before it; the architecture is ours.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from choreograph.errors import ParameterError
from choreograph.nets.presets import MAX_DEPTH, config_from_preset

WORD_DIM = 184  # of embeddings


@dataclass(frozen=True)
class WordConfig:
    """Everything that shapes and trains the motion-word network; stored beside its weights."""

    width: int = 64  # channels of the temporal convolutions
    n_blocks: int = 2
    same_m: float = 0.04  # kernel width: words much nearer than that count as the same
    contrast_weight: float = 0.1
    distance_weight: float = 1.0  # embedding distances against mean joint distances
    mirrored_share: float = 0.5  # of the motion samples; 0 where left and right must stay distinct
    batch_size: int = 128
    steps: int = 800
    learning_rate: float = 5e-4
    weight_decay: float = 1e-3

    def __post_init__(self) -> None:
        if min(self.steps, self.width) < 1 or not 1 <= self.n_blocks <= MAX_DEPTH or self.batch_size < 2:
            raise ParameterError(
                f"expected steps, width and blocks (to {MAX_DEPTH}) of 1 or more, batches of 2 or more, got "
                f"{self.steps}, {self.width}, {self.n_blocks} and {self.batch_size}"
            )
        if self.same_m <= 0 or min(self.contrast_weight, self.distance_weight) < 0:
            raise ParameterError(
                "expected same_m above 0 and weights of 0 or more, got "
                f"{self.same_m}, {self.contrast_weight} and {self.distance_weight}"
            )


_PRESETS = {
    "paper": WordConfig(width=512, n_blocks=4, batch_size=512, steps=20_000, learning_rate=2e-4),
    "small": WordConfig(),
    "tiny": WordConfig(width=32, n_blocks=1, batch_size=32, steps=100),
}


def word_config(preset: str, **changes: Any) -> WordConfig:
    """The preset's configuration with fields changed; `ParameterError` for an unknown name or field."""
    return config_from_preset(_PRESETS, preset, changes)
