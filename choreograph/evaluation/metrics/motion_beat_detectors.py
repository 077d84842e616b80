"""Five motion-beat detectors, and the F-score by each of them.

Conventions: body positions (T, 21, 3) are in metres at `fps`, and motion beats (Q,) in seconds, increasing.
Each detector takes the minima of the mean joint speed at 60 fps. They differ in how it is smoothed:

| detector | smoothing | minima |
| --- | --- | --- |
| `ours` | positions, Gaussian of 0.03 s | deeper than tremor, 0.1 s apart (`motion.motion_beats`) |
| `aist` | none, as AIST++'s code has it | lowest within ± 10 frames |
| `gaussian_50_ms` | Gaussian of 0.05 s | all |
| `savitzky_golay` | cubic over 0.35 s, as Rhythm is a Dancer's kinematic beats | all |
| `gaussian_100_ms` | Gaussian of 0.1 s | all |

The search of the engine uses `ours`, so it may fit that detector more than the dance. Use the mean of all
five, `f_score_mean`, and compare it with dancers who are on the count, who score little above chance. Rhythm
is a Dancer (5.2.1) does not state the length of its filter, nor its order.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np
from scipy.ndimage import gaussian_filter1d

from choreograph.core.numerics import Floats, default_numerics
from choreograph.core.timebase import STORE_FPS, frames_to_seconds
from choreograph.evaluation.metrics import beat
from choreograph.motion.body import body_pos_at, checked_body_pos_m
from choreograph.motion.motion_beats import motion_beat_times_s

SAVITZKY_GOLAY_S = 0.35
_SAVITZKY_GOLAY_ORDER = 3


def our_beats_s(body_pos_m: Floats, fps: float) -> Floats:
    """Motion beats (Q,) by `motion.motion_beats` at 60 fps.

    Examples
    --------
    >>> swing_m = np.cos(2 * np.pi * (np.arange(120) / 60 - 1 / 120))  # at rest twice a second
    >>> pos_m = np.tile(swing_m[:, None, None], (1, 21, 3))  # (T, 21, 3)
    >>> cg.metrics.motion_beat_detectors.our_beats_s(pos_m, 60.0).round(1)
    array([0.5, 1. , 1.5])
    """
    return motion_beat_times_s(body_pos_at(body_pos_m, fps, STORE_FPS), STORE_FPS)


def aist_beats_s(body_pos_m: Floats, fps: float) -> Floats:
    """Motion beats (Q,) as AIST++'s public code detects them.

    Examples
    --------
    >>> swing_m = np.cos(2 * np.pi * (np.arange(120) / 60 - 1 / 120))  # at rest twice a second
    >>> pos_m = np.tile(swing_m[:, None, None], (1, 21, 3))  # (T, 21, 3)
    >>> cg.metrics.motion_beat_detectors.aist_beats_s(pos_m, 60.0).round(1)
    array([0.5, 1. , 1.5])
    """
    return np.asarray(beat.published_motion_beats_s(body_pos_m, fps, "fact"), np.float64)


def gaussian_beats_s(body_pos_m: Floats, fps: float, *, sigma_s: float) -> Floats:
    """Minima (Q,) of the joint speed after a Gaussian of that standard deviation.

    Examples
    --------
    >>> swing_m = np.cos(2 * np.pi * (np.arange(120) / 60 - 1 / 120))  # at rest twice a second
    >>> pos_m = np.tile(swing_m[:, None, None], (1, 21, 3))  # (T, 21, 3)
    >>> cg.metrics.motion_beat_detectors.gaussian_beats_s(pos_m, 60.0, sigma_s=0.05).round(1)
    array([0.5, 1. , 1.5])
    """
    return _minima_s(gaussian_filter1d(_speed(body_pos_m, fps), sigma_s * STORE_FPS))


def savitzky_golay_beats_s(body_pos_m: Floats, fps: float, *, window_s: float = SAVITZKY_GOLAY_S) -> Floats:
    """Kinematic beats (Q,) of Rhythm is a Dancer, section 5.2.1: minima of the joint speed after its filter.

    Examples
    --------
    >>> swing_m = np.cos(2 * np.pi * (np.arange(120) / 60 - 1 / 120))  # at rest twice a second
    >>> pos_m = np.tile(swing_m[:, None, None], (1, 21, 3))  # (T, 21, 3)
    >>> cg.metrics.motion_beat_detectors.savitzky_golay_beats_s(pos_m, 60.0).round(1)
    array([0.5, 1. , 1.5])
    """
    from scipy.signal import savgol_filter  # half a second to import

    speed = _speed(body_pos_m, fps)
    frames = 2 * round(window_s * STORE_FPS / 2) + 1
    if len(speed) < frames:
        return np.zeros(0)
    return _minima_s(savgol_filter(speed, frames, _SAVITZKY_GOLAY_ORDER))


DETECTORS: Mapping[str, Callable[[Floats, float], Floats]] = {
    "ours": our_beats_s,
    "aist": aist_beats_s,
    "gaussian_50_ms": partial(gaussian_beats_s, sigma_s=0.05),
    "savitzky_golay": savitzky_golay_beats_s,
    "gaussian_100_ms": partial(gaussian_beats_s, sigma_s=0.1),
}


def validate(body_pos_m: Floats, fps: float, music_beats_s: Floats) -> None:
    """Raise `ParameterError` unless positions (T, 21, 3), rate and beats (Q,) are finite and valid.

    Examples
    --------
    >>> cg.metrics.motion_beat_detectors.validate(np.zeros((60, 21, 3)), 60.0, np.array([0.5]))
    >>> cg.metrics.motion_beat_detectors.validate(np.zeros((60, 21, 3)), 60.0, np.array([np.nan]))
    Traceback (most recent call last):
        ...
    choreograph.core.errors.ParameterError: expected increasing, finite music beats (Q,), got shape (1,)
    """
    checked_body_pos_m(body_pos_m, fps)
    beat.validate(np.zeros(0), music_beats_s)


def beats_by_detector(body_pos_m: Floats, fps: float) -> dict[str, Floats]:
    """Motion beats (Q,) in seconds by every detector.

    Examples
    --------
    >>> list(cg.metrics.motion_beat_detectors.beats_by_detector(np.zeros((60, 21, 3)), 60.0))
    ['ours', 'aist', 'gaussian_50_ms', 'savitzky_golay', 'gaussian_100_ms']
    """
    return {name: detect(body_pos_m, fps) for name, detect in DETECTORS.items()}


@default_numerics()
def evaluate(body_pos_m: Floats, fps: float, music_beats_s: Floats) -> dict[str, float]:
    """The F-score at 70 ms by every detector, as `f_score_…`, and their mean, 0 to 1.

    Compare with real dances to the same music, not with 1.

    Examples
    --------
    >>> swing_m = np.cos(2 * np.pi * (np.arange(120) / 60 - 1 / 120))  # at rest twice a second
    >>> pos_m = np.tile(swing_m[:, None, None], (1, 21, 3))  # (T, 21, 3)
    >>> scores = cg.metrics.motion_beat_detectors.evaluate(pos_m, 60.0, np.array([0.5, 1.0, 1.5]))
    >>> scores["f_score_mean"]
    1.0
    """
    validate(body_pos_m, fps, music_beats_s)
    return scores_of(beats_by_detector(body_pos_m, fps), music_beats_s)


def scores_of(motion_beats_s: Mapping[str, Floats], music_beats_s: Floats) -> dict[str, float]:
    """The F-scores of motion beats by detector, from `beats_by_detector`, and their mean.

    Examples
    --------
    >>> beats_s = {"ours": np.array([0.5, 1.0]), "aist": np.array([0.7, 1.2])}
    >>> cg.metrics.motion_beat_detectors.scores_of(beats_s, np.array([0.5, 1.0]))
    {'f_score_ours': 1.0, 'f_score_aist': 0.0, 'f_score_mean': 0.5}
    """
    scores = {f"f_score_{name}": beat.f_score(beats, music_beats_s) for name, beats in motion_beats_s.items()}
    return {**scores, "f_score_mean": float(np.mean(list(scores.values())))}


@default_numerics()
def evaluate_chance(
    motion_beats_s: Mapping[str, Floats],
    music_beats_s: Floats,
    *,
    duration_s: float,
    rng: np.random.Generator,
    rounds: int = 100,
) -> dict[str, float]:
    """The `beat.chance_level` of the F-score of every detector, and their mean.

    Examples
    --------
    >>> music_s, rng = np.arange(60) / 2, np.random.default_rng(0)
    >>> chance = cg.metrics.motion_beat_detectors.evaluate_chance(
    ...     {"ours": music_s}, music_s, duration_s=30.0, rng=rng
    ... )
    >>> chance["f_score_mean"] < 0.4
    True
    """
    levels = {
        f"f_score_{name}": beat.chance_level(
            beat.f_score, beats, music_beats_s, duration_s=duration_s, rng=rng, rounds=rounds
        )
        for name, beats in motion_beats_s.items()
    }
    return {**levels, "f_score_mean": float(np.mean(list(levels.values())))}


def _speed(body_pos_m: Floats, fps: float) -> Floats:
    """Mean joint speed between frames in m/s, (T' - 1,) at 60 fps."""
    pos = body_pos_at(body_pos_m, fps, STORE_FPS)
    result: Floats = np.linalg.norm(np.diff(pos, axis=0), axis=-1).mean(axis=1) * STORE_FPS
    return result


def _minima_s(speed: Floats) -> Floats:
    """Times of all local minima (Q,). The speed between frames i and i + 1 is at i + ½."""
    frames = np.flatnonzero((speed[1:-1] < speed[:-2]) & (speed[1:-1] <= speed[2:])) + 1
    return frames_to_seconds(frames + 0.5, STORE_FPS)
