"""Augmentation of the style networks' samples: other recordings of a song, other bodies of a dance."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.features.onsets import N_BANDS
from choreograph.features.rhythm import LOUDNESS, METRE, ONSETS, PATTERN, TEMPO
from choreograph.motion.body import mirrored
from choreograph.nets.style.model import centred, rotated_about_y

_NEPER_PER_DB = np.log(10.0) / 10.0  # natural logarithm of power in one decibel
_P_HIDDEN = 0.15  # of tempo and metre, and of patterns


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
    """Rhythm (B, RHYTHM_DIM) up to 7 % faster or slower, with other instruments, and now and then in part.

    Tempo and metre or the patterns are sometimes hidden, as where there are no beats: what is left has to do.
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
    """Rows (B, N) moved by fractional columns (B,); the ends are repeated."""
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
