"""The words that may be danced in each slot, their costs, and the search for the best sequence."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.engine import DanceRequest
from choreograph.choreography.graph.cost import WeightedCost, edge_costs, weighted_terms
from choreograph.choreography.graph.costs import Transition, own_costs
from choreograph.choreography.graph.layers import Layer, WordLayers, facing, joined_rad, rotated
from choreograph.choreography.graph.path_costs import beyond_stage_m, turned_costs
from choreograph.choreography.motif_sequences import words_on_count
from choreograph.choreography.slots import ResolvedConstraints
from choreograph.core.counts import bar_positions
from choreograph.core.errors import NoPathError, ParameterError
from choreograph.core.numerics import AnyFloats, Floats, Indices, squared_distances
from choreograph.core.timebase import NET_FPS, WORD_FRAMES
from choreograph.library.repertoire import Repertoire
from choreograph.library.vocabulary import Vocabulary
from choreograph.motion import rotations as rot
from choreograph.motion.body import clips_to_root_frame, ground_pos_m, heading_rad
from choreograph.plan.joins import MAX_STEER_RAD, stage_half_m
from choreograph.plan.plan import PlannedWord

# The features of words that the mixer compares: poses at their borders, and their motif margin.


# The three poses by which transitions are compared: around the instant of the transition, or as in the paper
# the first three of a word and the last three of the word before.
AROUND_S = np.array([-1.0, 0.0, 1.0]) / NET_FPS
INSIDE_S = np.array([[0.0, 1.0, 2.0], [-2.0, -1.0, 0.0]]) / NET_FPS
_THIRDS = np.array([0.0, 0.5, 1.0])  # of a word, where its heading is read


class WordBank:
    """Reads words by `poses_at` (see `library.clips.ClipMotion`), and embeds each when first needed.

    Words are danced between `bounds_s` (W, 2) of their takes, by default where they were cut. The poses at
    their borders are at `border_s` (2, 3) from the start and from the end, or (3,) from both.
    """

    def __init__(
        self,
        vocabulary: Vocabulary,
        poses_at: Callable[[Indices, AnyFloats], NDArray[np.float64]],
        embed: Callable[[AnyFloats], NDArray[np.float32]],
        bounds_s: AnyFloats | None = None,
        border_s: AnyFloats = AROUND_S,
    ) -> None:
        self.vocabulary = vocabulary
        self.border_s = border_s
        cut_s = np.stack([vocabulary.word_start_s, vocabulary.word_end_s], axis=1)
        self.bounds_s = cut_s if bounds_s is None else bounds_s
        self._poses_at = poses_at
        self._embed = embed
        self._margin_m = np.full(len(vocabulary.word_motif), np.nan)
        self._headings_rad = np.full((len(vocabulary.word_motif), len(_THIRDS)), np.nan)
        self._walks_m = np.zeros((len(vocabulary.word_motif), 2, 3))

    def borders_m(self, words: Indices, lengths_s: float) -> tuple[AnyFloats, AnyFloats]:
        """The three poses at the start and at the end of words (M,), each (M, 3, 21, 3), in the root frame.

        They are a twentieth of a second apart in the dance, where the words last `lengths_s`.
        """
        bounds_s = self.bounds_s[words]  # (M, 2)
        speed = np.diff(bounds_s, axis=1) / lengths_s  # (M, 1)
        poses = self._poses_m(words, bounds_s[..., None] + speed[..., None] * self.border_s)
        poses = clips_to_root_frame(poses)  # (M, 2, 3, 21, 3)
        return poses[:, 0], poses[:, 1]

    def ways(self, words: Indices, fronts_rad: Floats) -> tuple[AnyFloats, AnyFloats]:
        """Headings (M, 3) at the start, in the middle and at the end of words (M,), and how far they walk.

        Both are measured from the front (M,) of the word's take. The walks (M, 2, 2) are x and z of the
        pelvis in metres, from the start to the middle and to the end.
        """
        new = words[np.isnan(self._headings_rad[words, 0])]
        if len(new):
            bounds_s = self.bounds_s[new]
            poses_m = self._poses_m(new, bounds_s[:, :1] + _THIRDS * np.diff(bounds_s, axis=1))
            self._headings_rad[new], places_m = heading_rad(poses_m), ground_pos_m(poses_m)
            self._walks_m[new] = places_m[:, 1:] - places_m[:, :1]
        walks_m = rot.rotate(rot.about_y(-fronts_rad)[:, None], self._walks_m[words])
        return self._headings_rad[words] - fronts_rad[:, None], walks_m[..., [0, 2]]

    def motif_margin_m(self, words: Indices) -> AnyFloats:
        """Motif margin of each word (M,): how much nearer its motif is than any other, or negative if not."""
        new = np.unique(words[np.isnan(self._margin_m[words])])
        if len(new):
            self._margin_m[new] = self._measured_margin_m(new)
        return self._margin_m[words]

    def _measured_margin_m(self, words: Indices) -> AnyFloats:
        distance = self.distances_to_motifs(words)
        rows, own = np.arange(len(words)), self.vocabulary.word_motif[words]
        to_own = distance[rows, own]
        distance[rows, own] = np.inf
        margin_m: AnyFloats = (
            np.minimum(distance.min(axis=1), 1.0) - to_own
        )  # with one motif alone the next is a metre away
        return margin_m

    def embeddings(self, words: Indices) -> NDArray[np.float32]:
        """Embeddings (M, D) of words (M,) as they were cut."""
        v = self.vocabulary
        share = np.linspace(0.0, 1.0, WORD_FRAMES)
        length_s = v.word_end_s[words] - v.word_start_s[words]
        poses = self._poses_m(words, v.word_start_s[words, None] + length_s[:, None] * share)
        return self._embed(clips_to_root_frame(poses))

    def distances_to_motifs(self, words: Indices) -> NDArray[np.float64]:
        """Distances (M, K) of words (M,) from the medoids of all motifs, in the space of embeddings."""
        medoids = self.vocabulary.motifs.embeddings.astype(np.float64)  # (K, D)
        return np.sqrt(squared_distances(self.embeddings(words).astype(np.float64), medoids))

    def _poses_m(self, words: Indices, times_s: AnyFloats) -> NDArray[np.float64]:
        """Poses (M, ..., 21, 3) of the words' takes at times (M, ...)."""
        return self._poses_at(self.vocabulary.word_take[words], times_s)


