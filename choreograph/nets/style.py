"""Music and motion style embeddings and the beat-count head (ChoreoGraph, section 3.1).

The network of music reads the rhythm of the 12 s around a second, relative to the counts of the song
(`music.rhythm`), by one hidden layer and one linear layer to 32 dimensions. With `music_inputs="mel"`, it
reads the log-mel of 4 s instead, as in the paper: by four convolutional blocks, two GRU layers and the linear
layer. "mel+counts" reads both. The network of motion is that of the paper: four spatio-temporal graph
convolutional blocks, two GRU layers and one linear layer read the body positions of 4 s. A head of four
linear layers predicts the number of motion beats from the style vector of the music.

Unlike in the paper, style vectors have unit length, so that distances always lie in [0, 2]. Features are
batch-normalised before the linear layer. Without this, all vectors are almost equal at first and the
contrastive loss has no gradient. `normalised=False` switches both off.
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from choreograph.core.timebase import SEGMENT_FRAMES
from choreograph.motion.body import BODY_JOINTS, BODY_PARENTS, checked_body_pos_m
from choreograph.music.mel import MEL_BANDS
from choreograph.music.rhythm import RHYTHM_DIM
from choreograph.nets.configs import STYLE_DIM, StyleConfig
from choreograph.nets.inference import SongStyle
from choreograph.nets.stored import StoredNet

_GRAPH_STRIDES = (2, 2, 1, 1)  # 80 motion frames to 20 steps of the GRU
_LEFT_HIP, _RIGHT_HIP = BODY_JOINTS.index("left_hip"), BODY_JOINTS.index("right_hip")


class MusicStyle(nn.Module):
    """Log-mel (B, 240, 96) and rhythm (B, RHYTHM_DIM) to style vectors (B, 32)."""

    def __init__(self, config: StyleConfig) -> None:
        super().__init__()
        self.inputs = config.music_inputs.split("+")
        width = 0
        if "mel" in self.inputs:
            channels = (1, *config.conv_channels)
            self.blocks = nn.Sequential(*(_conv_block(*channels[i : i + 2]) for i in range(4)))
            self.gru = nn.GRU(
                channels[-1] * MEL_BANDS // 16,
                config.gru_width,
                num_layers=2,
                batch_first=True,
                dropout=config.dropout,
            )
            self.dropout = nn.Dropout(config.dropout)
            width += config.gru_width
        if "counts" in self.inputs:
            self.rhythm = nn.Sequential(
                nn.Linear(RHYTHM_DIM, config.rhythm_width), nn.ReLU(), nn.Dropout(config.dropout)
            )
            width += config.rhythm_width
        self.spread = nn.BatchNorm1d(width) if config.normalised else nn.Identity()
        self.linear = nn.Linear(width, STYLE_DIM)
        self.to_unit = _unit if config.normalised else nn.Identity()

    def forward(self, mel: Tensor, rhythm: Tensor) -> Tensor:
        """Standardised log-mel (B, 240, 96) and rhythm (B, RHYTHM_DIM) to style vectors (B, 32)."""
        features = []
        if "mel" in self.inputs:
            x = self.blocks(mel[:, None])  # (B, C, 15, 6)
            x, _ = self.gru(x.transpose(1, 2).flatten(2))  # (B, 15, G)
            features.append(self.dropout(x.mean(dim=1)))
        if "counts" in self.inputs:
            features.append(self.rhythm(rhythm))
        return self.to_unit(self.linear(self.spread(torch.cat(features, dim=1))))


class MotionStyle(nn.Module):
    """Body positions (B, 3, 80, 21) to style vectors (B, 32)."""

    def __init__(self, config: StyleConfig) -> None:
        super().__init__()
        channels = (3, *config.graph_channels)
        self.blocks = nn.Sequential(
            *(_GraphBlock(channels[i], channels[i + 1], _GRAPH_STRIDES[i], config.dropout) for i in range(4))
        )
        self.gru = nn.GRU(
            channels[-1], config.gru_width, num_layers=2, batch_first=True, dropout=config.dropout
        )
        self.dropout = nn.Dropout(config.dropout)
        self.spread = nn.BatchNorm1d(config.gru_width) if config.normalised else nn.Identity()
        self.linear = nn.Linear(config.gru_width, STYLE_DIM)
        self.to_unit = _unit if config.normalised else nn.Identity()

    def forward(self, body: Tensor) -> Tensor:
        """Centred body positions (B, 3, 80, 21) in metres, channels first, to style vectors (B, 32)."""
        x = self.blocks(body).mean(dim=3)  # (B, C, 20)
        x, _ = self.gru(x.transpose(1, 2))  # (B, 20, G)
        x = self.spread(self.dropout(x.mean(dim=1)))
        return self.to_unit(self.linear(x))


class StyleNets(StoredNet):
    """Both embeddings and the beat-count head, with the statistics that standardise their inputs."""

    config_class = StyleConfig
    mel_mean: Tensor
    mel_std: Tensor
    rhythm_mean: Tensor
    rhythm_std: Tensor
    beats_mean: Tensor
    beats_std: Tensor

    def __init__(self, config: StyleConfig) -> None:
        super().__init__()
        self.config = config
        self.music = MusicStyle(config)
        self.motion = MotionStyle(config)
        width = config.head_width
        self.beat_head = nn.Sequential(
            *(nn.Linear(STYLE_DIM, width), nn.ReLU(), nn.Linear(width, width), nn.ReLU()),
            *(nn.Linear(width, width), nn.ReLU(), nn.Linear(width, 1)),
        )
        for name, size in (("mel", MEL_BANDS), ("rhythm", RHYTHM_DIM), ("beats", 1)):
            self.register_buffer(f"{name}_mean", torch.zeros(size))
            self.register_buffer(f"{name}_std", torch.ones(size))

    def style_of_music(self, mel: Tensor, rhythm: Tensor) -> Tensor:
        """Log-mel (B, 240, 96) and rhythm (B, RHYTHM_DIM), raw, to (B, 32)."""
        result: Tensor = self.music(
            (mel - self.mel_mean) / self.mel_std, (rhythm - self.rhythm_mean) / self.rhythm_std
        )
        return result

    def style_of_motion(self, body: Tensor) -> Tensor:
        """Centred body positions (B, 80, 21, 3) in metres (`centred`) to (B, 32)."""
        # Contiguous: torch 2.13 crashes in oneDNN's backward pass of a permuted (channels-last) input.
        result: Tensor = self.motion(body.permute(0, 3, 1, 2).contiguous())
        return result

    def beat_count(self, music_style: Tensor) -> Tensor:
        """Motion beats expected in the 4 s, (B,), from the music's style (B, 32)."""
        result: Tensor = self.beat_head(music_style)[:, 0] * self.beats_std + self.beats_mean
        return result

    def embed_music(
        self, log_mel: NDArray[np.floating], rhythm: NDArray[np.floating], starts_s: NDArray[np.integer]
    ) -> NDArray[np.float32]:
        """Style vectors (N, 32) of the 4 s segments of a song from whole seconds `starts_s` (N,).

        Arguments and errors are those of `inference.SongStyle.embed_music`.
        """
        return self._of_songs().embed_music(log_mel, rhythm, starts_s)

    def embed_motion(
        self, body_pos_m: NDArray[np.floating], start_frames: NDArray[np.integer]
    ) -> NDArray[np.float32]:
        """Style vectors (N, 32) of the 4 s of motion from each of `start_frames` (N,).

        `body_pos_m` (T, 21, 3) is at 20 fps. The end poses are repeated outside.
        """
        body = checked_body_pos_m(body_pos_m).astype(np.float32)
        starts = np.asarray(start_frames, np.int64)

        def embed(part: slice) -> Tensor:
            frames = np.clip(starts[part, None] + np.arange(SEGMENT_FRAMES), 0, len(body) - 1)
            return self.style_of_motion(torch.from_numpy(centred(body[frames])))

        return self._in_batches(len(starts), embed, STYLE_DIM)

    def predict_beat_count(self, music_style: NDArray[np.floating]) -> NDArray[np.float32]:
        """Motion beats expected in each 4 s segment, (N,), from music styles (N, 32)."""
        return self._of_songs().predict_beat_count(music_style)

    def _of_songs(self) -> SongStyle:
        return SongStyle.from_arrays(*self.to_arrays())


