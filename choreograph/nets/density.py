"""Learned tempo-densities of motion and music (ChoreoGraph, section 3.2).

Layer counts, the hidden vector, inputs and outputs are those of the paper. By default, these are added:

- `skips`, skip connections from each convolution block to the deconvolution block of its rate, because timing
  does not survive a hidden vector of a few frames
- `velocities` of joints as inputs beside their positions
- `unit_variance` and zero mean of every density over its segment, so that it cannot collapse

The paper does not state widths, strides and activations, or whether positions are encoded. Here they are not,
so that the density of a movement does not depend on its time.
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from choreograph.core.errors import ParameterError
from choreograph.core.timebase import CLIP_FRAMES, MUSIC_FPS, NET_FPS, SEGMENT_FRAMES
from choreograph.motion.body import BODY_JOINTS, checked_body_pos_m
from choreograph.music.mel import MEL_BANDS
from choreograph.nets.configs import HIDDEN_FRAMES, DensityConfig
from choreograph.nets.inference import MEL_FRAMES
from choreograph.nets.stored import StoredNet
from choreograph.nets.style import centred

BODY_DIM = 3 * len(BODY_JOINTS)
_HOP_FRAMES = NET_FPS  # of the windows of a whole take


class MotionDensity(StoredNet):
    """The estimator, which maps centred clips (B, 160, 21, 3) to densities (B, 160) and contents (B, C)."""

    config_class = DensityConfig

    def __init__(self, config: DensityConfig) -> None:
        super().__init__()
        self.config = config
        channels = (config.width, *config.conv_channels)
        joined = 2 if config.skips else 1  # times the channels, with those of a skip connection
        self.embed = nn.Linear((2 if config.velocities else 1) * BODY_DIM, config.width)
        self.transformer = _transformer(config.width)
        self.convs = nn.ModuleList(_conv(channels[i], channels[i + 1], i == 4) for i in range(5))
        # A deconvolution block takes the output of the one before and of the convolution block of its rate.
        self.deconvs = nn.ModuleList(
            _deconv(channels[i + 1] * (1 if i == 4 else joined), channels[i], i == 4) for i in (4, 3, 2, 1, 0)
        )
        self.to_density = nn.Conv1d(joined * config.width, 1, 3, padding=1)
        self.content = nn.Sequential(
            nn.Linear(config.hidden_dim, config.content_dim),
            nn.ReLU(),
            nn.Linear(config.content_dim, config.content_dim),
        )

    def forward(self, body: Tensor) -> tuple[Tensor, Tensor]:
        """Centred clips (B, 160, 21, 3) in metres to densities (B, 160) and contents (B, C)."""
        pos = body.flatten(2)  # (B, 160, 63)
        if self.config.velocities:
            # The factor brings velocities to about the size of positions.
            pos = torch.cat([pos, 10 * torch.gradient(pos, dim=1)[0]], dim=2)
        x = self.transformer(self.embed(pos)).transpose(1, 2)  # (B, W, 160)
        skips = [x]
        for conv in self.convs:
            skips.append(conv(skips[-1]))
        content = self.content(skips[-1].flatten(1))
        x = skips.pop()
        for deconv in self.deconvs:
            x = deconv(x)
            if self.config.skips:
                x = torch.cat([x, skips.pop()], dim=1)
        density = self.to_density(x)[:, 0]
        return standardised(density) if self.config.unit_variance else density, content

    def clip_densities(self, clips_m: NDArray[np.floating]) -> NDArray[np.float32]:
        """Tempo-densities (N, 160) of clips, each from this clip alone, as in the paper.

        `clips_m` (N, 160, 21, 3) are their body positions in metres, at 20 fps.
        """
        body = np.asarray(clips_m, np.float32)
        return self._in_batches(len(body), lambda p: self(torch.from_numpy(centred(body[p])))[0], CLIP_FRAMES)

    def take_density(self, body_pos_m: NDArray[np.floating]) -> NDArray[np.float32]:
        """Tempo-density (T,) of a whole take, body positions (T, 21, 3) in metres at 20 fps.

        It is the mean over windows of 8 s, one starting every second. The last pose of a shorter take is
        repeated. The paper estimates the density of each clip from the clip alone (`clip_densities`). Here,
        the density of a clip is the mean of the estimates of all clips that overlap with it.
        """
        body = checked_body_pos_m(body_pos_m).astype(np.float32)
        n_frames = len(body)
        last = max(0, n_frames - CLIP_FRAMES)
        starts = np.unique(np.append(np.arange(0, last + 1, _HOP_FRAMES), last))
        frames = starts[:, None] + np.arange(CLIP_FRAMES)  # (N, 160)
        curves = self.clip_densities(body[np.minimum(frames, n_frames - 1)])
        # The ends of a window have the least context, so they have the least weight.
        weights = np.broadcast_to(np.hanning(CLIP_FRAMES + 2)[1:-1] + 1e-3, frames.shape)
        total = np.bincount(frames.ravel(), (weights * curves).ravel())
        return (total / np.bincount(frames.ravel(), weights.ravel()))[:n_frames].astype(np.float32)


class MotionDecoder(nn.Module):
    """The decoder, which maps densities (B, 160) and contents (B, C) to clips (B, 160, 21, 3)."""

    def __init__(self, config: DensityConfig) -> None:
        super().__init__()
        self.config = config
        channels = (config.width, *config.conv_channels)
        joined = 2 if config.skips else 1
        self.content = nn.Sequential(
            nn.Linear(config.content_dim, config.content_dim),
            nn.ReLU(),
            nn.Linear(config.content_dim, config.hidden_dim),
        )
        self.from_density = nn.Conv1d(1, config.width, 3, padding=1)
        self.convs = nn.ModuleList(_conv(channels[i], channels[i + 1], i == 4) for i in range(5))
        # The deepest block always takes both the density's hidden frames and the content's.
        self.deconvs = nn.ModuleList(
            _deconv(channels[i + 1] * (2 if i == 4 else joined), channels[i], i == 4) for i in (4, 3, 2, 1, 0)
        )
        self.join = nn.Linear(joined * config.width, config.width)
        self.transformer = _transformer(config.width)
        self.to_body = nn.Linear(config.width, BODY_DIM)

    def forward(self, density: Tensor, content: Tensor) -> Tensor:
        """Densities (B, 160) and contents (B, C) to centred clips (B, 160, 21, 3) in metres."""
        skips = [self.from_density(density[:, None])]
        for conv in self.convs:
            skips.append(conv(skips[-1]))
        x = torch.cat([self.content(content).view(len(content), -1, HIDDEN_FRAMES), skips.pop()], dim=1)
        for deconv in self.deconvs:
            x = deconv(x)
            if self.config.skips:
                x = torch.cat([x, skips.pop()], dim=1)
        x = self.join(x.transpose(1, 2))
        body: Tensor = self.to_body(self.transformer(x))  # (B, T, 63)
        return body.reshape(*body.shape[:2], len(BODY_JOINTS), 3)


class MusicDensity(StoredNet):
    """Maps log-mel (B, 240, 96) of 4 s to the tempo-density of suitable motion, (B, 80) at 20 fps."""

    config_class = DensityConfig

    def __init__(self, config: DensityConfig) -> None:
        super().__init__()
        self.config = config
        channels = (config.width, *config.music_channels)
        self.mel_mean: Tensor
        self.mel_std: Tensor
        self.register_buffer("mel_mean", torch.zeros(MEL_BANDS))
        self.register_buffer("mel_std", torch.ones(MEL_BANDS))
        self.embed = nn.Linear(MEL_BANDS, config.width)
        self.transformers = nn.Sequential(_transformer(config.width), _transformer(config.width))
        # The first block takes 240 frames at 60 fps to 80 at 20 fps. The others make 40, 20, 10 and 5.
        strides = (3, 2, 2, 2, 2)
        self.convs = nn.ModuleList(
            nn.Sequential(
                nn.Conv1d(channels[i], channels[i + 1], 5, stride=strides[i], padding=2),
                nn.BatchNorm1d(channels[i + 1]),
                nn.ReLU(),
            )
            for i in range(5)
        )
        joined = 2 if config.skips else 1
        self.deconvs = nn.ModuleList(
            _deconv(channels[i + 1] * (1 if i == 4 else joined), channels[i], False) for i in (4, 3, 2, 1)
        )
        self.last = nn.ConvTranspose1d(joined * channels[1], 1, 3, padding=1)  # the fifth: 80 to 80

    def forward(self, mel: Tensor) -> Tensor:
        """Log-mel (B, 240, 96), raw, to densities (B, 80), not yet standardised."""
        x = (mel - self.mel_mean) / self.mel_std
        x = self.transformers(self.embed(x)).transpose(1, 2)
        skips = []
        for conv in self.convs:
            x = conv(x)
            skips.append(x)
        skips.pop()
        for deconv in self.deconvs:
            x = deconv(x)
            if self.config.skips:
                x = torch.cat([x, skips.pop()], dim=1)
        result: Tensor = self.last(x)[:, 0]
        return result

    def song_density(self, log_mel: NDArray[np.floating], n_seconds: int) -> NDArray[np.float32]:
        """Densities (S, 80) for the 4 s from each second, from a song's log-mel (T, 96) at 60 fps.

        Each is scaled to unit variance (`unit_variance`), because a mean-square fit underestimates variance,
        and a flat query matches everywhere.
        """
        mel = np.asarray(log_mel, np.float32)
        if mel.ndim != 2 or mel.shape[1] != MEL_BANDS or len(mel) == 0 or n_seconds < 1:
            raise ParameterError(
                f"expected log-mel (T, {MEL_BANDS}) and a second or more, got {mel.shape} and {n_seconds}"
            )
        padded = np.pad(mel, ((0, MEL_FRAMES), (0, 0)), constant_values=float(mel.min()))
        frames = np.minimum(np.arange(n_seconds) * MUSIC_FPS, len(mel))[:, None] + np.arange(MEL_FRAMES)
        scaled = standardised if self.config.unit_variance else nn.Identity()
        curves = self._in_batches(
            n_seconds, lambda part: scaled(self(torch.from_numpy(padded[frames[part]])))
        )
        return curves.reshape(n_seconds, SEGMENT_FRAMES)


def standardised(curves: Tensor) -> Tensor:
    """Curves (B, T) with zero mean and unit variance each. A flat one becomes zero."""
    centre = curves - curves.mean(dim=1, keepdim=True)
    return centre / torch.sqrt(centre.square().mean(dim=1, keepdim=True) + 1e-5)


def _transformer(width: int) -> nn.Module:
    return nn.TransformerEncoderLayer(width, 4, 2 * width, dropout=0.0, batch_first=True, norm_first=True)


def _conv(n_in: int, n_out: int, deepest: bool) -> nn.Sequential:
    """Half the frames. The deepest block takes 10 frames to the 4 of the hidden vector."""
    conv = nn.Conv1d(n_in, n_out, 4, stride=2, padding=0 if deepest else 1)
    return nn.Sequential(conv, nn.BatchNorm1d(n_out), nn.ReLU())


def _deconv(n_in: int, n_out: int, deepest: bool) -> nn.Sequential:
    deconv = nn.ConvTranspose1d(n_in, n_out, 4, stride=2, padding=0 if deepest else 1)
    return nn.Sequential(deconv, nn.BatchNorm1d(n_out), nn.ReLU())
