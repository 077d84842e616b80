"""Training of the rollout network: auto-conditioning and losses (Rhythm is a Dancer, section 4.4)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from choreograph.motion.body import BODY_JOINTS
from choreograph.motion.skeleton import Skeleton
from choreograph.nets.kinematics import BodyKinematics, geodesic_rad
from choreograph.nets.rollout.config import RolloutConfig
from choreograph.nets.rollout.data import ROLLOUT_FPS, RolloutData, RolloutTake, Sequences
from choreograph.nets.rollout.model import N_FEET, ROOT_DIM, RolloutNet
from choreograph.nets.training import TrainingContext, load_pretrained, train
from choreograph.nets.words.model import WordNet

_FEET = [[BODY_JOINTS.index(f"{side}_{part}") for part in ("ankle", "foot")] for side in ("left", "right")]


def train_rollout(
    takes: Sequence[RolloutTake],
    words: WordNet,
    config: RolloutConfig,
    *,
    seed: int,
    context: TrainingContext | None = None,
    start: Mapping[str, NDArray] | None = None,
) -> RolloutNet:
    """Train the network on takes of one skeleton; `words` is P of the perceptual loss, and stays as it is.

    Raises `ParameterError` if no take dances words for longer than a training sequence.
    """
    data = RolloutData(takes, config.frames)
    skeleton = takes[0].motion.skeleton
    config = replace(config, n_joints=skeleton.n_joints)
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        net = RolloutNet(config)
    if start is not None:
        load_pretrained(net, "rollout", start)
    else:
        _standardise(net, data)
    losses = RolloutLosses(skeleton, words, config)

    def loss(rng: np.random.Generator, device: torch.device) -> Tensor:
        with_style = rng.random() >= config.style_dropout
        batch = data.sequences(
            config.batch_size, rng, own_embedding_share=config.own_embedding_share, with_style=with_style
        )
        made = rolled(net, batch, self_fed_frames=int(rng.choice(config.self_fed_frames)))
        return losses.total(net, made, batch)

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


def rolled(net: RolloutNet, batch: Sequences, *, self_fed_frames: int) -> Tensor:
    """Poses (B, T - 1, P) made for frames 1 … T - 1, before style, contacts as logits.

    `teacher_frames` times the network is given what was danced, then `self_fed_frames` times what it has made
    itself, and so on (auto-conditioning; the last row made goes nowhere).
    """
    into, condition = net.conditioned(batch.conditions)
    state = net.begin(len(batch.pose))
    period = net.config.teacher_frames + self_fed_frames
    made: list[Tensor] = []
    for frame in range(batch.pose.shape[1] - 1):
        given = batch.pose[:, frame] if frame % period < net.config.teacher_frames else net.fed(made[-1])
        pose, state = net.step(given, into[:, frame + 1], condition[:, frame + 1], state)
        made.append(pose)
    return torch.stack(made, dim=1)


class RolloutLosses:
    """What the made poses should have: the danced ones' rotations and places, and the motif asked for."""

    def __init__(self, skeleton: Skeleton, words: WordNet, config: RolloutConfig) -> None:
        self._kinematics = BodyKinematics(skeleton)
        self._words = words.eval().requires_grad_(False)
        self._config = config

    def total(self, net: RolloutNet, made: Tensor, batch: Sequences) -> Tensor:
        """The weighted sum; `made` (B, T - 1, P) as of `rolled`."""
        config, danced = self._config, batch.pose[:, 1:]
        later = replace(
            batch.conditions,
            progress=batch.conditions.progress[:, 1:],
            spectral=None if batch.conditions.spectral is None else batch.conditions.spectral[:, 1:],
        )
        shown = net.styled(made, later)
        coherence = geodesic_rad(net.rotations(shown), net.rotations(danced)).mean()
        ours_m, theirs_m = (self._in_place_m(net, pose) for pose in (shown, danced))
        position = (ours_m - theirs_m).norm(dim=-1).mean()
        speed = (ours_m.diff(dim=1) - theirs_m.diff(dim=1)).norm(dim=-1).mean() * ROLLOUT_FPS
        root = ((shown - danced)[..., :ROOT_DIM] / net.root_std).abs().mean()
        contact = functional.binary_cross_entropy_with_logits(made[..., -N_FEET:], danced[..., -N_FEET:])
        world_m = self._world_m(net, shown)
        loss = (
            coherence
            + config.position_weight * position
            + config.velocity_weight * speed
            + config.root_weight * root
            + config.contact_weight * contact
            + config.slide_weight * _slide_m_s(world_m, danced[..., -N_FEET:])
        )
        if config.perceptual_weight > 0 and len(batch.word_motif):
            loss = loss + config.perceptual_weight * self._perceptual_m(world_m, batch)
        return loss

    def _in_place_m(self, net: RolloutNet, pose: Tensor) -> Tensor:
        """Body positions (B, T, 21, 3) above the origin, without heading."""
        root = torch.stack([torch.zeros_like(pose[..., 2]), pose[..., 2], torch.zeros_like(pose[..., 2])], -1)
        return self._kinematics.body_pos_m(root, net.rotations(pose))

    def _world_m(self, net: RolloutNet, pose: Tensor) -> Tensor:
        """Body positions (B, T, 21, 3) on the way that the roots go."""
        body = self._in_place_m(net, pose)
        heading = pose[..., 3].cumsum(dim=1)  # (B, T)
        sin, cos = heading.sin(), heading.cos()
        before_sin, before_cos = (functional.pad(v[:, :-1], (1, 0)) for v in (sin, cos))
        before_cos[:, 0] = 1.0
        x, z = pose[..., 0], pose[..., 1]
        way_x = (before_cos * x + before_sin * z).cumsum(dim=1)
        way_z = (before_cos * z - before_sin * x).cumsum(dim=1)
        sin, cos = sin[..., None], cos[..., None]
        return torch.stack(
            [
                cos * body[..., 0] + sin * body[..., 2] + way_x[..., None],
                body[..., 1],
                cos * body[..., 2] - sin * body[..., 0] + way_z[..., None],
            ],
            dim=-1,
        )

    def _perceptual_m(self, world_m: Tensor, batch: Sequences) -> Tensor:
        """Mean distance of the words made from what they were asked to be (equation 9)."""
        # Frame 0 of a sequence is given, not made: a word that begins there begins with the first made one.
        frames = (batch.word_frames - 1.0).clamp_min(0.0)
        low = frames.long().clamp_max(world_m.shape[1] - 2)
        weight = (frames - low)[..., None, None]
        rows = batch.word_sequence[:, None]
        words = world_m[rows, low] * (1 - weight) + world_m[rows, low + 1] * weight  # (M, 13, 21, 3)
        return (self._words(words) - batch.word_motif).norm(dim=-1).mean()


