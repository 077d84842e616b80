"""Structure: synthetic repeats, sections that are danced alike, and transitions of known surprisal."""

from __future__ import annotations

import itertools

import mir_eval
import numpy as np
import pytest
from golden.regenerate import golden, structure_scores
from hypothesis import given, settings
from hypothesis import strategies as st

import choreograph as cg
from choreograph.core.errors import ParameterError
from choreograph.evaluation.metrics import structure

NONE = np.zeros(0, np.int64)


def pieces(*source_starts_s: float, length_s: float = 4.0) -> np.ndarray:
    """Consecutive pieces of that length in the dance, from these times of their takes."""
    starts = np.arange(len(source_starts_s)) * length_s
    source = np.array(source_starts_s)
    return np.stack([starts, starts + length_s, source, source + length_s], axis=1)


def test_signature_distance_of_equal_and_of_disjoint_motifs():
    motifs = np.array([0, 0, 1, 2])
    assert structure.signature_distance(motifs, np.array([0.5, 0.25, 0.25, 0.0])) == 0
    assert structure.signature_distance(motifs, np.array([0.0, 0.0, 0.0, 1.0])) == pytest.approx(1)
    assert np.isnan(structure.signature_distance(NONE, np.array([1.0])))


def test_surprisal_of_transitions():
    transitions = np.array([[0.5, 0.5], [1.0, 0.0]])
    assert structure.transition_bits(np.array([0, 1, 0, 0]), transitions) == pytest.approx(2 / 3)
    assert structure.transition_bits(np.array([1, 0]), transitions) == 0
    assert structure.transition_bits(np.array([1, 1]), transitions) == np.inf
    assert np.isnan(structure.transition_bits(np.array([1]), transitions))
    assert np.isnan(structure.transition_chance_bits(NONE, transitions))


@settings(max_examples=20)
@given(st.lists(st.integers(0, 3), min_size=2, max_size=12), st.integers(0, 99))
def test_chance_is_the_mean_over_orders(motifs, seed):
    rng = np.random.default_rng(seed)
    transitions = rng.dirichlet(np.ones(4), 4)
    motifs = np.array(motifs)
    shuffled = [structure.transition_bits(rng.permutation(motifs), transitions) for _ in range(2000)]
    error = 4 * np.std(shuffled) / np.sqrt(2000) + 1e-9
    assert structure.transition_chance_bits(motifs, transitions) == pytest.approx(
        np.mean(shuffled), abs=error
    )


def test_runs_of_motifs_that_the_takes_have():
    takes = [np.array([0, 1, 2, 3]), np.array([4, 5, 6])]
    assert structure.n_gram_share(takes[0], takes, 4) == structure.n_gram_share(takes[1], takes, 2) == 1.0
    assert structure.n_gram_share(np.array([3, 2, 1, 0]), takes, 2) == 0.0
    assert structure.n_gram_share(np.array([2, 3, 4, 5]), takes, 2) == pytest.approx(2 / 3)  # not 3, 4
    assert structure.n_gram_share(np.array([0, 1]), [], 2) == 0.0
    for metric in (structure.n_gram_share, structure.n_gram_chance):
        assert np.isnan(metric(NONE, takes, 1)) and np.isnan(metric(takes[1], takes, 4))


def test_real_takes_are_far_above_the_chance_of_their_runs():
    vocabulary = cg.starter_repertoire().vocabulary
    takes = [vocabulary.word_motif[vocabulary.words_of_take(take)] for take in range(345)]
    for n, least in ((3, 0.1), (4, 0.03)):  # a figure is danced differently each time
        left_out = [structure.n_gram_share(takes[i], takes[:i] + takes[i + 1 :], n) for i in range(0, 345, 9)]
        assert np.mean(left_out) > least > 20 * structure.n_gram_chance(takes[0], takes, n)


@settings(max_examples=20)
@given(st.lists(st.integers(0, 3), max_size=6), st.lists(st.integers(0, 3), max_size=8), st.integers(1, 3))
def test_the_chance_of_runs_is_the_mean_over_orders(motifs, take, n):
    motifs, takes = np.array(motifs, np.int64), [np.array(take, np.int64)]
    shares = [
        structure.n_gram_share(np.array(order), takes, n) for order in itertools.permutations(motifs.tolist())
    ]
    chance = structure.n_gram_chance(motifs, takes, n)
    assert chance == pytest.approx(np.mean(shares), nan_ok=True)


