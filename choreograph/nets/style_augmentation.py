"""Augmentation of the samples of the style networks: other recordings of a song, and other bodies."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from choreograph.motion.body import mirrored
from choreograph.music.mel import MEL_BANDS, N_BANDS
from choreograph.music.rhythm import LOUDNESS, METRE, ONSETS, PATTERN, TEMPO
from choreograph.nets.inference import MEL_FRAMES
from choreograph.nets.style import centred, rotated_about_y

_NEPER_PER_DB = np.log(10.0) / 10.0  # natural logarithm of power in one decibel
_P_HIDDEN = 0.15  # probability that tempo and metre, or the patterns, are set to zero


class MelChange(NamedTuple):
    """What makes another recording of a segment.

    It gets a gain of ±10 dB, a smooth filter of ±8 dB, a pitch shift of up to 6 bands and a noise floor. Half
    of the segments are mixed with another one of the batch at -6 to -20 dB. One span of time or bands is
    masked.
    """

    mixed: tuple[int, float] | None  # with another segment of the batch, which is quieter by this
    n_bands: int  # that it is shifted up
    curve: NDArray[np.float64]  # (6,) of a filter
    gain: float
    noise: float  # below the maximum
    masked: tuple[int, int, int]  # axis, start and length

    @classmethod
    def drawn(cls, size: int, rng: np.random.Generator) -> list[MelChange]:
        """One for each segment of a batch (B, 240, 96)."""
        changes = []
        for _ in range(size):
            mixed = None
            if rng.random() < 0.5:
                level = _NEPER_PER_DB * rng.uniform(6, 20)
                mixed = int(rng.integers(size)), level
            n_bands = int(rng.integers(-6, 7))
            curve = _NEPER_PER_DB * rng.uniform(-8, 8, 6)
            gain, noise = _NEPER_PER_DB * rng.uniform(-10, 10), _NEPER_PER_DB * rng.uniform(30, 90)
            if rng.random() < 0.5:
                masked = 1, int(rng.integers(MEL_BANDS)), int(rng.integers(1, 17))
            else:
                masked = 0, int(rng.integers(MEL_FRAMES)), int(rng.integers(1, 41))
            changes.append(cls(mixed, n_bands, curve, gain, noise, masked))
        return changes

    def changed(
        self, segment: NDArray[np.float32], batch: NDArray[np.float32], floor: float
    ) -> NDArray[np.floating]:
        """The changed segment (240, 96) of a batch (B, 240, 96) whose minimum is `floor`."""
        bands = np.arange(segment.shape[1])
        mixed: NDArray[np.floating] = segment
        if self.mixed is not None:
            other, level = self.mixed
            mixed = np.logaddexp(segment, batch[other] - level)
        source = np.clip(bands - self.n_bands, 0, len(bands) - 1)
        curve = np.interp(bands, np.linspace(0, len(bands) - 1, len(self.curve)), self.curve)
        changed: NDArray[np.floating] = mixed[:, source] + curve + self.gain
        noise = changed.max() - self.noise
        changed = np.maximum(changed, noise)
        axis, start, length = self.masked
        part = slice(start, start + length)
        changed[(slice(None), part) if axis else part] = max(floor, noise)
        return changed


def augment_mel(log_mel: NDArray[np.float32], changes: Sequence[MelChange]) -> NDArray[np.float32]:
    """Segments (B, 240, 96) in another key, room and mix, by their changes. Onset times do not change."""
    out = np.empty_like(log_mel)
    floor = log_mel.min()
    for row, change in enumerate(changes):
        out[row] = change.changed(log_mel[row], log_mel, floor)
    return out


def augment_rhythm(rhythm: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.float32]:
    """Rhythm (B, RHYTHM_DIM) up to 7 % faster or slower, with other instruments, sometimes partly zero.

    Tempo and metre, or the patterns, are sometimes set to zero, as in music without beats.
    """
    out = np.array(rhythm, np.float32)
    size = len(out)
    out[:, TEMPO] = _shifted(out[:, TEMPO], rng.uniform(-1.2, 1.2, size))
    bands = out[:, PATTERN].reshape(size, N_BANDS, -1)
    blend = np.eye(N_BANDS) + rng.uniform(0.0, 0.4, (size, N_BANDS, N_BANDS))
    bands = np.einsum("bij,bjd->bid", blend / blend.sum(axis=2, keepdims=True), bands)
    bands = bands * np.exp(rng.normal(0.0, 0.15, bands.shape))
    out[:, PATTERN] = bands.reshape(size, -1)
    out[:, LOUDNESS] += rng.normal(0.0, 0.5, size)
    out[:, ONSETS] *= np.exp(rng.normal(0.0, 0.05, size))
    hidden = rng.random(size)
    out[hidden < _P_HIDDEN, TEMPO.start : METRE.stop] = 0.0
    out[hidden > 1.0 - _P_HIDDEN, PATTERN] = 0.0
    return out


def _shifted(rows: NDArray[np.float32], by: NDArray[np.floating]) -> NDArray[np.floating]:
    """Rows (B, N) moved by fractional columns (B,). The ends are repeated."""
    position = np.clip(np.arange(rows.shape[1]) + by[:, None], 0, rows.shape[1] - 1.001)
    low = position.astype(np.int64)
    weight = position - low
    return np.take_along_axis(rows, low, 1) * (1 - weight) + np.take_along_axis(rows, low + 1, 1) * weight


def augment_body(
    body_pos_m: NDArray[np.float32], rng: np.random.Generator, *, mirrored_share: float
) -> NDArray[np.float32]:
    """Segments (B, 80, 21, 3) centred, some mirrored, rotated by up to 30° and scaled by up to 10 %."""
    flip = rng.random(len(body_pos_m)) < mirrored_share
    body = np.where(flip[:, None, None, None], mirrored(body_pos_m), body_pos_m)
    body = rotated_about_y(centred(body), rng.uniform(-np.pi / 6, np.pi / 6, len(body)))
    return (body * rng.uniform(0.9, 1.1, (len(body), 1, 1, 1))).astype(np.float32)
