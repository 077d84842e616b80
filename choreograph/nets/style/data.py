"""Training data of the style networks: takes as arrays, balanced batches, augmentation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from choreograph.errors import ParameterError
from choreograph.features.mel import MEL_BANDS
from choreograph.features.tempogram import LAGS_S, N_BANDS, N_SCALES, RHYTHM_DIM, RHYTHM_FPS
from choreograph.motion.body import mirrored
from choreograph.nets.style.model import MEL_FRAMES, centred, rotated_about_y
from choreograph.timebase import MUSIC_FPS, NET_FPS, SEGMENT_FRAMES, SEGMENT_S

_NEPER_PER_DB = np.log(10.0) / 10.0  # natural logarithm of power in one decibel


@dataclass(frozen=True, eq=False)
class StyleTake:
    """One take as training data; all arrays begin at the motion's first frame."""

    name: str
    song_name: str  # takes of one song are never each other's negatives
    genre: str  # "" if unknown
    log_mel: NDArray[np.float32]  # (T60, 96) at 60 fps
    rhythm: NDArray[np.float32]  # (M, RHYTHM_DIM) at 2 fps
    body_pos_m: NDArray[np.float32]  # (T20, 21, 3) at 20 fps
    motion_beat_times_s: NDArray[np.float64]  # (Q,)

    @property
    def n_starts(self) -> int:
        """Number of 4 s segments, one starting every half second, that lie inside music and motion."""
        shorter_s = min(len(self.log_mel) / MUSIC_FPS, len(self.body_pos_m) / NET_FPS)
        return int(max(0.0, (shorter_s - SEGMENT_S) * RHYTHM_FPS + 1))


@dataclass(frozen=True, eq=False)
class StyleBatch:
    """Segments of music and the motion danced to them."""

    mel: Tensor  # (B, 240, 96)
    rhythm: Tensor  # (B, RHYTHM_DIM)
    body: Tensor  # (B, 80, 21, 3)
    n_beats: Tensor  # (B,)
    song: Tensor  # (B,) integer label
    genre: Tensor  # (B,) integer label, -1 if unknown

    def to(self, device: torch.device) -> StyleBatch:
        """The batch on a device."""
        return StyleBatch(*(getattr(self, field.name).to(device) for field in fields(self)))


