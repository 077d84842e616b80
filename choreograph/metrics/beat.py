"""Beats: how motion beats and music beats meet.

Conventions: instants in seconds, increasing. Squared distances are in frames of 1/60 s, as the
paper's table reports them (ChoreoGraph, section 4.2.2); the F-score's window is ±70 ms, a beat of
one kind matched with at most one of the other. More motion beats alone raise precision-only scores,
so look at both directions, and at `chance_f_score`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import ParameterError

WINDOW_S = 0.07
PAPER_FPS = 60.0
FRAME_S = 1.0 / 30.0  # one frame of Rhythm is a Dancer

Times = NDArray[np.floating]


def validate(motion_beats_s: Times, music_beats_s: Times) -> None:
    """Raise `ParameterError` unless both are finite, one-dimensional and increasing."""
    for name, beats in (("motion", motion_beats_s), ("music", music_beats_s)):
        beats = np.asarray(beats)
        if beats.ndim != 1 or not np.isfinite(beats).all() or (np.diff(beats) <= 0).any():
            raise ParameterError(f"expected increasing, finite {name} beats (Q,), got shape {beats.shape}")


def squared_distance(from_s: Times, to_s: Times) -> float:
    """Mean squared distance from each beat to the nearest of the other kind, (1/60 s)²; nan if none."""
    if len(from_s) == 0 or len(to_s) == 0:
        return float("nan")
    after = np.searchsorted(to_s, from_s)
    sides = [np.asarray(to_s)[np.clip(after + side, 0, len(to_s) - 1)] for side in (-1, 0)]
    gap = np.minimum(*(np.abs(np.asarray(from_s) - side) for side in sides))
    return float(np.mean((gap * PAPER_FPS) ** 2))


def f_score(motion_beats_s: Times, music_beats_s: Times, *, window_s: float = WINDOW_S) -> float:
    """Harmonic mean of the shares of motion and of music beats that are matched, 0 … 1.

    Beats in order of time are matched greedily, which is the largest matching for one window.
    """
    i = j = hits = 0
    while i < len(motion_beats_s) and j < len(music_beats_s):
        gap = motion_beats_s[i] - music_beats_s[j]
        if abs(gap) <= window_s:
            hits += 1
        i += gap <= window_s
        j += gap >= -window_s
    total = len(motion_beats_s) + len(music_beats_s)
    return 2.0 * hits / total if total else 0.0


def aligned_share(motion_beats_s: Times, music_beats_s: Times, *, window_s: float = FRAME_S) -> float:
    """Share of the motion beats that lie within one frame of a music beat, 0 … 1; nan without motion beats.

    Rhythm is a Dancer, section 5.4.1: 64.7 % of its dances' beats, 72.5 % of real ones (its data). Standing
    still but for one beat is perfect, so look at `beat_ratio` beside it.
    """
    if len(motion_beats_s) == 0:
        return float("nan")
    if len(music_beats_s) == 0:
        return 0.0
    gaps = np.abs(np.asarray(motion_beats_s)[:, None] - np.asarray(music_beats_s))  # (Q, Q')
    return float(np.mean(gaps.min(axis=1) <= window_s + 1e-9))


def beat_ratio(motion_beats_s: Times, music_beats_s: Times) -> float:
    """Motion beats per music beat (Rhythm is a Dancer, section 5.4.1); nan without music beats."""
    return len(motion_beats_s) / len(music_beats_s) if len(music_beats_s) else float("nan")


def chance_f_score(
    motion_beats_s: Times,
    music_beats_s: Times,
    *,
    duration_s: float,
    rng: np.random.Generator,
    rounds: int = 200,
) -> float:
    """Mean F-score with the motion beats turned round the song by random amounts of 1 s or more."""
    shifts = rng.uniform(1.0, max(1.0, duration_s - 1.0), rounds)
    scores = [f_score(np.sort((motion_beats_s + s) % duration_s), music_beats_s) for s in shifts]
    return float(np.mean(scores))


def evaluate(motion_beats_s: Times, music_beats_s: Times) -> dict[str, float]:
    """All beat metrics by name."""
    validate(motion_beats_s, music_beats_s)
    return {
        "f_score": f_score(motion_beats_s, music_beats_s),
        "motion_to_music": squared_distance(motion_beats_s, music_beats_s),
        "music_to_motion": squared_distance(music_beats_s, motion_beats_s),
        "aligned_share": aligned_share(motion_beats_s, music_beats_s),
        "beat_ratio": beat_ratio(motion_beats_s, music_beats_s),
    }
