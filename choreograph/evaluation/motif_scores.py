"""The motifs that a dance is made of, and what they say of its genre and of its song's sections."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.building.segmentation import WORD_FPS
from choreograph.evaluation.measuring import Scores
from choreograph.features.sections import Sections
from choreograph.metrics import structure
from choreograph.motifs.vocabulary import ALL_GENRES
from choreograph.motifs.words import segment_words
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion
from choreograph.repertoire import Repertoire

Floats = NDArray[np.float64]

_CHANCE_ROUNDS = 100
_ANYWHERE = 0.01


@dataclass(frozen=True, eq=False)
class DancedMotifs:
    """The motifs of a dance in their order, and when each begins and ends."""

    motifs: NDArray[np.int64]  # (N,)
    start_s: Floats  # (N,)
    end_s: Floats  # (N,)

    def __len__(self) -> int:
        return len(self.motifs)


class SignatureJudge:
    """Measures which motifs of a repertoire's vocabulary a dance is made of."""

    def __init__(self, repertoire: Repertoire) -> None:
        self.vocabulary = repertoire.vocabulary
        self._net = repertoire.word_net()

    def motifs_of(self, motion: Motion, music_beats_s: Floats) -> DancedMotifs:
        """The dance's motifs, cut on the music's beats."""
        words = segment_words(body_pos_m(motion.resampled(WORD_FPS)), WORD_FPS, music_beats_s)
        if len(words) == 0:
            return DancedMotifs(np.zeros(0, np.int64), np.zeros(0), np.zeros(0))
        motifs = self.vocabulary.motifs.nearest(self._net.embed(words.body_pos_m))
        return DancedMotifs(motifs, words.start_s, words.end_s)

    def template(self, genre: str) -> Floats:
        """The genre's signature (K,); that of all genres if it is not among the repertoire's."""
        return self.vocabulary.signatures[self.vocabulary.genre_index(self._known(genre))]

    def scores(self, danced: DancedMotifs, genre: str) -> Scores:
        """How near the motifs are to a genre's shares of them, and to its steps from one to the next.

        Chance is motifs of words drawn from all the repertoire's, and the same motifs in any order. A step
        that the genre's takes never make would be infinitely surprising: one in a hundred is taken to lead
        anywhere.
        """
        motifs = danced.motifs
        if len(motifs) < 2:
            return Scores({})
        genre, n_motifs = self._known(genre), self.vocabulary.n_motifs
        template = self.template(genre)
        steps = self.vocabulary.transitions[self.vocabulary.genre_index(genre)]
        steps = (1.0 - _ANYWHERE) * steps + _ANYWHERE / n_motifs
        rng = np.random.default_rng(len(motifs))
        drawn = [rng.choice(self.vocabulary.word_motif, len(motifs)) for _ in range(_CHANCE_ROUNDS)]
        chance = np.mean([structure.signature_distance(motifs_of, template) for motifs_of in drawn])
        return Scores(
            {
                "signature_chi2": structure.signature_distance(motifs, template),
                "transition_bits": structure.transition_bits(motifs, steps),
                "longest_repeat_motifs": float(structure.longest_repeat(motifs)),
            },
            {
                "signature_chi2": float(chance),
                "transition_bits": structure.transition_chance_bits(motifs, steps),
            },
        )

    def section_scores(self, danced: DancedMotifs, sections: Sections) -> Scores:
        """Whether music that comes again is danced with the same motifs; nothing without sections."""
        if len(danced) == 0 or len(sections) == 0:
            return Scores({})
        moves = structure.moves_of_sections(danced.motifs, danced.start_s, sections.bounds_s)
        likeness = {
            "section_agreement": structure.shared_moves(moves, self.vocabulary.n_motifs),
            "section_agreement_in_step": structure.moves_in_step(moves),
        }
        values = {name: structure.section_agreement(like, sections.labels) for name, like in likeness.items()}
        return Scores(values, dict.fromkeys(values, 0.0))

    def _known(self, genre: str) -> str:
        return genre if genre in self.vocabulary.genres else ALL_GENRES
