"""Scores of one motion and its music: beats, counts, endings, physics and labels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from choreograph.counts import Counts
from choreograph.errors import ParameterError
from choreograph.evaluation.scores import Scores, split_chance
from choreograph.metrics import (
    beat,
    counts,
    endings,
    energy_response,
    labels,
    motion_beat_detectors,
    physical,
)
from choreograph.motion.body import body_pos_m
from choreograph.motion.floor import sole_pos_m
from choreograph.motion.motion import Motion
from choreograph.timebase import STORE_FPS

Floats = NDArray[np.float64]

_CHANCE_ROUNDS = 100
_OF_KINEMATIC_BEATS = {"aligned_share": beat.aligned_share, "beat_ratio": beat.beat_ratio}


def beat_scores(motion: Motion, music_beats_s: Floats, rng: np.random.Generator) -> Scores:
    """Beat metrics of a motion against music beats (Q,); beats after the end of the motion are left out.

    Positions go to the detectors at the motion's own rate, and are resampled there by splines: rotations
    interpolated between frames repeat each speed, and two equal speeds are no minimum to some detectors.

    Raises `ParameterError` if beats do not increase or the rig's joint names are unknown.
    """
    pos_m = body_pos_m(motion)
    music = np.asarray(music_beats_s, np.float64)
    music = music[music <= motion.duration_s]
    by_detector = motion_beat_detectors.beats_by_detector(pos_m, motion.fps)
    motion_beats_s, kinematic_s = by_detector["ours"], by_detector["savitzky_golay"]
    values = beat.evaluate(motion_beats_s, music) | beat.evaluate_published(pos_m, motion.fps, music)
    values |= _by_detector(motion_beat_detectors.scores_of(by_detector, music))
    values |= {f"{name}_published": score(kinematic_s, music) for name, score in _OF_KINEMATIC_BEATS.items()}
    if len(motion_beats_s) == 0 or len(music) == 0:
        return Scores(values)
    duration_s, rounds = motion.duration_s, _CHANCE_ROUNDS
    chance = beat.evaluate_chance(motion_beats_s, music, duration_s=duration_s, rng=rng, rounds=rounds)
    for name in beat.ALIGNMENT_VARIANTS:
        score = partial(beat.alignment_score, variant=name)
        published_s = beat.published_motion_beats_s(pos_m, motion.fps, name)
        chance[f"alignment_{name}_published"] = beat.chance_level(
            score, published_s, music, duration_s=duration_s, rng=rng, rounds=rounds
        )
    chance |= _by_detector(
        motion_beat_detectors.evaluate_chance(
            by_detector, music, duration_s=duration_s, rng=rng, rounds=rounds
        )
    )
    if len(kinematic_s):
        chance["aligned_share_published"] = beat.chance_level(
            beat.aligned_share, kinematic_s, music, duration_s=duration_s, rng=rng, rounds=rounds
        )
    return Scores(values, chance)


def second_opinion_scores(motion: Motion, danced: Counts, music_beats_s: Floats) -> Scores:
    """F-score of all detectors and the share of counts on beats, by the beats (Q,) of a second tracker."""
    music = np.asarray(music_beats_s, np.float64)
    music = music[music <= motion.duration_s]
    by_detector = motion_beat_detectors.beats_by_detector(body_pos_m(motion), motion.fps)
    scores = {"f_score_mean_second": motion_beat_detectors.scores_of(by_detector, music)["f_score_mean"]}
    if len(danced) and len(music) > 1:
        scores["counts_within_second"] = counts.counts_within(danced.times_s, music)
    return Scores(scores)


def count_scores(danced: Counts, music: Counts, duration_s: float, rng: np.random.Generator) -> Scores:
    """A dance's counts against the song's beats; what is not known (counts, bars) is left out."""
    if len(danced) == 0 or len(music) < 2:
        return Scores({})
    pair = (danced.times_s, danced.numbers, music.times_s, music.numbers)
    values = counts.evaluate(*pair)
    chance = counts.evaluate_chance(*pair, duration_s=duration_s, rng=rng, rounds=_CHANCE_ROUNDS)
    known = {name: value for name, value in values.items() if np.isfinite(value)}
    return Scores(known, {name: level for name, level in chance.items() if name in known})


def ending_scores(motion: Motion, music: Counts) -> Scores:
    """Speed at both ends, and the delay of the last pose after the song's last downbeat, or its last beat."""
    strong_s = music.downbeat_times_s if music.has_bars else music.times_s
    strong_s = strong_s[strong_s <= motion.duration_s]
    last_strong_s = float(strong_s[-1]) if len(strong_s) else None
    values = endings.evaluate(body_pos_m(motion), motion.fps, last_strong_s)
    return Scores({name: value for name, value in values.items() if np.isfinite(value)})


def energy_scores(
    motion: Motion, danced_s: tuple[float, float], section_bounds_s: Floats, loudness_db: Floats
) -> Scores:
    """Motion size against loudness (S,) over a song's sections; empty for songs that do not tell."""
    given = (body_pos_m(motion), motion.fps, danced_s, section_bounds_s, loudness_db)
    values = energy_response.evaluate(*given)
    known = {name: value for name, value in values.items() if np.isfinite(value)}
    chance = energy_response.evaluate_chance(*given, rounds=_CHANCE_ROUNDS) if known else {}
    return Scores(known, {name: level for name, level in chance.items() if name in known})


def physical_scores(motion: Motion, boundary_times_s: Sequence[float] | Floats = ()) -> Scores:
    """Feet, floor, jerk, jumps, bones; speed and jerk at transitions if `boundary_times_s` are given."""
    # Jumps at the motion's own rate, since resampling it by slerp makes corners.
    jumps_per_minute = physical.jumps_per_minute(body_pos_m(motion), motion.fps)
    motion = motion.resampled(STORE_FPS)
    values = physical.evaluate(
        body_pos_m(motion), motion.fps, boundary_times_s, sole_pos_m=sole_pos_m(motion)
    )
    return Scores(values | {"jumps_per_minute": jumps_per_minute})


def dance_label_values(motion: Motion) -> Floats:
    """The four dance labels of each window of 4 s in their own units, (N, 4)."""
    return labels.dance_values(body_pos_m(motion), motion.fps, labels.window_starts_s(motion.duration_s))


def label_scores(scale: labels.LabelScale, dance_values: Floats, music_values: Floats) -> Scores:
    """Label distances over the windows that dance and music share; empty if there are none."""
    n = min(len(dance_values), len(music_values))
    if n == 0:
        return Scores({})
    return split_chance(
        labels.evaluate(scale.dance_labels(dance_values[:n]), scale.music_labels(music_values[:n]))
    )


def _by_detector(scores: Mapping[str, float]) -> dict[str, float]:
    """The F-scores by detector, without that of ours, which is `f_score`."""
    return {name: score for name, score in scores.items() if name != "f_score_ours"}


def check_measurable(motion: Motion, name: str) -> None:
    """Raise `ParameterError` naming the dance if its rig has no body that can be measured."""
    try:
        body_pos_m(motion.sliced(0, 1))
    except ParameterError as error:
        raise ParameterError(f"{name}: {error}") from None
