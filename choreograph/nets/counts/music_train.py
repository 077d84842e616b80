"""Training of the network that hears counts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from choreograph.nets.counts.music_config import MusicCountsConfig
from choreograph.nets.counts.music_data import CountedMel, MusicCountsData
from choreograph.nets.counts.music_model import MusicCounts
from choreograph.nets.counts.phases import phase_loss
from choreograph.nets.training import TrainingContext, load_pretrained, train


def train_music_counts(
    songs: Sequence[CountedMel],
    config: MusicCountsConfig,
    *,
    seed: int,
    weights: NDArray[np.floating] | None = None,
    context: TrainingContext | None = None,
    pretrained: Mapping[str, NDArray] | None = None,
) -> MusicCounts:
    """Train on excerpts of songs; `weights` (N,) says how often each is heard, evenly if not given.

    Raises `ParameterError` as `MusicCountsData` does, or for pretrained weights that do not fit.
    """
    data = MusicCountsData(songs, config)
    share = None if weights is None else np.asarray(weights, np.float64) / np.sum(weights)
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        net = MusicCounts(config)
    if pretrained is not None:
        load_pretrained(net, "music_counts", pretrained)

    def loss(rng: np.random.Generator, device: torch.device) -> Tensor:
        mel, activation, phases = data.batch(rng, share)
        logits, vectors = net(mel.to(device))
        heard = functional.binary_cross_entropy_with_logits(logits, activation.to(device))
        pointed = phase_loss(vectors, phases.to(device), bar_weight=config.bar_weight)
        return config.activation_weight * heard + pointed

    train(
        net,
        loss,
        name="music_counts",
        n_steps=config.steps,
        learning_rate=config.learning_rate,
        weight_decay=config.weight_decay,
        seed=seed,
        configuration={**asdict(config), "songs": len(songs)},
        context=context,
    )
    return net