@pytest.mark.parametrize("metric", [structure.n_gram_share, structure.n_gram_chance])
@pytest.mark.parametrize(
    "wrong",
    [
        {"motifs": np.array([0.5, 1.0])},
        {"motifs": np.array([-1, 1])},
        {"takes": [np.array([[0, 1]])]},
        {"n": 0},
        {"n": 1.5},
    ],
)
def test_malformed_runs_are_refused(metric, wrong):
    with pytest.raises(ParameterError, match="expected"):
        metric(**{"motifs": np.array([0, 1]), "takes": [np.array([0, 1])], "n": 2, **wrong})


def test_longest_repeat_by_hand():
    assert (
        structure.longest_repeat([])
        == structure.longest_repeat([1])
        == structure.longest_repeat([1, 2, 3])
        == 0
    )
    assert structure.longest_repeat([1, 2, 3, 9, 1, 2, 3, 4]) == 3
    assert structure.longest_repeat([5, 5, 5, 5]) == 2  # twice two: they may not overlap
    assert structure.longest_repeat([1, 2, 1, 2, 1]) == 2


@settings(max_examples=50)
@given(st.lists(st.integers(0, 2), max_size=14))
def test_longest_repeat_is_the_longest(items):
    expected = max(
        (
            n
            for n in range(1, len(items))
            for i in range(len(items) - 2 * n + 1)
            for j in range(i + n, len(items) - n + 1)
            if items[i : i + n] == items[j : j + n]
        ),
        default=0,
    )
    assert structure.longest_repeat(items) == expected


def test_a_take_played_twice_straight_through():
    assert structure.longest_repeat_s(["a", "b", "a"], pieces(0, 0, 0)) == pytest.approx(4.0)
    assert structure.longest_repeat_s(["a", "a", "b", "a", "a"], pieces(0, 4, 0, 0, 4)) == pytest.approx(8.0)
    assert structure.longest_repeat_s(["a", "b", "c"], pieces(0, 0, 0)) == 0
    assert structure.longest_repeat_s(["a", "a"], pieces(0, 30)) == 0
    assert structure.longest_repeat_s(["a"], np.array([[0.0, 20.0, 0.0, 10.0]])) == 0  # slow is no repeat
    slower = pieces(0, 0, 0.2)
    slower[2, 3] = 4.4  # the same clip, five percent faster
    assert structure.longest_repeat_s(["a", "b", "a"], slower) == pytest.approx(4.0, abs=0.3)


def test_distinct_takes_a_minute():
    assert structure.distinct_takes_per_minute(["a", "b", "a"], 30.0) == 4.0
    assert structure.distinct_takes_per_minute([], 30.0) == 0.0


def test_sections_danced_alike_and_sections_danced_differently():
    bounds, labels = [0.0, 4.0, 8.0, 12.0], ["verse", "chorus", "verse"]
    starts = np.arange(12.0)
    faithful = np.array([0, 1, 2, 3, 4, 5, 4, 5, 0, 1, 2, 3])
    sections = structure.motifs_by_section(faithful, starts, bounds)
    assert [s.tolist() for s in sections] == [[0, 1, 2, 3], [4, 5, 4, 5], [0, 1, 2, 3]]
    for similarity in (structure.shared_motifs(sections, 6), structure.motifs_in_step(sections)):
        assert structure.section_agreement(similarity, labels) == 1.0
        assert structure.section_agreement(similarity, ["a", "a", "b"]) == -0.5
    backwards = [sections[0], sections[1], sections[2][::-1]]
    assert structure.section_agreement(structure.shared_motifs(backwards, 6), labels) == 1.0
    assert structure.section_agreement(structure.motifs_in_step(backwards), labels) == 0.0
    same = [np.array([1, 1])] * 3  # repeats whatever the song does
    assert structure.section_agreement(structure.shared_motifs(same, 6), labels) == 0.0