# The words that may be danced in each slot of one dance, and their costs.


# Costs of a word on its own, in metres of joint distance.
_SAFE_MARGIN_M = 0.04  # least motif margin without a cost, since transitions change a word
_SPEED_COST_M = 0.1  # of twice or half its speed
_OTHER_COUNT_M = 0.5  # of a word that begins on another count than the music
_TIE_BREAK_M = 0.02  # largest random cost, by the seed
_M_PER_COST = 1.0 / Transition.default_weight  # joint distance that has a cost of 1 in the graph engine


@dataclass(frozen=True, eq=False)
class Candidates:
    """The words that may be danced in one slot of the dance, M of them."""

    words: Indices  # (M,) indices in the vocabulary
    takes: Indices  # (M,) of these words
    cost_m: AnyFloats  # (M,) of the word on its own, in metres of joint distance. inf excludes the word
    first_m: AnyFloats  # (M, 3, 21, 3) the poses around its start, in the root frame
    last_m: AnyFloats  # (M, 3, 21, 3) the poses around its end
    # (M, 3) at start, middle and end, from the front of its take. Empty where they do not matter
    heading_rad: AnyFloats = field(default_factory=lambda: np.zeros(0))
    # (M, 2, 2) x and z from its start to its middle and end, likewise
    walk_m: AnyFloats = field(default_factory=lambda: np.zeros(0))

    @property
    def any_left(self) -> bool:
        """Whether there is a word that is not forbidden."""
        return bool(np.isfinite(self.cost_m).any())

    def without(self, *words: int) -> Candidates:
        """The same, with some words forbidden."""
        return replace(self, cost_m=np.where(np.isin(self.words, words), np.inf, self.cost_m))

    def preferring(self, word: int, by_m: float) -> Candidates:
        """The same, with all words but one more expensive."""
        return replace(self, cost_m=self.cost_m + by_m * (self.words != word))


