"""The words that may be danced in each place of one dance, and what each costs by itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.constraints.resolve import ResolvedConstraints
from choreograph.engines.word_bank import WordBank
from choreograph.engines.word_search import Candidates
from choreograph.motifs.vocabulary import Vocabulary
from choreograph.plan import PlannedWord
from choreograph.repertoire import Repertoire

# What a word costs by itself, metres of joint distance.
_SAFE_M = 0.04  # it should be nearer to its own motif than to any other by this: joins move it a little
_HURRY_M = 0.1  # at twice or half its speed
_WHIM_M = 0.02  # left to the seed


@dataclass(frozen=True, eq=False)
class CandidatePool:
    """All words of a repertoire for what is asked of one dance."""

    resolved: ResolvedConstraints
    repertoire: Repertoire
    bank: WordBank
    rng: np.random.Generator

    @classmethod
    def of(
        cls, resolved: ResolvedConstraints, repertoire: Repertoire, rng: np.random.Generator
    ) -> CandidatePool:
        """The shelf of a repertoire; `RepertoireError` if it has no vocabulary."""
        bank = WordBank(repertoire.vocabulary, repertoire.body_pos_m, repertoire.word_net().embed)
        return cls(resolved, repertoire, bank, rng)

    @property
    def vocabulary(self) -> Vocabulary:
        """Whose words they are."""
        return self.bank.vocabulary

    def length_s(self, slot: int) -> float:
        """How long the word in a place lasts."""
        return float(self.resolved.bounds_s[slot + 1] - self.resolved.bounds_s[slot])

    def candidates(self, slot: int, motif: int | None) -> Candidates:
        """Words of a motif, or of any that is not banned if it is None, for a place; perhaps none."""
        resolved, v = self.resolved, self.vocabulary
        fits = resolved.take_allowed[v.word_take] & ~resolved.motif_banned[v.word_motif]
        if motif is not None:
            fits &= v.word_motif == motif
        if slot in resolved.takes:
            fits &= v.word_take == resolved.takes[slot]
        words = np.flatnonzero(fits)
        hurry = np.log2((v.word_end_s[words] - v.word_start_s[words]) / self.length_s(slot))
        price = _HURRY_M * hurry**2 + _WHIM_M * self.rng.exponential(size=len(words))
        price += np.maximum(self.bank.motif_margin_m(words) + _SAFE_M, 0.0)
        return Candidates(words, price, *self.bank.borders_m(words, self.length_s(slot)))

    def motif_allowed(self) -> NDArray[np.bool_]:
        """Motifs (K,) that have a word that may be danced."""
        allowed = np.zeros(self.vocabulary.n_motifs, bool)
        allowed[self.vocabulary.word_motif[self.resolved.take_allowed[self.vocabulary.word_take]]] = True
        return allowed & ~self.resolved.motif_banned

    def planned(self, slot: int, word: int, *, pinned: bool) -> PlannedWord:
        """A word in its place of the dance."""
        v, bounds_s = self.vocabulary, self.resolved.bounds_s
        take = self.repertoire.takes[v.word_take[word]]
        return PlannedWord(
            start_s=round(float(bounds_s[slot]), 6), end_s=round(float(bounds_s[slot + 1]), 6),
            motif=int(v.word_motif[word]), take=take.name,
            source_start_s=round(float(v.word_start_s[word]), 6),
            source_end_s=round(float(v.word_end_s[word]), 6), credits=take.credits,
            pinned=pinned,
        )  # fmt: skip


def stretches(slots: Mapping[int, object]) -> list[list[int]]:
    """Places that follow one another with the same value, in order."""
    found: list[list[int]] = []
    for slot in sorted(slots):
        if found and found[-1][-1] == slot - 1 and slots[slot - 1] == slots[slot]:
            found[-1].append(slot)
        else:
            found.append([slot])
    return found
