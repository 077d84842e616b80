"""Training of the tempo-densities of motion and music (ChoreoGraph, section 3.2)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from choreograph.nets.density.config import DensityConfig
from choreograph.nets.density.data import MusicDensityData, clip_takes, warped_pairs
from choreograph.nets.density.losses import density_loss
from choreograph.nets.density.model import MotionDecoder, MotionDensity, MusicDensity
from choreograph.nets.style.data import StyleTake
from choreograph.nets.training import TrainingContext, load_pretrained, steps_of_epochs, train
from choreograph.timebase import CLIP_FRAMES


def train_motion_density(
    takes: Sequence[StyleTake],
    config: DensityConfig,
    *,
    seed: int,
    context: TrainingContext | None = None,
    pretrained: Mapping[str, NDArray] | None = None,
) -> MotionDensity:
    """Train motion's estimator with its decoder, on clips and their random warps.

    Raises `ParameterError` if no take has 8 s of motion.
    """
    usable = clip_takes(takes)
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        estimator, decoder = MotionDensity(config), MotionDecoder(config)
    nets = nn.ModuleDict({"estimator": estimator, "decoder": decoder})
    if pretrained is not None:
        load_pretrained(estimator, "motion_density", pretrained)

    def loss(rng: np.random.Generator, device: torch.device) -> Tensor:
        pairs = warped_pairs(
            usable,
            config.batch_size,
            rng,
            mirrored_share=config.mirrored_share,
            augmented=config.augmented,
        )
        return density_loss(estimator, decoder, pairs.to(device), config)

    n_clips = sum(len(take.body_pos_m) for take in usable) / CLIP_FRAMES

    train(
        nets,
        loss,
        name="motion_density",
        n_steps=_n_steps(config, config.steps, n_clips, config.batch_size),
        learning_rate=config.learning_rate,
        weight_decay=config.weight_decay,
        schedule=config.schedule,
        seed=seed,
        configuration={**asdict(config), "takes": [take.name for take in usable]},
        context=context,
    )
    return estimator


def train_music_density(
    takes: Sequence[StyleTake],
    motion_density: MotionDensity,
    config: DensityConfig,
    *,
    seed: int,
    context: TrainingContext | None = None,
    pretrained: Mapping[str, NDArray] | None = None,
) -> MusicDensity:
    """Train music's estimator to predict the motion's density (equation 3).

    Raises `ParameterError` if no take has 8 s of music and motion.
    """
    data = MusicDensityData(takes, motion_density, synchronise=config.synchronise)
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        net = MusicDensity(config)
    if pretrained is not None:
        load_pretrained(net, "music_density", pretrained)
    net.load_state_dict({name: torch.from_numpy(v) for name, v in data.statistics().items()}, strict=False)

    def loss(rng: np.random.Generator, device: torch.device) -> Tensor:
        mel, target = data.batch(config.music_batch_size, rng, augmented=config.augmented)
        return functional.mse_loss(net(mel.to(device)), target.to(device))

    train(
        net,
        loss,
        name="music_density",
        n_steps=_n_steps(config, config.music_steps, data.n_clips, config.music_batch_size),
        learning_rate=config.music_learning_rate,
        weight_decay=config.weight_decay,
        schedule=config.schedule,
        seed=seed,
        configuration={**asdict(config), "takes": [take.name for take in data.takes]},
        context=context,
    )
    return net


def _n_steps(config: DensityConfig, steps: int, n_clips: float, batch_size: int) -> int:
    return steps_of_epochs(config.epochs, n_clips, batch_size) if config.epochs else steps
