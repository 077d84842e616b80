"""Scores of the motifs in a dance: against its genre's signature and its song's sections."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.building.segmentation import WORD_FPS
from choreograph.errors import ParameterError
from choreograph.evaluation.scores import Scores
from choreograph.features.sections import Sections
from choreograph.metrics import structure
from choreograph.motifs.vocabulary import ALL_GENRES
from choreograph.motifs.words import segment_words
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion
from choreograph.repertoire import Repertoire

Floats = NDArray[np.float64]

OWN_NETWORK = "own network"  # the one that priced the dances judges them
_CHANCE_ROUNDS = 100
_SMOOTHING = 0.01  # share of the transition probability spread over all motifs


def scorer_for(repertoire: Repertoire, judge: Repertoire | None = None) -> MotifScorer | None:
    """A scorer by the judge's vocabulary, or by the repertoire's own; None if that has no vocabulary.

    A search that prices motifs by a word network may fit the network more than the dance, so a judge was
    trained with another seed. Raises `RepertoireError` if the judge has no vocabulary, `ParameterError` if
    its word network is the repertoire's.
    """
    if judge is None:
        return MotifScorer(repertoire) if repertoire.has_vocabulary else None
    scorer = MotifScorer(judge, network=judge.path.name)
    if repertoire.has_vocabulary:
        own, other = repertoire.net("words").weights, judge.net("words").weights
        if own.keys() == other.keys() and all(np.array_equal(own[name], other[name]) for name in own):
            raise ParameterError(
                f"{judge.path.name}: expected a judge with another word network than {repertoire.path.name}, "
                "got the same: build it with another --seed"
            )
    return scorer


@dataclass(frozen=True, eq=False)
class DancedMotifs:
    """The motifs of a dance in order, with their start and end times."""

    motifs: NDArray[np.int64]  # (N,)
    start_s: Floats  # (N,)
    end_s: Floats  # (N,)

    def __len__(self) -> int:
        return len(self.motifs)


class MotifScorer:
    """Assigns the motion words of a dance to the motifs of a repertoire, and scores the motifs."""

    def __init__(self, repertoire: Repertoire, *, network: str = OWN_NETWORK) -> None:
        """`network` names whose word network and vocabulary these are, for reports."""
        self.vocabulary = repertoire.vocabulary
        self.network = network
        self._net = repertoire.word_net()

    def motifs_of(self, motion: Motion, music_beats_s: Floats) -> DancedMotifs:
        """The motifs of a dance, whose words are segmented at the music's beats."""
        words = segment_words(body_pos_m(motion.resampled(WORD_FPS)), WORD_FPS, music_beats_s)
        if len(words) == 0:
            return DancedMotifs(np.zeros(0, np.int64), np.zeros(0), np.zeros(0))
        motifs = self.vocabulary.motifs.nearest(self._net.embed(words.body_pos_m))
        return DancedMotifs(motifs, words.start_s, words.end_s)

    def template(self, genre: str) -> Floats:
        """The signature (K,) of a genre, or of all genres if the repertoire does not have it."""
        return self.vocabulary.signatures[self.vocabulary.genre_index(self._known(genre))]

    def scores(self, danced: DancedMotifs, genre: str) -> Scores:
        """Distance of the motifs to the genre's signature, and surprisal of their transitions.

        Chance is the motifs of words drawn from the whole repertoire, and the same motifs in any order. A
        transition that never occurs in the genre's takes would be infinitely surprising, so transition
        probabilities are smoothed by 1 %.
        """
        motifs = danced.motifs
        if len(motifs) < 2:
            return Scores({})
        genre, n_motifs = self._known(genre), self.vocabulary.n_motifs
        template = self.template(genre)
        transitions = self.vocabulary.transitions[self.vocabulary.genre_index(genre)]
        transitions = (1.0 - _SMOOTHING) * transitions + _SMOOTHING / n_motifs
        rng = np.random.default_rng(len(motifs))
        drawn = [rng.choice(self.vocabulary.word_motif, len(motifs)) for _ in range(_CHANCE_ROUNDS)]
        chance = np.mean([structure.signature_distance(random_motifs, template) for random_motifs in drawn])
        return Scores(
            {
                "signature_chi2": structure.signature_distance(motifs, template),
                "transition_bits": structure.transition_bits(motifs, transitions),
                "longest_repeat_motifs": float(structure.longest_repeat(motifs)),
            },
            {
                "signature_chi2": float(chance),
                "transition_bits": structure.transition_chance_bits(motifs, transitions),
            },
        )

    def section_scores(self, danced: DancedMotifs, sections: Sections) -> Scores:
        """Whether sections of the same music are danced with the same motifs; empty without sections."""
        if len(danced) == 0 or len(sections) == 0:
            return Scores({})
        motifs = structure.motifs_by_section(danced.motifs, danced.start_s, sections.bounds_s)
        similarities = {
            "section_agreement": structure.shared_motifs(motifs, self.vocabulary.n_motifs),
            "section_agreement_in_step": structure.motifs_in_step(motifs),
        }
        values = {
            name: structure.section_agreement(similarity, sections.labels)
            for name, similarity in similarities.items()
        }
        return Scores(values, dict.fromkeys(values, 0.0))

    def _known(self, genre: str) -> str:
        return genre if genre in self.vocabulary.genres else ALL_GENRES
