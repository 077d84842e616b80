"""Training of the rollout network with auto-conditioning (Rhythm is a Dancer, section 4.4)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from choreograph.core.errors import ParameterError
from choreograph.motion.body import BODY_JOINTS
from choreograph.motion.skeleton import Skeleton
from choreograph.nets.configs import RolloutConfig
from choreograph.nets.rollout import N_FEET, ROOT_DIM, RolloutNet
from choreograph.nets.rollout_data import ROLLOUT_FPS, RolloutBatch, RolloutData, RolloutTake
from choreograph.nets.stored import BodyKinematics, geodesic_rad
from choreograph.nets.training import TrainingContext, load_pretrained, train
from choreograph.nets.words import WordNet

# Losses of the rollout network (Rhythm is a Dancer, section 4.4).


_FEET = [[BODY_JOINTS.index(f"{side}_{part}") for part in ("ankle", "foot")] for side in ("left", "right")]


class RolloutLosses:
    """Distances of predicted poses from the recorded ones, and of predicted words from their motifs."""

    def __init__(self, skeleton: Skeleton, words: WordNet, config: RolloutConfig) -> None:
        self._kinematics = BodyKinematics(skeleton)
        self._words = words.eval().requires_grad_(False)
        self._config = config

    def total(
        self, net: RolloutNet, predicted: Tensor, batch: RolloutBatch, *, self_fed_frames: int
    ) -> Tensor:
        """The loss of poses (B, T - 1, P) of `unroll`."""
        conditions = replace(
            batch.conditions,
            progress=batch.conditions.progress[:, 1:],
            word_s=batch.conditions.word_s[:, 1:],
            spectral=None if batch.conditions.spectral is None else batch.conditions.spectral[:, 1:],
        )
        styled = net.apply_style(predicted, conditions)
        if self._config.loss == "paper":
            return self._paper_loss(net, predicted, styled, batch, self_fed_frames)
        return self._weighted_loss(net, predicted, styled, batch)

    def _paper_loss(
        self, net: RolloutNet, predicted: Tensor, styled: Tensor, batch: RolloutBatch, self_fed_frames: int
    ) -> Tensor:
        """Equation 10: the coherence of both kinds of frames, equations 7 and 8, and λ times equation 9.

        Coherence is that of the LSTM's own poses, and equation 9 that of poses with style. The losses of
        positions and contacts are added, which the paper names without a formula. That of positions is the
        sum over the joints as in equation 6, in metres, along the path of the root, since no other term has
        the root's displacement.
        """
        config, target = self._config, batch.pose[:, 1:]
        geodesic = geodesic_rad(net.rotations(predicted), net.rotations(target)).sum(dim=-1)  # (B, T - 1)
        frame = torch.arange(geodesic.shape[1], device=geodesic.device)
        given_truth = frame % (config.teacher_frames + self_fed_frames) < config.teacher_frames
        loss = geodesic[:, given_truth].mean() + geodesic[:, ~given_truth].mean()
        distance_m = (self._world_pos_m(net, predicted) - self._world_pos_m(net, target)).norm(dim=-1)
        contact = functional.binary_cross_entropy_with_logits(predicted[..., -N_FEET:], target[..., -N_FEET:])
        loss = loss + config.position_weight * distance_m.sum(dim=-1).mean() + config.contact_weight * contact
        if config.perceptual_weight > 0 and len(batch.word_motif):
            loss = loss + config.perceptual_weight * self._perceptual_m(self._world_pos_m(net, styled), batch)
        result: Tensor = loss
        return result

    def _weighted_loss(
        self, net: RolloutNet, predicted: Tensor, styled: Tensor, batch: RolloutBatch
    ) -> Tensor:
        """Ours: the weighted sum of the configuration, of poses with style."""
        config, target = self._config, batch.pose[:, 1:]
        coherence = geodesic_rad(net.rotations(styled), net.rotations(target)).mean()
        styled_m, target_m = (self._local_pos_m(net, pose) for pose in (styled, target))
        position = (styled_m - target_m).norm(dim=-1).mean()
        velocity = (styled_m.diff(dim=1) - target_m.diff(dim=1)).norm(dim=-1).mean() * ROLLOUT_FPS
        root = ((styled - target)[..., :ROOT_DIM] / net.root_std).abs().mean()
        contact = functional.binary_cross_entropy_with_logits(predicted[..., -N_FEET:], target[..., -N_FEET:])
        world_m, target_world_m = self._world_pos_m(net, styled), self._world_pos_m(net, target)
        loss: Tensor = (
            coherence
            + config.position_weight * position
            + config.velocity_weight * velocity
            + config.root_weight * root
            + config.contact_weight * contact
            + config.border_speed_weight * _border_speed_m_s(world_m, target_world_m, batch)
            + config.slide_weight * _foot_slide_m_s(world_m, target[..., -N_FEET:])
        )
        if config.perceptual_weight > 0 and len(batch.word_motif):
            loss = loss + config.perceptual_weight * self._perceptual_m(world_m, batch)
        return loss

    def _local_pos_m(self, net: RolloutNet, pose: Tensor) -> Tensor:
        """Body positions (B, T, 21, 3) above the origin, without heading."""
        root = torch.stack([torch.zeros_like(pose[..., 2]), pose[..., 2], torch.zeros_like(pose[..., 2])], -1)
        return self._kinematics.body_pos_m(root, net.rotations(pose))

    def _world_pos_m(self, net: RolloutNet, pose: Tensor) -> Tensor:
        """Body positions (B, T, 21, 3) along the path of the root."""
        body = self._local_pos_m(net, pose)
        heading = pose[..., 3].cumsum(dim=1)  # (B, T)
        sin, cos = heading.sin(), heading.cos()
        last_sin, last_cos = (functional.pad(v[:, :-1], (1, 0)) for v in (sin, cos))
        last_cos[:, 0] = 1.0
        x, z = pose[..., 0], pose[..., 1]
        path_x = (last_cos * x + last_sin * z).cumsum(dim=1)
        path_z = (last_cos * z - last_sin * x).cumsum(dim=1)
        sin, cos = sin[..., None], cos[..., None]
        return torch.stack(
            [
                cos * body[..., 0] + sin * body[..., 2] + path_x[..., None],
                body[..., 1],
                cos * body[..., 2] - sin * body[..., 0] + path_z[..., None],
            ],
            dim=-1,
        )

    def _perceptual_m(self, world_m: Tensor, batch: RolloutBatch) -> Tensor:
        """Mean distance of the embeddings of predicted words from their motifs (equation 9)."""
        # Frame 0 of a sequence is not predicted, so a word that starts there starts one frame later.
        frames = (batch.word_frames - 1.0).clamp_min(0.0)
        low = frames.long().clamp_max(world_m.shape[1] - 2)
        weight = (frames - low)[..., None, None]
        rows = batch.word_sequence[:, None]
        words = world_m[rows, low] * (1 - weight) + world_m[rows, low + 1] * weight  # (M, 13, 21, 3)
        result: Tensor = (self._words(words) - batch.word_motif).norm(dim=-1).mean()
        return result


def _foot_slide_m_s(world_m: Tensor, contact: Tensor) -> Tensor:
    """Mean speed of feet in contact, of positions (B, T, 21, 3) and contacts (B, T, 2)."""
    speed = world_m.diff(dim=1).norm(dim=-1) * ROLLOUT_FPS  # (B, T - 1, 21)
    throughout = torch.minimum(contact[:, 1:], contact[:, :-1])
    per_foot = torch.stack([speed[..., foot].amin(dim=-1) for foot in _FEET], dim=-1)
    return (throughout * per_foot).mean()


def _border_speed_m_s(world_m: Tensor, target_m: Tensor, batch: RolloutBatch) -> Tensor:
    """Mean difference of joint speed where words begin, of positions (B, T, 21, 3) of frames 1 … T.

    The target is the speed of the dancer on the count, not rest, since not every dancer rests there.
    """
    if len(batch.word_frames) == 0:
        return world_m.new_zeros(())
    speeds = [
        pos.diff(dim=1).norm(dim=-1).mean(dim=-1) * ROLLOUT_FPS for pos in (world_m, target_m)
    ]  # (B, T - 1)
    # Speed i is that from frame i + 1 to i + 2 of the sequence, whose frame 0 is not predicted.
    frames = (batch.word_frames[:, 0] - 1.5).clamp(0.0, speeds[0].shape[1] - 1.001)
    low = frames.floor().long()
    weight = frames - low
    rows = batch.word_sequence
    predicted, danced = (
        speed[rows, low] * (1 - weight) + speed[rows, low + 1] * weight for speed in speeds
    )  # (M,)
    result: Tensor = (predicted - danced).abs().mean()
    return result


# Training of the rollout network with auto-conditioning (Rhythm is a Dancer, section 4.4).


def train_rollouts(
    takes: Sequence[RolloutTake],
    words: WordNet,
    config: RolloutConfig,
    *,
    seed: int,
    context: TrainingContext | None = None,
    pretrained: Mapping[str, NDArray[Any]] | None = None,
) -> Iterator[RolloutNet]:
    """Train the network, or with `config.by_genre` one for each genre, in the order of their names.

    Raises as `train_rollout`.
    """
    if not config.by_genre:
        yield train_rollout(takes, words, config, seed=seed, context=context, pretrained=pretrained)
        return
    of_genres = {name: [t for t in takes if t.genre == name] for name in sorted({t.genre for t in takes})}
    for genre, of_genre in of_genres.items():  # before hours of training
        try:
            RolloutData(of_genre, config.frames, config.tempi)
        except ParameterError as error:
            raise ParameterError(f"the genre {genre!r}: {error}: leave out its takes") from error
    for index, (genre, of_genre) in enumerate(of_genres.items()):
        yield train_rollout(
            of_genre, words, replace(config, genre=genre),
            seed=seed, context=context, pretrained=pretrained, name=f"rollout_{index}",
        )  # fmt: skip


def train_rollout(
    takes: Sequence[RolloutTake],
    words: WordNet,
    config: RolloutConfig,
    *,
    seed: int,
    context: TrainingContext | None = None,
    pretrained: Mapping[str, NDArray[Any]] | None = None,
    name: str = "rollout",
) -> RolloutNet:
    """Train the network on takes of one skeleton. `words` is the frozen P of the perceptual loss.

    `name` is that of its checkpoint.

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
    elif config.standardised:
        _init_statistics(net, data)
    losses = RolloutLosses(skeleton, words, config)

    def loss(rng: np.random.Generator, device: torch.device) -> Tensor:
        with_style = rng.random() >= config.style_dropout
        batch = data.batch(
            config.batch_size, rng, own_embedding_share=config.own_embedding_share, with_style=with_style
        )
        self_fed_frames = int(rng.choice(config.self_fed_frames))
        predicted = unroll(net, batch, self_fed_frames=self_fed_frames)
        return losses.total(net, predicted, batch, self_fed_frames=self_fed_frames)

    train(
        net,
        loss,
        name=name,
        n_steps=config.steps,
        learning_rate=config.learning_rate,
        weight_decay=config.weight_decay,
        seed=seed,
        schedule=config.schedule,
        configuration={**asdict(config), "takes": [take.name for take in takes]},
        context=context,
    )
    return net


def unroll(net: RolloutNet, batch: RolloutBatch, *, self_fed_frames: int) -> Tensor:
    """Poses (B, T - 1, P) predicted for frames 1 … T - 1, before style and with contacts as logits.

    The input is the true pose for `teacher_frames` frames, then the network's own prediction for
    `self_fed_frames` frames, and so on in turns: the paper's auto-conditioning.
    """
    # Slices of the frames would each have a gradient of the size of the whole.
    gate_inputs, condition = (values.unbind(1) for values in net.embed_conditions(batch.conditions))
    state = net.initial_state(len(batch.pose))
    period = net.config.teacher_frames + self_fed_frames
    predicted: list[Tensor] = []
    for frame in range(batch.pose.shape[1] - 1):
        teacher_forced = frame % period < net.config.teacher_frames
        pose = batch.pose[:, frame] if teacher_forced else net.as_input(predicted[-1])
        pose, state = net.step(pose, gate_inputs[frame + 1], condition[frame + 1], state)
        predicted.append(pose)
    return torch.stack(predicted, dim=1)


@torch.no_grad()
def _init_statistics(net: RolloutNet, data: RolloutData) -> None:
    """Set the standardisation to the statistics of the data, and the bias of the output to the mean pose."""
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
