"""Pinned and banned motifs in a dance: words of takes replace what violates them, until nothing does."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from choreograph.constraints.resolve import ResolvedConstraints
from choreograph.counts import Counts
from choreograph.engines.candidates import CandidatePool, Candidates, consecutive_slots
from choreograph.engines.danced_motifs import danced_motifs
from choreograph.engines.word_bank import AROUND_S
from choreograph.engines.word_search import search_words
from choreograph.errors import NoPathError
from choreograph.features.phrasing import coming_to_rest_s
from choreograph.motifs.words import poses_at
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion
from choreograph.motion.pose import clips_to_root_frame
from choreograph.plan import Plan, PlannedWord
from choreograph.repertoire import Repertoire

Indices = NDArray[np.int64]
WithWords = Callable[[tuple[PlannedWord, ...]], tuple[Plan, Motion]]


def enforce_motifs(
    plan: Plan,
    motion: Motion,
    constraints: ResolvedConstraints,
    repertoire: Repertoire,
    with_words: WithWords,
) -> tuple[Plan, Motion]:
    """The plan with words wherever pinned motifs are not danced, or banned ones are, and its motion.

    Each word is the one with the best transitions from and to what is danced around it. The result is
    rendered, by `with_words`, and checked: a word that no longer shows its motif, or makes another slot
    wrong, is replaced by the next best.

    Raises `NoPathError` naming the motif and the time for which no word is left.
    """
    song_counts = Counts(np.array(plan.music_beats_s), np.array(plan.music_beat_numbers), plan.metre)
    pool = CandidatePool.of(constraints, repertoire, song_counts, np.random.default_rng(plan.seed))
    surroundings = _Surroundings(body_pos_m(motion), motion.fps)
    candidates: dict[int, Candidates] = {}
    chosen: dict[int, int] = {}
    enforced = plan
    while True:
        danced = danced_motifs(motion, constraints.bounds_s, repertoire)
        wrong = [slot for slot in violated_slots(danced, constraints) if is_danced(slot, plan, constraints)]
        if not wrong:
            return enforced, motion
        for slot in wrong:
            here = candidates.get(slot) or surroundings.candidates(pool, slot)
            candidates[slot] = here.without(chosen[slot]) if slot in chosen else here
            if not candidates[slot].any_left:
                raise NoPathError(no_word_left(slot, constraints))
        chosen = _chosen(candidates)
        words = tuple(pool.planned(slot, word, pinned=True) for slot, word in sorted(chosen.items()))
        enforced, motion = with_words(words)


def is_danced(slot: int, plan: Plan, constraints: ResolvedConstraints) -> bool:
    """Whether a slot is danced throughout, and not in part or all of it a pose that is held."""
    end_s = plan.duration_s if plan.closing_s is None else coming_to_rest_s(plan.opening_s, plan.closing_s)[0]
    start_s, stop_s = constraints.bounds_s[slot : slot + 2]
    return start_s >= plan.opening_s and stop_s <= end_s


def violated_slots(danced: Indices, constraints: ResolvedConstraints) -> list[int]:
    """Slots whose motif (N,) is not the required one, or is banned; -1 is a word without a motif."""
    banned = np.append(constraints.motif_banned, False)[danced]
    return [
        slot
        for slot, motif in enumerate(danced)
        if banned[slot] or (slot in constraints.motifs and motif != constraints.motifs[slot])
    ]


def no_word_left(slot: int, constraints: ResolvedConstraints) -> str:
    """The message for a slot that no word is left for."""
    at = f"{constraints.bounds_s[slot]:.1f} s"
    if slot in constraints.motifs:
        return (
            f"no word of motif {constraints.motifs[slot]} can be danced at {at} so that it stays that motif: "
            "pin it elsewhere, or another"
        )
    return f"no word can be danced at {at} that is none of the banned motifs: ban fewer"


def _chosen(candidates: dict[int, Candidates]) -> dict[int, int]:
    """The word of every slot; words of consecutive slots are chosen together."""
    chosen: dict[int, int] = {}
    for slots in consecutive_slots(dict.fromkeys(candidates)):
        words = search_words([candidates[slot] for slot in slots])
        chosen.update(zip(slots, words.tolist(), strict=True))
    return chosen


class _Surroundings:
    """The dance that words are put into: its poses at their borders."""

    def __init__(self, body: NDArray[np.float64], fps: float) -> None:
        self._body, self._fps = body, fps

    def candidates(self, pool: CandidatePool, slot: int) -> Candidates:
        """The words for a slot; the distance from the dance at both borders adds to their cost."""
        here = pool.candidates(slot, pool.constraints.motifs.get(slot))
        start_s, end_s = pool.constraints.bounds_s[slot : slot + 2]
        distance_m = self._distance_m(here.first_m, start_s) + self._distance_m(here.last_m, end_s)
        return replace(here, cost_m=here.cost_m + distance_m)

    def _distance_m(self, poses_m: NDArray[np.floating], at_s: float) -> NDArray[np.floating]:
        danced_m = clips_to_root_frame(poses_at(self._body, self._fps, at_s + AROUND_S))  # (3, 21, 3)
        return np.sqrt(np.square(poses_m - danced_m).sum(axis=-1).mean(axis=(1, 2)))
