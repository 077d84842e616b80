"""Passages: runs of words of the takes, drawn phrase by phrase towards the goals of a dance (ours).

Rhythm is a Dancer draws motif after motif. Neighbours are then as in the takes, but sequences of four or
more motifs seldom are. A passage is a run of consecutive words of a take. It begins at the start of a bar and
lasts about `phrase_counts` counts. A dance is one passage after another, within the phrases of the song. A
passage of a phrase that returns in the song is drawn for all its times at once, and returns in the dance. The
last one may be another one, if the signature lacks its motifs no longer.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.engine import DanceRequest
from choreograph.choreography.motif_sequences import (
    MotifGoal,
    allowed_motifs,
    draw_motifs_of_parts,
    draw_next_motif,
    lacking,
    possible_motifs,
    words_on_count,
)
from choreograph.choreography.slots import ResolvedConstraints
from choreograph.core.counts import UNKNOWN, bar_positions, count_numbers
from choreograph.core.numerics import Floats, Indices, chi_square_distance, frame_blocks
from choreograph.library.repertoire import Repertoire
from choreograph.library.vocabulary import Vocabulary, signature
from choreograph.music.form import Form

# Passages of takes, and the draw of one.


_NEED_POWER = 8.0  # of the share of motifs that are lacking. With 1, signatures are half as far off again
_UNSEEN = 1e-3  # added to the probabilities of transitions from and to a passage
_RETURNS = 0.5  # least share of lacking motifs with which a passage returns


@dataclass(frozen=True, eq=False)
class TakeWords:
    """The words of a repertoire, with the positions in the bar at which they begin."""

    vocabulary: Vocabulary
    position: Indices  # (W,) as in `choreography.motif_sequences`

    @classmethod
    def of(cls, repertoire: Repertoire) -> TakeWords:
        """The words of all takes. Raises `RepertoireError` if there are none."""
        vocabulary = repertoire.vocabulary
        return cls(vocabulary, repertoire.word_positions)

    def runs(
        self, slot_position: Indices, takes: NDArray[np.bool_], allowed: NDArray[np.bool_]
    ) -> NDArray[np.int64]:
        """All runs of words (M, L) of one of the `takes` (takes,) that fit L slots.

        Each word begins on the count of its slot (L,), and is of a motif that is `allowed` (L, K) there.
        """
        take, motif = self.vocabulary.word_take, self.vocabulary.word_motif
        length = len(slot_position)
        first = np.arange(max(0, len(take) - length + 1))
        first = first[(take[first] == take[first + length - 1]) & takes[take[first]]]
        for slot, wanted in enumerate(slot_position):
            word = first + slot
            first = first[words_on_count(wanted, self.position, word) & allowed[slot, motif[word]]]
        runs: NDArray[np.int64] = first[:, None] + np.arange(length)
        return runs


@dataclass(frozen=True, eq=False)
class DancedSoFar:
    """What the draw of a passage depends on, beside its slots."""

    counts: Floats  # (K,) how often each motif is danced in this part, without the passage
    previous: int | None = None  # the motif before the passage
    following: int | None = None  # the motif after it, if it is given
    n_words: int = 0  # of this part when it is finished, for a passage that returns
    times: int = 1  # how often the passage will be danced
    returning: Indices | None = None  # motifs (L,) of the passage where the song first had this phrase
    may_vary: bool = False  # whether another passage may be danced instead of `returning`


def draw_passage(
    words: TakeWords,
    goal: MotifGoal,
    danced: DancedSoFar,
    *,
    slot_position: Indices,
    takes: NDArray[np.bool_],
    allowed: NDArray[np.bool_],
    need: str,
    rng: np.random.Generator,
    costs: Floats | None = None,
) -> Indices | None:
    """The motifs (L,) of a passage for L slots, or None if no run of words fits them.

    A returning passage is danced again. If it may vary, it is danced again only if half of its motifs or more
    are still lacking in the signature. Otherwise, runs of words are drawn by equation 5 of Rhythm is a
    Dancer, as `draw_motifs` draws motifs. The weight of a run is the share of its motifs that are lacking if
    it is danced all its times, to the power 8 for each time, times the probability of the transitions to its
    first motif and from its last one. With `costs` (L, W) of words in these slots, it is also divided by e
    for each unit that the run costs. The other arguments are as in `TakeWords.runs` and `draw_motifs`.
    """
    length = len(slot_position)
    again = danced.returning
    if again is not None and len(again) == length and allowed[np.arange(length), again].all():
        lacks = lacking(danced.counts, goal.signature, danced.n_words, need)
        if not danced.may_vary or _share_lacking(again[None], lacks)[0] >= _RETURNS:
            return again
    words_of_runs = words.runs(slot_position, takes, allowed)
    cost = np.zeros(len(words_of_runs))
    if costs is not None:
        cost = costs[np.arange(length), words_of_runs].sum(axis=1)
        words_of_runs, cost = words_of_runs[np.isfinite(cost)], cost[np.isfinite(cost)]
    if len(cost) == 0:
        return None
    runs = words.vocabulary.word_motif[words_of_runs]  # (M, L)
    joins = np.exp(cost.min() - cost)
    if danced.previous is not None:
        joins *= goal.transitions[danced.previous, runs[:, 0]] + _UNSEEN
    if danced.following is not None:
        joins *= goal.transitions[runs[:, -1], danced.following] + _UNSEEN
    lacks = lacking(danced.counts, goal.signature, danced.counts.sum() + danced.times * length, need)
    weights = joins * _share_lacking(runs, lacks / danced.times) ** (_NEED_POWER * danced.times)
    if weights.sum() <= 0:
        weights = joins
    drawn: Indices = runs[rng.choice(len(runs), p=weights / weights.sum())]
    return drawn


def _share_lacking(runs: NDArray[np.int64], lacks: Floats) -> Floats:
    """The share (M,) of the motifs of runs (M, L) that are lacking, by how often each motif (K,) is."""
    same = runs[:, :, None] == runs[:, None, :]  # (M, L, L)
    earlier = np.tril(same, -1).sum(axis=2)  # (M, L) how often the run has the motif before
    share: Floats = np.clip(lacks[runs] - earlier, 0.0, 1.0).mean(axis=1)
    return share


# The motifs of a whole dance.

# The costs (L, W) of all words in consecutive slots, made where they are used. For an hour, all take 0.2 GB.
SlotCosts = Callable[[slice], Floats]

_FEWEST_OF_PASSAGE = 3  # words that are looked for together in a take
_VARIED_COUNTS = 4  # at the end of a phrase that returns, as by the cost `form` of the graph engine
_SLOTS_AT_ONCE = 128  # whose words with a finite cost are looked up
_NO_MOTIF = -1  # in a slot that is not drawn yet
# A dance is drawn once more for each 20 words. With more draws, seeds of short dances share the nearest one.
_WORDS_A_DRAW, _MOST_DRAWS = 20, 8


def draw_dance(
    request: DanceRequest,
    constraints: ResolvedConstraints,
    *,
    rng: np.random.Generator,
    pins: Mapping[int, int],
    banned: Collection[int],
    costs: SlotCosts | None = None,
    most_draws: int = _MOST_DRAWS,
) -> Indices:
    """The motifs (N,) of a dance, in passages of about the setting `phrase_counts`, or one by one if it is 1.

    In passages, up to `most_draws` dances are drawn, and the one that is nearest to the signatures of its
    parts is kept. `pins` (slot -> motif) are kept and `banned` motifs avoided, as by `draw_motifs`. Around a
    pin that no passage has, passages are shorter. One by one and with the setting `motif_draw` "absolute",
    positions in the bar are not regarded, as in Rhythm is a Dancer. The `costs` choose among passages. Raises
    as `draw_motifs`.
    """
    draw = _Draw.of(request, constraints, pins, banned, costs)
    if request.config.phrase_counts == 1:
        return draw_motifs_of_parts(
            draw.parts, draw.goals, rng=rng, pins=pins, banned=banned, possible=draw.possible, need=draw.need
        )
    n_draws = min(1 + (len(draw.parts) - len(pins)) // _WORDS_A_DRAW, most_draws)
    return min((draw.dance(rng) for _ in range(n_draws)), key=draw.away)


def drawn_words(request: DanceRequest, constraints: ResolvedConstraints, motifs: Indices) -> Indices:
    """Words (N,) of takes that show the passages of a dance of motifs (N,), -1 where no passage has them.

    They are those of the first take that has a passage of these motifs on these counts.
    """
    draw = _Draw.of(request, constraints, dict(enumerate(motifs.tolist())), (), None)
    found = np.full(len(motifs), -1)
    to_find = list(draw.passages) if request.config.phrase_counts > 1 else []
    while to_find:
        passage = to_find.pop()
        here = passage.slots
        runs = draw.words.runs(draw.position[here], draw.takes[passage.start], draw.allowed[here])
        if len(runs):
            found[here] = runs[0]
        elif passage.stop - passage.start > _FEWEST_OF_PASSAGE:
            to_find += passage.halves()
    return found


def first_slots(request: DanceRequest, constraints: ResolvedConstraints, motifs: Indices) -> Indices:
    """For every slot (N,), the slot with the same motif where the song first had this part of the phrase.

    It is the slot itself if the motifs (N,) of the dance do not return there, or are drawn one by one.
    """
    firsts = np.arange(len(motifs))
    if request.config.phrase_counts == 1:
        return firsts
    draw = _Draw.of(request, constraints, {}, (), None)
    seen: dict[tuple[int, int, int], Indices] = {}
    for passage in draw.passages:
        if passage.place is not None:
            here = firsts[passage.slots].copy()
            before = seen.setdefault(passage.place, here)
            firsts[passage.slots] = np.where(motifs[before] == motifs[here], before, here)
    return firsts


@dataclass(frozen=True, eq=False)
class _Draw:
    """What a draw of the N motifs of a dance depends on, beside chance."""

    words: TakeWords
    goals: Sequence[MotifGoal]
    parts: Indices  # (N,) the goal of each slot
    position: Indices  # (N,) in the bar
    takes: NDArray[np.bool_]  # (N, takes) that may be danced
    possible: NDArray[np.bool_]  # (N, K) motifs that have a word on the count
    allowed: NDArray[np.bool_]  # (N, K) motifs that are neither banned nor contradict a pin
    passages: Sequence[PassageSlots]
    pins: Mapping[int, int]
    need: str
    costs: SlotCosts | None

    @classmethod
    def of(
        cls,
        request: DanceRequest,
        constraints: ResolvedConstraints,
        pins: Mapping[int, int],
        banned: Collection[int],
        costs: SlotCosts | None,
    ) -> _Draw:
        """The draw for a request. Raises as `draw_motifs`."""
        config, material = request.config, request.material
        words, starts_s = TakeWords.of(request.repertoire), constraints.bounds_s[:-1]
        position, parts = bar_positions(starts_s, constraints.counts), material.parts_at(starts_s)
        if config.phrase_counts == 1 and config.motif_draw == "absolute":
            position = np.full(len(starts_s), UNKNOWN)
        takes = constraints.take_wanted
        possible = possible_motifs(position, words.position, takes, words.vocabulary)
        if costs is not None:
            possible &= _with_a_word(costs, len(position), words.vocabulary)
        return cls(
            words, [part.goal for part in material.goals], parts, position, takes, possible,
            allowed_motifs(possible, pins, banned),
            passage_slots(position, parts, config.phrase_counts, starts_s, request.song_features.form),
            pins, config.motif_draw, costs,
        )  # fmt: skip

    def dance(self, rng: np.random.Generator) -> Indices:
        """The motifs (N,) of a dance, drawn passage by passage."""
        motifs = np.full(len(self.parts), _NO_MOTIF)
        motifs[list(self.pins)] = list(self.pins.values())
        to_draw = list(self.passages)
        while to_draw:
            passage = to_draw.pop(0)
            if (
                passage.ends
                and passage.stop - passage.start > _VARIED_COUNTS
                and self._returns(passage, motifs)
            ):
                to_draw[:0] = passage.with_end(_VARIED_COUNTS)
                continue
            here, allowed = passage.slots, self.allowed[passage.slots]
            danced = _danced_so_far(passage, motifs, self.parts, self.words.vocabulary.n_motifs)
            again = [later for later in to_draw if _is_same(passage, later, self.parts)]
            danced = replace(danced, times=1 + len(again), may_vary=passage.ends)
            if self._returns(passage, motifs):
                danced = replace(danced, returning=motifs[here])
            goal = self.goals[self.parts[passage.start]]
            drawn = draw_passage(
                self.words, goal, danced, slot_position=self.position[here],
                takes=self.takes[passage.start], allowed=allowed, need=self.need, rng=rng,
                costs=None if self.costs is None else self.costs(here),
            )  # fmt: skip
            if drawn is None and passage.stop - passage.start > 1:
                to_draw[:0] = passage.halves()
                continue
            if drawn is None:
                drawn = _single_motif(goal, danced, allowed, self.need, rng)
            for same in (passage, *again):
                if self.allowed[same.slots][np.arange(len(drawn)), drawn].all():
                    motifs[same.slots] = drawn
        return motifs

    def _returns(self, passage: PassageSlots, motifs: Indices) -> bool:
        """Whether the motifs (N,) drawn so far include this passage, because the song had it before."""
        return passage.place is not None and bool((motifs[passage.slots] != _NO_MOTIF).all())

    def away(self, motifs: Indices) -> float:
        """Sum of the χ² distances of the parts of a dance (N,) from their signatures, by their lengths."""
        away = 0.0
        for part, goal in enumerate(self.goals):
            own = motifs[self.parts == part]
            if len(own):
                shares = signature(own, len(goal.signature))
                away += len(own) * float(chi_square_distance(shares, goal.signature))
        return away


def _with_a_word(costs: SlotCosts, n_slots: int, vocabulary: Vocabulary) -> NDArray[np.bool_]:
    """Motifs (N, K) that have a word with a finite cost in each slot."""
    found = np.zeros((n_slots, vocabulary.n_motifs), bool)
    for slots in frame_blocks(n_slots, _SLOTS_AT_ONCE):
        slot, word = np.nonzero(np.isfinite(costs(slots)))
        found[slots.start + slot, vocabulary.word_motif[word]] = True
    return found


def _is_same(passage: PassageSlots, other: PassageSlots, parts: Indices) -> bool:
    """Whether the song has the same part of a phrase in both, in one part of the dance."""
    same_part = bool(parts[passage.start] == parts[other.start])
    return passage.place is not None and passage.place == other.place and same_part


def _danced_so_far(passage: PassageSlots, motifs: Indices, parts: Indices, n_motifs: int) -> DancedSoFar:
    """What is danced before a passage, with the motifs (N,) that are drawn and pinned so far."""
    in_part = parts == parts[passage.start]
    others = in_part.copy()
    others[passage.slots] = False
    known = motifs[others & (motifs != _NO_MOTIF)]
    before = int(motifs[passage.start - 1]) if passage.start else None
    after = int(motifs[passage.stop]) if passage.stop < len(motifs) else _NO_MOTIF
    return DancedSoFar(
        np.bincount(known, minlength=n_motifs).astype(np.float64),
        before,
        None if after == _NO_MOTIF else after,
        int(in_part.sum()),
    )


def _single_motif(
    goal: MotifGoal, danced: DancedSoFar, allowed: NDArray[np.bool_], need: str, rng: np.random.Generator
) -> Indices:
    """The motif (1,) of a slot that no word fits, by equation 5."""
    motif = draw_next_motif(
        danced.counts, goal.signature, goal.transitions, rng=rng, previous=danced.previous,
        possible=np.concatenate([allowed, np.ones_like(allowed)]), need=need,
    )  # fmt: skip
    return np.array([motif])


# The slots of a dance as passages, by the bars and phrases of the song.

_SAME_TIME_S = 1e-3


@dataclass(frozen=True)
class PassageSlots:
    """The slots of one passage of a dance."""

    start: int
    stop: int  # one after the last
    place: tuple[int, int, int] | None = None  # equal where the song repeats a phrase. None outside phrases
    ends: bool = False  # whether it is the last one of its phrase

    @property
    def slots(self) -> slice:
        """The slots as an index."""
        return slice(self.start, self.stop)

    def halves(self) -> tuple[PassageSlots, PassageSlots]:
        """Two shorter passages without a place."""
        middle = (self.start + self.stop) // 2
        return PassageSlots(self.start, middle), PassageSlots(middle, self.stop)

    def with_end(self, n_counts: int) -> tuple[PassageSlots, PassageSlots]:
        """The passage without its last counts, and these counts as another passage of the same place."""
        middle, place = self.stop - n_counts, self.place
        return (
            PassageSlots(self.start, middle, place and (place[0], place[1], middle - self.start)),
            PassageSlots(middle, self.stop, place and (place[0], -1 - place[1], n_counts), self.ends),
        )


def passage_slots(
    slot_position: Indices, parts: Indices, phrase_counts: int, starts_s: Floats, form: Form
) -> list[PassageSlots]:
    """The slots (N,) of a dance as passages, in order.

    A passage begins where a part of the dance or a phrase of the song (`form`) begins. It ends before the
    start of a bar, if bars are known, as near to `phrase_counts` as possible. The last passage of a phrase
    may be shorter. `slot_position` (N,) is as in `choreography.motif_sequences`, and `starts_s` (N,) are the
    times of the slots.

    Examples
    --------
    >>> import numpy as np
    >>> from choreograph.choreography.passages import passage_slots
    >>> from choreograph.music.form import Form
    >>> bars_of_three = 300 + np.arange(24) % 3 + 1
    >>> found = passage_slots(bars_of_three, np.zeros(24, int), 8, np.arange(24.0), Form.empty())
    >>> [passage.stop - passage.start for passage in found]
    [9, 9, 6]
    """
    n_slots = len(slot_position)
    bars = np.flatnonzero(count_numbers(slot_position) == 1)
    first_slots = np.searchsorted(starts_s, [phrase.start_s - _SAME_TIME_S for phrase in form.phrases])
    on_bar = np.isin(first_slots, bars)
    labels = {int(first_slots[i]): label for i, label in enumerate(form.labels) if on_bar[i]}
    changes = np.flatnonzero(np.diff(parts)) + 1
    borders = np.unique([0, *changes.tolist(), *bars[:1].tolist(), *labels, n_slots])
    passages = []
    for start, stop in pairwise(borders.tolist()):
        first, index = start, 0
        while first < stop:
            last = passage_stop(first, stop, bars, phrase_counts)
            place = (labels[start], index, last - first) if start in labels else None
            passages.append(PassageSlots(first, last, place, ends=last == stop))
            first, index = last, index + 1
    return passages


def passage_stop(start: int, stop: int, bars: Indices, phrase_counts: int) -> int:
    """The slot before which a passage ends that begins at `start`, at most `stop`.

    It is the start of a bar (`bars`, slots) if one is in between, as near to `phrase_counts` as possible.
    """
    inside = bars[(bars > start) & (bars < stop)]
    possible = np.append(inside if len(inside) else np.arange(start + 1, stop), stop)
    return int(possible[np.abs(possible - (start + phrase_counts)).argmin()])
