"""Motifs that are kept: every word has the nearest, and the word that stands for a motif is its medoid."""

import numpy as np
import pytest
from synthetic_repertoire import synthetic_repertoire

from choreograph.core.timebase import NET_FPS
from choreograph.library.building.words import KeptMotifs, WordTable, embedder_of, words_of_body
from choreograph.motion.body import clips_to_root_frame

CENTRES = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], np.float32)
# Words of takes a, a, b, b, b, c. The medoids of the motifs are words 1, 2 and 5.
EMBEDDINGS = np.array([[0.1, 0.1], [0, 0], [1, 0], [0.9, 0.3], [0.8, 0.1], [0, 1]], np.float32)
TAKE = np.array([0, 0, 1, 1, 1, 2])
START_S = np.array([0.0, 1.0, 0.5, 1.5, 2.5, 0.0])


@pytest.fixture
def kept():
    medoids = (("a", 1.0, 2.0), ("b", 0.5, 1.5), ("c", 0.0, 1.0))
    return KeptMotifs(CENTRES, medoids, "a set")


def vocabulary(kept, words):
    """The vocabulary of some of the words, without takes of none of them."""
    words = np.array(words)
    takes = np.unique(TAKE[words])
    table = WordTable(
        np.searchsorted(takes, TAKE[words]),
        START_S[words],
        START_S[words] + 1.0,
        ["abc"[take] for take in takes],
        ["x"] * len(takes),
    )
    return kept.vocabulary(table, kept.nearest(EMBEDDINGS[words]), lambda own: EMBEDDINGS[words][own])


def test_all_words_have_the_motifs_and_medoids_of_before(kept):
    made = vocabulary(kept, range(6))
    np.testing.assert_array_equal(made.word_motif, [0, 0, 1, 1, 1, 2])
    np.testing.assert_array_equal(made.motifs.words, [1, 2, 5])
    np.testing.assert_array_equal(made.motifs.counts, [2, 3, 1])
    np.testing.assert_array_equal(made.motifs.embeddings, CENTRES)
    np.testing.assert_allclose(made.signatures[-1], [1 / 3, 1 / 3, 1 / 3])


def test_the_nearest_word_takes_the_place_of_a_medoid_that_is_gone(kept):
    made = vocabulary(kept, [0, 1, 3, 4, 5])
    np.testing.assert_array_equal(made.motifs.words, [1, 3, 4])  # word 4 of all six is nearer than word 3
    np.testing.assert_array_equal(made.motifs.embeddings, CENTRES)  # it does not change what the motif is


def test_a_motif_without_words_is_left_out_and_later_ones_keep_their_order(kept):
    made = vocabulary(kept, [0, 1, 5])
    np.testing.assert_array_equal(made.word_motif, [0, 0, 1])
    np.testing.assert_array_equal(made.motifs.embeddings, CENTRES[[0, 2]])
    np.testing.assert_array_equal(made.motifs.words, [1, 2])


def test_another_take_of_the_same_name_has_no_medoids(kept):
    """Its word at the time of a medoid shows another motif."""
    table = WordTable(np.zeros(2, int), np.array([1.0, 2.0]), np.array([2.0, 3.0]), ["a"], ["x"])
    embeddings = np.array([[1.0, 0.1], [0.1, 0.0]], np.float32)
    made = kept.vocabulary(table, kept.nearest(embeddings), lambda own: embeddings[own])
    np.testing.assert_array_equal(made.motifs.words, [1, 0])


def test_distances_are_those_from_the_nearest_motif(kept):
    np.testing.assert_allclose(kept.distances_m(EMBEDDINGS[[1, 3, 0]]), [0.0, 0.1**0.5, 0.02**0.5], atol=1e-7)


def test_words_of_a_body_are_in_their_root_frames():
    body = np.random.default_rng(0).normal(size=(60, 21, 3)).astype(np.float32)
    [word] = words_of_body(body, np.array([0.5]), np.array([1.1]))
    frames = 0.5 * NET_FPS + np.arange(13)
    np.testing.assert_allclose(word, clips_to_root_frame(body[frames.astype(int)][None])[0], atol=1e-6)


def test_embeddings_are_those_of_single_words_in_the_order_asked_for(tmp_path):
    repertoire = synthetic_repertoire(tmp_path / "rep.h5", vocabulary=True)
    v, net = repertoire.vocabulary, repertoire.word_net()
    table = WordTable(v.word_take, v.word_start_s, v.word_end_s, (), ())
    embed = embedder_of(table, repertoire.body_pos_m, net.embed)
    words = np.array([2, 5, len(v.word_take) - 1])
    np.testing.assert_allclose(
        embed(words), np.concatenate([embed(words[i : i + 1]) for i in range(3)]), atol=1e-6
    )
    np.testing.assert_array_equal(
        np.concatenate([embed(words[:1]), embed(words[2:])]).shape, (2, v.motifs.embeddings.shape[1])
    )
