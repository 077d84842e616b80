"""The mixer engine: a sequence of motifs, the words that dance it, and whether they still do when joined."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from choreograph.config import DanceConfig
from choreograph.errors import NoPathError, ParameterError
from choreograph.features.music import Music
from choreograph.motifs.choreography import draw_motifs
from choreograph.motifs.goals import MotifGoal
from choreograph.motifs.words import dance_bounds_s
from choreograph.motion.motion import Motion
from choreograph.pipeline.asked import resolve
from choreograph.pipeline.genre import goal_for
from choreograph.pipeline.overlaying import nothing_left, unfulfilled
from choreograph.pipeline.rendering import danced_motifs, render
from choreograph.pipeline.saving import Report
from choreograph.pipeline.shelf import Shelf, stretches
from choreograph.pipeline.wishes import Wishes
from choreograph.plan import Plan, PlannedWord
from choreograph.repertoire import Repertoire
from choreograph.rollout.mixer import SEARCHES, Choices, choose_words

Indices = NDArray[np.int64]

_STAY_M = 0.1  # price of changing a word that is danced as it should, to help another
_ROUNDS = 6  # renderings to make every word its motif; what is pinned or banned may take more


@dataclass(frozen=True, eq=False)
class Mixed:
    """A mixed dance and what its words should be."""

    plan: Plan
    motion: Motion
    words: Indices  # (N,) of the vocabulary
    wanted: Indices  # (N,) motif of each word
    danced: Indices  # (N,) the one that the rendered motion shows there; -1 for a word too short to tell
    broken: tuple[int, ...]  # places where a pinned motif is not danced, or a banned one is

    @property
    def wrong(self) -> Indices:
        """Places whose motif is not the one wanted."""
        return np.flatnonzero((self.danced != self.wanted) & (self.danced >= 0))


def dance_by_mixer(
    music: Music,
    repertoire: Repertoire,
    config: DanceConfig,
    wishes: Wishes,
    *,
    start_s: float,
    report: Report | None,
) -> tuple[Plan, Motion, tuple[str, ...]]:
    """A dance of motion words, and notes; the genre is that nearest to the song unless one is asked for."""
    goal, notes = goal_for(music, repertoire, wishes)
    mixed = mix(music, repertoire, config, wishes, goal, start_s=start_s, report=report)
    if len(mixed.wrong):
        notes = (*notes, f"{len(mixed.wrong)} of {len(mixed.wanted)} words are not quite their motifs")
    return mixed.plan, mixed.motion, (*notes, *sequence_notes(wishes, len(mixed.wanted)))


def sequence_notes(wishes: Wishes, n_words: int) -> tuple[str, ...]:
    """What is odd about a motif sequence for a dance of `n_words`."""
    given = len(wishes.motifs)
    if given > n_words:
        return (f"{given} motifs were given for a dance of {n_words} words: the last ones are left out",)
    if 0 < given < n_words:
        return (f"{given} motifs were given for a dance of {n_words} words: the rest is drawn",)
    return ()


def mix(
    music: Music,
    repertoire: Repertoire,
    config: DanceConfig,
    wishes: Wishes,
    goal: MotifGoal,
    *,
    start_s: float = 0.0,
    report: Report | None = None,
) -> Mixed:
    """A dance of motion words (Rhythm is a Dancer, sections 4.3 and 5.2.5).

    A word that is not its motif any more once it is joined to its neighbours is changed for another, and
    all is rendered again: that check, and choosing all words together, are ours.

    Raises `ParameterError` if wishes contradict each other, `NoPathError` naming the instant where no word
    holds a pinned motif or keeps clear of a banned one, `RepertoireError` without a vocabulary.
    """
    if config.planner not in SEARCHES:
        raise ParameterError(
            f"expected a planner among {', '.join(SEARCHES)} for the mixer, got {config.planner!r}"
        )
    bounds_s = dance_bounds_s(music.beat_times_s, music.duration_s)
    asked = resolve(wishes, repertoire, bounds_s, music.duration_s)
    shelf = Shelf.of(asked, repertoire, np.random.default_rng(config.seed))
    wanted = _motifs(shelf, config, goal)
    choices = [shelf.choices(place, int(motif)) for place, motif in enumerate(wanted)]
    held = set(asked.pinned)
    best: Mixed | None = None
    rounds = 0
    while True:
        words = choose_words(choices, search=config.planner)
        mixed = _rendered(words, held, shelf, music, config, start_s)
        if best is None or _faults(mixed) < _faults(best):
            best = mixed
        rounds += 1
        if report is not None:
            report("mixing", rounds, 0)
        if _faults(best) == (0, 0) or (rounds >= _ROUNDS and not best.broken):
            return best
        held.update(mixed.broken)
        choices = [_others(place, here, mixed, shelf) for place, here in enumerate(choices)]


def _faults(mixed: Mixed) -> tuple[int, int]:
    return len(mixed.broken), len(mixed.wrong)


def _rendered(
    words: Indices, held: Collection[int], shelf: Shelf, music: Music, config: DanceConfig, start_s: float
) -> Mixed:
    asked = shelf.asked
    plan = _to_plan(words, held, shelf, music, config, start_s)
    motion = render(plan, shelf.repertoire)
    danced = danced_motifs(motion, asked.bounds_s, shelf.repertoire)
    must = replace(asked, motifs={place: asked.motifs[place] for place in asked.pinned})
    wanted = shelf.vocabulary.word_motif[words]
    return Mixed(plan, motion, words, wanted, danced, tuple(unfulfilled(danced, must)))


def _others(place: int, here: Choices, mixed: Mixed, shelf: Shelf) -> Choices:
    """The choices for another try: not the word that failed, and one that did not again if possible.

    A word that shows a banned motif whatever is taken of its own may become any other, unless it was asked
    for. Raises `NoPathError` if nothing is left where something must be.
    """
    word = int(mixed.words[place])
    if place not in mixed.broken and place not in mixed.wrong:
        return here.preferring(word, _STAY_M)
    left = here.without(word)
    if not np.isfinite(left.price_m).any() and place in mixed.broken:
        if place in shelf.asked.motifs:
            raise NoPathError(nothing_left(place, shelf.asked))
        left = shelf.choices(place, None).without_any(here.words)
        if not np.isfinite(left.price_m).any():
            raise NoPathError(nothing_left(place, shelf.asked))
    return left if np.isfinite(left.price_m).any() else here


def _motifs(shelf: Shelf, config: DanceConfig, goal: MotifGoal) -> Indices:
    """The motif of every word (N,): those asked for, the take's own where one is pinned, the rest drawn."""
    asked = shelf.asked
    motifs = dict(asked.motifs)
    for places in stretches(asked.takes):
        of_take = [shelf.choices(place, motifs.get(place)) for place in places]
        if any(len(here.words) == 0 for here in of_take):
            raise ParameterError(
                f"the take pinned at {asked.bounds_s[places[0]]:.1f} s has no motion word that may be danced"
            )
        passage = choose_words(of_take, search=config.planner)
        motifs.update(zip(places, shelf.vocabulary.word_motif[passage].tolist(), strict=True))
    return draw_motifs(
        asked.n_words, goal.signature, goal.transitions, rng=shelf.rng, pins=motifs,
        banned=np.flatnonzero(~shelf.motif_allowed()).tolist(),
    )  # fmt: skip


def _to_plan(
    words: Indices, held: Collection[int], shelf: Shelf, music: Music, config: DanceConfig, start_s: float
) -> Plan:
    planned = [shelf.planned(p, int(word), pinned=p in held) for p, word in enumerate(words)]
    planned[0] = _reaching(planned[0], 0.0, planned[0].end_s, shelf.repertoire)
    planned[-1] = _reaching(planned[-1], planned[-1].start_s, music.duration_s, shelf.repertoire)
    return Plan(
        song=music.name, duration_s=music.duration_s, start_s=start_s, repertoire=shelf.repertoire.path.name,
        planner=config.planner, blending=config.blending, seed=config.seed, fps=config.fps, weights={},
        music_beats_s=tuple(float(beat) for beat in music.beat_times_s), seconds=(), engine="mixer",
        words=tuple(planned),
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
