"""The mixer engine: a sequence of motifs, and the choice of its motion words (Rhythm is a Dancer)."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from functools import partial, reduce

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.constraints import Constraints
from choreograph.choreography.enforcement import (
    consecutive_slots,
    is_danced,
    motifs_of_embeddings,
    no_word_left,
    violated_slots,
    with_border_costs,
    without_distant,
)
from choreograph.choreography.engine import Check, DanceRequest, EngineResult
from choreograph.choreography.graph.cost import Cost
from choreograph.choreography.graph.costs import own_costs
from choreograph.choreography.mixer.words import SEARCHES, CandidatePool, Candidates, WordCosts, search_words
from choreograph.choreography.passages import SlotCosts, draw_dance, first_slots
from choreograph.choreography.slots import ResolvedConstraints
from choreograph.core.arguments import as_stage_m
from choreograph.core.errors import NoPathError, ParameterError
from choreograph.core.long_songs import is_long
from choreograph.core.numerics import Floats, Indices
from choreograph.library.repertoire import Repertoire
from choreograph.motion.motion import Motion
from choreograph.music.count_grids import held_times_s
from choreograph.plan.joins import stage_half_m
from choreograph.plan.plan import Plan, PlannedWord
from choreograph.settings import DanceConfig, settings_of

_NO_POSES = np.zeros((0, 3, 21, 3))  # of candidates while a long dance is rendered
_KEEP_M = 0.1  # cost of replacing a word that shows its motif, to help another
_RETURN_M = 0.2  # cost of another word than the first time, where a phrase returns
_CUT_COST_M = 0.2  # of a word within a passage that does not follow the word before it in its take
# In the draw of passages, where each unit divides the probability by e.
_AWAY_COST = 4.0  # of a word with the back to the audience
_LAST_POSE_COST = 32.0  # of a last pose with the back to the audience
_ROAM_COST = 1.0  # of a word that moves by half a stage with borders
_ROUNDS = 6  # renderings until every word shows its motif, more for pinned and banned motifs


class MixerEngine:
    """Motion words of takes (Rhythm is a Dancer, sections 4.3 and 5.2.5)."""

    name = "mixer"
    settings = settings_of(name) | {"costs"}

    def check(
        self,
        repertoire: Repertoire,
        config: DanceConfig,
        constraints: Constraints,
        costs: Sequence[Cost],
    ) -> None:
        """As `Engine.check`. It needs motifs, a planner among `SEARCHES`, and costs without `of_path`."""
        if config.planner not in SEARCHES:
            raise ParameterError(
                f"expected a planner among {', '.join(SEARCHES)} for the mixer, got {config.planner!r}"
            )
        own_costs(config, costs, self.name)
        _ = repertoire.vocabulary

    def plan(self, request: DanceRequest) -> EngineResult:
        """A dance of motion words. Each part follows its likely genre unless one is requested."""
        return Mixing(request).attempt()


@dataclass(frozen=True, eq=False)
class _MixedDance:
    """A rendered dance of words, and what it shows."""

    plan: Plan
    motion: Motion
    words: Indices  # (N,) of the vocabulary
    wrong: Indices  # slots that insist on their motif and show another one
    broken: tuple[int, ...]  # slots where a pinned motif is not danced, or a banned one is

    @property
    def n_violations(self) -> tuple[int, int]:
        """Slots that break constraints, and slots that insist on their motif and show another one."""
        return len(self.broken), len(self.wrong)


def sequence_notes(constraints: ResolvedConstraints) -> tuple[str, ...]:
    """Notes on a given sequence of motifs that begins later, is longer or shorter, or is all of the dance."""
    requested, first = constraints.requested, constraints.first_given
    given, n_words = len(requested.motifs), constraints.n_words - first
    notes: tuple[str, ...] = ()
    if given and first:
        begins_s = constraints.bounds_s[first]
        notes = (f"the motifs that were given begin at {begins_s:.1f} s, on the count of their takes",)
    if given > n_words:
        notes += (f"{given} motifs were given for a dance of {n_words} words: the last ones are not danced",)
    if given >= n_words and not first and requested.signature is not None:
        notes += ("the signature has no effect, since all motifs were given",)
    if given >= n_words:
        return notes
    if given:
        notes += (f"{given} motifs were given for a dance of {n_words} words: the rest is drawn",)
    return notes


class Mixing:
    """A dance of motion words in the making (Rhythm is a Dancer, sections 4.3 and 5.2.5).

    It differs from the paper in four ways. Motifs are drawn in passages of takes. A word that no longer shows
    its motif after blending is replaced, and the dance is rendered again. In a passage, this holds for
    requested motifs only, because another word would interrupt the passage. All words are chosen together.
    Words begin at the position of the music in the bar. With the planner "greedy", words are chosen as in the
    paper, and only a word that misses a request is replaced.

    Raises `ParameterError` if constraints contradict each other, `NoPathError` naming the time at which no
    word shows a pinned motif or avoids a banned one, `RepertoireError` without a vocabulary.
    """

    def __init__(self, request: DanceRequest) -> None:
        constraints, config = request.constraints, request.config
        own = WordCosts.of(request, constraints, MixerEngine.name)
        self._request = request
        self._pool = pool = CandidatePool.of(
            constraints, request.repertoire, np.random.default_rng(config.seed),
            nearest=config.planner == "greedy", costs=None if own is None else own.of_words(),
        )  # fmt: skip
        self._wanted = _motifs(pool, request)
        self._insists = np.full(constraints.n_words, config.phrase_counts == 1 and config.planner == "exact")
        self._insists[list(constraints.motifs)] = True
        candidates = [pool.candidates(slot, int(motif)) for slot, motif in enumerate(self._wanted)]
        if request.kept is not None:
            candidates = with_border_costs(candidates, request.kept, constraints)
        self._search: Callable[[list[Candidates]], Indices] = partial(
            search_words, search=config.planner, cut_cost_m=_CUT_COST_M if config.phrase_counts > 1 else 0.0,
            last_slot=_last_slot(request), stage_m=as_stage_m(config.stage),
            own_costs=None if own is None else own.of_edges,
        )  # fmt: skip
        if config.planner == "exact":
            candidates = _returning(candidates, first_slots(request, constraints, self._wanted), self._search)
        self._candidates = candidates
        self._locked = set(constraints.pinned)
        self._best: _MixedDance | None = None
        self._n_rendered = 0

    def attempt(self) -> EngineResult:
        """The plan of the best words that are left. It is checked if motifs have to be shown."""
        constraints = self._request.constraints
        words = self._search(self._candidates)
        if is_long(self._request.song_features.duration_s):  # of an hour, the poses have 0.13 GB
            self._candidates = [replace(one, first_m=_NO_POSES, last_m=_NO_POSES) for one in self._candidates]
        plan = _to_plan(words, self._locked, self._pool, self._request)
        if not (constraints.constrains_motifs or self._insists.any()):
            return EngineResult(plan, self._notes(0))
        return EngineResult(plan, check=Check(constraints.bounds_s, partial(self._again, plan, words)))

    def _again(
        self, plan: Plan, words: Indices, motion: Motion, embeddings: NDArray[np.float32]
    ) -> EngineResult:
        """Another attempt, or the best one if it shows all motifs or enough were made."""
        mixed = self._checked(plan, words, motion, embeddings)
        if self._best is None or mixed.n_violations < self._best.n_violations:
            self._best = mixed
        self._n_rendered += 1
        best = self._best
        if best.n_violations == (0, 0) or (self._n_rendered >= _ROUNDS and not best.broken):
            return EngineResult(best.plan, self._notes(len(best.wrong)), motion=best.motion)
        if is_long(self._request.song_features.duration_s):
            self._candidates = [
                _with_poses(slot, one, self._pool) for slot, one in enumerate(self._candidates)
            ]
        self._locked.update(mixed.broken)
        self._candidates = [
            _next_candidates(slot, one, mixed, self._pool) for slot, one in enumerate(self._candidates)
        ]
        return self.attempt()

    def _checked(
        self, plan: Plan, words: Indices, motion: Motion, embeddings: NDArray[np.float32]
    ) -> _MixedDance:
        constraints, repertoire = self._request.constraints, self._request.repertoire
        held = [not is_danced(slot, plan, constraints) for slot in range(constraints.n_words)]
        # A pose that is held has no motif of its own.
        pinned = {slot: constraints.motifs[slot] for slot in constraints.pinned}
        shown = without_distant(motifs_of_embeddings(embeddings, repertoire), embeddings, pinned, repertoire)
        chosen = self._pool.vocabulary.word_motif[words]
        danced = np.where(held, chosen, shown)  # -1 for a word too short to have a motif
        broken = violated_slots(danced, replace(constraints, motifs=pinned))
        wrong = np.flatnonzero((danced != chosen) & (danced >= 0) & self._insists)
        return _MixedDance(plan, motion, words, wrong, tuple(broken))

    def _notes(self, n_wrong: int) -> tuple[str, ...]:
        material, n_words = self._request.material, self._request.constraints.n_words
        missing = (f"{n_wrong} of {n_words} words do not show their motifs",) if n_wrong else ()
        of_sequence = sequence_notes(self._request.constraints)
        return (*material.notes, *material.metre_notes, *missing, *of_sequence)


def _returning(
    candidates: list[Candidates], firsts: Indices, search: Callable[[list[Candidates]], Indices]
) -> list[Candidates]:
    """The candidates. Where a phrase returns (`firsts`, (N,)), the word of the first time is preferred."""
    if (firsts == np.arange(len(firsts))).all():
        return candidates
    words = search(candidates)
    return [
        here if first == slot else here.preferring(int(words[first]), _RETURN_M)
        for slot, (here, first) in enumerate(zip(candidates, firsts.tolist(), strict=True))
    ]


def _last_slot(request: DanceRequest) -> int | None:
    """The slot at whose end the last pose of the dance is, or None if words are chosen without the front."""
    if request.config.front != "audience" or request.config.planner == "greedy":
        return None
    opening_s, closing_s = request.danced_span_s
    held_s = held_times_s(opening_s, closing_s)[1]
    return int(np.abs(request.constraints.bounds_s[1:] - held_s).argmin())


def _next_candidates(slot: int, here: Candidates, mixed: _MixedDance, pool: CandidatePool) -> Candidates:
    """The candidates for another attempt, without a word that failed, and with a preference for the others.

    A slot that has a banned motif with every word of its own motif may have any other, unless its motif was
    requested. Raises `NoPathError` if nothing is left where a constraint must hold.
    """
    word = int(mixed.words[slot])
    if slot not in mixed.broken and slot not in mixed.wrong:
        return here.preferring(word, _KEEP_M)
    left = here.without(word)
    if not left.any_left and slot in mixed.broken:
        if slot in pool.constraints.motifs:
            raise NoPathError(no_word_left(slot, pool.constraints))
        left = pool.candidates(slot, None).without(*here.words)
        if not left.any_left:
            raise NoPathError(no_word_left(slot, pool.constraints))
    return left if left.any_left else here


def _with_poses(slot: int, here: Candidates, pool: CandidatePool) -> Candidates:
    """The candidates of a slot with the poses that `CandidatePool.candidates` gave them."""
    first_m, last_m = pool.bank.borders_m(here.words, pool.length_s(slot))
    return replace(here, first_m=first_m, last_m=last_m)


def _motifs(pool: CandidatePool, request: DanceRequest) -> Indices:
    """The motif of every word (N,), as requested, or that of a pinned take, or drawn."""
    constraints = pool.constraints
    motifs = dict(constraints.motifs)
    for slots in consecutive_slots(constraints.takes):
        of_take = [pool.candidates(slot, motifs.get(slot)) for slot in slots]
        if any(len(here.words) == 0 for here in of_take):
            raise ParameterError(
                "expected a pinned take with motion words that may be danced, got none at "
                f"{constraints.bounds_s[slots[0]]:.1f} s"
            )
        passage = search_words(of_take, search=request.config.planner)
        motifs.update(zip(slots, pool.vocabulary.word_motif[passage].tolist(), strict=True))
    banned = np.flatnonzero(~pool.motif_allowed()).tolist()
    terms: list[SlotCosts] = [] if pool.costs is None else [pool.costs.__getitem__]
    last_slot, stage_m = _last_slot(request), as_stage_m(request.config.stage)
    if last_slot is not None:
        terms.append(_front_costs(pool, last_slot))
    if stage_m is not None:
        terms.append(_stage_costs(pool, stage_m))

    def costs(slots: slice) -> Floats:
        total: Floats = reduce(np.add, [of(slots) for of in terms])
        return total

    return draw_dance(
        request, constraints, rng=pool.rng, pins=motifs, banned=banned, costs=costs if terms else None
    )


def _front_costs(pool: CandidatePool, last_slot: int) -> SlotCosts:
    """Costs of all words by how far they are turned from the audience.

    With them, passages that face it are drawn. The last pose of the dance is that at the end of `last_slot`.
    """
    words, away = _words_to_draw(pool), np.zeros((len(pool.vocabulary.word_take), 3))
    away[words] = (0.5 - 0.5 * np.cos(pool.ways(words)[0])) ** 2
    cost, of_last = _AWAY_COST * away.mean(axis=1), _LAST_POSE_COST * away[:, -1]  # (W,)

    def costs(slots: slice) -> Floats:
        rows = np.tile(cost, (slots.stop - slots.start, 1))
        if slots.start <= last_slot < slots.stop:
            rows[last_slot - slots.start] += of_last
        return rows

    return costs


def _stage_costs(pool: CandidatePool, stage_m: tuple[float, float]) -> SlotCosts:
    """Costs of all words by how far they move. With them, passages that keep to the stage are drawn.

    A word may be danced in any direction, so that the smaller side of the stage counts.
    """
    words, cost = _words_to_draw(pool), np.zeros(len(pool.vocabulary.word_take))
    _, walk_m = pool.ways(words)  # (M, 2, 2)
    moved = np.linalg.norm(walk_m[:, -1], axis=-1) / min(stage_half_m(stage_m))
    cost[words] = _ROAM_COST * moved**2
    return lambda slots: np.tile(cost, (slots.stop - slots.start, 1))


def _words_to_draw(pool: CandidatePool) -> Indices:
    """The words of takes that a slot may be drawn from. The poses of others are not read."""
    wanted = pool.constraints.take_wanted[:, pool.vocabulary.word_take]  # (N, W)
    return np.flatnonzero(wanted.any(axis=0))


def _to_plan(words: Indices, locked: Collection[int], pool: CandidatePool, request: DanceRequest) -> Plan:
    planned = [pool.planned(slot, int(word), pinned=slot in locked) for slot, word in enumerate(words)]
    duration_s = request.song_features.duration_s
    planned[0] = _extended(planned[0], 0.0, planned[0].end_s, pool.repertoire)
    planned[-1] = _extended(planned[-1], planned[-1].start_s, duration_s, pool.repertoire)
    return request.new_plan(engine=MixerEngine.name, words=tuple(planned))


def _extended(word: PlannedWord, start_s: float, end_s: float, repertoire: Repertoire) -> PlannedWord:
    """A word that begins earlier or ends later at the same speed, as far as its take goes."""
    speed = (word.source_end_s - word.source_start_s) / (word.end_s - word.start_s)
    take = repertoire.takes[repertoire.take_index(word.take)]
    first = max(0.0, word.source_start_s - speed * (word.start_s - start_s))
    last = min(take.duration_s, word.source_end_s + speed * (end_s - word.end_s))
    return replace(
        word, start_s=start_s, end_s=end_s, source_start_s=round(first, 6), source_end_s=round(last, 6)
    )
