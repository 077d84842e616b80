"""Several attempts of the rollout network at a word (ours): the one nearest to what was asked is danced.

A network that is trained for minutes blurs the words that it is asked for. Asked for a word that is farther
from the mean of all words, it shows the one that is wanted more often. The words are compared as the
network of words embeds them. Rhythm is a Dancer makes one attempt.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from choreograph.core.numerics import AnyFloats
from choreograph.core.timebase import WORD_FRAMES
from choreograph.library.repertoire import Repertoire
from choreograph.library.words import poses_at
from choreograph.motion.body import body_pos_m
from choreograph.motion.skeleton import Skeleton
from choreograph.nets.inference import Array
from choreograph.nets.rollout_poses import ROLLOUT_FPS, to_motion

ASKED = (1.0, 1.2, 1.4, 0.85)  # distances from the mean of all words, of that of the word that is wanted


@dataclass(frozen=True, eq=False)
class WordJudge:
    """Embeds attempts at a word, and compares them with the embedding that is wanted."""

    embed: Callable[[NDArray[np.floating]], Array]  # of words (N, 13, 21, 3): (N, 184)
    mean: NDArray[np.floating]  # (184,) of all motifs
    skeleton: Skeleton

    @classmethod
    def of(cls, repertoire: Repertoire, skeleton: Skeleton) -> Self:
        """The judge by the word network of a repertoire."""
        return cls(
            repertoire.word_net().embed, repertoire.vocabulary.motifs.embeddings.mean(axis=0), skeleton
        )

    def asked(self, wanted: NDArray[np.floating]) -> Array:
        """What the network is asked for, (A, 184), to show a word (184,)."""
        asked: Array = (self.mean + np.outer(ASKED, wanted - self.mean)).astype(np.float32)
        return asked

    def nearest(self, rows: AnyFloats, span_s: tuple[float, float], wanted: NDArray[np.floating]) -> int:
        """The attempt whose word is nearest to the one that is wanted.

        `span_s` is that of the word, from the first frame of the pose rows (A, T, P) on.
        """
        motion = to_motion(np.concatenate(rows), self.skeleton)
        body = body_pos_m(motion)  # (A T, 21, 3), where attempts follow each other
        last = rows.shape[1] - 1
        frames = np.clip(np.linspace(*span_s, WORD_FRAMES) * ROLLOUT_FPS, 0, last)  # (13,)
        first = np.arange(len(rows)) * rows.shape[1]
        shown = self.embed(poses_at(body, 1.0, first[:, None] + frames))  # (A, 184)
        return int(np.linalg.norm(shown - wanted, axis=1).argmin())
