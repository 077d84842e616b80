"""Takes of music and motion whose style or tempo is known, for the style and density networks."""

from __future__ import annotations

import numpy as np

from choreograph.features.tempogram import RHYTHM_DIM
from choreograph.nets.style.data import StyleTake


def genre_take(genre: str, number: int, duration_s: int = 12) -> StyleTake:
    """Genres "a" and "b" differ in the lag at which their rhythm repeats and in how fast the arms swing."""
    rng = np.random.default_rng([number, ord(genre)])
    rate_hz, lag = {"a": (0.5, 20), "b": (2.0, 45)}[genre]
    rhythm = rng.normal(0, 0.1, (2 * duration_s + 1, 3, RHYTHM_DIM // 3))
    rhythm[:, :, lag - 3 : lag + 4] += 1.0
    body = np.zeros((20 * duration_s, 21, 3), np.float32)
    body[..., 1] = 1.0
    body[:, 1, 0], body[:, 2, 0] = 0.1, -0.1  # hips
    swing = np.sin(2 * np.pi * rate_hz * np.arange(20 * duration_s) / 20 + rng.uniform(0, 6))
    body[:, 15:, 2] += 0.3 * swing[:, None]
    return StyleTake(
        f"{genre}{number}",
        f"{genre}{number}",
        genre,
        rng.normal(-4, 2, (60 * duration_s, 96)).astype(np.float32),
        rhythm.reshape(len(rhythm), -1).astype(np.float32),
        body,
        np.arange(0.0, duration_s, 0.5 / rate_hz),
    )


def click_take(name: str = "a", duration_s: int = 12, seed: int = 0) -> StyleTake:
    """A body that swings irregularly to a click every 0.5 s."""
    rng = np.random.default_rng(seed)
    n_frames = duration_s * 20
    phase = np.cumsum(rng.uniform(0.1, 0.3, n_frames))
    reach = rng.normal(size=(21, 3)) * 0.3
    body = np.sin(phase)[:, None, None] * reach + rng.normal(size=(21, 3))
    mel = np.full((duration_s * 60, 96), -10.0, np.float32)
    mel[::30] = 0.0
    beats = np.arange(0.6, duration_s - 0.5, 0.5)
    return StyleTake(name, name, "", mel, np.zeros((1, 1), np.float32), body.astype(np.float32), beats)
