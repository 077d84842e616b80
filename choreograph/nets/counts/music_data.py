"""What the network that hears counts is trained on: excerpts of songs at any tempo, and their true phases."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from choreograph.counts import Counts
from choreograph.errors import ParameterError
from choreograph.features.bar_pointer import METRES
from choreograph.nets.counts.music_augmentation import augmented
from choreograph.nets.counts.music_config import MusicCountsConfig
from choreograph.nets.counts.music_model import CURVE_FPS, levelled
from choreograph.nets.counts.phases import Phases, PhaseTargets, phases_at
from choreograph.timebase import MUSIC_FPS, seconds_to_frames

Floats = NDArray[np.float64]

_TEMPO_STD, _LEAST_TEMPO, _MOST_TEMPO = 0.18, 0.7, 1.4  # of the factor of tempo: its logarithm, and bounds
_BEFORE_S = 2.0  # how much silence an excerpt may begin or end with
_SILENCE = -13.8  # log-mel of silence
_WIDTH_FRAMES = 1.5  # of an activation's target to either side of the beat, at 30 fps
_MIN_COUNTS = 8


@dataclass(frozen=True, eq=False)
class CountedMel:
    """A song to learn from."""

    log_mel: NDArray[np.floating]  # (T, 96) at 60 fps
    counts: Counts  # with bars of three or four


class MusicCountsData:
    """Batches of excerpts without end."""

    def __init__(self, songs: Sequence[CountedMel], config: MusicCountsConfig) -> None:
        """Raises `ParameterError` unless there are songs, each of eight counts or more in one of `METRES`."""
        for song in songs:
            if len(song.counts) < _MIN_COUNTS or song.counts.metre not in METRES:
                raise ParameterError(
                    f"expected songs of {_MIN_COUNTS} counts or more in a metre of {METRES}, got "
                    f"{len(song.counts)} in {song.counts.metre}"
                )
        if not songs:
            raise ParameterError("expected songs with counts, got none")
        self.songs, self.config = list(songs), config

    def batch(
        self, rng: np.random.Generator, weights: Floats | None = None
    ) -> tuple[Tensor, Tensor, PhaseTargets]:
        """Levelled log-mel (B, T, 96) at 60 fps; true activations (B, 2, T / 2) and phases at 30 fps.

        `weights` (N,) say how often each song is drawn; their sum is 1.
        """
        chosen = rng.choice(len(self.songs), self.config.batch_size, p=weights)
        mels, activations, phases = zip(*(self._excerpt(self.songs[i], rng) for i in chosen), strict=True)
        return (
            torch.from_numpy(np.stack(mels)),
            torch.from_numpy(np.stack(activations)),
            PhaseTargets.of(list(phases)),
        )

    def _excerpt(
        self, song: CountedMel, rng: np.random.Generator
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], Phases]:
        tempo = float(np.clip(np.exp(rng.normal(0.0, _TEMPO_STD)), _LEAST_TEMPO, _MOST_TEMPO))
        n_frames = 2 * seconds_to_frames(self.config.excerpt_s, CURVE_FPS)
        longest_s = len(song.log_mel) / MUSIC_FPS - tempo * self.config.excerpt_s
        start_s = rng.uniform(min(-_BEFORE_S, longest_s), max(0.0, longest_s) + _BEFORE_S)
        frames = start_s * MUSIC_FPS + tempo * np.arange(n_frames)
        mel = augmented(resampled(song.log_mel, frames), rng)
        times_s = start_s + tempo * np.arange(n_frames // 2) / CURVE_FPS
        return levelled(mel), activations(song.counts, times_s, tempo), phases_at(song.counts, times_s)


def resampled(log_mel: NDArray[np.floating], frames: NDArray[np.floating]) -> NDArray[np.float32]:
    """Log-mel (T', 96) at fractional frames (T',); silence outside."""
    inside = (frames >= 0) & (frames <= len(log_mel) - 1)
    position = np.clip(frames, 0, len(log_mel) - 1)
    low = np.minimum(position.astype(np.int64), max(len(log_mel) - 2, 0))
    high = np.minimum(low + 1, len(log_mel) - 1)
    share = (position - low).astype(np.float32)[:, None]
    mel = log_mel[low].astype(np.float32) * (1 - share) + log_mel[high].astype(np.float32) * share
    mel[~inside] = _SILENCE
    return mel


def activations(counts: Counts, times_s: NDArray[np.floating], tempo: float) -> NDArray[np.float32]:
    """At times (T,), `tempo` thirtieths of a second apart: 1 on a beat, on a downbeat, else 0; (2, T).

    A triangle falls to 0 in `_WIDTH_FRAMES` to either side, since a beat lies between frames.
    """
    rows = []
    for instants_s in (counts.times_s, counts.downbeat_times_s):
        after = np.clip(np.searchsorted(instants_s, times_s), 1, len(instants_s) - 1)
        distance_s = np.minimum(np.abs(times_s - instants_s[after - 1]), np.abs(times_s - instants_s[after]))
        rows.append(np.maximum(0.0, 1.0 - distance_s * CURVE_FPS / tempo / _WIDTH_FRAMES))
    return np.stack(rows).astype(np.float32)
