"""The mixer engine: a sequence of motifs, the words that dance it, and whether they still do when joined."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from choreograph.config import DanceConfig
from choreograph.errors import NoPathError, ParameterError
from choreograph.features.music import Music
from choreograph.motifs.choreography import draw_motifs
from choreograph.motifs.words import dance_bounds_s
from choreograph.motion.motion import Motion
from choreograph.pipeline.asked import Asked, resolve
from choreograph.pipeline.rendering import danced_motifs, render
from choreograph.pipeline.saving import Report
from choreograph.pipeline.wishes import Wishes
from choreograph.plan import Plan, PlannedWord
from choreograph.repertoire import Repertoire
from choreograph.rollout.mixer import SEARCHES, Choices, choose_words
from choreograph.rollout.word_bank import WordBank

Indices = NDArray[np.int64]
Floats = NDArray[np.float64]

# What a word costs by itself, metres of joint distance.
_SAFE_M = 0.04  # it should be nearer to its own motif than to any other by this: joins move it a little
_HURRY_M = 0.1  # at twice or half its speed
_WHIM_M = 0.02  # left to the seed
_STAY_M = 0.1  # changing a word that is danced as it should, to help another
_ROUNDS = 6  # renderings to make every word its motif; one that is pinned may have as many as it has words


@dataclass(frozen=True, eq=False)
class Mixed:
    """A mixed dance and what its words should be."""

    plan: Plan
    motion: Motion
    wanted: Indices  # (N,) motif of each word
    danced: Indices  # (N,) the one that the rendered motion shows there; -1 for a word too short to tell


def mix(
    music: Music,
    repertoire: Repertoire,
    config: DanceConfig,
    wishes: Wishes,
    *,
    signature: Floats,
    transitions: Floats,
    start_s: float = 0.0,
    report: Report | None = None,
) -> Mixed:
    """A dance of motion words (Rhythm is a Dancer, sections 4.3 and 5.2.5).

    `signature` (K,) and `transitions` (K, K) are the genre's, or what the user gave. A word that is not
    its motif any more once it is joined to its neighbours is changed for another, and all is rendered
    again: that check, and choosing all words together, are ours.

    Raises `ParameterError` if wishes contradict each other, `NoPathError` naming the instant where no word
    holds a pinned motif, `RepertoireError` without a vocabulary.
    """
    if config.planner not in SEARCHES:
        raise ParameterError(
            f"expected a planner among {', '.join(SEARCHES)} for the mixer, got {config.planner!r}"
        )
    bounds_s = dance_bounds_s(music.beat_times_s, music.duration_s)
    asked = resolve(wishes, repertoire, bounds_s, music.duration_s)
    rng = np.random.default_rng(config.seed)
    shelf = _Shelf(
        asked, WordBank(repertoire.vocabulary, repertoire.body_pos_m, repertoire.word_net().embed), rng
    )
    wanted = _motifs(shelf, config, signature, transitions)
    choices = [shelf.choices(place, motif) for place, motif in enumerate(wanted)]
    best: Mixed | None = None
    rounds = 0
    while True:
        words = choose_words(choices, search=config.planner)
        plan = _to_plan(words, wanted, asked, music, repertoire, config, start_s)
        motion = render(plan, repertoire)
        mixed = Mixed(plan, motion, wanted, danced_motifs(motion, bounds_s, repertoire))
        if best is None or _faults(mixed, asked) < _faults(best, asked):
            best = mixed
        rounds += 1
        if report is not None:
            report("mixing", rounds, 0)
        pins_wrong, n_wrong = _faults(best, asked)
        if n_wrong == 0 or (rounds >= _ROUNDS and pins_wrong == 0):
            return best
        choices = _others(choices, words, mixed, asked)


def _faults(mixed: Mixed, asked: Asked) -> tuple[int, int]:
    """How many pinned words are not their motif, and how many words in all."""
    wrong = np.flatnonzero((mixed.danced != mixed.wanted) & (mixed.danced >= 0))
    return sum(place in asked.pinned for place in wrong), len(wrong)


def _others(choices: Sequence[Choices], words: Indices, mixed: Mixed, asked: Asked) -> list[Choices]:
    """The choices for another try: not the words that failed, and those that did not again if possible."""
    tried = []
    for place, here in enumerate(choices):
        if mixed.danced[place] in (mixed.wanted[place], -1):
            tried.append(here.preferring(int(words[place]), _STAY_M))
            continue
        left = here.without(int(words[place]))
        if np.isfinite(left.price_m).any():
            here = left
        elif place in asked.pinned:
            raise NoPathError(
                f"no word of motif {mixed.wanted[place]} can be danced at {asked.bounds_s[place]:.1f} s so "
                "that it stays that motif: pin it elsewhere, or another"
            )
        tried.append(here)
    return tried


@dataclass(frozen=True, eq=False)
class _Shelf:
    """The words that may be danced, place by place."""

    asked: Asked
    bank: WordBank
    rng: np.random.Generator

    def choices(self, place: int, motif: int | None) -> Choices:
        """Words of a motif, or of any if it is None, for a place."""
        asked, v = self.asked, self.bank.vocabulary
        fits = asked.take_allowed[v.word_take] & ~asked.motif_banned[v.word_motif]
        if motif is not None:
            fits &= v.word_motif == motif
        if place in asked.takes:
            fits &= v.word_take == asked.takes[place]
        words = np.flatnonzero(fits)
        length_s = float(asked.bounds_s[place + 1] - asked.bounds_s[place])
        hurry = np.log2((v.word_end_s[words] - v.word_start_s[words]) / length_s)
        price = _HURRY_M * hurry**2 + _WHIM_M * self.rng.exponential(size=len(words))
        if motif is not None:
            price += np.maximum(self.bank.doubt_m(words) + _SAFE_M, 0.0)
        return Choices(words, price, *self.bank.borders_m(words, length_s))

    def motifs_allowed(self) -> NDArray[np.bool_]:
        """Motifs (K,) that have a word that may be danced."""
        v = self.bank.vocabulary
        allowed = np.zeros(v.n_motifs, bool)
        allowed[v.word_motif[self.asked.take_allowed[v.word_take]]] = True
        return allowed & ~self.asked.motif_banned


def _motifs(shelf: _Shelf, config: DanceConfig, signature: Floats, transitions: Floats) -> Indices:
    """The motif of every word (N,): those asked for, the take's own where one is pinned, the rest drawn."""
    asked = shelf.asked
    motifs = dict(asked.motifs)
    for places in _stretches(asked.takes):
        of_take = [shelf.choices(place, motifs.get(place)) for place in places]
        if any(len(here.words) == 0 for here in of_take):
            raise ParameterError(
                f"the take pinned at {asked.bounds_s[places[0]]:.1f} s has no motion word that may be danced"
            )
        passage = choose_words(of_take, search=config.planner)
        motifs.update(zip(places, shelf.bank.vocabulary.word_motif[passage].tolist(), strict=True))
    return draw_motifs(
        asked.n_words, signature, transitions, rng=shelf.rng, pins=motifs,
        banned=np.flatnonzero(~shelf.motifs_allowed()).tolist(),
    )  # fmt: skip


