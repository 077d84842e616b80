"""The rollout network: from pose to pose, to the motif asked for, in time (Rhythm is a Dancer, section 4).

A pose is a row of 4 + 4 J + 2 numbers: how the root goes on, the rotations, the contacts of both feet (see
`nets.rollout_data`). What is asked for in a frame comes as conditions: the motif's embedding, the four
rhythmic features and, ours, how far the word is.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional

from choreograph.features.frame_rhythm import FRAME_RHYTHM_FPS, FRAME_RHYTHM_NAMES
from choreograph.features.spectral import SPECTRAL_DIM
from choreograph.nets.rollout.config import RolloutConfig
from choreograph.nets.stored import StoredNet
from choreograph.nets.words.config import WORD_DIM

ROOT_DIM = 4
N_FEET = 2
RHYTHM_DIM = len(FRAME_RHYTHM_NAMES)
PHASE_DIM = 3

State = list[tuple[Tensor, Tensor]]


@dataclass(frozen=True, eq=False)
class RolloutConditions:
    """What the frames to come should be; all tensors (B, T, ...)."""

    motif: Tensor  # (B, T, 184) embedding of the frame's motif
    rhythm: Tensor  # (B, T, 4) as of `features.frame_rhythm`, some frames ahead
    progress: Tensor  # (B, T) how far the frame's word is, 0 to 1
    word_s: Tensor  # (B, T) how long it lasts
    spectral: Tensor | None  # (B, T, 87) of the frame's word; None: no style


class RolloutNet(StoredNet):
    """The auto-conditioned LSTM, its conditions, and the AdaIN layer behind it."""

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
        self.conditions = nn.Sequential(
            nn.Linear(WORD_DIM + RHYTHM_DIM + PHASE_DIM, config.condition_width), nn.GELU(),
            nn.Linear(config.condition_width, config.condition_width), nn.GELU(),
        )  # fmt: skip
        self.into = nn.Linear(config.condition_width, 4 * width)
        self.pose = nn.Linear(n_pose, 4 * width, bias=False)
        self.recurrent = nn.ModuleList(
            nn.Linear(width, 4 * width, bias=False) for _ in range(config.n_layers)
        )
        between = [nn.Linear(width, 4 * width) for _ in range(config.n_layers - 1)]
        self.between = nn.ModuleList(between)
        self.out = nn.Linear(width + config.condition_width, n_pose)
        self.style = nn.Sequential(
            nn.Linear(SPECTRAL_DIM, 128), nn.GELU(), nn.Linear(128, 2 * 4 * config.n_joints)
        )
        for name, size in (("root", ROOT_DIM), ("rhythm", RHYTHM_DIM), ("spectral", SPECTRAL_DIM)):
            self.register_buffer(f"{name}_mean", torch.zeros(size))
            self.register_buffer(f"{name}_std", torch.ones(size))
        self.register_buffer("motif_std", torch.ones(1))
        with torch.no_grad():  # an LSTM that forgets at once learns nothing long
            for layer in (self.into, *between):
                layer.bias[width : 2 * width].fill_(1.0)

    def begin(self, n: int) -> State:
        """The state before the first frame of `n` dances."""
        zero = self.out.weight.new_zeros(n, self.config.width)
        return [(zero, zero)] * self.config.n_layers

    def conditioned(self, conditions: RolloutConditions) -> tuple[Tensor, Tensor]:
        """What the first and the last layer get of the conditions: (B, T, 4 W) and (B, T, C)."""
        config = self.config
        motif = conditions.motif / self.motif_std if config.motifs else torch.zeros_like(conditions.motif)
        rhythm = (conditions.rhythm - self.rhythm_mean) / self.rhythm_std
        turn = 2 * torch.pi * conditions.progress
        phase = torch.stack([turn.sin(), turn.cos(), conditions.word_s], dim=-1)  # (B, T, 3)
        rhythm, phase = rhythm * config.use_audio, phase * (config.use_audio and config.phase)
        condition = self.conditions(torch.cat([motif, rhythm, phase], dim=-1))
        return self.into(condition), condition

    def step(self, pose: Tensor, into: Tensor, condition: Tensor, state: State) -> tuple[Tensor, State]:
        """The next pose (B, P) after `pose` (B, P), of unit rotations, its contacts as logits."""
        gates = into + self.pose(self._standardised(pose))
        after: State = []
        for index, (hidden, cell) in enumerate(state):
            if index:
                gates = self.between[index - 1](after[-1][0])
            input_gate, forget_gate, cell_gate, output_gate = (gates + self.recurrent[index](hidden)).chunk(
                4, dim=-1
            )
            cell = forget_gate.sigmoid() * cell + input_gate.sigmoid() * cell_gate.tanh()
            after.append((output_gate.sigmoid() * cell.tanh(), cell))
        made = self.out(torch.cat([after[-1][0], condition], dim=-1))
        root = made[..., :ROOT_DIM] * self.root_std + self.root_mean
        quat = self.rotations(made)
        return torch.cat([root, quat.flatten(-2), made[..., -N_FEET:]], dim=-1), after

    def rotations(self, pose: Tensor) -> Tensor:
        """The unit rotations (..., J, 4) of poses (..., P)."""
        return functional.normalize(pose[..., ROOT_DIM:-N_FEET].unflatten(-1, (-1, 4)), dim=-1)

    def styled(self, pose: Tensor, conditions: RolloutConditions) -> Tensor:
        """Poses (B, T, P) with the style of their songs (equation 4), or as they are without one.

        The MLP's vector has length 1, as the paper's is "normalized". The paper fades it in and out in every
        word by a Hamming window γ, so that words meet (here without its pedestal: the first and the last
        pose of a word stay as they are). That moves the body on its own account and with it the motion
        beats; ours lets the vectors of words pass into each other over `style_fade_s` instead.
        """
        if conditions.spectral is None:
            return pose
        vector = self.style((conditions.spectral - self.spectral_mean) / self.spectral_std)
        vector = functional.normalize(vector, dim=-1)  # (B, T, 2 * 4 J)
        if self.config.style_fade_s > 0:
            vector = _faded(vector, round(self.config.style_fade_s * FRAME_RHYTHM_FPS))
        else:
            vector = vector * (0.5 - 0.5 * torch.cos(2 * torch.pi * conditions.progress[..., None]))
        scale, shift = (self.config.style_strength * vector).chunk(2, dim=-1)  # (B, T, 4 J) each
        quat = pose[..., ROOT_DIM:-N_FEET]
        quat = functional.normalize(((1 + scale) * quat + shift).unflatten(-1, (-1, 4)), dim=-1)
        return torch.cat([pose[..., :ROOT_DIM], quat.flatten(-2), pose[..., -N_FEET:]], dim=-1)

    def fed(self, pose: Tensor) -> Tensor:
        """A pose (..., P) as the network made it, as the network is given it: contacts from 0 to 1."""
        return torch.cat([pose[..., :-N_FEET], pose[..., -N_FEET:].sigmoid()], dim=-1)

    def _standardised(self, pose: Tensor) -> Tensor:
        root = (pose[..., :ROOT_DIM] - self.root_mean) / self.root_std
        return torch.cat([root, pose[..., ROOT_DIM:]], dim=-1)


def _faded(vectors: Tensor, n_frames: int) -> Tensor:
    """Vectors (B, T, D) averaged twice over so many frames around each; the ends hold."""
    side = n_frames // 2
    rows = vectors.transpose(1, 2)  # (B, D, T)
    for _ in range(2):
        held = functional.pad(rows, (side, side), mode="replicate")
        rows = functional.avg_pool1d(held, 2 * side + 1, stride=1)
    return rows.transpose(1, 2)
