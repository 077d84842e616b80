"""Training of the network that counts motion, by the likelihood of the phases of takes with counts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

import numpy as np
import torch
from torch import Tensor

from choreograph.nets.counts.motion_config import MotionCountsConfig
from choreograph.nets.counts.motion_data import CountedMotion, MotionData
from choreograph.nets.counts.motion_model import MotionCountsNet, motion_features
from choreograph.nets.counts.phases import phase_loss
from choreograph.nets.training import TrainingContext, train

_STATISTICS_SAMPLES = 128


def train_motion_counts(
    takes: Sequence[CountedMotion],
    config: MotionCountsConfig,
    *,
    seed: int,
    name: str = "motion_counts",
    context: TrainingContext | None = None,
) -> MotionCountsNet:
    """Train the network; `ParameterError` if no take has counts in bars of 3 or 4."""
    data = MotionData(takes, config)
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        net = MotionCountsNet(config)
    features = motion_features(data.batch(_STATISTICS_SAMPLES, np.random.default_rng(seed)).body).flatten(
        0, 1
    )
    net.feature_mean.copy_(features.mean(dim=0))
    net.feature_std.copy_(features.std(dim=0) + 0.01)

    def loss(rng: np.random.Generator, device: torch.device) -> Tensor:
        batch = data.batch(config.batch_size, rng).to(device)
        return phase_loss(net(batch.body, batch.present), batch.targets, bar_weight=config.bar_weight)

    train(
        net,
        loss,
        name=name,
        n_steps=config.steps,
        learning_rate=config.learning_rate,
        weight_decay=config.weight_decay,
        seed=seed,
        configuration={**asdict(config), "takes": sorted(take.name for take in data.takes)},
        context=context,
    )
    return net