def _stretches(takes: dict[int, int]) -> list[list[int]]:
    """Places that follow one another with the same take."""
    stretches: list[list[int]] = []
    for place in sorted(takes):
        if stretches and stretches[-1][-1] == place - 1 and takes[place - 1] == takes[place]:
            stretches[-1].append(place)
        else:
            stretches.append([place])
    return stretches


def _to_plan(
    words: Indices, wanted: Indices, asked: Asked, music: Music, repertoire: Repertoire, config: DanceConfig,
    start_s: float,
) -> Plan:  # fmt: skip
    planned = [
        planned_word(int(word), place, asked, repertoire, int(wanted[place]))
        for place, word in enumerate(words)
    ]
    planned[0] = _reaching(planned[0], 0.0, planned[0].end_s, repertoire)
    planned[-1] = _reaching(planned[-1], planned[-1].start_s, music.duration_s, repertoire)
    return Plan(
        song=music.name, duration_s=music.duration_s, start_s=start_s, repertoire=repertoire.path.name,
        planner=config.planner, blending=config.blending, seed=config.seed, fps=config.fps, weights={},
        music_beats_s=tuple(float(beat) for beat in music.beat_times_s), seconds=(), engine="mixer",
        words=tuple(planned),
    )  # fmt: skip


def planned_word(word: int, place: int, asked: Asked, repertoire: Repertoire, motif: int) -> PlannedWord:
    """A word of the vocabulary in its place of the dance."""
    v = repertoire.vocabulary
    take = repertoire.takes[v.word_take[word]]
    return PlannedWord(
        start_s=round(float(asked.bounds_s[place]), 6), end_s=round(float(asked.bounds_s[place + 1]), 6),
        motif=motif, take=take.name, source_start_s=round(float(v.word_start_s[word]), 6),
        source_end_s=round(float(v.word_end_s[word]), 6), credits=take.credits, pinned=place in asked.pinned,
    )  # fmt: skip


def _reaching(word: PlannedWord, start_s: float, end_s: float, repertoire: Repertoire) -> PlannedWord:
    """A word that begins earlier or ends later at the same speed, as far as its take goes."""
    speed = (word.source_end_s - word.source_start_s) / (word.end_s - word.start_s)
    take = repertoire.takes[repertoire.take_index(word.take)]
    first = max(0.0, word.source_start_s - speed * (word.start_s - start_s))
    last = min(take.duration_s, word.source_end_s + speed * (end_s - word.end_s))
    return replace(
        word, start_s=start_s, end_s=end_s, source_start_s=round(first, 6), source_end_s=round(last, 6)
    )
