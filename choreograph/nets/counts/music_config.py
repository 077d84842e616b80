"""Sizes and training length of the network that hears counts: `small` (one CPU core) and `tiny` (tests)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from choreograph.nets.presets import config_from_preset


@dataclass(frozen=True)
class MusicCountsConfig:
    """Everything that shapes and trains the network; stored beside its weights."""

    front_channels: tuple[int, int] = (8, 16)  # of the two convolutions over bands and frames
    width: int = 32  # channels of the trunk
    n_blocks: int = 9  # of the trunk: it sees 34 s to either side
    dropout: float = 0.1
    excerpt_s: float = 30.0
    batch_size: int = 8
    steps: int = 900
    learning_rate: float = 3e-3
    weight_decay: float = 1e-3
    bar_weight: float = 1.0  # of the bar's phase beside the beat's
    activation_weight: float = 1.0  # of the activations beside the phases


PRESETS = {
    "small": MusicCountsConfig(),
    "tiny": MusicCountsConfig((4, 4), 8, 4, excerpt_s=8.0, batch_size=4, steps=60),
}


def music_counts_config(preset: str = "small", **changes: Any) -> MusicCountsConfig:
    """A preset with fields changed; `ParameterError` for an unknown name or field."""
    return config_from_preset(PRESETS, preset, changes)
