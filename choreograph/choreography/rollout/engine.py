"""The rollout engine: the recurrent network of a repertoire dances a sequence of motifs, drawn or given."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.constraints import Constraints
from choreograph.choreography.enforcement import (
    Repairs,
    danced_motifs,
    is_danced,
    motifs_of_embeddings,
    violated_slots,
    without_distant,
)
from choreograph.choreography.engine import Check, DanceRequest, EngineResult
from choreograph.choreography.graph.cost import Cost
from choreograph.choreography.graph.costs import own_costs
from choreograph.choreography.mixer.engine import sequence_notes
from choreograph.choreography.mixer.words import WordBank, WordCosts
from choreograph.choreography.passages import draw_dance, drawn_words
from choreograph.choreography.rollout.generation import (
    SEED_FRAMES,
    HeldPoses,
    MotifSequence,
    SongMusic,
    asked_embeddings,
    generate_motion,
)
from choreograph.choreography.slots import ResolvedConstraints
from choreograph.core.counts import count_phase
from choreograph.core.errors import NoPathError, ParameterError
from choreograph.core.numerics import Floats, Indices, frame_blocks
from choreograph.core.progress import substage
from choreograph.library.repertoire import Repertoire
from choreograph.library.vocabulary import WORDS_AT_ONCE
from choreograph.motion.motion import Credits, Motion
from choreograph.nets.rollout_poses import ROLLOUT_FPS
from choreograph.plan.plan import Plan, PlannedWord
from choreograph.settings import DanceConfig, settings_of

_ATTEMPTS = 4  # to make a dance that shows the requested motifs


class RolloutEngine:
    """A network's motion (Rhythm is a Dancer, section 4)."""

    name = "rollout"
    settings = settings_of(name) | {"costs"}

    def check(
        self,
        repertoire: Repertoire,
        config: DanceConfig,
        constraints: Constraints,
        costs: Sequence[Cost],
    ) -> None:
        """As `Engine.check`. It needs motifs and a rollout network, and dances no take.

        Costs rate the passages of takes that are drawn, so that they need `Cost.node` and passages.
        """
        used = [weighted.cost for weighted in own_costs(config, costs, self.name)]
        edges_only = [cost.name for cost in used if type(cost).node is Cost.node]
        if edges_only:
            raise ParameterError(
                f"expected costs of nodes with the rollout engine, which generates what is between them, got "
                f"{edges_only[0]!r}, which has none: use --engine graph or mixer"
            )
        if used and config.phrase_counts == 1:
            raise ParameterError(
                f"expected phrase_counts above 1 with the cost {used[0].name!r}, got 1: costs rate "
                "passages, which the rollout dances"
            )
        genres = repertoire.rollout_genres
        if genres and constraints.signature is not None and constraints.genre is None:
            raise ParameterError(
                f"expected a genre among {', '.join(genres)} beside the signature, got none: each genre has "
                "its own rollout network"
            )
        _ = repertoire.vocabulary

    def plan(self, request: DanceRequest) -> EngineResult:
        """A dance of the network. Each part follows its likely genre unless one is requested."""
        request, notes = _of_one_genre(request)
        edges = [cost.name for cost in request.costs if type(cost).edge is not Cost.edge]
        if edges:
            notes += (
                f"only the costs of nodes of {', '.join(edges)}: the rollout generates what is between",
            )
        material = request.material
        notes = (*material.notes, *notes, *material.metre_notes, *sequence_notes(request.constraints))
        return _RollingOut(request, notes).attempt()


def _of_one_genre(request: DanceRequest) -> tuple[DanceRequest, tuple[str, ...]]:
    """The request with one goal, where each genre has its own network, and a note if there were several.

    It is the genre of most seconds of the song among those that have a network.
    """
    genres, goals = request.repertoire.rollout_genres, request.material.goals
    if not genres:
        return request, ()
    seconds = np.diff([*(goal.first_second for goal in goals), request.song_features.n_seconds])
    having = [index for index, goal in enumerate(goals) if goal.genre in genres]
    if not having:
        danced = ", ".join(sorted({goal.genre or "no genre" for goal in goals}))
        raise ParameterError(
            f"expected a genre with a rollout network, among {', '.join(genres)}, got {danced}: choose one"
        )
    longest = goals[max(having, key=lambda index: seconds[index])]
    material = replace(request.material, goals=(replace(longest, first_second=0),))
    others = {goal.genre for goal in goals} - {longest.genre}
    notes = (f"{longest.genre} throughout, because each genre has its own rollout network",) if others else ()
    return replace(request, material=material), notes


