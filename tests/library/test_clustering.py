"""Motifs: synthetic clusters are found, medoids are words, and everything is deterministic."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_motions import stepping

from choreograph.core.errors import ParameterError
from choreograph.library.motifs import find_motifs, n_motifs_for
from choreograph.library.words import segment_words
from choreograph.motion.body import body_pos_m


def _blobs(rng, n_blobs=5, n_each=20, dim=8):
    middles = 10.0 * rng.normal(size=(n_blobs, dim))
    labels = rng.permutation(np.repeat(np.arange(n_blobs), n_each))
    return middles[labels] + 0.1 * rng.normal(size=(len(labels), dim)), labels


def test_synthetic_clusters_are_found():
    vectors, truth = _blobs(np.random.default_rng(1))
    motifs, labels = find_motifs(vectors, n_motifs=5, seed=0)
    assert len(motifs) == 5
    for cluster in range(5):
        assert len(np.unique(truth[labels == cluster])) == 1
    np.testing.assert_array_equal(motifs.counts, 20)


def test_a_dance_of_two_moves_has_two_motifs():
    # There and back, each half a second: a word from every rest to the next.
    body = body_pos_m(stepping(601, fps=60, period_s=0.5, seed=4))
    words = segment_words(body, 60, np.arange(0.0, 10.1, 0.5)).body_pos_m
    motifs, labels = find_motifs(words.reshape(len(words), -1), n_motifs=2)
    np.testing.assert_array_equal(labels, [labels[0], 1 - labels[0]] * 10)
    np.testing.assert_array_equal(motifs.counts, 10)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 12))
def test_medoids_are_words_of_their_own_cluster_and_counts_fall(seed, n_motifs):
    vectors = np.random.default_rng(seed).normal(size=(40, 3))
    motifs, labels = find_motifs(vectors, n_motifs=n_motifs, seed=seed)
    np.testing.assert_array_equal(motifs.embeddings, vectors[motifs.words].astype(np.float32))
    np.testing.assert_array_equal(labels[motifs.words], np.arange(len(motifs)))
    np.testing.assert_array_equal(motifs.nearest(vectors), labels)
    np.testing.assert_array_equal(np.bincount(labels), motifs.counts)
    assert np.all(np.diff(motifs.counts) <= 0) and motifs.counts.min() >= 1


def test_the_same_seed_gives_the_same_motifs():
    vectors = np.random.default_rng(3).normal(size=(400, 16))
    first, labels = find_motifs(vectors, seed=7)
    again, labels_again = find_motifs(vectors, seed=7)
    np.testing.assert_array_equal(first.words, again.words)
    np.testing.assert_array_equal(labels, labels_again)


def test_identical_words_are_one_motif():
    motifs, labels = find_motifs(np.ones((30, 4)), n_motifs=5)
    assert len(motifs) == 1
    np.testing.assert_array_equal(labels, 0)


def test_the_number_of_motifs_follows_the_rule():
    assert [n_motifs_for(n) for n in (1, 19, 20, 40, 2000, 10_000, 100_000)] == [1, 1, 1, 2, 100, 500, 500]
    vectors = np.random.default_rng(0).normal(size=(100, 4))
    assert len(find_motifs(vectors)[0]) == 5


@pytest.mark.parametrize(
    ("vectors", "n_motifs"),
    [
        (np.zeros((0, 4)), None),
        (np.zeros(4), None),
        (np.full((4, 4), np.nan), None),
        (np.eye(4), 0),
        (np.eye(4), 5),
    ],
)
def test_malformed_input_is_refused(vectors, n_motifs):
    with pytest.raises(ParameterError):
        find_motifs(vectors, n_motifs=n_motifs)


def test_embeddings_of_another_dimension_are_refused():
    motifs, _ = find_motifs(np.eye(4))
    with pytest.raises(ParameterError, match="4"):
        motifs.nearest(np.eye(5))
    assert motifs.nearest(np.zeros((0, 4))).shape == (0,)


def test_words_that_differ_by_rounding_alone_are_one_motif():
    """Else rounding, which differs between CPUs, would decide which of two motifs a word shows."""
    rng = np.random.default_rng(3)
    distinct = rng.normal(size=(4, 8)).astype(np.float32)
    words = np.repeat(distinct, 30, axis=0) + rng.normal(scale=1e-7, size=(120, 8)).astype(np.float32)
    motifs, of_word = find_motifs(words, n_motifs=9)
    assert len(motifs) == 4
    assert all(len(np.unique(of_word[start : start + 30])) == 1 for start in range(0, 120, 30))
