"""What an evaluation found: every measured dance with its numbers, and a few dances to look at."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.evaluation.measuring import Scores
from choreograph.evaluation.motif_judge import DancedMotifs
from choreograph.motion.motion import Motion
from choreograph.plan import Plan

Floats = NDArray[np.float64]

REAL, TAKES = "real", "takes"  # the columns beside the variants
SELECTION = "selection"  # no dance: what is found for a song by style
GIVEN = "dance"  # the one column where a single dance is measured


@dataclass(frozen=True, eq=False)
class MeasuredDance:
    """One dance, or a real take, and its numbers."""

    variant: str  # or `REAL`
    song: str
    seed: int
    scores: Scores
    plan: Plan | None = None


@dataclass(frozen=True, eq=False)
class ShownDance:
    """A dance kept whole, to be looked at."""

    variant: str
    motion: Motion
    plan: Plan | None
    motifs: DancedMotifs | None = None


@dataclass(frozen=True, eq=False)
class Shown:
    """All dances to one song."""

    song: str
    music_beats_s: Floats  # (Q,)
    dances: tuple[ShownDance, ...]
    template: Floats | None = None  # (K,) signature of its genre


@dataclass(frozen=True, eq=False)
class Evaluation:
    """All that was measured; `tables.tables` sums it up."""

    facts: Mapping[str, Any]  # what was evaluated and how, for people and JSON
    variants: Mapping[str, str]  # name -> what it is, in the tables' order
    dances: tuple[MeasuredDance, ...]
    sets: tuple[MeasuredDance, ...]  # of all songs together: song is ""
    notes: tuple[str, ...] = ()
    shown: Shown | None = None


def dances_of(dances: Iterable[MeasuredDance], variant: str) -> list[MeasuredDance]:
    """Those of one variant."""
    return [dance for dance in dances if dance.variant == variant]