@dataclass(frozen=True, eq=False)
class CandidatePool:
    """All words of a repertoire that the constraints of one dance allow.

    With `nearest`, words have no costs of their own, are danced as they were cut, and are compared by their
    first and last poses, as in Rhythm is a Dancer, section 5.2.5.
    """

    constraints: ResolvedConstraints
    repertoire: Repertoire
    bank: WordBank
    rng: np.random.Generator
    slot_position: Indices  # (N,) of each slot in the song's bar, see `choreography.motif_sequences`
    word_position: Indices  # (words,) of each word in its take's bar
    nearest: bool = False
    costs: Floats | None = None  # (N, words) of the user, in each slot

    @classmethod
    def of(
        cls,
        constraints: ResolvedConstraints,
        repertoire: Repertoire,
        rng: np.random.Generator,
        *,
        nearest: bool = False,
        costs: Floats | None = None,
    ) -> CandidatePool:
        """The pool of a repertoire. Raises `RepertoireError` if it has no vocabulary."""
        vocabulary = repertoire.vocabulary
        embed = repertoire.word_net().embed
        bounds_s, border_s = (None, INSIDE_S) if nearest else (repertoire.accented_bounds_s, AROUND_S)
        bank = WordBank(vocabulary, repertoire.clip_motion.poses_at, embed, bounds_s, border_s)
        slots = bar_positions(constraints.bounds_s[:-1], constraints.counts)
        positions = repertoire.word_positions
        return cls(constraints, repertoire, bank, rng, slots, positions, nearest, costs)

    @property
    def vocabulary(self) -> Vocabulary:
        """The vocabulary of the words."""
        return self.bank.vocabulary

    def length_s(self, slot: int) -> float:
        """How long the word in a slot lasts."""
        return float(self.constraints.bounds_s[slot + 1] - self.constraints.bounds_s[slot])

    def candidates(self, slot: int, motif: int | None) -> Candidates:
        """Words for a slot, of a motif or, if it is None, of every motif that is not banned.

        They are from the requested takes, or from any take that is not banned if those have none.
        """
        constraints, v = self.constraints, self.vocabulary
        fits = constraints.take_allowed[v.word_take] & ~constraints.motif_banned[v.word_motif]
        if motif is not None:
            fits &= v.word_motif == motif
        if slot in constraints.takes:
            fits &= v.word_take == constraints.takes[slot]
        wanted = fits & constraints.take_wanted[slot, v.word_take]
        words = np.flatnonzero(wanted if wanted.any() else fits)
        borders_m = self.bank.borders_m(words, self.length_s(slot))
        own = np.zeros(len(words)) if self.costs is None else _M_PER_COST * self.costs[slot, words]
        if self.nearest:  # the first word of a dance follows none, so it is drawn
            cost = self.rng.random(len(words)) if slot == 0 else np.zeros(len(words))
            return Candidates(words, v.word_take[words], cost + own, *borders_m)
        octaves = np.log2((v.word_end_s[words] - v.word_start_s[words]) / self.length_s(slot))
        cost = _SPEED_COST_M * octaves**2 + _TIE_BREAK_M * self.rng.exponential(size=len(words))
        cost += np.maximum(_SAFE_MARGIN_M - self.bank.motif_margin_m(words), 0.0)
        cost += _OTHER_COUNT_M * ~words_on_count(self.slot_position[slot], self.word_position, words)
        return Candidates(words, v.word_take[words], cost + own, *borders_m, *self.ways(words))

    def ways(self, words: Indices) -> tuple[AnyFloats, AnyFloats]:
        """The headings and walks of words (M,), as in `Candidates`."""
        fronts_rad = self.repertoire.clip_motion.fronts_rad[self.vocabulary.word_take[words]]
        return self.bank.ways(words, fronts_rad)

    def motif_allowed(self) -> NDArray[np.bool_]:
        """Motifs (K,) that are not banned and have a word that may be danced."""
        allowed = np.zeros(self.vocabulary.n_motifs, bool)
        allowed[self.vocabulary.word_motif[self.constraints.take_allowed[self.vocabulary.word_take]]] = True
        return allowed & ~self.constraints.motif_banned

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


# The mixer's search for the word of each slot that best continues the word before it.
#
# In Rhythm is a Dancer, section 5.2.5, each word is chosen once, after the one before it (`greedy`), by the
# distance of its first three poses from the last three of the word before. By default (`exact`), all words
# are chosen together as the cheapest sequence, and the poses are those around the instant of the transition,
# so that position and velocity are compared there. A word that follows in its take then costs nothing.


SEARCHES = ("exact", "greedy")
_REPEAT_COST_M = 0.15  # of an immediate repeat of a word, in metres of joint distance
_AWAY_COST_M = 1.0  # of a word with the back to the audience, ((1 - cos) / 2)² of its headings
_TURNED_TAKE_M = 0.3  # of 1 - cos of the rotation at which a take is entered
_OFF_STAGE = 0.6  # of a distance beyond the borders of the stage
_WORDS_OF_ALL_TAKES = 1 << 32
_LAST_POSE_M = 4.0  # of 1 - cos of the heading of the last pose


