"""The features of words that the mixer compares: poses around their borders, and their motif margins."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic_repertoire import synthetic_repertoire

import choreograph as cg
from choreograph.choreography.mixer.words import WordBank
from choreograph.library.vocabulary import poses_at


@pytest.fixture(scope="module")
def rep(tmp_path_factory):
    return synthetic_repertoire(tmp_path_factory.mktemp("bank") / "rep.h5", vocabulary=True)


@pytest.fixture(scope="module")
def bank(rep):
    return WordBank(rep.vocabulary, rep.clip_motion.poses_at, rep.word_net().embed)


def test_a_word_ends_as_the_next_of_its_take_begins(bank):
    v = bank.vocabulary
    words = v.words_of_take(1)
    lengths = v.word_end_s - v.word_start_s
    for word in words[3:6]:  # at their own speed, so that the poses are the same instants
        _, last = bank.borders_m(np.array([word]), float(lengths[word]))
        first, _ = bank.borders_m(np.array([word + 1]), float(lengths[word + 1]))
        assert np.abs(first - last).max() < 5e-3
    other, _ = bank.borders_m(v.words_of_take(0)[:1], 0.5)
    assert np.abs(other - last).max() > 0.05


def test_poses_of_several_takes_are_read_at_once(rep):
    takes = np.array([1, 0, 1])
    times_s = np.array([[0.02, 3.33], [-1.0, 1.0], [2.5, 1e4]])  # also before and after a take
    poses = rep.clip_motion.poses_at(takes, times_s)
    for take, at_s, found in zip(takes, times_s, poses, strict=True):
        np.testing.assert_array_equal(found, poses_at(rep.body_pos_m(int(take)), 20, at_s))


def test_faster_words_show_poses_farther_apart(bank):
    word = np.array([bank.vocabulary.words_of_take(0)[4]])
    own = float((bank.vocabulary.word_end_s - bank.vocabulary.word_start_s)[word[0]])
    middle = [bank.borders_m(word, length)[1][0, 1] for length in (own, own / 3)]
    assert np.allclose(*middle, atol=0.1)
    spread = [np.ptp(bank.borders_m(word, length)[1][0], axis=0).max() for length in (own, own / 3)]
    assert spread[1] > 1.5 * spread[0]


def test_the_margin_is_the_distance_to_the_next_motif_less_that_to_its_own(bank):
    v = bank.vocabulary
    margin_m = bank.motif_margin_m(np.arange(len(v.word_motif)))
    assert np.mean(margin_m > 0) > 0.95  # nearest is how words were given their motifs, here at 20 fps
    medoids = v.motifs.embeddings.astype(np.float64)
    gaps = np.linalg.norm(medoids[:, None] - medoids, axis=-1)
    np.fill_diagonal(gaps, np.inf)
    # A medoid is its motif: all its margin is the distance to the next medoid.
    np.testing.assert_allclose(margin_m[v.motifs.words], gaps.min(axis=1), atol=0.02)


def test_words_are_danced_from_accent_to_accent():
    starter = cg.starter_repertoire()
    v, bounds_s = starter.vocabulary, starter.accented_bounds_s
    cut_s = np.stack([v.word_start_s, v.word_end_s], axis=1)
    assert 0.0 < np.abs(bounds_s - cut_s).max() <= 0.05 + 1e-9
    assert (np.diff(bounds_s, axis=1) > 0.1).all()

    def from_motion_beats_s(of_words):
        beats_s = [starter.motion_beats_s(int(take)) for take in v.word_take]
        return np.array([np.abs(own - at).min() for own, at in zip(beats_s, of_words[:, 0], strict=True)])

    moved = np.abs(bounds_s - cut_s)[:, 0] > 1e-6
    assert moved.mean() > 0.5
    assert from_motion_beats_s(bounds_s)[moved].mean() < 0.4 * from_motion_beats_s(cut_s)[moved].mean()


def test_words_that_follow_one_another_still_do():
    starter = cg.starter_repertoire()
    v, bounds_s = starter.vocabulary, starter.accented_bounds_s
    follows = (v.word_take[1:] == v.word_take[:-1]) & np.isclose(v.word_start_s[1:], v.word_end_s[:-1])
    assert np.allclose(bounds_s[1:, 0][follows], bounds_s[:-1, 1][follows])


def test_words_of_takes_without_accents_on_counts_stay(rep):
    v = rep.vocabulary
    assert np.array_equal(rep.accented_bounds_s, np.stack([v.word_start_s, v.word_end_s], axis=1))
