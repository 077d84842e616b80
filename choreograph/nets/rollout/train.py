"""Training of the rollout network with auto-conditioning (Rhythm is a Dancer, section 4.4)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from choreograph.nets.rollout.config import RolloutConfig
from choreograph.nets.rollout.losses import RolloutLosses
from choreograph.nets.rollout.model import N_FEET, ROOT_DIM, RolloutNet
from choreograph.nets.rollout.training_data import RolloutBatch, RolloutData, RolloutTake
from choreograph.nets.training import TrainingContext, load_pretrained, train
from choreograph.nets.words.model import WordNet


def train_rollout(
    takes: Sequence[RolloutTake],
    words: WordNet,
    config: RolloutConfig,
    *,
    seed: int,
    context: TrainingContext | None = None,
    pretrained: Mapping[str, NDArray] | None = None,
) -> RolloutNet:
    """Train the network on takes of one skeleton; `words` is the frozen P of the perceptual loss.

    Raises `ParameterError` if no take has motion words for longer than a training sequence.
    """
    data = RolloutData(takes, config.frames, config.tempi)
    skeleton = takes[0].motion.skeleton
    config = replace(config, n_joints=skeleton.n_joints)
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        net = RolloutNet(config)
    if pretrained is not None:
        load_pretrained(net, "rollout", pretrained)
    else:
        _init_statistics(net, data)
    losses = RolloutLosses(skeleton, words, config)

    def loss(rng: np.random.Generator, device: torch.device) -> Tensor:
        with_style = rng.random() >= config.style_dropout
        batch = data.batch(
            config.batch_size, rng, own_embedding_share=config.own_embedding_share, with_style=with_style
        )
        predicted = unroll(net, batch, self_fed_frames=int(rng.choice(config.self_fed_frames)))
        return losses.total(net, predicted, batch)

    train(
        net,
        loss,
        name="rollout",
        n_steps=config.steps,
        learning_rate=config.learning_rate,
        weight_decay=config.weight_decay,
        seed=seed,
        configuration={**asdict(config), "takes": [take.name for take in takes]},
        context=context,
    )
    return net


def unroll(net: RolloutNet, batch: RolloutBatch, *, self_fed_frames: int) -> Tensor:
    """Poses (B, T - 1, P) predicted for frames 1 … T - 1, before style and with contacts as logits.

    The input is the true pose for `teacher_frames` frames, then the network's own prediction for
    `self_fed_frames` frames, and so on in turns: the paper's auto-conditioning.
    """
    gate_inputs, condition = net.embed_conditions(batch.conditions)
    state = net.initial_state(len(batch.pose))
    period = net.config.teacher_frames + self_fed_frames
    predicted: list[Tensor] = []
    for frame in range(batch.pose.shape[1] - 1):
        teacher_forced = frame % period < net.config.teacher_frames
        pose = batch.pose[:, frame] if teacher_forced else net.as_input(predicted[-1])
        pose, state = net.step(pose, gate_inputs[:, frame + 1], condition[:, frame + 1], state)
        predicted.append(pose)
    return torch.stack(predicted, dim=1)


@torch.no_grad()
def _init_statistics(net: RolloutNet, data: RolloutData) -> None:
    """Set the standardisation to the data's statistics, and the output's bias to its mean pose."""
    roots = data.all_poses()[:, :ROOT_DIM]
    for name, values in (
        ("root", roots),
        ("rhythm", data.all_conditions("rhythm")),
        ("spectral", data.all_conditions("spectral")),
    ):
        getattr(net, f"{name}_mean").copy_(values.mean(dim=0))
        getattr(net, f"{name}_std").copy_(values.std(dim=0).clamp_min(1e-4))
    net.motif_std.copy_(data.all_conditions("motif").std())
    net.out.bias.copy_(data.all_poses().mean(dim=0))
    net.out.bias[:ROOT_DIM] = 0.0
    net.out.bias[-N_FEET:] = 0.0
