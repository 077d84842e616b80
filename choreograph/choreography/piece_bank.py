"""The counts of all takes, on which pieces begin and end, and an existing dance around a piece."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from choreograph.choreography.edits import EditSlots
from choreograph.core.counts import Counts, bar_positions
from choreograph.core.numerics import Floats, Indices
from choreograph.library.repertoire import Repertoire
from choreograph.library.vocabulary import dance_bounds_s, poses_at
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Credits, Motion
from choreograph.music.count_grids import accent_shifts_s
from choreograph.plan.plan import Plan

# The counts of all takes, on which pieces begin and end.


NEAR_S = 0.12  # of the start of a word from a count that is its start


class PieceBank:
    """The counts of the takes of a repertoire, with their positions in the bar and their motifs."""

    def __init__(self, repertoire: Repertoire) -> None:
        self.repertoire = repertoire
        self._motifs: dict[int, Indices] = {}

    @cached_property
    def counts_s(self) -> list[Floats]:
        """The counts (Q,) of each take, moved to its accents and continued to its ends."""
        found = []
        for take, info in enumerate(self.repertoire.takes):
            counts_s = self.repertoire.counts(take).times_s
            beats_s = self.repertoire.motion_beats_s(take)
            if len(counts_s) < 2:
                counts_s = beats_s
            found.append(dance_bounds_s(counts_s + accent_shifts_s(beats_s, counts_s), info.duration_s))
        return found

    @cached_property
    def positions(self) -> list[Indices]:
        """The position in the bar (Q,) of each count of each take, as of `bar_positions`."""
        return [bar_positions(s, self.repertoire.counts(take)) for take, s in enumerate(self.counts_s)]

    def motifs(self, take: int) -> Indices:
        """The motif (Q,) of the word that begins on each count of a take, -1 where there is none."""
        if take not in self._motifs:
            times_s = self.counts_s[take]
            motifs = np.full(len(times_s), -1, np.int64)
            if self.repertoire.has_vocabulary:
                v = self.repertoire.vocabulary
                words = v.words_of_take(take)
                if len(v.word_start_s[words]):
                    away_s = np.abs(v.word_start_s[words] - times_s[:, None])  # (Q, W)
                    nearest = away_s.argmin(axis=1)
                    near = away_s[np.arange(len(times_s)), nearest] < NEAR_S
                    motifs[near] = v.word_motif[words][nearest[near]]
            self._motifs[take] = motifs
        return self._motifs[take]


# The existing dance around an edit.


class Surroundings:
    """An existing dance, with its counts, its poses, and the takes that it is made of."""

    def __init__(self, plan: Plan, motion: Motion, bounds_s: Floats) -> None:
        self.plan, self.bounds_s, self.fps = plan, bounds_s, motion.fps
        self.body_m = body_pos_m(motion)  # (T, 21, 3)
        self.blocks = plan.planned_blocks
        numbers = np.array(plan.music_beat_numbers, np.int64)
        beats_s = np.array(plan.music_beats_s)
        counts = Counts(beats_s, numbers if len(numbers) else np.zeros(len(beats_s), np.int64), plan.metre)
        self.positions = bar_positions(bounds_s, counts)  # (N + 1,)

    def poses_m(self, times_s: Floats) -> Floats:
        """Poses (..., 21, 3) of the dance at times (...)."""
        return poses_at(self.body_m, self.fps, times_s)

    def source_at(self, at_s: float) -> tuple[str, float]:
        """The take that is danced at a time, and the time in it."""
        block = next((b for b in self.blocks if b.start_s <= at_s < b.end_s), self.blocks[-1])
        return block.planned.take, block.source_s(at_s)

    def credits(self, slots: EditSlots) -> list[Credits]:
        """The credits of the takes in a span."""
        start_s, end_s = self.bounds_s[[slots.first, slots.stop]]
        return [b.planned.credits for b in self.blocks if b.start_s < end_s and b.end_s > start_s]
