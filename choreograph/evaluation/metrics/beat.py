"""Beat alignment: how well motion beats and music beats coincide.

Conventions: beat times in seconds, increasing. Squared distances are in frames of 1/60 s, as in the paper's
table (ChoreoGraph, section 4.2.2). The F-score is the beat tracking F-measure of MIR with its window of ±70
ms. Every beat is matched at most once. A mean over the music's beats rises with the number of motion beats
alone, and a mean over the motion's beats is perfect for a single beat in the right place. So compare both
directions, and `evaluate_chance`, which gives the same scores for motion beats shifted circularly in the
song.

The field's "beat alignment" is the mean of exp(-d²/2σ²), with d the distance from each beat to the nearest
one of the other kind. Papers share the name and differ in everything else. `ALIGNMENT_VARIANTS` holds what
the public code of each computes:

| | mean over | σ | rate | motion beats: minima of joint speed |
| --- | --- | --- | --- | --- |
| FACT (AI Choreographer, AIST++) | motion beats | 3 frames, 50 ms | 60 fps | lowest within ± 10 frames |
| Bailando | music beats | 3 frames, 50 ms | 60 fps | all, after a Gaussian of 5 frames (83 ms) |
| LODGE (and others at 30 fps) | music beats | 3 frames, 100 ms | 30 fps | all, after 5 frames (167 ms) |

Bailando's code run at 30 fps, as in LODGE, has twice the σ, so the two papers' numbers do not compare. A
metronome of random phase scores about 0.25 on a song of 120 BPM with σ = 50 ms, and 0.48 with 100 ms. The
published code rounds beats to frames, with an error of half a frame at most. We do not.

`DETECTORS` are five ways to find motion beats (Q,) in body positions (T, 21, 3) in metres at `fps`. Each
takes the minima of the mean joint speed at 60 fps. They differ in how it is smoothed:

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
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.signal import argrelextrema

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats, default_numerics
from choreograph.core.timebase import STORE_FPS, frames_to_seconds
from choreograph.motion.body import body_pos_at, checked_body_pos_m
from choreograph.motion.motion_beats import motion_beat_times_s

WINDOW_S = 0.07
PAPER_FPS = 60.0
FRAME_S = 1.0 / 30.0  # one frame of Rhythm is a Dancer

Times = NDArray[np.floating]


@dataclass(frozen=True)
class AlignmentVariant:
    """How a paper's public code computes beat alignment."""

    mean_over: Literal["music", "motion"]  # the beats that the mean is taken over
    fps: float
    sigma_frames: float
    smoothing_frames: float  # Gaussian over the joint speed, or 0 for none
    order: int  # a motion beat is slower than this many frames on either side
    starts_at_rest: bool = False  # speed 0 at the first frame, and each step counted at its last frame

    @property
    def sigma_s(self) -> float:
        """Standard deviation in seconds."""
        return self.sigma_frames / self.fps


ALIGNMENT_VARIANTS = {
    "fact": AlignmentVariant("motion", 60.0, 3.0, 0.0, 10, starts_at_rest=True),
    "bailando": AlignmentVariant("music", 60.0, 3.0, 5.0, 1),
    "lodge": AlignmentVariant("music", 30.0, 3.0, 5.0, 1),
}


def validate(motion_beats_s: Times, music_beats_s: Times) -> None:
    """Raise `ParameterError` unless both are finite, one-dimensional and increasing.

    Examples
    --------
    >>> beats_s = np.array([0.5, 1.0, 1.5])
    >>> cg.metrics.beat.validate(beats_s, beats_s)
    >>> cg.metrics.beat.validate(beats_s[::-1], beats_s)
    Traceback (most recent call last):
        ...
    choreograph.core.errors.ParameterError: expected increasing, finite motion beats (Q,), got shape (3,)
    """
    for name, beats in (("motion", motion_beats_s), ("music", music_beats_s)):
        beats = np.asarray(beats)
        if beats.ndim != 1 or not np.isfinite(beats).all() or (np.diff(beats) <= 0).any():
            raise ParameterError(f"expected increasing, finite {name} beats (Q,), got shape {beats.shape}")


