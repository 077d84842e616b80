"""`MusicCounts`: beats, downbeats and their phases from a song's log-mel, by a temporal convolution network.

After Davies and Böck, *Temporal convolutional networks for musical audio beat tracking*, EUSIPCO 2019, and
Böck and Davies, *Deconstruct, analyse, reconstruct*, ISMIR 2020: small convolutions over bands and frames,
then dilated convolutions that see half a minute to either side. Ours: 30 fps rather than 100, an input
without level and equalisation, and the phases of beat and bar besides, from which the bar pointer counts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from choreograph.errors import ParameterError
from choreograph.features.bar_pointer import PhaseCurves
from choreograph.features.mel import MEL_BANDS
from choreograph.nets.counts.music_config import MusicCountsConfig
from choreograph.nets.counts.phases import N_OUTPUTS, curves_from
from choreograph.nets.counts.trunk import Trunk
from choreograph.nets.stored import StoredNet
from choreograph.timebase import MUSIC_FPS

CURVE_FPS = MUSIC_FPS // 2
N_ACTIVATIONS = 2  # of beat and downbeat
_RANGE = 12.0  # nats below the loudest band of a song that are heard: 52 dB
_SCALE = 3.0  # nats: about the spread of a band


@dataclass(frozen=True, eq=False)
class MusicCurves:
    """What the network hears at 30 fps; frame i is at i / 30 s."""

    beat: NDArray[np.float32]  # (T,) probability of a beat in the frame
    downbeat: NDArray[np.float32]  # (T,)
    phases: PhaseCurves  # of beat and bar


class MusicCounts(StoredNet):
    """Log-mel at 60 fps to activations and phases at 30 fps."""

    config_class = MusicCountsConfig

    def __init__(self, config: MusicCountsConfig) -> None:
        super().__init__()
        self.config = config
        first, second = config.front_channels
        # (B, 1, T, 96) to (B, first, T / 2, 32), then a quarter of the bands.
        self.front = nn.Sequential(
            nn.Conv2d(1, first, (5, 5), stride=(2, 3), padding=(2, 1)),
            nn.ELU(),
            nn.MaxPool2d((1, 2)),
            nn.Conv2d(first, second, (3, 3), padding=(1, 1)),
            nn.ELU(),
            nn.MaxPool2d((1, 2)),
        )
        self.trunk = Trunk(second * (MEL_BANDS // 12), config.width, config.n_blocks, config.dropout)
        self.head = nn.Conv1d(config.width, N_ACTIVATIONS + N_OUTPUTS, 1)

    def forward(self, mel: Tensor) -> tuple[Tensor, Tensor]:
        """Levelled log-mel (B, T, 96), T even, to logits of activations (B, 2, T / 2) and phase vectors
        (B, N_OUTPUTS, T / 2), as `nets.counts.phases` has them."""
        bands = self.front(mel[:, None]).transpose(2, 3).flatten(1, 2)  # (B, C * 8, T / 2)
        curves = self.head(self.trunk(bands))
        return curves[:, :N_ACTIVATIONS], curves[:, N_ACTIVATIONS:]

    def curves(self, log_mel: NDArray[np.floating]) -> MusicCurves:
        """The curves of a whole song from its log-mel (T, 96); `ParameterError` for another shape."""
        mel = np.asarray(log_mel, np.float32)
        if mel.ndim != 2 or mel.shape[1] != MEL_BANDS or len(mel) == 0:
            raise ParameterError(f"expected log-mel (T, {MEL_BANDS}), got an array of shape {mel.shape}")
        even = np.pad(levelled(mel), ((0, len(mel) % 2), (0, 0)), mode="edge")
        self.eval()
        with torch.no_grad():
            logits, vectors = self(torch.from_numpy(even)[None])
        beat, downbeat = torch.sigmoid(logits[0]).numpy()
        return MusicCurves(beat, downbeat, curves_from(vectors[0], CURVE_FPS))


def levelled(log_mel: NDArray[np.floating]) -> NDArray[np.float32]:
    """Log-mel (T, 96) without gain and equalisation: a band's mean is 0, what is 52 dB down is cut."""
    mel = np.asarray(log_mel, np.float32)
    mel = np.maximum(mel, mel.max() - _RANGE)
    return (mel - mel.mean(axis=0)) / _SCALE
