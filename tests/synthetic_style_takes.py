"""Takes of music and motion whose style or tempo is known, for the style and density networks."""

from __future__ import annotations

import numpy as np

from choreograph.music.rhythm import PATTERN, RHYTHM_DIM, TEMPO
from choreograph.nets.style_training import StyleSong, StyleTake

_TEMPO_COLUMNS = {"a": 5, "b": 14, "c": 23}


def genre_song(genre: str, number: int, duration_s: int = 12) -> StyleSong:
    """Genres "a", "b" and "c" differ in their tempo and in where in the bar it sounds."""
    rng = np.random.default_rng([number, ord(genre)])
    column = _TEMPO_COLUMNS[genre]
    rhythm = rng.normal(0, 0.1, (2 * duration_s + 1, RHYTHM_DIM))
    rhythm[:, TEMPO.start + column] += 1.0
    rhythm[:, PATTERN.start + column :: 28] += 1.0
    mel = rng.normal(-4, 2, (60 * duration_s, 96)).astype(np.float32)
    return StyleSong(f"{genre}{number}", genre, mel, rhythm.astype(np.float32))


def genre_take(genre: str, number: int, duration_s: int = 12) -> StyleTake:
    """A take to a song of genre "a" or "b", which differ in how fast the arms swing, too."""
    song = genre_song(genre, number, duration_s)
    rng = np.random.default_rng([number, ord(genre), 1])
    rate_hz = {"a": 0.5, "b": 2.0}[genre]
    body = np.zeros((20 * duration_s, 21, 3), np.float32)
    body[..., 1] = 1.0
    body[:, 1, 0], body[:, 2, 0] = 0.1, -0.1  # hips
    swing = np.sin(2 * np.pi * rate_hz * np.arange(20 * duration_s) / 20 + rng.uniform(0, 6))
    body[:, 15:, 2] += 0.3 * swing[:, None]
    return StyleTake(
        song.name, genre, song.log_mel, song.rhythm, song_name=song.name, body_pos_m=body,
        motion_beat_times_s=np.arange(0.0, duration_s, 0.5 / rate_hz),
    )  # fmt: skip


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
    return StyleTake(
        name, "", mel, np.zeros((1, RHYTHM_DIM), np.float32), song_name=name,
        body_pos_m=body.astype(np.float32), motion_beat_times_s=beats,
    )  # fmt: skip