def squared_distance(from_s: Times, to_s: Times) -> float:
    """Mean squared distance from each beat to the nearest one of the other kind, in (1/60 s)².

    ChoreoGraph, section 4.2.2. 0 is perfect. The result is nan if one side has no beats.

    Examples
    --------
    >>> music_s = np.array([0.5, 1.0, 1.5])
    >>> cg.metrics.beat.squared_distance(music_s, music_s)
    0.0
    >>> round(cg.metrics.beat.squared_distance(music_s + 3 / 60, music_s), 3)
    9.0
    """
    if len(from_s) == 0 or len(to_s) == 0:
        return float("nan")
    return float(np.mean((_gaps_s(from_s, to_s) * PAPER_FPS) ** 2))


def f_score(motion_beats_s: Times, music_beats_s: Times, *, window_s: float = WINDOW_S) -> float:
    """F-score of motion beats within `window_s` of music beats, 0 to 1. Higher is better.

    It is the harmonic mean of precision and recall, the shares of motion and of music beats that are matched.
    It equals `mir_eval.beat.f_measure` without trimming. Matching in time order gives the largest matching.

    Examples
    --------
    >>> music_s = np.array([0.5, 1.0, 1.5])
    >>> cg.metrics.beat.f_score(music_s, music_s), cg.metrics.beat.f_score(music_s + 0.25, music_s)
    (1.0, 0.0)
    >>> cg.metrics.beat.f_score(music_s[:1], music_s)
    0.5
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
    """Share of the motion beats within `window_s` of a music beat, 0 to 1. Higher is better.

    Rhythm is a Dancer, section 5.4.1, with one frame at 30 fps. The paper reports 0.647 for its dances and
    0.725 for real ones. A single motion beat in the right place scores 1, so compare `beat_ratio` as well.
    The result is nan without motion beats.

    Examples
    --------
    >>> music_s = np.array([0.5, 1.0, 1.5])
    >>> cg.metrics.beat.aligned_share(music_s, music_s)
    1.0
    >>> cg.metrics.beat.aligned_share(np.array([0.5, 0.8]), music_s)
    0.5
    """
    if len(motion_beats_s) == 0:
        return float("nan")
    if len(music_beats_s) == 0:
        return 0.0
    return float(np.mean(_gaps_s(motion_beats_s, music_beats_s) <= window_s + 1e-9))


def beat_ratio(motion_beats_s: Times, music_beats_s: Times) -> float:
    """Motion beats per music beat, 0 or more. Nearer to real dances is better. It is nan without music beats.

    Rhythm is a Dancer, section 5.4.1.

    Examples
    --------
    >>> music_s = np.arange(8) / 2
    >>> cg.metrics.beat.beat_ratio(music_s, music_s), cg.metrics.beat.beat_ratio(music_s[::2], music_s)
    (1.0, 0.5)
    """
    return len(motion_beats_s) / len(music_beats_s) if len(music_beats_s) else float("nan")


def alignment_score(motion_beats_s: Times, music_beats_s: Times, variant: str = "bailando") -> float:
    """Mean of exp(-d²/2σ²), 0 to 1, as the paper that `variant` names computes it. Higher is better.

    d is the distance from each beat to the nearest one of the other kind. `ALIGNMENT_VARIANTS` holds σ and
    the beats that the mean is taken over. To reproduce a paper's number, use its motion beats as well
    (`published_motion_beats_s`). The result is 0 without motion beats and nan without music beats. Raises
    `ParameterError` for an unknown variant.

    Examples
    --------
    >>> music_s = np.arange(8) / 2
    >>> cg.metrics.beat.alignment_score(music_s, music_s)
    1.0
    >>> late_s = music_s + 0.05  # one σ of FACT
    >>> round(cg.metrics.beat.alignment_score(late_s, music_s, "fact"), 3)
    0.607
    """
    known = _variant(variant)
    if len(music_beats_s) == 0:
        return float("nan")
    if len(motion_beats_s) == 0:
        return 0.0
    pair = (music_beats_s, motion_beats_s) if known.mean_over == "music" else (motion_beats_s, music_beats_s)
    return float(np.mean(np.exp(-0.5 * (_gaps_s(*pair) / known.sigma_s) ** 2)))


def published_motion_beats_s(body_pos_m: NDArray[np.floating], fps: float, variant: str) -> Times:
    """Motion beats in seconds, (Q,), as a paper's code detects them in body positions (T, 21, 3).

    The papers use 24 joints, we use 21. Equal neighbouring speeds are not a minimum. Our own motion beats
    (`motion.motion_beats`) ignore tremor and do not depend on the frame rate. Raises `ParameterError` for an
    unknown variant or positions of another shape.

    Examples
    --------
    >>> swing_m = np.cos(2 * np.pi * (np.arange(120) / 60 - 1 / 120))  # at rest twice a second
    >>> pos_m = np.tile(swing_m[:, None, None], (1, 21, 3))  # (T, 21, 3)
    >>> cg.metrics.beat.published_motion_beats_s(pos_m, 60.0, "bailando").round(1)
    array([0.5, 1. , 1.5])
    """
    known = _variant(variant)
    pos = body_pos_at(body_pos_m, fps, known.fps)
    if len(pos) < 3:
        return np.zeros(0)
    speed = np.linalg.norm(np.diff(pos, axis=0), axis=-1).mean(axis=1)  # (T'-1,)
    if known.starts_at_rest:
        speed = np.concatenate([[0.0], speed])
    if known.smoothing_frames > 0:
        speed = gaussian_filter1d(speed, known.smoothing_frames)
    return frames_to_seconds(argrelextrema(speed, np.less, order=known.order)[0], known.fps)


@default_numerics()
def evaluate(motion_beats_s: Times, music_beats_s: Times) -> dict[str, float]:
    """All beat metrics by name. Raises `ParameterError` as `validate` does.

    Examples
    --------
    >>> music_s = np.arange(8) / 2
    >>> scores = cg.metrics.beat.evaluate(music_s, music_s)
    >>> scores["f_score"], scores["motion_to_music"], scores["alignment_fact"]
    (1.0, 0.0, 1.0)
    """
    validate(motion_beats_s, music_beats_s)
    return {
        "f_score": f_score(motion_beats_s, music_beats_s),
        "motion_to_music": squared_distance(motion_beats_s, music_beats_s),
        "music_to_motion": squared_distance(music_beats_s, motion_beats_s),
        "aligned_share": aligned_share(motion_beats_s, music_beats_s),
        "beat_ratio": beat_ratio(motion_beats_s, music_beats_s),
    } | {
        f"alignment_{name}": alignment_score(motion_beats_s, music_beats_s, name)
        for name in ALIGNMENT_VARIANTS
    }


@default_numerics()
def evaluate_published(
    body_pos_m: NDArray[np.floating],
    fps: float,
    music_beats_s: Times,
    *,
    rng: np.random.Generator | None = None,
    rounds: int = 200,
) -> dict[str, float]:
    """The papers' alignment scores by name, each with the motion beats that the paper's code detects.

    With `rng`, the `chance_level` of each score over the duration of the dance is added as `…_chance`.

    Examples
    --------
    >>> swing_m = np.cos(2 * np.pi * (np.arange(240) / 60 - 1 / 120))  # at rest twice a second
    >>> pos_m = np.tile(swing_m[:, None, None], (1, 21, 3))  # (T, 21, 3)
    >>> scores = cg.metrics.beat.evaluate_published(pos_m, 60.0, np.arange(1, 8) / 2)
    >>> round(scores["alignment_bailando_published"], 2)
    1.0
    """
    scores = {}
    for name in ALIGNMENT_VARIANTS:
        motion_beats_s = published_motion_beats_s(body_pos_m, fps, name)
        validate(motion_beats_s, music_beats_s)
        score = partial(alignment_score, variant=name)
        scores[f"alignment_{name}_published"] = score(motion_beats_s, music_beats_s)
        if rng is not None:
            scores[f"alignment_{name}_published_chance"] = chance_level(
                score, motion_beats_s, music_beats_s, duration_s=len(body_pos_m) / fps, rng=rng, rounds=rounds
            )
    return scores


@default_numerics()
def evaluate_chance(
    motion_beats_s: Times,
    music_beats_s: Times,
    *,
    duration_s: float,
    rng: np.random.Generator,
    rounds: int = 200,
) -> dict[str, float]:
    """The `chance_level` of all beat metrics by name.

    Examples
    --------
    >>> music_s = np.arange(60) / 2
    >>> rng = np.random.default_rng(0)
    >>> chance = cg.metrics.beat.evaluate_chance(music_s, music_s, duration_s=30.0, rng=rng)
    >>> chance["f_score"] < 0.4 and chance["motion_to_music"] > 0
    True
    """
    validate(motion_beats_s, music_beats_s)
    shifted = _shifted(motion_beats_s, duration_s, rng, rounds)
    rows = [evaluate(beats, music_beats_s) for beats in shifted]
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
    """Mean score after circular shifts of the motion beats by 1 s or more.

    Examples
    --------
    >>> music_s = np.arange(60) / 2  # ± 70 ms are 28 % of 0.5 s
    >>> share, rng = cg.metrics.beat.f_score, np.random.default_rng(0)
    >>> level = cg.metrics.beat.chance_level(share, music_s, music_s, duration_s=30.0, rng=rng, rounds=1000)
    >>> 0.25 < level < 0.31
    True
    """
    shifted = _shifted(motion_beats_s, duration_s, rng, rounds)
    return float(np.mean([score(beats, music_beats_s) for beats in shifted]))


def _shifted(motion_beats_s: Times, duration_s: float, rng: np.random.Generator, rounds: int) -> list[Times]:
    """The motion beats after `rounds` random circular shifts of 1 s or more."""
    if not (np.isfinite(duration_s) and duration_s > 0) or rounds < 1:
        raise ParameterError(f"expected a duration and rounds above 0, got {duration_s} s and {rounds}")
    shifts_s = rng.uniform(1.0, max(1.0, duration_s - 1.0), rounds)
    return [np.unique((np.asarray(motion_beats_s) + shift) % duration_s) for shift in shifts_s]


def _gaps_s(from_s: Times, to_s: Times) -> NDArray[np.float64]:
    """Seconds from each beat to the nearest of the other kind, (Q,). Neither may be empty."""
    to_s = np.asarray(to_s, np.float64)
    after = np.searchsorted(to_s, from_s)
    sides = [to_s[np.clip(after + side, 0, len(to_s) - 1)] for side in (-1, 0)]
    return np.minimum(*(np.abs(np.asarray(from_s) - side) for side in sides))


def _variant(name: str) -> AlignmentVariant:
    if name not in ALIGNMENT_VARIANTS:
        raise ParameterError(f"expected a variant among {', '.join(ALIGNMENT_VARIANTS)}, got {name!r}")
    return ALIGNMENT_VARIANTS[name]


# Five motion-beat detectors, and the F-score by each of them.


SAVITZKY_GOLAY_S = 0.35
_SAVITZKY_GOLAY_ORDER = 3


def our_beats_s(body_pos_m: Floats, fps: float) -> Floats:
    """Motion beats (Q,) by `motion.motion_beats` at 60 fps.

    Examples
    --------
    >>> swing_m = np.cos(2 * np.pi * (np.arange(120) / 60 - 1 / 120))  # at rest twice a second
    >>> pos_m = np.tile(swing_m[:, None, None], (1, 21, 3))  # (T, 21, 3)
    >>> cg.metrics.beat.our_beats_s(pos_m, 60.0).round(1)
    array([0.5, 1. , 1.5])
    """
    return motion_beat_times_s(body_pos_at(body_pos_m, fps, STORE_FPS), STORE_FPS)


def aist_beats_s(body_pos_m: Floats, fps: float) -> Floats:
    """Motion beats (Q,) as AIST++'s public code detects them.

    Examples
    --------
    >>> swing_m = np.cos(2 * np.pi * (np.arange(120) / 60 - 1 / 120))  # at rest twice a second
    >>> pos_m = np.tile(swing_m[:, None, None], (1, 21, 3))  # (T, 21, 3)
    >>> cg.metrics.beat.aist_beats_s(pos_m, 60.0).round(1)
    array([0.5, 1. , 1.5])
    """
    return np.asarray(published_motion_beats_s(body_pos_m, fps, "fact"), np.float64)


def gaussian_beats_s(body_pos_m: Floats, fps: float, *, sigma_s: float) -> Floats:
    """Minima (Q,) of the joint speed after a Gaussian of that standard deviation.

    Examples
    --------
    >>> swing_m = np.cos(2 * np.pi * (np.arange(120) / 60 - 1 / 120))  # at rest twice a second
    >>> pos_m = np.tile(swing_m[:, None, None], (1, 21, 3))  # (T, 21, 3)
    >>> cg.metrics.beat.gaussian_beats_s(pos_m, 60.0, sigma_s=0.05).round(1)
    array([0.5, 1. , 1.5])
    """
    return _minima_s(gaussian_filter1d(_speed(body_pos_m, fps), sigma_s * STORE_FPS))


def savitzky_golay_beats_s(body_pos_m: Floats, fps: float, *, window_s: float = SAVITZKY_GOLAY_S) -> Floats:
    """Kinematic beats (Q,) of Rhythm is a Dancer, section 5.2.1: minima of the joint speed after its filter.

    Examples
    --------
    >>> swing_m = np.cos(2 * np.pi * (np.arange(120) / 60 - 1 / 120))  # at rest twice a second
    >>> pos_m = np.tile(swing_m[:, None, None], (1, 21, 3))  # (T, 21, 3)
    >>> cg.metrics.beat.savitzky_golay_beats_s(pos_m, 60.0).round(1)
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


