"""Pinned and banned motifs in a dance of the graph: words in place of what is not as asked, until all is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from choreograph.constraints.resolve import ResolvedConstraints
from choreograph.engines.candidates import CandidatePool, stretches
from choreograph.engines.rendering import danced_motifs, render
from choreograph.engines.word_bank import AROUND_S
from choreograph.engines.word_search import Candidates, search_words
from choreograph.errors import NoPathError
from choreograph.motifs.words import poses_at
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion
from choreograph.motion.pose import clips_to_root_frame
from choreograph.plan import Plan
from choreograph.repertoire import Repertoire

Indices = NDArray[np.int64]


def enforce_motifs(
    plan: Plan, motion: Motion, resolved: ResolvedConstraints, repertoire: Repertoire
) -> tuple[Plan, Motion]:
    """The plan with words wherever pinned motifs are not danced, or banned ones are, and its motion.

    Each word is the one that joins best to what is danced around it; the result is rendered and measured,
    and a word that is not its motif any more, or makes another place wrong, gives way to the next.

    Raises `NoPathError` naming the motif and the instant for which there is no word left.
    """
    pool = CandidatePool.of(resolved, repertoire, np.random.default_rng(plan.seed))
    around = _Around(body_pos_m(motion), motion.fps)
    candidates: dict[int, Candidates] = {}
    chosen: dict[int, int] = {}
    made = plan
    while True:
        danced = danced_motifs(motion, resolved.bounds_s, repertoire)
        wrong = violated_slots(danced, resolved)
        if not wrong:
            return made, motion
        for slot in wrong:
            here = candidates.get(slot) or around.joined_to(pool, slot)
            candidates[slot] = here.without(chosen[slot]) if slot in chosen else here
            if not np.isfinite(candidates[slot].price_m).any():
                raise NoPathError(nothing_left(slot, resolved))
        chosen = _chosen(candidates)
        words = tuple(pool.planned(slot, word, pinned=True) for slot, word in sorted(chosen.items()))
        made = replace(plan, words=words)
        motion = render(made, repertoire)


def violated_slots(danced: Indices, resolved: ResolvedConstraints) -> list[int]:
    """Places whose motif (N,) is another than asked for, or banned; -1 is no motif that could be told."""
    banned = np.append(resolved.motif_banned, False)[danced]
    return [
        slot
        for slot, motif in enumerate(danced)
        if banned[slot] or (slot in resolved.motifs and motif != resolved.motifs[slot])
    ]


def nothing_left(slot: int, resolved: ResolvedConstraints) -> str:
    """What to tell a user when no word is left for a place."""
    at = f"{resolved.bounds_s[slot]:.1f} s"
    if slot in resolved.motifs:
        return (
            f"no word of motif {resolved.motifs[slot]} can be danced at {at} so that it stays that motif: "
            "pin it elsewhere, or another"
        )
    return f"no word can be danced at {at} that is none of the banned motifs: ban fewer"


def _chosen(candidates: dict[int, Candidates]) -> dict[int, int]:
    """The word of every place; of places that follow one another, those that go best together."""
    chosen: dict[int, int] = {}
    for slots in stretches(dict.fromkeys(candidates)):
        words = search_words([candidates[slot] for slot in slots])
        chosen.update(zip(slots, words.tolist(), strict=True))
    return chosen


class _Around:
    """The dance that words are put into: its poses at the words' borders."""

    def __init__(self, body: NDArray[np.float64], fps: float) -> None:
        self._body, self._fps = body, fps

    def joined_to(self, pool: CandidatePool, slot: int) -> Candidates:
        """The words for a place, dearer by what they are off from the dance at their borders."""
        here = pool.candidates(slot, pool.resolved.motifs.get(slot))
        start_s, end_s = pool.resolved.bounds_s[slot : slot + 2]
        off_m = self._off_m(here.first_m, start_s) + self._off_m(here.last_m, end_s)
        return replace(here, price_m=here.price_m + off_m)

    def _off_m(self, poses_m: NDArray[np.floating], at_s: float) -> NDArray[np.floating]:
        mine = clips_to_root_frame(poses_at(self._body, self._fps, at_s + AROUND_S))  # (3, 21, 3)
        return np.sqrt(np.square(poses_m - mine).sum(axis=-1).mean(axis=(1, 2)))