@dataclass(frozen=True, eq=False)
class _Rollout:
    """One attempt at a dance."""

    motifs: Indices  # (N,) drawn or given
    asked: NDArray[np.float32]  # (N, D) embeddings that the network was conditioned on
    motion: Motion
    shown: NDArray[np.float32]  # (N, D) embeddings of the motion
    danced: Indices  # (N,) motifs of these
    wrong: tuple[int, ...]  # slots that do not show the requested motif


class _RollingOut:
    """Motifs drawn towards the goal of each part and danced by the network, in several attempts if need be.

    The style of the motion (equation 4) is the song's, or another song's (`style_song`), from beat to beat.
    The motion is checked. If a requested motif is missing, or a banned one occurs, another dance is sampled.
    A requested motif then begins earlier, lasts longer, and is requested with a larger embedding. If a pin or
    ban is never met, a word of a take replaces the motion there. Requests that are still not met are in
    `unmet`.

    Raises `ParameterError` if constraints name takes, `RepertoireError` without a vocabulary or a rollout
    network.
    """

    def __init__(self, request: DanceRequest, notes: tuple[str, ...]) -> None:
        end_s = request.song_features.duration_s
        bounds_s = np.concatenate([[0.0], request.constraints.bounds_s[1:-1], [end_s]])
        self._request, self._notes = request, notes
        self._constraints = constraints = replace(request.constraints, bounds_s=bounds_s)
        if constraints.takes or not constraints.take_allowed.all():
            raise ParameterError(
                "expected pins and bans of motifs, got takes or genres: the rollout engine dances no take. "
                "Use --engine graph or mixer, or --genre"
            )
        self._pinned = {slot: constraints.motifs[slot] for slot in constraints.pinned}
        self._plan = request.new_plan(engine=RolloutEngine.name)
        own = WordCosts.of(request, constraints, RolloutEngine.name)
        self._costs = None if own is None else own.of_words()
        self._music = SongMusic.of(request, constraints)
        self._best: _Rollout | None = None  # with all requested motifs and no banned one, or the fewest wrong
        self._n_made = 0

    def attempt(self) -> EngineResult:
        """A dance of the network, which is checked if motifs are requested."""
        request, constraints, best = self._request, self._constraints, self._best
        held = _held_longer(best.wrong if best else (), self._n_made, constraints)
        motifs = _drawn_motifs(request, constraints, self._n_made, held, self._costs)
        asked = _asked(motifs, best, self._n_made, constraints, request)
        if best is not None and np.array_equal(asked, best.asked):  # the network would dance the same
            return self._laid_over(best)
        generated = _generated(request, constraints, motifs, asked, self._music)
        check = None
        if constraints.constrains_motifs:
            check = Check(constraints.bounds_s, partial(self._again, motifs, asked))
        return EngineResult(self._planned(motifs), self._notes, generated=generated, check=check)

    def _again(
        self, motifs: Indices, asked: NDArray[np.float32], motion: Motion, shown: NDArray[np.float32]
    ) -> EngineResult:
        """Another attempt, unless the best one shows what it should or enough were made."""
        dance = self._checked(motifs, asked, motion, shown)
        if self._best is None or len(dance.wrong) < len(self._best.wrong):
            self._best = dance
        self._n_made += 1
        if self._best.wrong and self._n_made < _ATTEMPTS:
            return self.attempt()
        return self._laid_over(self._best)

    def _planned(self, motifs: Indices) -> Plan:
        credits = Credits(performer=f"learned from {len(self._request.repertoire.takes)} takes")
        bounds_s, pinned = self._constraints.bounds_s.round(6).tolist(), self._constraints.pinned
        words = tuple(
            PlannedWord(*span_s, int(motif), "", 0.0, 0.0, credits, pinned=slot in pinned)
            for slot, (motif, span_s) in enumerate(zip(motifs, pairwise(bounds_s), strict=True))
        )
        return replace(self._plan, words=words)

    def _checked(
        self, motifs: Indices, asked: NDArray[np.float32], motion: Motion, shown: NDArray[np.float32]
    ) -> _Rollout:
        """The attempt with the motifs of its motion."""
        constraints, repertoire = self._constraints, self._request.repertoire
        danced = without_distant(motifs_of_embeddings(shown, repertoire), shown, self._pinned, repertoire)
        violated = violated_slots(danced, constraints)
        wrong = tuple(slot for slot in violated if is_danced(slot, self._plan, constraints))
        return _Rollout(motifs, asked, motion, shown, danced, wrong)

    def _laid_over(self, best: _Rollout) -> EngineResult:
        """The best attempt, with words of takes where it violates pins and bans if such words exist."""
        plan = self._planned(best.motifs)
        if not best.wrong:
            return EngineResult(plan, self._notes, motion=best.motion)
        wanted = replace(self._constraints, motifs=self._pinned)
        repairs = Repairs(plan, best.motion, wanted, self._request.repertoire)
        return self._repaired(best, repairs, plan, best.motion, best.shown)

    def _repaired(
        self, best: _Rollout, repairs: Repairs, laid: Plan, motion: Motion, shown: NDArray[np.float32]
    ) -> EngineResult:
        """The plan `laid` with its motion, or with other words over the best attempt if it violates any."""
        try:
            words = repairs.words(shown)
        except NoPathError:
            plan = self._planned(best.motifs)
            return EngineResult(plan, self._notes, _unmet(best, self._constraints), best.motion)
        if words is None:
            dance = self._checked(best.motifs, best.asked, motion, shown)
            return EngineResult(laid, self._notes, _unmet(dance, self._constraints), motion)
        plan = self._planned(best.motifs)
        by_start = {word.start_s: word for word in words}
        laid = replace(plan, words=tuple(by_start.get(word.start_s, word) for word in plan.words))
        check = Check(self._constraints.bounds_s, partial(self._repaired, best, repairs, laid))
        return EngineResult(laid, self._notes, over=best.motion, check=check)


