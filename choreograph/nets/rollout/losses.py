"""Losses of the rollout network (Rhythm is a Dancer, section 4.4)."""

from __future__ import annotations

from dataclasses import replace

import torch
from torch import Tensor
from torch.nn import functional

from choreograph.motion.body import BODY_JOINTS
from choreograph.motion.skeleton import Skeleton
from choreograph.nets.kinematics import BodyKinematics, geodesic_rad
from choreograph.nets.rollout.config import RolloutConfig
from choreograph.nets.rollout.data import ROLLOUT_FPS
from choreograph.nets.rollout.model import N_FEET, ROOT_DIM, RolloutNet
from choreograph.nets.rollout.training_data import RolloutBatch
from choreograph.nets.words.model import WordNet

_FEET = [[BODY_JOINTS.index(f"{side}_{part}") for part in ("ankle", "foot")] for side in ("left", "right")]


class RolloutLosses:
    """Distances of predicted poses from the ones danced, and of predicted words from their motifs."""

    def __init__(self, skeleton: Skeleton, words: WordNet, config: RolloutConfig) -> None:
        self._kinematics = BodyKinematics(skeleton)
        self._words = words.eval().requires_grad_(False)
        self._config = config

    def total(self, net: RolloutNet, predicted: Tensor, batch: RolloutBatch) -> Tensor:
        """The weighted sum for poses (B, T - 1, P) of `train.unroll`."""
        config, target = self._config, batch.pose[:, 1:]
        conditions = replace(
            batch.conditions,
            progress=batch.conditions.progress[:, 1:],
            spectral=None if batch.conditions.spectral is None else batch.conditions.spectral[:, 1:],
        )
        styled = net.apply_style(predicted, conditions)
        coherence = geodesic_rad(net.rotations(styled), net.rotations(target)).mean()
        styled_m, target_m = (self._local_pos_m(net, pose) for pose in (styled, target))
        position = (styled_m - target_m).norm(dim=-1).mean()
        velocity = (styled_m.diff(dim=1) - target_m.diff(dim=1)).norm(dim=-1).mean() * ROLLOUT_FPS
        root = ((styled - target)[..., :ROOT_DIM] / net.root_std).abs().mean()
        contact = functional.binary_cross_entropy_with_logits(predicted[..., -N_FEET:], target[..., -N_FEET:])
        world_m, target_world_m = self._world_pos_m(net, styled), self._world_pos_m(net, target)
        loss = (
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
        # Frame 0 of a sequence is given, not predicted: a word that starts there starts one frame later.
        frames = (batch.word_frames - 1.0).clamp_min(0.0)
        low = frames.long().clamp_max(world_m.shape[1] - 2)
        weight = (frames - low)[..., None, None]
        rows = batch.word_sequence[:, None]
        words = world_m[rows, low] * (1 - weight) + world_m[rows, low + 1] * weight  # (M, 13, 21, 3)
        return (self._words(words) - batch.word_motif).norm(dim=-1).mean()


def _foot_slide_m_s(world_m: Tensor, contact: Tensor) -> Tensor:
    """Mean speed of feet in contact, of positions (B, T, 21, 3) and contacts (B, T, 2)."""
    speed = world_m.diff(dim=1).norm(dim=-1) * ROLLOUT_FPS  # (B, T - 1, 21)
    throughout = torch.minimum(contact[:, 1:], contact[:, :-1])
    per_foot = torch.stack([speed[..., foot].amin(dim=-1) for foot in _FEET], dim=-1)
    return (throughout * per_foot).mean()


def _border_speed_m_s(world_m: Tensor, target_m: Tensor, batch: RolloutBatch) -> Tensor:
    """Mean difference of joint speed where words begin, of positions (B, T, 21, 3) of frames 1 … T.

    What is asked for is the dancer's own speed on the count, not rest: not all come to rest there.
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
    return (predicted - danced).abs().mean()
