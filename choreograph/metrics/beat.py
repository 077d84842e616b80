"""Beats: how motion beats and music beats meet.

Conventions: instants in seconds, increasing. Squared distances are in frames of 1/60 s, as the
paper's table reports them (ChoreoGraph, section 4.2.2); the F-score's window is ±70 ms, a beat of
one kind matched with at most one of the other. More motion beats alone raise scores that ask the music's
beats, and one motion beat well placed is perfect to those that ask the motion's: look at both directions,
and at `evaluate_chance`, the same with the dance turned round its song.

The field's "beat alignment" is the mean of exp(-d²/2σ²), d from each beat to the nearest of the other kind.
Papers share the name, and differ in all else; `PROTOCOLS` has what the public code of each does:

| | beats asked | σ | frames | motion beats: minima of joint speed |
| --- | --- | --- | --- | --- |
| FACT (AI Choreographer, AIST++) | motion's | 3 frames, 50 ms | 60 fps | lower than 10 frames either side |
| Bailando | music's | 3 frames, 50 ms | 60 fps | all, after a Gaussian of 5 frames (83 ms) |
| LODGE (and others at 30 fps) | music's | 3 frames, 100 ms | 30 fps | all, after 5 frames (167 ms) |

Bailando's code run at 30 fps, as LODGE's is, has twice the σ: its numbers are not Bailando's. A metronome of
random phase scores about 0.25 on a song of 120 BPM with 50 ms, and 0.48 with 100 ms. We do not round beats to
frames, which those do (half a frame at most).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.signal import argrelextrema

from choreograph.errors import ParameterError
from choreograph.motion.body import body_pos_at
from choreograph.timebase import frames_to_seconds

WINDOW_S = 0.07
PAPER_FPS = 60.0
FRAME_S = 1.0 / 30.0  # one frame of Rhythm is a Dancer

Times = NDArray[np.floating]


@dataclass(frozen=True)
class AlignmentProtocol:
    """How a paper's public code scores beat alignment."""

    asks: Literal["music", "motion"]  # whose beats the mean is over
    fps: float
    sigma_frames: float
    smoothing_frames: float  # Gaussian over the joints' speed; 0 for none
    order: int  # a motion beat is slower than so many frames to either side
    starts_still: bool = False  # the first frame counts as speed 0, and a step as its last frame's

    @property
    def sigma_s(self) -> float:
        """Standard deviation in seconds."""
        return self.sigma_frames / self.fps


PROTOCOLS = {
    "fact": AlignmentProtocol("motion", 60.0, 3.0, 0.0, 10, starts_still=True),
    "bailando": AlignmentProtocol("music", 60.0, 3.0, 5.0, 1),
    "lodge": AlignmentProtocol("music", 30.0, 3.0, 5.0, 1),
}


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
    return float(np.mean((_gaps_s(from_s, to_s) * PAPER_FPS) ** 2))


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
    return float(np.mean(_gaps_s(motion_beats_s, music_beats_s) <= window_s + 1e-9))


def beat_ratio(motion_beats_s: Times, music_beats_s: Times) -> float:
    """Motion beats per music beat (Rhythm is a Dancer, section 5.4.1); nan without music beats."""
    return len(motion_beats_s) / len(music_beats_s) if len(music_beats_s) else float("nan")


def alignment_score(motion_beats_s: Times, music_beats_s: Times, protocol: str = "bailando") -> float:
    """Mean exp(-d²/2σ²) as a paper's code has it, by the paper's name in `PROTOCOLS`, 0 … 1.

    For that paper's number take its motion beats too (`published_motion_beats_s`). 0 without motion beats;
    `nan` without music beats. Raises `ParameterError` if no such protocol is known.
    """
    known = _protocol(protocol)
    if len(music_beats_s) == 0:
        return float("nan")
    if len(motion_beats_s) == 0:
        return 0.0
    pair = (music_beats_s, motion_beats_s) if known.asks == "music" else (motion_beats_s, music_beats_s)
    return float(np.mean(np.exp(-0.5 * (_gaps_s(*pair) / known.sigma_s) ** 2)))


def published_motion_beats_s(body_pos_m: NDArray[np.floating], fps: float, protocol: str) -> Times:
    """Motion beats in seconds, (Q,), as a paper's code finds them in body positions (T, 21, 3).

    The papers have 24 joints where we have 21, and steps as slow as each other are no minimum. Our own
    motion beats, of `features.motion_beats`, are kept clear of tremor and independent of the rate.

    Raises `ParameterError` for unknown protocols and positions of another shape.
    """
    known = _protocol(protocol)
    pos = body_pos_at(body_pos_m, fps, known.fps)
    if len(pos) < 3:
        return np.zeros(0)
    speed = np.linalg.norm(np.diff(pos, axis=0), axis=-1).mean(axis=1)  # (T'-1,)
    if known.starts_still:
        speed = np.concatenate([[0.0], speed])
    if known.smoothing_frames > 0:
        speed = gaussian_filter1d(speed, known.smoothing_frames)
    return frames_to_seconds(argrelextrema(speed, np.less, order=known.order)[0], known.fps)