def _asked(
    motifs: Indices,
    best: _Rollout | None,
    attempt: int,
    constraints: ResolvedConstraints,
    request: DanceRequest,
) -> NDArray[np.float32]:
    """Embeddings (N, D) for the network, and for requests also the error of the best attempt.

    They are those of the words of the passages that were drawn, if the network was trained with those of
    words, and the medoids of requested and single motifs. See `asked_embeddings` for words.
    Later attempts add a smaller share of the error.
    """
    repertoire = request.repertoire
    asked = repertoire.vocabulary.motifs.embeddings[motifs].astype(np.float32)
    words = drawn_words(request, constraints, motifs)
    words[list(constraints.motifs)] = -1
    net = repertoire.rollout_net(request.material.goals[0].genre or "")
    if (words >= 0).any() and net.config.own_embedding_share > 0:
        bank = WordBank(repertoire.vocabulary, repertoire.clip_motion.poses_at, repertoire.word_net().embed)
        known = np.flatnonzero(words >= 0)
        for part in frame_blocks(len(known), WORDS_AT_ONCE):
            here = known[part]
            asked[here] = asked_embeddings(bank.embeddings(words[here]), repertoire.vocabulary.motifs)
    if best is not None:
        for slot in constraints.motifs:
            missed = asked[slot] - best.shown[slot] if slot in best.wrong else np.zeros(1, np.float32)
            asked[slot] = best.asked[slot] + np.nan_to_num(missed) / attempt
    return asked


def _held_longer(wrong: Sequence[int], slots: int, constraints: ResolvedConstraints) -> dict[int, int]:
    """The motif of each wrong slot, for the free slots before it and the one after it."""
    held: dict[int, int] = {}
    for slot in set(wrong) & set(constraints.motifs):
        near = range(max(0, slot - slots), min(constraints.n_words, slot + 2))
        held |= dict.fromkeys(set(near) - set(constraints.motifs), constraints.motifs[slot])
    return held


