"""Clips with the motifs of the signature have a smaller mismatch than others."""

from __future__ import annotations

import numpy as np
import pytest

from choreograph.choreography.selection import clip_signature_mismatch
from choreograph.library.vocabulary import find_motifs, make_vocabulary

CLIP_TAKE = np.repeat([0, 1, 2], 13)
CLIP_START_S = np.tile(np.arange(13.0), 3)


@pytest.fixture(scope="module")
def vocabulary():
    """Take 0 has motif a for 10 s and then b, take 1 only c, take 2 has no words."""
    embeddings = np.concatenate([np.repeat(np.eye(3), [40, 30, 10], axis=0)])
    motifs, labels = find_motifs(embeddings, n_motifs=3)
    c, b, a = labels[0], labels[40], labels[-1]
    word_motif = np.array([a] * 10 + [b] * 10 + [c] * 20)
    start_s = np.concatenate([np.arange(20.0), np.arange(20.0)])
    made = make_vocabulary(
        motifs, word_motif, np.repeat([0, 1], 20), start_s, start_s + 1, ["waltz", "rumba", "tango"]
    )
    return made, a, b, c


def test_the_mismatch_is_the_mean_cost_of_a_clips_words(vocabulary):
    made, a, _, c = vocabulary
    target = np.zeros(3)
    target[[a, c]] = [0.9, 0.1]
    mismatch = clip_signature_mismatch(made, target, CLIP_TAKE, CLIP_START_S, n_words=100).reshape(3, 13)
    good, fair = (1 - 90) / (1 + 90), (1 - 10) / (1 + 10)
    by_hand = [(n_a * good + (8 - n_a) * 1.0) / 8 for n_a in np.clip(10 - np.arange(13), 0, 8)]
    assert np.allclose(mismatch[0], by_hand)
    assert np.allclose(mismatch[1], fair)
    assert np.array_equal(mismatch[2], np.zeros(13))


def test_a_motif_expected_once_costs_nothing(vocabulary):
    made, a, b, _ = vocabulary
    target = np.zeros(3)
    target[[a, b]] = [0.1, 0.9]
    mismatch = clip_signature_mismatch(made, target, CLIP_TAKE, CLIP_START_S, n_words=10)
    assert mismatch[0] == pytest.approx(0.0)
    assert mismatch[12] < -0.7