def _slide_m_s(world_m: Tensor, standing: Tensor) -> Tensor:
    """Mean speed of feet that should stand, of (B, T, 21, 3) and contacts (B, T, 2)."""
    speed = world_m.diff(dim=1).norm(dim=-1) * ROLLOUT_FPS  # (B, T - 1, 21)
    surely = torch.minimum(standing[:, 1:], standing[:, :-1])
    per_foot = torch.stack([speed[..., foot].amin(dim=-1) for foot in _FEET], dim=-1)
    return (surely * per_foot).mean()


@torch.no_grad()
def _standardise(net: RolloutNet, data: RolloutData) -> None:
    roots = data.all_poses()[:, :ROOT_DIM]
    for name, values in (
        ("root", roots), ("rhythm", data.all_of("rhythm")), ("spectral", data.all_of("spectral")),
    ):  # fmt: skip
        getattr(net, f"{name}_mean").copy_(values.mean(dim=0))
        getattr(net, f"{name}_std").copy_(values.std(dim=0).clamp_min(1e-4))
    net.motif_std.copy_(data.all_of("motif").std())
    net.out.bias.copy_(data.all_poses().mean(dim=0))
    net.out.bias[:ROOT_DIM] = 0.0
    net.out.bias[-N_FEET:] = 0.0
