"""The results of an evaluation: the scores of every dance, and all dances to one song for the plots."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.evaluation.motif_scores import DancedMotifs
from choreograph.evaluation.phase_scores import DancedPhases
from choreograph.evaluation.scores import Scores
from choreograph.motion.motion import Motion
from choreograph.plan import Plan

Floats = NDArray[np.float64]

EXPERT, REAL, TAKES = "expert", "real", "takes"  # table columns next to the variants
SELECTION = "selection"  # not a dance: style retrieval for a song
SINGLE = "dance"  # the only column if a single dance is evaluated


@dataclass(frozen=True, eq=False)
class MeasuredDance:
    """The scores of one dance or real take."""

    variant: str  # or `EXPERT`, `REAL`
    song: str
    seed: int
    scores: Scores
    plan: Plan | None = None
    phases: DancedPhases | None = None  # of its motion beats in the counts


@dataclass(frozen=True, eq=False)
class ExampleDance:
    """A dance kept whole, for the plots."""

    variant: str
    motion: Motion
    plan: Plan | None
    motifs: DancedMotifs | None = None


@dataclass(frozen=True, eq=False)
class ExampleSong:
    """All dances to one song, for the plots."""

    song: str
    music_beats_s: Floats  # (Q,)
    dances: tuple[ExampleDance, ...]
    template: Floats | None = None  # (K,) signature of its genre


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Everything that was measured; `tables.tables` summarises it."""

    facts: Mapping[str, Any]  # what was evaluated and how, for the report and JSON
    variants: Mapping[str, str]  # name -> description, in the order of the tables
    dances: tuple[MeasuredDance, ...]
    sets: tuple[MeasuredDance, ...]  # all songs together: `song` is ""
    notes: tuple[str, ...] = ()
    example: ExampleSong | None = None
    expert_phases: tuple[DancedPhases, ...] = ()  # that the phases of dances are compared with


def dances_of(dances: Iterable[MeasuredDance], variant: str) -> list[MeasuredDance]:
    """The dances of one variant."""
    return [dance for dance in dances if dance.variant == variant]