def evaluate(motion_beats_s: Times, music_beats_s: Times) -> dict[str, float]:
    """All beat metrics by name."""
    validate(motion_beats_s, music_beats_s)
    return {
        "f_score": f_score(motion_beats_s, music_beats_s),
        "motion_to_music": squared_distance(motion_beats_s, music_beats_s),
        "music_to_motion": squared_distance(music_beats_s, motion_beats_s),
        "aligned_share": aligned_share(motion_beats_s, music_beats_s),
        "beat_ratio": beat_ratio(motion_beats_s, music_beats_s),
    } | {f"alignment_{name}": alignment_score(motion_beats_s, music_beats_s, name) for name in PROTOCOLS}


def evaluate_published(
    body_pos_m: NDArray[np.floating],
    fps: float,
    music_beats_s: Times,
    *,
    rng: np.random.Generator | None = None,
    rounds: int = 200,
) -> dict[str, float]:
    """The papers' alignment scores by name, each with the motion beats that its own code finds.

    With `rng` each has its `chance_level` beside it, over the duration of the dance.
    """
    scores = {}
    for name in PROTOCOLS:
        motion_beats_s = published_motion_beats_s(body_pos_m, fps, name)
        validate(motion_beats_s, music_beats_s)
        score = partial(alignment_score, protocol=name)
        scores[f"alignment_{name}_published"] = score(motion_beats_s, music_beats_s)
        if rng is not None:
            scores[f"alignment_{name}_published_chance"] = chance_level(
                score, motion_beats_s, music_beats_s, duration_s=len(body_pos_m) / fps, rng=rng, rounds=rounds
            )
    return scores


def evaluate_chance(
    motion_beats_s: Times,
    music_beats_s: Times,
    *,
    duration_s: float,
    rng: np.random.Generator,
    rounds: int = 200,
) -> dict[str, float]:
    """All beat metrics by name, each the mean of the dance turned round the song: its `chance_level`."""
    validate(motion_beats_s, music_beats_s)
    turned = _turned(motion_beats_s, duration_s, rng, rounds)
    rows = [evaluate(beats, music_beats_s) for beats in turned]
    return {name: float(np.mean([row[name] for row in rows])) for name in rows[0]}


def chance_level(
    score: Callable[[Times, Times], float],
    motion_beats_s: Times,
    music_beats_s: Times,
    *,
    duration_s: float,
    rng: np.random.Generator,
    rounds: int = 200,
) -> float:
    """Mean of a score of motion and music beats with the motion's turned round the song by 1 s or more."""
    turned = _turned(motion_beats_s, duration_s, rng, rounds)
    return float(np.mean([score(beats, music_beats_s) for beats in turned]))


def chance_f_score(
    motion_beats_s: Times,
    music_beats_s: Times,
    *,
    duration_s: float,
    rng: np.random.Generator,
    rounds: int = 200,
) -> float:
    """The `chance_level` of `f_score`."""
    return chance_level(f_score, motion_beats_s, music_beats_s, duration_s=duration_s, rng=rng, rounds=rounds)


def _turned(motion_beats_s: Times, duration_s: float, rng: np.random.Generator, rounds: int) -> list[Times]:
    """The motion beats turned round the song by random amounts of 1 s or more, `rounds` times."""
    if not (np.isfinite(duration_s) and duration_s > 0) or rounds < 1:
        raise ParameterError(f"expected a duration and rounds above 0, got {duration_s} s and {rounds}")
    shifts_s = rng.uniform(1.0, max(1.0, duration_s - 1.0), rounds)
    return [np.unique((np.asarray(motion_beats_s) + shift) % duration_s) for shift in shifts_s]


def _gaps_s(from_s: Times, to_s: Times) -> NDArray[np.float64]:
    """Seconds from each beat to the nearest of the other kind, (Q,); both have one."""
    to_s = np.asarray(to_s, np.float64)
    after = np.searchsorted(to_s, from_s)
    sides = [to_s[np.clip(after + side, 0, len(to_s) - 1)] for side in (-1, 0)]
    return np.minimum(*(np.abs(np.asarray(from_s) - side) for side in sides))


def _protocol(name: str) -> AlignmentProtocol:
    if name not in PROTOCOLS:
        raise ParameterError(f"expected a protocol of {', '.join(PROTOCOLS)}, got {name!r}")
    return PROTOCOLS[name]
