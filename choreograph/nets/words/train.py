"""Training of the motion-word network (Rhythm is a Dancer, section 4.2.2).

The paper uses a pretrained network, "trained to distinguish between groups of similar motions disregarding
low level details, temporal warping and frame rate differences". Ours learns this from augmented words.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import partial

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from choreograph.errors import ParameterError
from choreograph.nets.training import TrainingContext, load_pretrained, train
from choreograph.nets.words.config import WordConfig
from choreograph.nets.words.data import AugmentedWords, WordTake, augmented_words
from choreograph.nets.words.model import WordNet, clips_to_root_frame

_PCA_WORDS = 2000


def train_word_net(
    takes: Sequence[WordTake],
    config: WordConfig,
    *,
    seed: int,
    context: TrainingContext | None = None,
    pretrained: Mapping[str, NDArray] | None = None,
) -> WordNet:
    """Train the network; `ParameterError` if the takes have fewer than two words."""
    usable = [take for take in takes if len(take.start_s) > 0]
    if sum(len(take.start_s) for take in usable) < 2:
        raise ParameterError("expected takes of two motion words or more to learn from, got fewer")
    sampled = partial(augmented_words, usable, mirrored_share=config.mirrored_share)
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        net = WordNet(config)
    if pretrained is not None:
        load_pretrained(net, "words", pretrained)
    else:
        net.init_from_pca(sampled(_PCA_WORDS, np.random.default_rng(seed)).words)

    def loss(rng: np.random.Generator, device: torch.device) -> Tensor:
        return word_loss(net, sampled(config.batch_size, rng).to(device))

    train(
        net,
        loss,
        name="words",
        n_steps=config.steps,
        learning_rate=config.learning_rate,
        weight_decay=config.weight_decay,
        seed=seed,
        configuration={**asdict(config), "takes": [take.name for take in usable]},
        context=context,
    )
    return net


def word_loss(net: WordNet, batch: AugmentedWords) -> Tensor:
    """Contrast between augmented copies, and embedding distances that match mean joint distances.

    Contrast: cross-entropy over the batch between two Gaussian kernels of distance, `same_m` wide: one of the
    embeddings of the copies, one of the words without augmentation. Dances repeat themselves, so a word that
    looks like another is not its negative.

    Distance: the squared logarithm of the ratio of embedding distance to mean joint distance, so that one
    centimetre counts more between similar words than between different ones.
    """
    config = net.config
    true_m = mean_joint_distance_m(clips_to_root_frame(batch.words))  # (B, B)
    first, second = net(batch.first), net(batch.second)
    distance_m = torch.cdist(first, second)  # (B, B)
    target = functional.softmax(-((true_m / config.same_m) ** 2), dim=1)
    logits = -((distance_m / config.same_m) ** 2)
    contrast = 0.5 * (functional.cross_entropy(logits, target) + functional.cross_entropy(logits.T, target))
    floor_m = 0.5 * config.same_m
    log_ratio = torch.log((distance_m + floor_m) / (true_m + floor_m))
    return config.contrast_weight * contrast + config.distance_weight * log_ratio.square().mean()


def mean_joint_distance_m(words: Tensor) -> Tensor:
    """Mean joint distance of every pair of words (B, T, J, 3), (B, B)."""
    points = words.flatten(1, 2).transpose(0, 1)  # (T J, B, 3)
    return torch.cdist(points, points).mean(dim=0)
