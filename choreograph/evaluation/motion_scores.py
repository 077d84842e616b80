"""Scores of one motion and its music: beats, physics and labels."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import ParameterError
from choreograph.evaluation.scores import Scores, split_chance
from choreograph.features.motion_beats import motion_beat_times_s
from choreograph.metrics import beat, labels, physical
from choreograph.motion.body import body_pos_m
from choreograph.motion.floor import sole_pos_m
from choreograph.motion.motion import Motion
from choreograph.timebase import STORE_FPS

Floats = NDArray[np.float64]

_CHANCE_ROUNDS = 100


def beat_scores(motion: Motion, music_beats_s: Floats, rng: np.random.Generator) -> Scores:
    """Beat metrics of a motion against music beats (Q,); beats after the end of the motion are left out.

    Raises `ParameterError` if beats do not increase or the rig's joint names are unknown.
    """
    motion = motion.resampled(STORE_FPS)
    pos_m = body_pos_m(motion)
    music = np.asarray(music_beats_s, np.float64)
    music = music[music <= motion.duration_s]
    motion_beats_s = motion_beat_times_s(pos_m, motion.fps)
    values = beat.evaluate(motion_beats_s, music) | beat.evaluate_published(pos_m, motion.fps, music)
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
    return Scores(values, chance)


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


def check_measurable(motion: Motion, name: str) -> None:
    """Raise `ParameterError` naming the dance if its rig has no body that can be measured."""
    try:
        body_pos_m(motion.sliced(0, 1))
    except ParameterError as error:
        raise ParameterError(f"{name}: {error}") from None
