"""Pinned and banned motifs in a dance of the graph: words in place of what is not as asked, until all is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import NoPathError
from choreograph.motifs.words import poses_at
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion
from choreograph.motion.pose import phrases_from_own_place
from choreograph.pipeline.asked import Asked
from choreograph.pipeline.rendering import danced_motifs, render
from choreograph.pipeline.shelf import Shelf, stretches
from choreograph.plan import Plan
from choreograph.repertoire import Repertoire
from choreograph.rollout.mixer import Choices, choose_words
from choreograph.rollout.word_bank import AROUND_S

Indices = NDArray[np.int64]


def overlaid_plan(plan: Plan, motion: Motion, asked: Asked, repertoire: Repertoire) -> tuple[Plan, Motion]:
    """The plan with words wherever pinned motifs are not danced, or banned ones are, and its motion.

    Each word is the one that joins best to what is danced around it; the result is rendered and measured,
    and a word that is not its motif any more, or makes another place wrong, gives way to the next.

    Raises `NoPathError` naming the motif and the instant for which there is no word left.
    """
    shelf = Shelf.of(asked, repertoire, np.random.default_rng(plan.seed))
    around = _Around(body_pos_m(motion), motion.fps)
    choices: dict[int, Choices] = {}
    chosen: dict[int, int] = {}
    made = plan
    while True:
        danced = danced_motifs(motion, asked.bounds_s, repertoire)
        wrong = unfulfilled(danced, asked)
        if not wrong:
            return made, motion
        for place in wrong:
            here = choices.get(place) or around.joined_to(shelf, place)
            choices[place] = here.without(chosen[place]) if place in chosen else here
            if not np.isfinite(choices[place].price_m).any():
                raise NoPathError(nothing_left(place, asked))
        chosen = _chosen(choices)
        words = tuple(shelf.planned(place, word, pinned=True) for place, word in sorted(chosen.items()))
        made = replace(plan, words=words)
        motion = render(made, repertoire)


def unfulfilled(danced: Indices, asked: Asked) -> list[int]:
    """Places whose motif (N,) is another than asked for, or banned; -1 is no motif that could be told."""
    banned = np.append(asked.motif_banned, False)[danced]
    return [
        place
        for place, motif in enumerate(danced)
        if banned[place] or (place in asked.motifs and motif != asked.motifs[place])
    ]


def nothing_left(place: int, asked: Asked) -> str:
    """What to tell a user when no word is left for a place."""
    at = f"{asked.bounds_s[place]:.1f} s"
    if place in asked.motifs:
        return (
            f"no word of motif {asked.motifs[place]} can be danced at {at} so that it stays that motif: "
            "pin it elsewhere, or another"
        )
    return f"no word can be danced at {at} that is none of the banned motifs: ban fewer"


def _chosen(choices: dict[int, Choices]) -> dict[int, int]:
    """The word of every place; of places that follow one another, those that go best together."""
    chosen: dict[int, int] = {}
    for places in stretches(dict.fromkeys(choices)):
        words = choose_words([choices[place] for place in places])
        chosen.update(zip(places, words.tolist(), strict=True))
    return chosen


class _Around:
    """The dance that words are put into: its poses at the words' borders."""

    def __init__(self, body: NDArray[np.float64], fps: float) -> None:
        self._body, self._fps = body, fps

    def joined_to(self, shelf: Shelf, place: int) -> Choices:
        """The words for a place, dearer by what they are off from the dance at their borders."""
        here = shelf.choices(place, shelf.asked.motifs.get(place))
        start_s, end_s = shelf.asked.bounds_s[place : place + 2]
        off_m = self._off_m(here.first_m, start_s) + self._off_m(here.last_m, end_s)
        return replace(here, price_m=here.price_m + off_m)

    def _off_m(self, poses_m: NDArray[np.floating], at_s: float) -> NDArray[np.floating]:
        mine = phrases_from_own_place(poses_at(self._body, self._fps, at_s + AROUND_S))  # (3, 21, 3)
        return np.sqrt(np.square(poses_m - mine).sum(axis=-1).mean(axis=(1, 2)))
