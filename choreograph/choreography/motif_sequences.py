"""Sequences of motifs: the goals of a dance, and random sequences towards them, on the beats of the bar."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.core.counts import UNKNOWN
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats, Indices
from choreograph.library.vocabulary import ALL_GENRES, Vocabulary, checked_signature

# Goals for a whole dance: its motif signature and its motif transitions.


@dataclass(frozen=True, eq=False)
class MotifGoal:
    """The target signature, and the probabilities of transitions between motifs."""

    signature: Floats  # (K,)
    transitions: Floats  # (K, K) row i: probabilities of the motif after motif i


def motif_goal(
    vocabulary: Vocabulary, *, genre: str | None = None, signature: Floats | None = None
) -> MotifGoal:
    """The goal of a genre, or of a custom signature (K,) with a genre's transitions.

    Without a genre the transitions are those of all takes. Raises `ParameterError` for an unknown genre, or
    a signature that does not match this vocabulary's motifs or does not sum to 1.
    """
    row = vocabulary.genre_index(ALL_GENRES if genre is None else genre)
    shares = vocabulary.signatures[row] if signature is None else signature
    return MotifGoal(checked_signature(shares, vocabulary.n_motifs), vocabulary.transitions[row])


def words_on_count(wanted: int, word_position: Indices, words: Indices) -> NDArray[np.bool_]:
    """Which of the words (M,) begin at a position in the bar. All do if positions are unknown.

    `word_position` (W,) is that of all words, `wanted` that of a slot of the dance.
    """
    known = wanted != UNKNOWN and bool((word_position != UNKNOWN).any())
    return word_position[words] == wanted if known else np.ones(len(words), bool)


def possible_motifs(
    slot_position: Indices, word_position: Indices, takes: NDArray[np.bool_], vocabulary: Vocabulary
) -> NDArray[np.bool_]:
    """Motifs (N, K) that have a word of the `takes` (N, takes) on the count of each slot (N,).

    Where these takes have no word on the count, all of their motifs are possible.
    """
    possible = np.zeros((len(slot_position), vocabulary.n_motifs), bool)
    for slot, wanted in enumerate(slot_position):
        words = np.flatnonzero(takes[slot, vocabulary.word_take])
        on_count = words[words_on_count(wanted, word_position, words)]
        possible[slot, vocabulary.word_motif[on_count if len(on_count) else words]] = True
    return possible


def shares_on_count(
    slot_position: Indices, word_position: Indices, takes: NDArray[np.bool_], vocabulary: Vocabulary
) -> Floats:
    """Of the words of each motif, the share (N, K) that begins on the count of each slot (N,).

    Only words of the `takes` (N, takes) are counted. The share is NaN where none of them is on the count.
    """
    shares = np.full((len(slot_position), vocabulary.n_motifs), np.nan)
    for slot, wanted in enumerate(slot_position):
        words = takes[slot, vocabulary.word_take]
        on_count = words & (word_position == wanted)
        if wanted == UNKNOWN or not on_count.any():
            continue
        n_words, n_on_count = (
            np.bincount(vocabulary.word_motif[which], minlength=vocabulary.n_motifs)
            for which in (words, on_count)
        )
        shares[slot] = n_on_count / np.maximum(n_words, 1)
    return shares


# Sequences of motifs, drawn so that they have the signature and transitions of a genre, around pinned motifs.
#
# Rhythm is a Dancer, section 4.3. Equation 5 is, componentwise, p_{k+1} = |s_k - s_G| · T_j, normalised to
# sum to 1. Here s_k is the signature of the dance so far, s_G the target signature, and T_j the row of the
# transition matrix for the last motif. Literally, a motif that is danced too often is as likely as one that
# is danced too seldom. This contradicts the text, which raises "the probability of missing motifs". Our
# default is therefore the missing part of the difference, max(s_G - s_k, 0) (parameter `need`).


NEEDS = ("missing", "absolute")
_UNSEEN = 1e-9  # probability of unseen transitions in the backward messages, for pins that need one
_DEAD_END = 1e-7  # missing motifs with a smaller share of the probability reach the next pin only by them


def draw_motifs(
    n_words: int,
    signature: Floats,
    transitions: Floats,
    *,
    rng: np.random.Generator,
    pins: Mapping[int, int] | None = None,
    banned: Collection[int] = (),
    possible: NDArray[np.bool_] | None = None,
    need: str = "missing",
    previous: int | None = None,
) -> NDArray[np.int64]:
    """A dance of `n_words` motifs, (N,).

    Parameters
    ----------
    signature : float array (K,)       target signature s_G
    transitions : float array (K, K)   row i: probabilities of the motif after motif i
    pins : position -> motif           always kept. Pinning all positions re-creates a given dance
    banned : motifs that must not occur
    possible : bool array (N, K)       which motifs each word may be, such as those that have a word on its
        count, or all if there is none. This is not in the paper
    need : "missing" or "absolute", the reading of the difference in equation 5, see above
    previous : the motif before the first word, if it is known

    Each motif is drawn by equation 5 times the probability that the transitions lead from it to the next pin
    in the remaining steps, by possible motifs (backward messages, one per position). Gaps are therefore
    filled with observed transitions wherever possible. Pinned motifs are counted from the start, and the gaps
    have the rest of the signature. If no missing motif can follow, any motif that can follow is drawn. If
    none can follow, because pins or bans contradict the transitions, any allowed motif is drawn.

    Raises `ParameterError` if shapes disagree, the signature or a row does not sum to 1, a pin is outside
    the dance, a pin or ban is of an unknown motif, a pinned motif is banned, or all motifs are.
    """
    n_motifs = len(np.atleast_1d(signature))
    target = checked_signature(signature, n_motifs)
    transitions = _checked_transitions(transitions, n_motifs)
    if n_words < 0 or need not in NEEDS:
        raise ParameterError(
            f"expected at least 0 words and a need among {', '.join(NEEDS)}, got {n_words} and {need!r}"
        )
    pins = dict(pins or {})
    everywhere = np.ones((n_words, n_motifs), bool) if possible is None else possible
    if np.shape(everywhere) != (n_words, n_motifs):
        raise ParameterError(f"expected possible motifs {(n_words, n_motifs)}, got {np.shape(everywhere)}")
    allowed = allowed_motifs(everywhere, pins, banned)  # (N, K)
    smoothed = (1.0 - _UNSEEN) * transitions + _UNSEEN / n_motifs
    last = n_words - 1 if possible is not None else max(pins, default=0)
    messages = _backward_messages(last, smoothed, pins, allowed)
    counts = np.bincount(list(pins.values()), minlength=n_motifs).astype(np.float64)
    motifs = np.empty(n_words, np.int64)
    for position in range(n_words):
        if position in pins:
            motifs[position] = pins[position]
            continue
        before = motifs[position - 1] if position else previous
        prior = target if before is None else transitions[before]
        possible_now = messages[position] * allowed[position]
        motifs[position] = _drawn(prior, possible_now, _need(counts, target, need), rng)
        counts[motifs[position]] += 1
    return motifs


def draw_motifs_of_parts(
    parts: Indices,
    goals: Sequence[MotifGoal],
    *,
    rng: np.random.Generator,
    pins: Mapping[int, int],
    banned: Collection[int],
    possible: NDArray[np.bool_],
    need: str,
) -> NDArray[np.int64]:
    """A dance whose parts have goals of their own, (N,): `draw_motifs` for each part, in order.

    `parts` (N,) is the index of the goal of each word. The count of motifs restarts where a part begins.
    Raises as `draw_motifs`.
    """
    motifs = np.empty(len(parts), np.int64)
    borders = np.flatnonzero(np.diff(parts)) + 1
    for words in np.split(np.arange(len(parts)), borders):
        first, goal = int(words[0]), goals[parts[words[0]]]
        motifs[words] = draw_motifs(
            len(words), goal.signature, goal.transitions, rng=rng,
            pins={slot - first: pins[slot] for slot in words.tolist() if slot in pins},
            banned=banned, possible=possible[words], need=need,
            previous=int(motifs[first - 1]) if first else None,
        )  # fmt: skip
    return motifs


def draw_next_motif(
    danced: NDArray[np.floating],
    signature: Floats,
    transitions: Floats,
    *,
    rng: np.random.Generator,
    previous: int | None,
    possible: NDArray[np.bool_],
    need: str = "missing",
) -> int:
    """The motif of the next word of a dance, as by `draw_motifs` without pins, word by word.

    `danced` (K,) is how often each motif was danced so far and `previous` the last one, None before the first
    word. `possible` (2, K) is which motifs this word and the next may be. A row without any means all. Later
    words are not considered. `signature` (K,) and `transitions` (K, K) are of a checked goal.
    """
    allowed = np.where(possible.any(axis=1, keepdims=True), possible, True)
    n_motifs = len(signature)
    onwards = ((1.0 - _UNSEEN) * transitions + _UNSEEN / n_motifs) @ allowed[1]
    prior = signature if previous is None else transitions[previous]
    missing = _need(np.asarray(danced, np.float64), signature, need)
    return _drawn(prior, onwards / onwards.max() * allowed[0], missing, rng)


def _drawn(prior: Floats, possible: Floats, need: Floats, rng: np.random.Generator) -> int:
    """A motif by equation 5 that may follow and is needed, or else may follow, or else is possible."""
    feasible = prior * possible
    weights = feasible * need
    if weights.sum() <= _DEAD_END * feasible.sum():
        weights = feasible if feasible.sum() > 0 else possible
    return int(rng.choice(len(weights), p=weights / weights.sum()))


def _need(counts: Floats, target: Floats, need: str) -> Floats:
    """Equation 5's difference of signatures, (K,), from the counts of the dance so far (K,)."""
    n_words = max(1.0, counts.sum())
    need_of: Floats = lacking(counts, target, n_words, need) / n_words
    return need_of


