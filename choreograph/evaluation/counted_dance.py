"""`CountedDance`: a dance to one of the evaluated songs with its counts and its plan, to be measured."""

from __future__ import annotations

from dataclasses import dataclass

from choreograph.counts import NO_COUNTS, Counts
from choreograph.evaluation.danced_counts import danced_counts
from choreograph.motion.motion import Motion
from choreograph.plan import Plan
from choreograph.repertoire import Repertoire


@dataclass(frozen=True, eq=False)
class CountedDance:
    """A dance from the song's first second on: a variant's, a real take, or an expert's choreography."""

    variant: str  # column of the tables
    song: str  # name of the `EvaluatedSong`, or of another song
    motion: Motion
    counts: Counts = NO_COUNTS  # its own, in seconds of the dance
    plan: Plan | None = None
    repertoire: Repertoire | None = None  # that the plan's takes are in
    genre: str = ""  # where it is known

    @classmethod
    def from_plan(
        cls, variant: str, song: str, motion: Motion, plan: Plan, repertoire: Repertoire
    ) -> CountedDance:
        """A dance with the plan it was rendered from: its counts are those of its takes."""
        return cls(variant, song, motion, danced_counts(plan, repertoire), plan, repertoire)