def validate_motion(body_pos_m: Floats, fps: float, music_beats_s: Floats) -> None:
    """Raise `ParameterError` unless positions (T, 21, 3), rate and beats (Q,) are finite and valid.

    Examples
    --------
    >>> cg.metrics.beat.validate_motion(np.zeros((60, 21, 3)), 60.0, np.array([0.5]))
    >>> cg.metrics.beat.validate_motion(np.zeros((60, 21, 3)), 60.0, np.array([np.nan]))
    Traceback (most recent call last):
        ...
    choreograph.core.errors.ParameterError: expected increasing, finite music beats (Q,), got shape (1,)
    """
    checked_body_pos_m(body_pos_m, fps)
    validate(np.zeros(0), music_beats_s)


def beats_by_detector(body_pos_m: Floats, fps: float) -> dict[str, Floats]:
    """Motion beats (Q,) in seconds by every detector.

    Examples
    --------
    >>> list(cg.metrics.beat.beats_by_detector(np.zeros((60, 21, 3)), 60.0))
    ['ours', 'aist', 'gaussian_50_ms', 'savitzky_golay', 'gaussian_100_ms']
    """
    return {name: detect(body_pos_m, fps) for name, detect in DETECTORS.items()}


@default_numerics()
def evaluate_detectors(body_pos_m: Floats, fps: float, music_beats_s: Floats) -> dict[str, float]:
    """The F-score at 70 ms by every detector, as `f_score_…`, and their mean, 0 to 1.

    Compare with real dances to the same music, not with 1.

    Examples
    --------
    >>> swing_m = np.cos(2 * np.pi * (np.arange(120) / 60 - 1 / 120))  # at rest twice a second
    >>> pos_m = np.tile(swing_m[:, None, None], (1, 21, 3))  # (T, 21, 3)
    >>> scores = cg.metrics.beat.evaluate_detectors(pos_m, 60.0, np.array([0.5, 1.0, 1.5]))
    >>> scores["f_score_mean"]
    1.0
    """
    validate_motion(body_pos_m, fps, music_beats_s)
    return detector_scores(beats_by_detector(body_pos_m, fps), music_beats_s)


