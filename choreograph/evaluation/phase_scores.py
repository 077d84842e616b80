"""Where in the count dances come to rest, against the expert dances of their genre."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.evaluation.scores import Scores
from choreograph.metrics import count_phase
from choreograph.metrics.motion_beat_detectors import our_beats_s
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class DancedPhases:
    """The phases of a dance's motion beats within the song's beats."""

    genre: str
    song: str
    phases: Floats  # (Q,) 0 … 1


def danced_phases(motion: Motion, music_beats_s: Floats, genre: str, song: str) -> DancedPhases:
    """Phases of a motion's beats; `genre` and `song` are those of the song."""
    motion_beats_s = our_beats_s(body_pos_m(motion), motion.fps)
    return DancedPhases(genre, song, count_phase.phases(motion_beats_s, music_beats_s))


def phase_scores(dance: DancedPhases, experts: Sequence[DancedPhases], rng: np.random.Generator) -> Scores:
    """Distance of a dance's phases to the experts' of the same genre to other songs.

    Chance is as many uniformly random phases. Empty unless the genre has two such dances or more.
    """
    others = [e for e in experts if e.genre == dance.genre and e.song != dance.song and len(e.phases)]
    if len({e.song for e in others}) < 2 or len(dance.phases) == 0:
        return Scores({})
    scores = count_phase.evaluate(dance.phases, [e.phases for e in others], [e.song for e in others], rng)
    values = {name: scores[name] for name in ("phase_distance", "phase_nearness")}
    return Scores(
        {name: value for name, value in values.items() if np.isfinite(value)},
        {"phase_distance": scores["phase_distance_chance"]},
    )


def phases_by_genre(
    dances: Sequence[DancedPhases], experts: Sequence[DancedPhases], rng: np.random.Generator
) -> dict[str, dict[str, float]]:
    """`count_phase.evaluate` of all dances of a genre together against its experts, by genre.

    A single dance has few motion beats, so that much of its distance is chance. Genres without a dance or
    without experts' dances to two songs are left out.
    """
    found = {}
    for genre in sorted({dance.genre for dance in dances}):
        danced = np.concatenate([d.phases for d in dances if d.genre == genre])
        known = [e for e in experts if e.genre == genre and len(e.phases)]
        if len(danced) and len({e.song for e in known}) > 1:
            found[genre] = count_phase.evaluate(
                danced, [e.phases for e in known], [e.song for e in known], rng
            )
    return found
