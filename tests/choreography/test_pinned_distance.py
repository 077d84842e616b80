"""A pinned motif is danced if a word is as near to it as the words of the takes are."""

from __future__ import annotations

import numpy as np
import pytest

import choreograph as cg
from choreograph.choreography.enforcement import danced_embeddings, motifs_of_embeddings, without_distant

STARTER = cg.starter_repertoire()


def words_of_take(take: int):
    """The motifs of the words of a take, and their embeddings."""
    v = STARTER.vocabulary
    words = v.words_of_take(take)
    motion, first_s = STARTER.motion(take, 0.0, STARTER.takes[take].duration_s)
    bounds_s = np.append(v.word_start_s[words], v.word_end_s[words[-1]]) - first_s
    return v.word_motif[words], danced_embeddings(motion, bounds_s, STARTER)


@pytest.mark.parametrize("take", [20, 40, 100])
def test_nearly_all_words_of_takes_are_near_enough(take):
    motifs, embeddings = words_of_take(take)
    danced = motifs_of_embeddings(embeddings, STARTER)
    same = np.flatnonzero(danced == motifs)[:24]
    pinned = {int(slot): int(motifs[slot]) for slot in same}
    held = without_distant(danced, embeddings, pinned, STARTER)
    assert np.mean(held[same] == motifs[same]) >= 0.8  # 0.95 on average
    others = np.setdiff1d(np.arange(len(danced)), same)
    assert np.array_equal(held[others], danced[others])


def test_a_word_that_has_the_name_alone_is_not_the_motif():
    medoids = STARTER.vocabulary.motifs.embeddings
    direction = medoids[5] - medoids.mean(axis=0)
    for distance_m, held in ((0.0, True), (0.01, True), (3.0, False)):
        embeddings = np.stack([medoids[5] + distance_m * direction / np.linalg.norm(direction)] * 2)
        danced = np.full(2, 5)
        shown = without_distant(danced, embeddings, {0: 5}, STARTER)
        assert shown.tolist() == [5 if held else -1, 5]  # the second one is not pinned
        assert danced.tolist() == [5, 5]


def test_another_motif_is_not_the_pinned_one_however_near():
    medoids = STARTER.vocabulary.motifs.embeddings
    assert without_distant(np.array([7, -1]), medoids[[5, 5]], {0: 5, 1: 5}, STARTER).tolist() == [7, -1]