def detector_scores(motion_beats_s: Mapping[str, Floats], music_beats_s: Floats) -> dict[str, float]:
    """The F-scores of motion beats by detector, from `beats_by_detector`, and their mean.

    Examples
    --------
    >>> beats_s = {"ours": np.array([0.5, 1.0]), "aist": np.array([0.7, 1.2])}
    >>> cg.metrics.beat.detector_scores(beats_s, np.array([0.5, 1.0]))
    {'f_score_ours': 1.0, 'f_score_aist': 0.0, 'f_score_mean': 0.5}
    """
    scores = {f"f_score_{name}": f_score(beats, music_beats_s) for name, beats in motion_beats_s.items()}
    return {**scores, "f_score_mean": float(np.mean(list(scores.values())))}


@default_numerics()
def evaluate_detectors_chance(
    motion_beats_s: Mapping[str, Floats],
    music_beats_s: Floats,
    *,
    duration_s: float,
    rng: np.random.Generator,
    rounds: int = 100,
) -> dict[str, float]:
    """The `chance_level` of the F-score of every detector, and their mean.

    Examples
    --------
    >>> music_s, rng = np.arange(60) / 2, np.random.default_rng(0)
    >>> chance = cg.metrics.beat.evaluate_detectors_chance(
    ...     {"ours": music_s}, music_s, duration_s=30.0, rng=rng
    ... )
    >>> chance["f_score_mean"] < 0.4
    True
    """
    levels = {
        f"f_score_{name}": chance_level(
            f_score, beats, music_beats_s, duration_s=duration_s, rng=rng, rounds=rounds
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
