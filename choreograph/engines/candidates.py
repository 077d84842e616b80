"""The words that may be danced in each slot of one dance, and what each costs on its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from choreograph.constraints.resolve import ResolvedConstraints
from choreograph.counts import Counts
from choreograph.engines.word_bank import WordBank, accented_bounds_s
from choreograph.motifs.bar_positions import bar_positions, possible_motifs, word_positions, words_on_count
from choreograph.motifs.vocabulary import Vocabulary
from choreograph.plan import PlannedWord
from choreograph.repertoire import Repertoire

Floats = NDArray[np.floating]
Indices = NDArray[np.int64]

# Costs of a word on its own, in metres of joint distance.
_SAFE_MARGIN_M = 0.04  # a word should be nearer to its motif than to any other by this: transitions move it
_SPEED_COST_M = 0.1  # of twice or half its speed
_OTHER_COUNT_M = 0.5  # of a word that begins on another count than the music's
_TIE_BREAK_M = 0.02  # left to the seed


@dataclass(frozen=True, eq=False)
class Candidates:
    """The words that may be danced in one slot of the dance, M of them."""

    words: Indices  # (M,) indices in the vocabulary
    cost_m: Floats  # (M,) of the word on its own, in metres of joint distance; inf forbids
    first_m: Floats  # (M, 3, 21, 3) the poses around its start, in the root frame
    last_m: Floats  # (M, 3, 21, 3) the poses around its end

    @property
    def any_left(self) -> bool:
        """Whether a word is not forbidden."""
        return bool(np.isfinite(self.cost_m).any())

    def without(self, *words: int) -> Candidates:
        """The same, with some words forbidden."""
        return replace(self, cost_m=np.where(np.isin(self.words, words), np.inf, self.cost_m))

    def preferring(self, word: int, by_m: float) -> Candidates:
        """The same, with all words but one more expensive."""
        return replace(self, cost_m=self.cost_m + by_m * (self.words != word))


@dataclass(frozen=True, eq=False)
class CandidatePool:
    """All words of a repertoire that the constraints of one dance allow."""

    constraints: ResolvedConstraints
    repertoire: Repertoire
    bank: WordBank
    rng: np.random.Generator
    slot_position: Indices  # (N,) where in the song's bar each slot begins: see `motifs.bar_positions`
    word_position: Indices  # (words,) where in its take's bar each word does

    @classmethod
    def of(
        cls,
        constraints: ResolvedConstraints,
        repertoire: Repertoire,
        song_counts: Counts,
        rng: np.random.Generator,
    ) -> CandidatePool:
        """The pool of a repertoire; `RepertoireError` if it has no vocabulary."""
        vocabulary = repertoire.vocabulary
        embed = repertoire.word_net().embed
        bank = WordBank(vocabulary, repertoire.body_pos_m, embed, accented_bounds_s(repertoire))
        slots = bar_positions(constraints.bounds_s[:-1], song_counts)
        return cls(constraints, repertoire, bank, rng, slots, word_positions(vocabulary, repertoire.counts))

    @property
    def vocabulary(self) -> Vocabulary:
        """The vocabulary of the words."""
        return self.bank.vocabulary

    def length_s(self, slot: int) -> float:
        """How long the word in a slot lasts."""
        return float(self.constraints.bounds_s[slot + 1] - self.constraints.bounds_s[slot])

    def candidates(self, slot: int, motif: int | None) -> Candidates:
        """Words of a motif, or of every motif that is not banned if None, for a slot; perhaps none."""
        constraints, v = self.constraints, self.vocabulary
        fits = constraints.take_allowed[v.word_take] & ~constraints.motif_banned[v.word_motif]
        if motif is not None:
            fits &= v.word_motif == motif
        if slot in constraints.takes:
            fits &= v.word_take == constraints.takes[slot]
        words = np.flatnonzero(fits)
        octaves = np.log2((v.word_end_s[words] - v.word_start_s[words]) / self.length_s(slot))
        cost = _SPEED_COST_M * octaves**2 + _TIE_BREAK_M * self.rng.exponential(size=len(words))
        cost += np.maximum(_SAFE_MARGIN_M - self.bank.motif_margin_m(words), 0.0)
        cost += _OTHER_COUNT_M * ~self._on_count(slot, words)
        return Candidates(words, cost, *self.bank.borders_m(words, self.length_s(slot)))

    def motif_allowed(self) -> NDArray[np.bool_]:
        """Motifs (K,) that are not banned and have a word that may be danced."""
        allowed = np.zeros(self.vocabulary.n_motifs, bool)
        allowed[self.vocabulary.word_motif[self.constraints.take_allowed[self.vocabulary.word_take]]] = True
        return allowed & ~self.constraints.motif_banned

    def motif_possible(self) -> NDArray[np.bool_]:
        """Motifs (N, K) that have a word, of a take that may be danced, on the count of each slot."""
        v = self.vocabulary
        words = np.flatnonzero(self.constraints.take_allowed[v.word_take])
        return possible_motifs(self.slot_position, self.word_position, words, v)

    def _on_count(self, slot: int, words: Indices) -> NDArray[np.bool_]:
        """Which words (M,) begin where the slot does in its bar; all where that is not known of any word."""
        return words_on_count(self.slot_position[slot], self.word_position, words)

    def planned(self, slot: int, word: int, *, pinned: bool) -> PlannedWord:
        """A word in its slot of the dance."""
        v, bounds_s = self.vocabulary, self.constraints.bounds_s
        take, source_s = self.repertoire.takes[v.word_take[word]], self.bank.bounds_s[word]
        return PlannedWord(
            start_s=round(float(bounds_s[slot]), 6), end_s=round(float(bounds_s[slot + 1]), 6),
            motif=int(v.word_motif[word]), take=take.name,
            source_start_s=round(float(source_s[0]), 6), source_end_s=round(float(source_s[1]), 6),
            credits=take.credits, pinned=pinned,
        )  # fmt: skip


def consecutive_slots(slots: Mapping[int, object]) -> list[list[int]]:
    """Slots that follow one another with the same value, in order."""
    groups: list[list[int]] = []
    for slot in sorted(slots):
        if groups and groups[-1][-1] == slot - 1 and slots[slot - 1] == slots[slot]:
            groups[-1].append(slot)
        else:
            groups.append([slot])
    return groups
