"""The rollout network predicts pose after pose from motif and rhythm (Rhythm is a Dancer, section 4).

A pose is a row of 4 + 4 J + 2 numbers: root motion, rotations, and contacts of both feet
(`nets.rollout_data`). Each frame is conditioned on the embedding of its motif and the four rhythmic features.
Unlike in the paper, it is also conditioned on the phase in its word, in the beat and in the bar.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
from torch import Tensor, nn
from torch.nn import functional

from choreograph.core.counts import COUNT_PHASE_DIM
from choreograph.music.frame_rhythm import FRAME_RHYTHM_FPS, FRAME_RHYTHM_NAMES
from choreograph.music.spectral import SPECTRAL_DIM
from choreograph.nets.configs import WORD_DIM, RolloutConfig
from choreograph.nets.stored import StoredNet

ROOT_DIM = 4  # shift sideways and forward, height, change of heading
N_FEET = 2
RHYTHM_DIM = len(FRAME_RHYTHM_NAMES)
PHASE_DIM = 3

State = list[tuple[Tensor, Tensor]]


@dataclass(frozen=True, eq=False)
class RolloutConditions:
    """Conditioning of each frame. All tensors (B, T, ...)."""

    motif: Tensor  # (B, T, 184) embedding of the frame's motif
    rhythm: Tensor  # (B, T, 4) of `music.frame_rhythm`, some frames ahead
    progress: Tensor  # (B, T) phase in the frame's word, 0 to 1
    word_s: Tensor  # (B, T) duration of the word
    count_phase: Tensor  # (B, T, 4) of `core.counts`
    spectral: Tensor | None  # (B, T, 87) of the music of the word, or None without style


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
            nn.Linear(SPECTRAL_DIM, 128), nn.GELU(), nn.Linear(128, 2 * 4 * config.n_joints)
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

    def embed_conditions(self, conditions: RolloutConditions) -> tuple[Tensor, Tensor]:
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
        output = self.out(torch.cat([next_state[-1][0], condition], dim=-1))
        root = output[..., :ROOT_DIM] * self.root_std + self.root_mean
        quat = self.rotations(output)
        return torch.cat([root, quat.flatten(-2), output[..., -N_FEET:]], dim=-1), next_state

    def rotations(self, pose: Tensor) -> Tensor:
        """The unit rotations (..., J, 4) of poses (..., P)."""
        return _unit_quaternions(pose[..., ROOT_DIM:-N_FEET])

    def apply_style(self, pose: Tensor, conditions: RolloutConditions) -> Tensor:
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

    def with_style(self, strength: float | None, window: str | None) -> RolloutNet:
        """The same network with another β of equation 4, or another window: "smooth" or "hamming".

        None keeps the value of the network. The values of the paper are 40 and hamming.
        """
        config, smooth_s = self.config, RolloutConfig().style_fade_s
        if strength is not None:
            config = replace(config, style_strength=strength)
        if window is not None:
            config = replace(config, style_fade_s=smooth_s if window == "smooth" else 0.0)
        if config == self.config:
            return self
        styled = RolloutNet(config)
        styled.load_state_dict(self.state_dict())
        return styled

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
