"""Sizes and training lengths of the networks that count, without torch: `small` and `tiny`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from choreograph.core.errors import ParameterError
from choreograph.nets.configs import config_from_preset

# Sizes and training lengths of the network that counts motion: `small` (two CPU cores), `tiny` (tests).


@dataclass(frozen=True)
class MotionCountsConfig:
    """Everything that shapes and trains the network; stored beside its weights."""

    width: int = 48  # channels
    n_blocks: int = 6  # of dilations 1, 2, 4, …: 12.8 s are seen at 20 fps
    dropout: float = 0.15
    feature_dropout: float = 0.2  # of its inputs: no joint alone shall tell the count
    bar_weight: float = 1.0  # of the bar's likelihood against the beat's
    window_s: float = 16.0  # length of a training sample
    tempo_range: tuple[float, float] = (0.7, 1.4)  # that samples are played at
    mirrored_share: float = 0.5  # of the samples; 0 where left and right must stay distinct
    recorded_share: float = 0.65  # of the samples, from recorded takes if there are built-in ones as well
    batch_size: int = 16
    steps: int = 400
    learning_rate: float = 3e-3
    weight_decay: float = 2e-2

    def __post_init__(self) -> None:
        if min(self.width, self.n_blocks, self.batch_size, self.steps) < 1 or self.window_s <= 0:
            raise ParameterError(
                "expected width, blocks, batch size and steps of 1 or more and a window above 0 s, got "
                f"{self.width}, {self.n_blocks}, {self.batch_size}, {self.steps} and {self.window_s}"
            )
        if not 0 < self.tempo_range[0] <= self.tempo_range[1]:
            raise ParameterError(f"expected a range of tempi above 0, got {self.tempo_range}")


_PRESETS = {
    "small": MotionCountsConfig(),
    "tiny": MotionCountsConfig(width=16, n_blocks=4, batch_size=4, window_s=8.0, steps=60),
}


def motion_counts_config(preset: str, **changes: Any) -> MotionCountsConfig:
    """The preset's configuration with fields changed; `ParameterError` for an unknown name or field."""
    return config_from_preset(_PRESETS, preset, changes)


# Sizes and training length of the network that hears counts: `small` (one CPU core) and `tiny` (tests).


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