def _unmet(dance: _Rollout, constraints: ResolvedConstraints) -> tuple[str, ...]:
    """A line on each pin and ban that was not met, and one on the other motifs of a given sequence."""
    lines, others = [], []
    for slot in dance.wrong:
        shown = int(dance.danced[slot])
        there = f"{'no motif' if shown < 0 else f'motif {shown}'} at {constraints.bounds_s[slot]:.1f} s"
        if slot not in constraints.motifs:
            lines.append(f"expected no banned motif, but the network dances {there}: use --engine mixer")
        elif slot in constraints.pinned:
            lines.append(
                f"expected motif {constraints.motifs[slot]}, but the network dances {there}: pin it "
                "elsewhere, or use --engine mixer"
            )
        else:
            others.append(there)
    if others:
        lines.append(
            f"expected {len(constraints.motifs)} motifs as given, but {len(others)} are danced as other ones "
            f"({', '.join(others[:3])}{', …' if len(others) > 3 else ''}): use --engine mixer"
        )
    return tuple(lines)


def _drawn_motifs(
    request: DanceRequest,
    constraints: ResolvedConstraints,
    attempt: int,
    held: Mapping[int, int],
    costs: Floats | None = None,
) -> Indices:
    """The motifs of every slot (N,) towards the goal of its part. Another attempt draws others."""
    seed = request.config.seed
    return draw_dance(
        request,
        constraints,
        rng=np.random.default_rng([seed, attempt] if attempt else seed),
        pins={**_kept_motifs(request, constraints), **held, **constraints.motifs},
        banned=np.flatnonzero(constraints.motif_banned).tolist(),
        costs=None if costs is None else costs.__getitem__,
    )


def _kept_motifs(request: DanceRequest, constraints: ResolvedConstraints) -> dict[int, int]:
    """The motifs of the slots that are kept. The motifs in the gaps are drawn to follow them."""
    if request.kept is None:
        return {}
    danced = danced_motifs(request.kept.motion, constraints.bounds_s, request.repertoire)
    spans_s = pairwise(constraints.bounds_s.tolist())
    return {
        slot: int(motif)
        for slot, (motif, span_s) in enumerate(zip(danced, spans_s, strict=True))
        if motif >= 0 and request.kept.keeps(*span_s)
    }


def _generated(
    request: DanceRequest,
    constraints: ResolvedConstraints,
    motifs: Indices,
    asked: NDArray[np.float32],
    music: SongMusic,
) -> Motion:
    """The network's dance to the song of motifs (N,), conditioned on embeddings (N, D)."""
    repertoire, features, config = request.repertoire, request.song_features, request.config
    bounds_s, report = constraints.bounds_s, request.report
    sequence = MotifSequence(
        start_s=bounds_s[:-1],
        end_s=bounds_s[1:],
        motif=asked,
        rhythm=music.rhythm,
        count_phase=count_phase(constraints.counts, np.arange(0.0, features.duration_s, 1.0 / ROLLOUT_FPS)),
        spectral=music.spectral,
    )
    net = repertoire.rollout_net(request.material.goals[0].genre or "")
    net = net.with_style(config.style_strength, config.style_window)
    return generate_motion(
        net, sequence, lead_in(int(motifs[0]), repertoire, ROLLOUT_FPS), fps=config.fps,
        to_front=config.front == "audience", stage=config.stage,
        held=None if request.kept is None else HeldPoses.of(request.kept.motion, request.kept.frames),
        report=substage(report, "dancing"),
    )  # fmt: skip


def lead_in(motif: int, repertoire: Repertoire, fps: float) -> Motion:
    """The recorded motion before a motif's medoid, or its beginning if the medoid begins the take."""
    v = repertoire.vocabulary
    word = int(v.motifs.words[motif])
    length_s = (SEED_FRAMES + 1) / fps
    end_s = max(float(v.word_start_s[word]), length_s)
    motion, first_s = repertoire.motion(int(v.word_take[word]), end_s - length_s, end_s)
    times_s = end_s - np.arange(SEED_FRAMES, 0, -1) / fps
    return motion.sampled((times_s - first_s) * motion.fps, fps=fps)
