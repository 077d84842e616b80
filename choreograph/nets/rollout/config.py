"""Sizes and training of the rollout network: `paper`, `small` (two CPU cores), `tiny` (tests)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from choreograph.errors import ParameterError
from choreograph.nets.presets import MAX_DEPTH, config_from_preset


@dataclass(frozen=True)
class RolloutConfig:
    """Everything that shapes and trains the rollout network; stored beside its weights.

    The paper's network takes conditions without standardisation, is conditioned on medoids only, alternates 5
    teacher-forced with 5 self-fed frames, and has no loss weight but `perceptual_weight`. The rest is ours.
    """

    n_joints: int = 24  # of the takes' skeleton, set by the training
    width: int = 256
    n_layers: int = 2
    condition_width: int = 192
    use_audio: bool = True  # rhythm and phases; False is the ablation without audio
    motifs: bool = True  # False is the acLSTM baseline
    phase: bool = True  # condition on the phase in the word and its duration; ours
    count_phase: bool = True  # and on the phase in the beat and in the bar
    own_embedding_share: float = 0.5  # of sequences conditioned on their own words, not on medoids
    style_strength: float = 1.5  # β of equation 4
    style_fade_s: float = 1.0  # of the transition between styles of words; 0: the paper's window
    style_dropout: float = 0.5  # share of sequences without style
    perceptual_weight: float = 0.5  # λ of equation 10
    position_weight: float = 2.0
    velocity_weight: float = 0.3
    root_weight: float = 0.1
    contact_weight: float = 0.05
    slide_weight: float = 0.2
    border_speed_weight: float = 0.3  # of the speed of joints where words meet
    tempi: tuple[float, ...] = (0.8, 0.9, 1.0, 1.11, 1.25)  # that takes are played at; 1 alone: their own
    frames: int = 75  # of a training sequence
    teacher_frames: int = 5  # with teacher forcing, before each run of self-fed frames
    self_fed_frames: tuple[int, ...] = (5, 15, 60)  # with the network's own poses as input; drawn per batch
    batch_size: int = 32
    steps: int = 1500
    learning_rate: float = 1e-3
    weight_decay: float = 1e-4

    def __post_init__(self) -> None:
        sizes = (self.n_joints, self.width, self.n_layers, self.condition_width, self.teacher_frames)
        if min(*sizes, *self.self_fed_frames, self.batch_size, self.steps) < 1 or self.frames < 2:
            raise ParameterError(f"expected sizes of 1 or more and sequences of 2 frames or more, got {self}")
        if self.n_layers > MAX_DEPTH:
            raise ParameterError(f"expected at most {MAX_DEPTH} layers, got {self.n_layers}")
        if not self.tempi or min(self.tempi) <= 0:
            raise ParameterError(f"expected tempi above 0, got {self.tempi}")
        if not (0 <= self.own_embedding_share <= 1 and 0 <= self.style_dropout <= 1):
            raise ParameterError(
                f"expected shares from 0 to 1, got {self.own_embedding_share} and {self.style_dropout}"
            )


_PRESETS = {
    "paper": RolloutConfig(
        width=1024, n_layers=3, condition_width=512, frames=100, self_fed_frames=(5,), steps=500_000,
        learning_rate=1e-4, style_fade_s=0.0, style_strength=40.0,
    ),
    "small": RolloutConfig(),
    "tiny": RolloutConfig(
        width=48, n_layers=1, condition_width=32, frames=40, self_fed_frames=(5, 15), batch_size=8, steps=40
    ),
}  # fmt: skip


_TEMPI_TAUGHT = (0.7, 0.8, 0.9, 1.0, 1.11, 1.25, 1.45)


def taught(config: RolloutConfig) -> RolloutConfig:
    """How a network is trained that learns from dances beside the takes: longer, and at more tempi.

    There is more to learn, and a song can be half as fast again as any take of its genre.
    """
    return replace(config, steps=2 * config.steps, tempi=_TEMPI_TAUGHT)


def rollout_config(preset: str, **changes: Any) -> RolloutConfig:
    """The preset's configuration with fields changed; `ParameterError` for an unknown name or field."""
    return config_from_preset(_PRESETS, preset, changes)