def search_words(
    candidates: Sequence[Candidates],
    *,
    search: str = "exact",
    cut_cost_m: float = 0.0,
    last_slot: int | None = None,
    stage_m: tuple[float, float] | None = None,
    own_costs: Callable[[int, Indices, Indices], Floats] | None = None,
) -> Indices:
    """A word for every slot, (N,): the cheapest sequence.

    Going from one word to the next costs the root mean square distance of their three poses at the
    transition, in metres, and `cut_cost_m` more if it is not the word that follows in the take. Unless the
    search is greedy, it costs more if it is the same word again. If `last_slot` is given, headings away from
    the audience have a cost, too. They are followed along the cheapest path to each word, as by the cost
    `front` of the graph engine. The last pose of the dance is that at the end of `last_slot`. On a stage of
    `stage_m`, width and depth, places outside have a cost as well, as by the cost `stage`. The user's
    `own_costs` (M, M') of a slot, the words (M,) before it and its words (M',) are added.

    Raises `ParameterError` for an unknown search, `NoPathError` naming the slot where every word is
    forbidden.
    """
    if search not in SEARCHES:
        raise ParameterError(f"expected a search among {', '.join(SEARCHES)}, got {search!r}")
    for slot, here in enumerate(candidates):
        if not here.any_left:
            raise NoPathError(f"every word of slot {slot} of the dance is forbidden")
    if not candidates:
        return np.zeros(0, np.int64)
    reached = candidates[0].cost_m  # (M,)
    ends: _Ends | None = None
    if last_slot is not None or stage_m is not None:
        steer_rad = MAX_STEER_RAD if last_slot is not None else 0.0
        ends = _Ends(np.zeros(len(reached)), candidates[0].walk_m[:, -1], steer_rad)
    parents: list[Indices] = []
    repeat_cost_m = 0.0 if search == "greedy" else _REPEAT_COST_M
    for slot, (before, here) in enumerate(pairwise(candidates), start=1):
        if search == "greedy":  # one word is left, the cheapest
            reached = np.where(np.arange(len(reached)) == np.argmin(reached), reached, np.inf)
        edges_m = _transition_costs_m(before, here, cut_cost_m, repeat_cost_m=repeat_cost_m)
        if ends is not None and last_slot is not None:
            edges_m += _front_costs_m(before, here, ends, is_last=slot == last_slot)
        if ends is not None and stage_m is not None:
            where = ends.place_m, *ends.joined(before, here), here.walk_m, *stage_half_m(stage_m)
            edges_m += _OFF_STAGE * beyond_stage_m(*where)
        if own_costs is not None:
            edges_m += _M_PER_COST * own_costs(slot, before.words, here.words)
        paths = reached[:, None] + edges_m  # (M, M')
        parents.append(np.argmin(paths, axis=0))
        reached = paths[parents[-1], np.arange(len(here.words))] + here.cost_m
        if not np.isfinite(reached).any():
            raise NoPathError(f"every way to slot {slot} of the dance is forbidden: relax a cost of inf")
        if ends is not None:
            ends = ends.next(before, here, parents[-1])
    rows = [int(np.argmin(reached))]
    for parent in reversed(parents):
        rows.append(int(parent[rows[-1]]))
    return np.array([here.words[row] for here, row in zip(candidates, rows[::-1], strict=True)])


def _follows(before: Candidates, here: Candidates) -> NDArray[np.bool_]:
    """Which words of a slot (M') are the next in its take of each word of the slot before (M), (M, M')."""
    following: NDArray[np.bool_] = before.words[:, None] + 1 == here.words
    same_take: NDArray[np.bool_] = before.takes[:, None] == here.takes
    return following & same_take


def _transition_costs_m(
    before: Candidates, here: Candidates, cut_cost_m: float, *, repeat_cost_m: float
) -> AnyFloats:
    """Cost of going from each word (M) to each of the next slot (M'), (M, M')."""
    a, b = before.last_m.reshape(len(before.words), -1), here.first_m.reshape(len(here.words), -1)
    n_points = a.shape[1] // 3
    again = before.words[:, None] == here.words
    cost_m: AnyFloats = np.sqrt(squared_distances(a, b) / n_points) + repeat_cost_m * again
    cost_m += cut_cost_m * ~_follows(before, here)
    return cost_m


# Headings and places are those of the dance: takes are joined at heading and place of the word before, and
# steered back to the front.