def centred(body_pos_m: NDArray[np.floating]) -> NDArray[np.float32]:
    """Segments (N, T, 21, 3) moved and rotated to the origin, so that style does not depend on position.

    The pelvis is on average above the origin, and the hips of the middle frame face +Z.
    """
    pos = np.array(body_pos_m, np.float32)
    pos[..., [0, 2]] -= pos[:, :, :1, [0, 2]].mean(axis=1, keepdims=True)
    middle = pos[:, pos.shape[1] // 2]
    across = middle[:, _LEFT_HIP] - middle[:, _RIGHT_HIP]  # (N, 3), +X when facing +Z
    return rotated_about_y(pos, np.arctan2(across[:, 2], across[:, 0]))


def rotated_about_y(pos_m: NDArray[np.floating], yaw_rad: NDArray[np.floating]) -> NDArray[np.float32]:
    """Segments (N, T, J, 3) rotated about the vertical axis by angles (N,)."""
    cos, sin = (f(yaw_rad).astype(np.float32)[:, None, None] for f in (np.cos, np.sin))
    x, y, z = np.moveaxis(pos_m, -1, 0)
    return np.stack([cos * x + sin * z, y, cos * z - sin * x], axis=-1)


def _unit(vectors: Tensor) -> Tensor:
    return functional.normalize(vectors, dim=1)


def _conv_block(n_in: int, n_out: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(n_in, n_out, 3, stride=2, padding=1, bias=False), nn.BatchNorm2d(n_out), nn.ReLU()
    )


class _GraphBlock(nn.Module):
    """Spatio-temporal graph convolution, over a joint, its parent and its children, and then over time."""

    gather: Tensor

    def __init__(self, n_in: int, n_out: int, stride: int, dropout: float) -> None:
        super().__init__()
        self.register_buffer("gather", _adjacency(), persistent=False)  # (J, 3 J)
        self.spatial = nn.Conv2d(3 * n_in, n_out, 1)
        self.temporal = nn.Sequential(
            nn.BatchNorm2d(n_out),
            nn.ReLU(),
            nn.Conv2d(n_out, n_out, (9, 1), stride=(stride, 1), padding=(4, 0)),
            nn.BatchNorm2d(n_out),
            nn.Dropout(dropout),
        )
        self.residual = nn.Conv2d(n_in, n_out, 1, stride=(stride, 1), bias=False)

    def forward(self, x: Tensor) -> Tensor:
        batch, channels, frames, joints = x.shape
        y = (x @ self.gather).view(batch, channels, frames, 3, joints)  # from itself, parent, children
        y = y.transpose(2, 3).reshape(batch, 3 * channels, frames, joints)
        y = self.spatial(y)  # (B, C', T, J)
        return functional.relu(self.temporal(y) + self.residual(x))


def _adjacency() -> Tensor:
    """Normalised adjacency of each joint with itself, its parent and its children: (J, 3 J)."""
    n_joints = len(BODY_PARENTS)
    partitions = np.zeros((3, n_joints, n_joints), np.float32)
    partitions[0] = np.eye(n_joints)
    for joint, parent in enumerate(BODY_PARENTS):
        if parent >= 0:
            partitions[1, parent, joint] = 1.0
            partitions[2, joint, parent] = 1.0
    partitions /= np.maximum(partitions.sum(axis=1, keepdims=True), 1.0)
    return torch.from_numpy(np.concatenate(list(partitions), axis=1))