class StyleData:
    """The takes of a training run; `ParameterError` if fewer than two songs have 4 s of pairs."""

    def __init__(self, takes: Sequence[StyleTake], *, balanced_genres: bool = True) -> None:
        self.takes = [take for take in takes if take.n_starts > 0]
        songs = sorted({take.song_name for take in self.takes})
        if len(songs) < 2:
            raise ParameterError(
                f"expected takes of two songs or more with {SEGMENT_S} s of music and motion to learn style "
                f"from, got {len(songs)}"
            )
        genres = sorted({take.genre for take in self.takes} - {""})
        self._song = np.array([songs.index(take.song_name) for take in self.takes])
        self._genre = np.array([genres.index(t.genre) if t.genre else -1 for t in self.takes])
        if balanced_genres:  # each genre is equally likely, and each take within it
            weight = 1.0 / np.array([np.sum(self._genre == g) for g in self._genre], np.float64)
        else:
            weight = np.array([take.n_starts for take in self.takes], np.float64)
        self._probability = weight / np.sum(weight)

    @property
    def n_segments(self) -> float:
        """Length of the takes in segments of 4 s that do not overlap."""
        return sum((take.n_starts - 1) / (RHYTHM_FPS * SEGMENT_S) + 1 for take in self.takes)

    def statistics(self) -> dict[str, NDArray[np.float32]]:
        """Means and deviations for standardising inputs, by the names of the buffers of `StyleNets`."""
        mel = np.concatenate([take.log_mel for take in self.takes])
        rhythm = np.concatenate([take.rhythm for take in self.takes])
        counts = np.concatenate([_beat_counts(take, np.arange(take.n_starts)) for take in self.takes])
        return {
            "mel_mean": mel.mean(axis=0),
            "mel_std": mel.std(axis=0) + 0.1,
            "rhythm_mean": rhythm.mean(axis=0),
            "rhythm_std": rhythm.std(axis=0) + 0.05,
            "beats_mean": np.array([counts.mean()], np.float32),
            "beats_std": np.array([counts.std() + 0.1], np.float32),
        }

    def batch(
        self, size: int, rng: np.random.Generator, *, mirrored_share: float = 0.5, augmented: bool = True
    ) -> StyleBatch:
        """Random segments, augmented or as they are."""
        chosen = rng.choice(len(self.takes), size, p=self._probability)
        starts = [int(rng.integers(self.takes[i].n_starts)) for i in chosen]
        mel = np.empty((size, MEL_FRAMES, MEL_BANDS), np.float32)
        rhythm = np.empty((size, RHYTHM_DIM), np.float32)
        body = np.empty((size, SEGMENT_FRAMES, 21, 3), np.float32)
        n_beats = np.empty(size, np.float32)
        for row, (i, start) in enumerate(zip(chosen, starts, strict=True)):
            take = self.takes[i]
            frame = start * (MUSIC_FPS // RHYTHM_FPS)
            mel[row] = take.log_mel[frame : frame + MEL_FRAMES]
            rhythm[row] = take.rhythm[min(start + SEGMENT_S // 2 * RHYTHM_FPS, len(take.rhythm) - 1)]
            frame = start * (NET_FPS // RHYTHM_FPS)
            body[row] = take.body_pos_m[frame : frame + SEGMENT_FRAMES]
            n_beats[row] = _beat_counts(take, np.array([start]))[0]
        if augmented:
            mel, rhythm = augment_mel(mel, rng), augment_rhythm(rhythm, rng)
            body = augment_body(body, rng, mirrored_share=mirrored_share)
        else:
            body = centred(body)
        return StyleBatch(
            torch.from_numpy(mel),
            torch.from_numpy(rhythm),
            torch.from_numpy(body),
            torch.from_numpy(n_beats),
            torch.from_numpy(self._song[chosen]),
            torch.from_numpy(self._genre[chosen]),
        )


def count_beats(beat_times_s: NDArray[np.floating], starts_s: NDArray[np.floating]) -> NDArray[np.float32]:
    """Motion beats (Q,) within the 4 s from each of `starts_s` (N,): (N,)."""
    beats, starts = np.sort(beat_times_s), np.asarray(starts_s, np.float64)
    return (np.searchsorted(beats, starts + SEGMENT_S) - np.searchsorted(beats, starts)).astype(np.float32)


def _beat_counts(take: StyleTake, starts: NDArray[np.integer]) -> NDArray[np.float32]:
    return count_beats(take.motion_beat_times_s, starts / RHYTHM_FPS)


def augment_mel(log_mel: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.float32]:
    """Segments (B, 240, 96) in another key, room and mix; onset times do not change.

    Gain of ±10 dB and a smooth filter of ±8 dB, pitch shift of up to 6 bands, a noise floor; half of them
    mixed with another segment of the batch at -6 to -20 dB; one span of time or bands masked.
    """
    size, frames, bands = log_mel.shape
    out = np.empty_like(log_mel)
    floor = log_mel.min()
    knots = np.linspace(0, bands - 1, 6)
    for row in range(size):
        segment = log_mel[row]
        if rng.random() < 0.5:
            level = _NEPER_PER_DB * rng.uniform(6, 20)
            segment = np.logaddexp(segment, log_mel[rng.integers(size)] - level)
        source = np.clip(np.arange(bands) - rng.integers(-6, 7), 0, bands - 1)
        curve = np.interp(np.arange(bands), knots, _NEPER_PER_DB * rng.uniform(-8, 8, len(knots)))
        segment = segment[:, source] + curve + _NEPER_PER_DB * rng.uniform(-10, 10)
        noise = segment.max() - _NEPER_PER_DB * rng.uniform(30, 90)
        segment = np.maximum(segment, noise)
        if rng.random() < 0.5:
            start = rng.integers(bands)
            segment[:, start : start + rng.integers(1, 17)] = max(floor, noise)
        else:
            start = rng.integers(frames)
            segment[start : start + rng.integers(1, 41)] = max(floor, noise)
        out[row] = segment
    return out


def augment_rhythm(rhythm: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.float32]:
    """Rhythm (B, RHYTHM_DIM) up to 4 % faster or slower, noisier, and with other instruments.

    The lag axis is logarithmic, so a tempo change shifts the tempogram; the scale transform does not change.
    """
    columns = rhythm.reshape(len(rhythm), N_BANDS, -1)
    n_lags = len(LAGS_S)
    shift = rng.uniform(-1.0, 1.0, (len(rhythm), 1, 1))
    position = np.clip(np.arange(n_lags) + shift, 0, n_lags - 1.001)
    low = np.broadcast_to(position.astype(np.int64), (len(rhythm), N_BANDS, n_lags))
    lags = columns[..., :n_lags]
    weight = position % 1.0
    moved = np.take_along_axis(lags, low, 2) * (1 - weight) + np.take_along_axis(lags, low + 1, 2) * weight
    out = np.concatenate([moved, columns[..., n_lags:]], axis=2)
    out = out * rng.uniform(0.7, 1.2, (len(rhythm), N_BANDS, 1))
    blend = np.eye(N_BANDS) + rng.uniform(0.0, 0.4, (len(rhythm), N_BANDS, N_BANDS))
    out = np.einsum("bij,bjd->bid", blend / blend.sum(axis=2, keepdims=True), out)
    out[..., :n_lags] += rng.normal(0.0, 0.05, moved.shape)
    return out.reshape(len(rhythm), N_BANDS * (n_lags + N_SCALES)).astype(np.float32)


def augment_body(
    body_pos_m: NDArray[np.float32], rng: np.random.Generator, *, mirrored_share: float
) -> NDArray[np.float32]:
    """Segments (B, 80, 21, 3) centred, some mirrored, rotated by up to 30° and scaled by up to 10 %."""
    flip = rng.random(len(body_pos_m)) < mirrored_share
    body = np.where(flip[:, None, None, None], mirrored(body_pos_m), body_pos_m)
    body = rotated_about_y(centred(body), rng.uniform(-np.pi / 6, np.pi / 6, len(body)))
    return (body * rng.uniform(0.9, 1.1, (len(body), 1, 1, 1))).astype(np.float32)
