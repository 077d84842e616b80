"""The mixer engine: a sequence of motifs, the words that dance it, and whether they still do when joined."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from choreograph.config import DanceConfig
from choreograph.constraints.likely_genre import choose_goal
from choreograph.constraints.resolve import resolve
from choreograph.constraints.spec import Constraints
from choreograph.engines.candidates import CandidatePool, stretches
from choreograph.engines.enforce_motifs import nothing_left, violated_slots
from choreograph.engines.rendering import danced_motifs, render
from choreograph.engines.word_search import SEARCHES, Candidates, search_words
from choreograph.errors import NoPathError, ParameterError
from choreograph.features.song_features import SongFeatures
from choreograph.motifs.choreography import draw_motifs
from choreograph.motifs.goals import MotifGoal
from choreograph.motifs.words import dance_bounds_s
from choreograph.motion.motion import Motion
from choreograph.plan import Plan, PlannedWord
from choreograph.progress import ProgressReport
from choreograph.repertoire import Repertoire

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
    song_features: SongFeatures,
    repertoire: Repertoire,
    config: DanceConfig,
    constraints: Constraints,
    *,
    start_s: float,
    report: ProgressReport | None,
) -> tuple[Plan, Motion, tuple[str, ...]]:
    """A dance of motion words, and notes; the genre is that nearest to the song unless one is asked for."""
    goal, notes = choose_goal(song_features, repertoire, constraints)
    mixed = mix(song_features, repertoire, config, constraints, goal, start_s=start_s, report=report)
    if len(mixed.wrong):
        notes = (*notes, f"{len(mixed.wrong)} of {len(mixed.wanted)} words are not quite their motifs")
    return mixed.plan, mixed.motion, (*notes, *sequence_notes(constraints, len(mixed.wanted)))


def sequence_notes(constraints: Constraints, n_words: int) -> tuple[str, ...]:
    """What is odd about a motif sequence for a dance of `n_words`."""
    given = len(constraints.motifs)
    if given > n_words:
        return (f"{given} motifs were given for a dance of {n_words} words: the last ones are left out",)
    if 0 < given < n_words:
        return (f"{given} motifs were given for a dance of {n_words} words: the rest is drawn",)
    return ()


def mix(
    song_features: SongFeatures,
    repertoire: Repertoire,
    config: DanceConfig,
    constraints: Constraints,
    goal: MotifGoal,
    *,
    start_s: float = 0.0,
    report: ProgressReport | None = None,
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
    bounds_s = dance_bounds_s(song_features.beat_times_s, song_features.duration_s)
    resolved = resolve(constraints, repertoire, bounds_s, song_features.duration_s)
    pool = CandidatePool.of(resolved, repertoire, np.random.default_rng(config.seed))
    wanted = _motifs(pool, config, goal)
    candidates = [pool.candidates(slot, int(motif)) for slot, motif in enumerate(wanted)]
    held = set(resolved.pinned)
    best: Mixed | None = None
    rounds = 0
    while True:
        words = search_words(candidates, search=config.planner)
        mixed = _rendered(words, held, pool, song_features, config, start_s)
        if best is None or _faults(mixed) < _faults(best):
            best = mixed
        rounds += 1
        if report is not None:
            report("mixing", rounds, 0)
        if _faults(best) == (0, 0) or (rounds >= _ROUNDS and not best.broken):
            return best
        held.update(mixed.broken)
        candidates = [_remaining_candidates(slot, here, mixed, pool) for slot, here in enumerate(candidates)]


def _faults(mixed: Mixed) -> tuple[int, int]:
    return len(mixed.broken), len(mixed.wrong)


def _rendered(
    words: Indices,
    held: Collection[int],
    pool: CandidatePool,
    song_features: SongFeatures,
    config: DanceConfig,
    start_s: float,
) -> Mixed:
    resolved = pool.resolved
    plan = _to_plan(words, held, pool, song_features, config, start_s)
    motion = render(plan, pool.repertoire)
    danced = danced_motifs(motion, resolved.bounds_s, pool.repertoire)
    must = replace(resolved, motifs={slot: resolved.motifs[slot] for slot in resolved.pinned})
    wanted = pool.vocabulary.word_motif[words]
    return Mixed(plan, motion, words, wanted, danced, tuple(violated_slots(danced, must)))


def _remaining_candidates(slot: int, here: Candidates, mixed: Mixed, pool: CandidatePool) -> Candidates:
    """The choices for another try: not the word that failed, and one that did not again if possible.

    A word that shows a banned motif whatever is taken of its own may become any other, unless it was asked
    for. Raises `NoPathError` if nothing is left where something must be.
    """
    word = int(mixed.words[slot])
    if slot not in mixed.broken and slot not in mixed.wrong:
        return here.preferring(word, _STAY_M)
    left = here.without(word)
    if not np.isfinite(left.price_m).any() and slot in mixed.broken:
        if slot in pool.resolved.motifs:
            raise NoPathError(nothing_left(slot, pool.resolved))
        left = pool.candidates(slot, None).without_any(here.words)
        if not np.isfinite(left.price_m).any():
            raise NoPathError(nothing_left(slot, pool.resolved))
    return left if np.isfinite(left.price_m).any() else here


def _motifs(pool: CandidatePool, config: DanceConfig, goal: MotifGoal) -> Indices:
    """The motif of every word (N,): those asked for, the take's own where one is pinned, the rest drawn."""
    resolved = pool.resolved
    motifs = dict(resolved.motifs)
    for slots in stretches(resolved.takes):
        of_take = [pool.candidates(slot, motifs.get(slot)) for slot in slots]
        if any(len(here.words) == 0 for here in of_take):
            raise ParameterError(
                f"the take pinned at {resolved.bounds_s[slots[0]]:.1f} s has no motion word that may be danced"
            )
        passage = search_words(of_take, search=config.planner)
        motifs.update(zip(slots, pool.vocabulary.word_motif[passage].tolist(), strict=True))
    return draw_motifs(
        resolved.n_words, goal.signature, goal.transitions, rng=pool.rng, pins=motifs,
        banned=np.flatnonzero(~pool.motif_allowed()).tolist(),
    )  # fmt: skip


def _to_plan(
    words: Indices,
    held: Collection[int],
    pool: CandidatePool,
    song_features: SongFeatures,
    config: DanceConfig,
    start_s: float,
) -> Plan:
    planned = [pool.planned(p, int(word), pinned=p in held) for p, word in enumerate(words)]
    planned[0] = _reaching(planned[0], 0.0, planned[0].end_s, pool.repertoire)
    planned[-1] = _reaching(planned[-1], planned[-1].start_s, song_features.duration_s, pool.repertoire)
    return Plan(
        song=song_features.name, duration_s=song_features.duration_s, start_s=start_s, repertoire=pool.repertoire.path.name,
        planner=config.planner, blending=config.blending, seed=config.seed, fps=config.fps, weights={},
        music_beats_s=tuple(float(beat) for beat in song_features.beat_times_s), seconds=(), engine="mixer",
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