@dataclass(frozen=True, eq=False)
class _Ends:
    """How the words of a slot are danced along the cheapest path to each."""

    turn_rad: AnyFloats  # (M,) rotation of the word's take
    place_m: AnyFloats  # (M, 2) x and z of the pelvis at the end of the word, from the middle of the stage
    steer_rad: float  # by which a join steers back to the front

    def next(self, before: Candidates, here: Candidates, parent: Indices) -> _Ends:
        """Those of the next words (M',), each after its `parent` (M',)."""
        kept_rad = self.turn_rad[parent]
        joined = joined_rad(kept_rad, before.heading_rad[parent, -1], here.heading_rad[:, 0], self.steer_rad)
        continues = (before.words[parent] + 1 == here.words) & (before.takes[parent] == here.takes)
        turn_rad = np.where(continues, kept_rad, joined)
        place_m = self.place_m[parent] + rotated(here.walk_m[:, -1], turn_rad)
        return replace(self, turn_rad=turn_rad, place_m=place_m)

    def joined(self, before: Candidates, here: Candidates) -> tuple[Any, Any, Any, Any, Any, Any]:
        """The arguments of `turned_costs` and `beyond_stage_m` that describe how words are joined."""
        return (
            self.turn_rad, before.heading_rad[:, -1], here.heading_rad[:, 0], self.steer_rad,
            before.takes * _WORDS_OF_ALL_TAKES + before.words + 1,
            here.takes * _WORDS_OF_ALL_TAKES + here.words,
        )  # fmt: skip


def _front_costs_m(before: Candidates, here: Candidates, ends: _Ends, *, is_last: bool) -> AnyFloats:
    """Cost (M, M') of the headings of words after those of the slot before, which end at `ends`."""
    series = _AWAY_COST_M * facing(here.heading_rad) * np.array([-1 / 2, 1 / 2, 1 / 8, -1 / 8])
    constant = _AWAY_COST_M * 3 / 8
    if is_last:
        last_rad = here.heading_rad[:, -1]
        series[:, :2] += _LAST_POSE_M * np.stack([-np.cos(last_rad), np.sin(last_rad)], axis=1)
        constant += _LAST_POSE_M
    costs_m: AnyFloats = turned_costs(*ends.joined(before, here), series, constant, _TURNED_TAKE_M)
    return costs_m


# Costs of the user for words. The words of a slot are the nodes of a layer. A cost counts for as long as the
# word lasts, so that a second of words costs as much as a second of the graph engine.


@dataclass(frozen=True, eq=False)
class WordCosts:
    """The costs of the user for the words of a dance, weighted."""

    request: DanceRequest
    bounds_s: Floats  # (N + 1,) of the slots
    costs: tuple[WeightedCost, ...]  # one or more

    @classmethod
    def of(cls, request: DanceRequest, constraints: ResolvedConstraints, engine: str) -> WordCosts | None:
        """Those of a request, or None if it has no costs. Raises as `own_costs`."""
        costs = own_costs(request.config, request.costs, engine)
        return cls(request, constraints.bounds_s, costs) if costs else None

    def of_words(self) -> Floats:
        """Costs (N, W) of all words in every slot. They are `inf` for words of banned takes.

        Raises `ParameterError` for values that a cost must not return, and `NoPathError` if every word of the
        genre is forbidden in a slot.
        """
        constraints, take = self.request.constraints, self.request.repertoire.vocabulary.word_take
        words = np.flatnonzero(constraints.take_allowed[take])
        costs = np.full((len(self.bounds_s) - 1, len(take)), np.inf)
        for slot, costs_here in enumerate(costs):
            costs_here[words] = self._of_nodes(slot, words)
            finite, wanted = np.isfinite(costs_here), constraints.take_wanted[slot, take]
            if not finite[wanted if wanted.any() else words].any():
                raise NoPathError(
                    f"every word of the genre at {self.bounds_s[slot]:.1f} s is forbidden: relax a cost that "
                    "returns inf"
                )
        return costs

    def _of_nodes(self, slot: int, words: Indices) -> Floats:
        """Costs (M,) of words in a slot."""
        layer, features, total = self._layer(slot, words), self.request.song_features, np.zeros(len(words))
        for _, cost in weighted_terms(self.costs, lambda c: c.node(layer, features), total.shape):
            total += cost * self._length_s(slot)
        return np.where(np.isfinite(total), total, np.inf)

    def of_edges(self, slot: int, before: Indices, words: Indices) -> Floats:
        """Costs (M, M') of going to words (M',) of a slot from words (M,) of the slot before."""
        layers = self._layer(slot - 1, before), self._layer(slot, words)
        costs = edge_costs(*layers, self.costs, self.request.song_features).astype(np.float64)
        return costs * self._length_s(slot)

    def _length_s(self, slot: int) -> float:
        return float(self.bounds_s[slot + 1] - self.bounds_s[slot])

    def _layer(self, slot: int, words: Indices) -> Layer:
        second = min(int(self.bounds_s[slot : slot + 2].mean()), self.request.song_features.n_seconds - 1)
        return self._layers.layer(words, slot, second, self._length_s(slot))

    @cached_property
    def _layers(self) -> WordLayers:
        return WordLayers(self.request.repertoire)
