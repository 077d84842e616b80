"""The motion-word network P: 13 frames between two beats to 184 dimensions (Rhythm is a Dancer, 3.3).

Distances between embeddings approximate mean joint distances in metres. The network moves a word to its root
frame first, so that it does not matter where on the floor it is danced, and is differentiable from world
positions on: the rollout network's perceptual loss (equation 9) goes through it.
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from choreograph.errors import ParameterError
from choreograph.motion.body import BODY_JOINTS
from choreograph.nets.stored import StoredNet
from choreograph.nets.words.config import WORD_DIM, WordConfig
from choreograph.timebase import WORD_FRAMES

_N_VALUES = len(BODY_JOINTS) * 3
_LEFT, _RIGHT = (
    [BODY_JOINTS.index(f"{side}_{part}") for part in ("hip", "shoulder")] for side in ("left", "right")
)


class WordNet(StoredNet):
    """Words to embeddings, with the statistics that standardise its inputs."""

    config_class = WordConfig
    mean_m: Tensor
    std_m: Tensor

    def __init__(self, config: WordConfig) -> None:
        super().__init__()
        self.config = config
        width = config.width
        self.linear = nn.Linear(WORD_FRAMES * _N_VALUES, WORD_DIM)
        self.into = nn.Conv1d(_N_VALUES, width, 3, padding=1)
        self.blocks = nn.Sequential(*(_Block(width) for _ in range(config.n_blocks)))
        self.out = nn.Linear(width * WORD_FRAMES, WORD_DIM)
        nn.init.zeros_(self.out.weight)
        nn.init.zeros_(self.out.bias)
        self.register_buffer("mean_m", torch.zeros(WORD_FRAMES, _N_VALUES))
        self.register_buffer("std_m", torch.ones(1))

    @torch.no_grad()
    def init_from_pca(self, words: Tensor) -> None:
        """Initialise with the principal components of words (N, 13, 21, 3), which almost keep distances."""
        values = clips_to_root_frame(words).flatten(2)  # (N, 13, 63)
        self.mean_m.copy_(values.mean(dim=0))
        self.std_m.copy_((values - self.mean_m).square().mean().sqrt())
        axes = torch.linalg.svd((values - self.mean_m).flatten(1), full_matrices=False).Vh[:WORD_DIM]
        self.linear.weight.zero_()
        self.linear.weight[: len(axes)] = axes
        self.linear.bias.zero_()

    def forward(self, body: Tensor) -> Tensor:
        """Body positions (B, T, 21, 3) in metres, anywhere on the floor, to embeddings (B, 184).

        Words of another length than 13 frames are resampled to 13, from the first frame to the last.
        """
        x = (clips_to_root_frame(_resampled_words(body)).flatten(2) - self.mean_m) / self.std_m  # (B, 13, 63)
        features = self.blocks(self.into(x.transpose(1, 2)))  # (B, C, 13)
        # From standard deviations summed over joints and frames to root mean joint distances in metres.
        scale_m = self.std_m / (WORD_FRAMES * len(BODY_JOINTS)) ** 0.5
        return scale_m * (self.linear(x.flatten(1)) + self.out(features.flatten(1)))

    def embed(self, words_m: NDArray[np.floating]) -> NDArray[np.float32]:
        """Embeddings (N, 184) of words (N, 13, 21, 3); `ParameterError` for another shape or nan."""
        words = np.asarray(words_m, np.float32)
        if words.shape[1:] != (WORD_FRAMES, len(BODY_JOINTS), 3):
            raise ParameterError(
                f"expected motion words (N, {WORD_FRAMES}, {len(BODY_JOINTS)}, 3), got {words.shape}"
            )
        if not np.isfinite(words).all():
            raise ParameterError("expected finite motion words, got nan or infinity")
        return self._in_batches(len(words), lambda part: self(torch.from_numpy(words[part])), WORD_DIM)


def clips_to_root_frame(body: Tensor) -> Tensor:
    """`motion.pose.clips_to_root_frame` of tensors (B, T, 21, 3); differentiable."""
    middle = body[:, body.shape[1] // 2]
    across = (middle[:, _LEFT] - middle[:, _RIGHT]).sum(dim=1)[:, [0, 2]]  # (B, 2)
    cos, sin = functional.normalize(across, dim=1).T[..., None, None]  # (B, 1, 1) each
    origin = body[:, :, :1].mean(dim=1, keepdim=True)  # (B, 1, 1, 3) mean position of the pelvis
    x, z = body[..., 0] - origin[..., 0], body[..., 2] - origin[..., 2]
    return torch.stack([cos * x + sin * z, body[..., 1], cos * z - sin * x], dim=-1)


def _resampled_words(body: Tensor) -> Tensor:
    if body.shape[1] == WORD_FRAMES:
        return body
    values = body.flatten(2).transpose(1, 2)  # (B, 63, T)
    resampled = functional.interpolate(values, WORD_FRAMES, mode="linear", align_corners=True)
    return resampled.transpose(1, 2).unflatten(2, body.shape[2:])  # (B, 13, 21, 3)


class _Block(nn.Module):
    def __init__(self, width: int) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            nn.GroupNorm(1, width), nn.GELU(), nn.Conv1d(width, width, 3, padding=1),
            nn.GroupNorm(1, width), nn.GELU(), nn.Conv1d(width, width, 3, padding=1),
        )  # fmt: skip

    def forward(self, x: Tensor) -> Tensor:
        return x + self.layers(x)