def test_agreement_without_a_pair_to_compare():
    alike = np.ones((2, 2))
    assert np.isnan(structure.section_agreement(alike, ["a", "b"]))
    assert np.isnan(structure.section_agreement(alike, ["a", "a"]))


@settings(max_examples=10)
@given(st.integers(0, 99))
def test_random_orders_of_the_labels_have_no_agreement_on_average(seed):
    rng = np.random.default_rng(seed)
    similarity = structure.motifs_in_step(list(rng.integers(0, 3, (7, 6))))
    labels = np.array([0, 0, 0, 1, 1, 2, 2])
    agreements = [structure.section_agreement(similarity, rng.permutation(labels)) for _ in range(2000)]
    assert np.mean(agreements) == pytest.approx(0, abs=5 * np.std(agreements) / np.sqrt(2000) + 1e-9)


def test_a_section_in_which_no_motif_starts():
    sections = structure.motifs_by_section(np.array([1]), [0.5], [0.0, 1.0, 2.0])
    assert [len(s) for s in sections] == [1, 0]
    assert structure.motifs_in_step(sections)[0, 1] == 0
    assert np.isfinite(structure.shared_motifs(sections, 2)).all()


@pytest.mark.parametrize("motifs", [np.array([0.5]), np.array([[1]]), np.array([-1]), np.array([2])])
def test_broken_motifs_are_refused(motifs):
    with pytest.raises(ParameterError, match="motif"):
        structure.signature_distance(motifs, np.array([0.5, 0.5]))
    with pytest.raises(ParameterError, match="motif"):
        structure.transition_bits(motifs, np.full((2, 2), 0.5))


def test_broken_input_is_refused():
    with pytest.raises(ParameterError, match="probabilities"):
        structure.transition_bits(np.array([0, 0]), np.array([[2.0]]))
    with pytest.raises(ParameterError, match="pieces"):
        structure.longest_repeat_s(["a"], np.zeros((2, 4)))
    with pytest.raises(ParameterError, match="order"):
        structure.longest_repeat_s(["a", "b"], pieces(0, 0)[::-1])
    with pytest.raises(ParameterError, match="duration"):
        structure.distinct_takes_per_minute(["a"], 0.0)
    with pytest.raises(ParameterError, match="bounds"):
        structure.motifs_by_section(np.array([1]), [0.0], [1.0])
    with pytest.raises(ParameterError, match="increasing"):
        structure.motifs_by_section(np.array([1, 2]), [1.0, 0.0], [0.0, 1.0])
    with pytest.raises(ParameterError, match="similarities"):
        structure.section_agreement(np.ones((2, 2)), ["a"])


def test_golden():
    assert structure_scores() == pytest.approx(golden("structure"))


def test_repeats_found_exactly_or_not_at_all():
    true = np.array([0, 1, 2, 0, 1, 2, 3])
    assert structure.repeat_f(true + 5, true) == 1.0
    assert structure.repeat_f(np.arange(7), true) == structure.repeat_f(true, np.arange(7)) == 0.0
    assert structure.repeat_f(np.arange(7), np.arange(7)) == structure.repeat_f(NONE, NONE) == 1.0


def test_repeats_at_another_count_of_the_phrase_are_not_repeats():
    assert structure.repeat_f(np.array([0, 1, 2, 1, 2, 0]), np.array([0, 1, 2, 0, 1, 2])) == 0.0


@pytest.mark.parametrize("found", [np.zeros(3, int), np.zeros((2, 2), int)])
def test_repeats_of_other_counts_are_refused(found):
    with pytest.raises(ParameterError, match="ids"):
        structure.repeat_f(found, np.zeros(4, int))


def test_repeat_f_is_mir_evals_pairwise_f():
    rng = np.random.default_rng(5)
    frames = np.stack([np.arange(40.0), np.arange(40.0) + 1], axis=1)
    for _ in range(5):
        found, true = rng.integers(12, size=(2, 40))
        *_, expected = mir_eval.segment.pairwise(frames, true, frames, found, frame_size=1.0)
        assert structure.repeat_f(found, true) == pytest.approx(expected)