def lacking(counts: Floats, target: Floats, n_words: float, need: str) -> Floats:
    """How often each motif (K,) is lacking in a dance that shall have `n_words` words of a signature (K,).

    `counts` (K,) are those of the dance so far, and `need` is as in `draw_motifs`.
    """
    missing = n_words * target - counts
    lacks: Floats = np.maximum(missing, 0.0) if need == "missing" else np.abs(missing)
    return lacks


def _backward_messages(
    last: int, transitions: Floats, pins: Mapping[int, int], allowed: NDArray[np.bool_]
) -> Floats:
    """Likelihood (N, K) that the transitions lead from each motif at a position to all later pins.

    They are scaled so that the largest of a position is 1. From position `last` on, all are 1.
    """
    messages = np.ones(allowed.shape)
    for position in range(last - 1, -1, -1):
        if position + 1 in pins:
            message = transitions[:, pins[position + 1]] * messages[position + 1, pins[position + 1]]
        else:
            message = transitions @ (messages[position + 1] * allowed[position + 1])
        messages[position] = message / message.max()
    return messages


def allowed_motifs(
    possible: NDArray[np.bool_], pins: Mapping[int, int], banned: Collection[int]
) -> NDArray[np.bool_]:
    """The motifs (N, K) that may be drawn for each word: its pinned motif, or possible ones without a ban.

    Where all possible motifs are banned, every other motif may be drawn. Raises as `draw_motifs`.
    """
    n_words, n_motifs = possible.shape
    for motif in (*pins.values(), *banned):
        if not 0 <= motif < n_motifs:
            raise ParameterError(f"expected motifs 0 to {n_motifs - 1}, got motif {motif}")
    for position, motif in pins.items():
        if not 0 <= position < n_words:
            raise ParameterError(
                f"expected pins at words 0 to {n_words - 1} of the dance, got a pin at word {position}"
            )
        if motif in banned:
            raise ParameterError(
                f"expected pinned motifs that are not banned, got motif {motif}, pinned at word {position}: "
                "remove the pin or the ban"
            )
    free = np.ones(n_motifs, bool)
    free[list(banned)] = False
    if not free.any():
        raise ParameterError(f"expected at least one motif that is not banned, got all {n_motifs} banned")
    both = possible & free
    allowed: NDArray[np.bool_] = np.where(both.any(axis=1, keepdims=True), both, free)
    for position, motif in pins.items():
        allowed[position] = np.arange(n_motifs) == motif
    return allowed


def _checked_transitions(transitions: Floats, n_motifs: int) -> Floats:
    rows = np.asarray(transitions, np.float64)
    if rows.shape != (n_motifs, n_motifs):
        raise ParameterError(f"expected transitions ({n_motifs}, {n_motifs}), got {rows.shape}")
    if not (np.isfinite(rows).all() and (rows >= 0).all() and np.allclose(rows.sum(axis=1), 1.0)):
        raise ParameterError(
            "expected rows of transition probabilities that sum to 1, got negative values or other sums"
        )
    return rows
