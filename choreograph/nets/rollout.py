"""The rollout network in torch, and its losses (Rhythm is a Dancer, section 4).

The network predicts pose after pose (`nets.rollout_poses`) from motif and rhythm. Each frame is conditioned
on the embedding of its motif and the four rhythmic features. Unlike in the paper, it is also conditioned on
the phase in its word, in the beat and in the bar.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace

import torch
from torch import Tensor, nn
from torch.nn import functional

from choreograph.core.counts import COUNT_PHASE_DIM
from choreograph.motion.body import BODY_JOINTS
from choreograph.motion.skeleton import Skeleton
from choreograph.music.rhythm import FRAME_RHYTHM_FPS
from choreograph.music.spectral import SPECTRAL_DIM
from choreograph.nets.configs import WORD_DIM, RolloutConfig
from choreograph.nets.rollout_poses import (
    N_FEET,
    PHASE_DIM,
    RHYTHM_DIM,
    ROLLOUT_FPS,
    ROOT_DIM,
    STYLE_WIDTH,
    RolloutConditions,
)
from choreograph.nets.stored import BodyKinematics, StoredNet, geodesic_rad, in_float32
from choreograph.nets.words import WordNet

# The network.


State = list[tuple[Tensor, Tensor]]


class RolloutNet(StoredNet):
    """The auto-conditioned LSTM, the embedding of its conditions, and the AdaIN layer after it."""

    config_class = RolloutConfig
    root_mean: Tensor
    root_std: Tensor
    rhythm_mean: Tensor
    rhythm_std: Tensor
    spectral_mean: Tensor
    spectral_std: Tensor
    motif_std: Tensor

    def __init__(self, config: RolloutConfig) -> None:
        super().__init__()
        self.config = config
        width, n_pose = config.width, ROOT_DIM + 4 * config.n_joints + N_FEET
        n_conditions = WORD_DIM + RHYTHM_DIM + PHASE_DIM + COUNT_PHASE_DIM * config.count_phase
        self.conditions: nn.Module = nn.Identity()
        if config.condition_width:
            self.conditions = nn.Sequential(
                nn.Linear(n_conditions, config.condition_width), nn.GELU(),
                nn.Linear(config.condition_width, config.condition_width), nn.GELU(),
            )  # fmt: skip
        self.into = nn.Linear(config.condition_width or n_conditions, 4 * width)
        self.pose = nn.Linear(n_pose, 4 * width, bias=False)
        self.recurrent = nn.ModuleList(
            nn.Linear(width, 4 * width, bias=False) for _ in range(config.n_layers)
        )
        between = [nn.Linear(width, 4 * width) for _ in range(config.n_layers - 1)]
        self.between = nn.ModuleList(between)
        self.out = nn.Linear(width + config.condition_width, n_pose)
        self.style = nn.Sequential(
            nn.Linear(SPECTRAL_DIM, STYLE_WIDTH), nn.GELU(), nn.Linear(STYLE_WIDTH, 2 * 4 * config.n_joints)
        )
        for name, size in (("root", ROOT_DIM), ("rhythm", RHYTHM_DIM), ("spectral", SPECTRAL_DIM)):
            self.register_buffer(f"{name}_mean", torch.zeros(size))
            self.register_buffer(f"{name}_std", torch.ones(size))
        self.register_buffer("motif_std", torch.ones(1))
        with torch.no_grad():  # forget gates start open, or long dependencies are not learned
            for layer in (self.into, *between):
                layer.bias[width : 2 * width].fill_(1.0)

    def initial_state(self, batch_size: int) -> State:
        """Hidden and cell states before the first frame."""
        zero = self.out.weight.new_zeros(batch_size, self.config.width)
        return [(zero, zero)] * self.config.n_layers

    def embed_conditions(self, conditions: RolloutConditions[Tensor]) -> tuple[Tensor, Tensor]:
        """Conditions as gate inputs of the first layer (B, T, 4 W), and as input of the last (B, T, C).

        C is 0 where they are not embedded, as in the paper, whose last layer has the LSTM alone as its input.
        """
        config = self.config
        motif = conditions.motif / self.motif_std if config.motifs else torch.zeros_like(conditions.motif)
        rhythm = (conditions.rhythm - self.rhythm_mean) / self.rhythm_std
        angle = 2 * torch.pi * conditions.progress
        phase = torch.stack([angle.sin(), angle.cos(), conditions.word_s], dim=-1)  # (B, T, 3)
        rhythm, phase = rhythm * config.use_audio, phase * (config.use_audio and config.phase)
        inputs = [motif, rhythm, phase]
        if config.count_phase:
            inputs.append(conditions.count_phase * config.use_audio)
        condition = self.conditions(torch.cat(inputs, dim=-1))
        return self.into(condition), condition[..., : config.condition_width]

    def step(
        self, pose: Tensor, gate_inputs: Tensor, condition: Tensor, state: State
    ) -> tuple[Tensor, State]:
        """The pose (B, P) that follows `pose` (B, P), with unit rotations and contacts as logits."""
        gates = gate_inputs + self.pose(self._standardised(pose))
        next_state: State = []
        for index, (hidden, cell) in enumerate(state):
            if index:
                gates = self.between[index - 1](next_state[-1][0])
            gates = gates + self.recurrent[index](hidden)
            input_gate, forget_gate, cell_gate, output_gate = gates.chunk(4, dim=-1)
            cell = forget_gate.sigmoid() * cell + input_gate.sigmoid() * cell_gate.tanh()
            next_state.append((output_gate.sigmoid() * cell.tanh(), cell))
        with in_float32(pose):  # rounded poses would tremble
            output = self.out(torch.cat([next_state[-1][0].float(), condition.float()], dim=-1))
        root = output[..., :ROOT_DIM] * self.root_std + self.root_mean
        quat = self.rotations(output)
        return torch.cat([root, quat.flatten(-2), output[..., -N_FEET:]], dim=-1), next_state

    def rotations(self, pose: Tensor) -> Tensor:
        """The unit rotations (..., J, 4) of poses (..., P)."""
        return _unit_quaternions(pose[..., ROOT_DIM:-N_FEET])

    def apply_style(self, pose: Tensor, conditions: RolloutConditions[Tensor]) -> Tensor:
        """Poses (B, T, P) with the style of their songs (equation 4), unchanged without one.

        The vector of the MLP has length 1 in each pose, and is smoothed from word to word over
        `style_fade_s`. In the paper, it is "normalized" over all poses of a word, and faded in and out in
        every word with a Hamming window γ, so that words meet. With a `style_fade_s` of 0, this is done here
        as well, without the pedestal of the window, so that the first and the last pose of a word do not
        change. The fades move the body and shift its motion beats.
        """
        if conditions.spectral is None:
            return pose
        vector = self.style((conditions.spectral - self.spectral_mean) / self.spectral_std)
        vector = functional.normalize(vector, dim=-1)  # (B, T, 2 * 4 J)
        if self.config.style_fade_s > 0:
            vector = _smoothed(vector, round(self.config.style_fade_s * FRAME_RHYTHM_FPS))
        else:
            window = 0.5 - 0.5 * torch.cos(2 * torch.pi * conditions.progress)  # (B, T)
            n_frames = (conditions.word_s * FRAME_RHYTHM_FPS).clamp_min(1.0)
            vector = vector * (window / n_frames.sqrt())[..., None]
        scale, shift = (self.config.style_strength * vector).chunk(2, dim=-1)  # (B, T, 4 J) each
        quat = pose[..., ROOT_DIM:-N_FEET]
        quat = _unit_quaternions((1 + scale) * quat + shift)
        return torch.cat([pose[..., :ROOT_DIM], quat.flatten(-2), pose[..., -N_FEET:]], dim=-1)

    def as_input(self, pose: Tensor) -> Tensor:
        """A predicted pose (..., P) as the next input: contacts as probabilities instead of logits."""
        return torch.cat([pose[..., :-N_FEET], pose[..., -N_FEET:].sigmoid()], dim=-1)

    def _standardised(self, pose: Tensor) -> Tensor:
        root = (pose[..., :ROOT_DIM] - self.root_mean) / self.root_std
        return torch.cat([root, pose[..., ROOT_DIM:]], dim=-1)


def _unit_quaternions(values: Tensor) -> Tensor:
    """Values (..., 4 J) as unit quaternions (..., J, 4)."""
    return functional.normalize(values.reshape(*values.shape[:-1], values.shape[-1] // 4, 4), dim=-1)


def _smoothed(vectors: Tensor, n_frames: int) -> Tensor:
    """Vectors (B, T, D) after two moving averages over about `n_frames`. The end values are repeated."""
    side = n_frames // 2
    rows = vectors.transpose(1, 2)  # (B, D, T)
    for _ in range(2):
        padded = functional.pad(rows, (side, side), mode="replicate")
        rows = functional.avg_pool1d(padded, 2 * side + 1, stride=1)
    return rows.transpose(1, 2)


# Losses of the network (Rhythm is a Dancer, section 4.4).


@dataclass(frozen=True, eq=False)
class RolloutBatch:
    """Sequences of T frames: recorded poses, their conditions, and the words that lie within."""

    pose: Tensor  # (B, T, P)
    conditions: RolloutConditions[Tensor]
    word_frames: Tensor  # (M, 13) fractional frames of the words, in 0 … T - 1
    word_sequence: Tensor  # (M,) the sequence of each word
    word_motif: Tensor  # (M, 184) the embedding that each word is conditioned on
    word_weight: float = 1.0  # of means over the words

    def to(self, device: torch.device) -> RolloutBatch:
        """The sequences on a device."""
        return RolloutBatch(
            self.pose.to(device), self.conditions.mapped(lambda rows: rows.to(device)),
            self.word_frames.to(device), self.word_sequence.to(device), self.word_motif.to(device),
            self.word_weight,
        )  # fmt: skip

    def part(self, rows: slice) -> RolloutBatch:
        """Some of the sequences, and their words.

        Parts may have more or fewer words. With the weight of the words, the mean loss of equal parts is that
        of the batch.
        """
        inside = (self.word_sequence >= rows.start) & (self.word_sequence < rows.stop)
        share = (rows.stop - rows.start) / len(self.pose)
        return RolloutBatch(
            self.pose[rows], self.conditions.mapped(lambda values: values[rows]),
            self.word_frames[inside], self.word_sequence[inside] - rows.start, self.word_motif[inside],
            float(inside.sum()) / (share * max(1, len(inside))),
        )  # fmt: skip


_FEET = [[BODY_JOINTS.index(f"{side}_{part}") for part in ("ankle", "foot")] for side in ("left", "right")]


class RolloutLosses:
    """Distances of predicted poses from the recorded ones, and of predicted words from their motifs."""

    def __init__(self, skeleton: Skeleton, words: WordNet, config: RolloutConfig) -> None:
        self._kinematics = BodyKinematics(skeleton)
        self._words = copy.deepcopy(words).eval().requires_grad_(False)
        self._config = config

    def to(self, device: torch.device) -> RolloutLosses:
        """The same losses, after their word network was moved to a device."""
        self._words.to(device)
        return self

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
        return batch.word_weight * result


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
    return batch.word_weight * result
