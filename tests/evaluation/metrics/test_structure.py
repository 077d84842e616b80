"""Structure: synthetic repeats, sections that are danced alike, and transitions of known surprisal."""

from __future__ import annotations

import itertools

import mir_eval
import numpy as np
import pytest
from golden.regenerate import golden, structure_scores
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_motions import stepping, swaying

import choreograph as cg
from choreograph.core.errors import ParameterError
from choreograph.evaluation.metrics import structure
from choreograph.evaluation.metrics.counts import outside_tempi_share
from choreograph.evaluation.metrics.structure import genre_share, joint_distance_m
from choreograph.motion.body import body_pos_m

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


# Returns: dances that repeat with their song, that never repeat, and that repeat elsewhere.


PHRASE_S = 4.0
FPS = 20.0


def spans(n: int) -> np.ndarray:
    starts_s = PHRASE_S * np.arange(n)
    return np.stack([starts_s, starts_s + PHRASE_S], axis=1)


def pieces_of_phrases(*source_starts_s: float) -> np.ndarray:
    """One piece for each phrase, from these times of its take."""
    source = np.array(source_starts_s)
    return np.hstack([spans(len(source)), np.stack([source, source + PHRASE_S], axis=1)])


def danced(letters: str) -> np.ndarray:
    """Body positions (T, 21, 3) of a dance with other steps for each letter."""
    n = round(PHRASE_S * FPS)
    parts = {
        letter: body_pos_m(stepping(n, fps=FPS, period_s=0.5 + 0.1 * i, seed=i))
        for i, letter in enumerate(sorted(set(letters)))
    }
    return np.concatenate([parts[letter] for letter in letters])


@pytest.fixture(scope="module")
def scores():
    """Scores of a dance for the form ABAB, by what is danced."""
    sources = {"a": 0.0, "b": 10.0, "c": 20.0, "d": 30.0}

    def of(letters: str) -> dict[str, float]:
        return structure.evaluate_returns(
            danced(letters), FPS, ["take"] * len(letters),
            pieces_of_phrases(*(sources[letter] for letter in letters)),
            phrases_s=spans(len(letters)), labels="ABAB",
        )  # fmt: skip

    return {letters: of(letters) for letters in ("abab", "abcd", "aabb", "aaaa")}


def test_a_dance_that_returns_with_its_song_is_perfect(scores):
    perfect = scores["abab"]
    assert perfect["return_distance_m"] == pytest.approx(0.0, abs=1e-9)
    assert perfect["other_distance_m"] > 0.01
    assert perfect["return_distance_ratio"] == pytest.approx(0.0, abs=1e-6)
    assert (perfect["returned_share"], perfect["returned_share_chance"]) == (1.0, 0.0)
    assert perfect["shared_between_sections"] == 0.0


def test_a_dance_that_never_returns_scores_as_by_chance(scores):
    medley = scores["abcd"]
    assert medley["return_distance_ratio"] > 0.5
    assert medley["returned_share"] == medley["returned_share_chance"] == 0.0


def test_a_dance_that_repeats_elsewhere_is_no_better(scores):
    wrong = scores["aabb"]
    assert wrong["returned_share"] == 0.0
    assert wrong["return_distance_ratio"] > 1.0
    assert wrong["returned_share_chance"] == pytest.approx(0.5)
    assert wrong["shared_between_sections"] == 1.0


def test_one_phrase_over_and_over_returns_by_chance(scores):
    same = scores["aaaa"]
    assert same["returned_share"] == same["returned_share_chance"] == same["shared_between_sections"] == 1.0
    assert np.isnan(same["return_distance_ratio"])


def test_place_and_heading_do_not_count():
    body = danced("ab")
    turned = body @ np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]) + [2.0, 0.0, 1.0]
    distances_m = structure.pose_distances_m(np.concatenate([body, turned]), FPS, spans(4))
    assert distances_m[0, 2] < 1e-6 < distances_m[0, 1]
    assert np.allclose(distances_m, distances_m.T)


def test_moments_within_a_quarter_of_a_second_are_the_same():
    shares = [
        structure.same_shares(["t", "t"], pieces_of_phrases(0.0, shift_s), spans(2))[0, 1]
        for shift_s in (0.2, 0.3)
    ]
    assert shares == [1.0, 0.0]
    assert structure.same_shares(["t", "u"], pieces_of_phrases(0.0, 0.0), spans(2))[0, 1] == 0.0


def test_without_returns_or_other_phrases_there_is_no_value():
    values = np.zeros((3, 3))
    assert np.isnan(structure.return_mean(values, "ABC"))
    assert np.isnan(structure.other_mean(values, "AAA"))


@pytest.mark.parametrize(
    ("phrases_s", "labels"),
    [
        (np.zeros((0, 2)), ""),
        (spans(2), "A"),
        (spans(2)[::-1], "AB"),
        (np.array([[0.0, 1.0], [0.5, 2.0]]), "AB"),
        (np.array([[0.0, np.nan]]), "A"),
    ],
)
def test_malformed_phrases_are_refused(phrases_s, labels):
    with pytest.raises(ParameterError, match=r"expected .*phrases"):
        structure.validate_phrases(phrases_s, labels)
    with pytest.raises(ParameterError, match=r"expected .*phrases"):
        structure.shared_between_sections(["t"], pieces_of_phrases(0.0), phrases_s, labels)


def test_malformed_values_are_refused():
    with pytest.raises(ParameterError, match=r"expected finite values \(2, 2\)"):
        structure.return_mean(np.zeros((2, 3)), "AB")
    with pytest.raises(ParameterError, match=r"expected finite values \(2, 2\)"):
        structure.other_mean(np.full((2, 2), np.nan), "AB")
    with pytest.raises(ParameterError, match="body positions"):
        structure.pose_distances_m(np.zeros((10, 3)), FPS, spans(2))


# Requests: shares of genres, planted tempi, distances of dances, nothing, malformed input.


NET_FPS = 30.0


def test_genre_share_perfect_and_none():
    assert genre_share(["waltz", "waltz"], [2.0, 5.0], "waltz") == 1.0
    assert genre_share(["house", "salsa"], [2.0, 5.0], "waltz") == 0.0
    assert genre_share(["house", "waltz"], [3.0, 1.0], "waltz") == 0.25


def test_genre_share_of_nothing():
    assert np.isnan(genre_share([], [], "waltz"))
    assert np.isnan(genre_share(["waltz"], [0.0], "waltz"))


@pytest.mark.parametrize("lengths", [[1.0], [1.0, -1.0], [1.0, np.nan], [[1.0, 2.0]]])
def test_genre_share_malformed(lengths):
    with pytest.raises(ParameterError, match="a length") as raised:
        genre_share(["waltz", "house"], lengths, "waltz")
    assert "\n" not in str(raised.value)


def test_tempo_inside_and_outside():
    counts_s = np.arange(0.0, 20.0, 0.5)  # 120 a minute
    assert outside_tempi_share(counts_s, 100.0, 130.0) == 0.0
    assert outside_tempi_share(counts_s, 130.0, 140.0) == 1.0
    assert outside_tempi_share(counts_s, 123.0, 140.0) == 0.0  # within 4 %
    assert outside_tempi_share(counts_s, 123.0, 140.0, tolerance=0.0) == 1.0


def test_tempo_range_of_each_interval():
    counts_s = np.arange(0.0, 20.5, 0.5)  # 40 intervals
    low = np.where(np.arange(40) < 10, 150.0, 100.0)  # ten danced with takes of a faster genre
    assert outside_tempi_share(counts_s, low, 200.0) == 0.25


def test_one_count_too_many_at_a_join_is_no_tempo():
    counts_s = np.insert(np.arange(0.0, 20.0, 0.5), 10, 4.7)
    assert outside_tempi_share(counts_s, 110.0, 130.0) == 0.0


def test_tempo_of_nothing():
    assert np.isnan(outside_tempi_share([], 100.0, 130.0))
    assert np.isnan(outside_tempi_share([1.0], 100.0, 130.0))


@pytest.mark.parametrize(
    ("counts_s", "low", "high"),
    [
        ([0.0, 0.5, 0.4], 100.0, 130.0),
        ([0.0, np.nan], 100.0, 130.0),
        ([0.0, 0.5, 1.0], 130.0, 100.0),
        ([0.0, 0.5, 1.0], np.nan, 100.0),
        ([0.0, 0.5, 1.0], [100.0], 130.0),
        ([0.0, 0.5, 1.0], -1.0, 130.0),
    ],
)
def test_tempo_malformed(counts_s, low, high):
    with pytest.raises(ParameterError) as raised:
        outside_tempi_share(counts_s, low, high)
    assert "\n" not in str(raised.value)


def test_the_same_dance_elsewhere_is_no_other_dance():
    dance = swaying(90, fps=NET_FPS)
    moved = dance.moved(yaw_rad=2.0, shift_m=np.array([1.0, 0.0, -3.0]))
    assert joint_distance_m(body_pos_m(dance), body_pos_m(moved), NET_FPS) == pytest.approx(0.0, abs=1e-9)
    assert joint_distance_m(body_pos_m(dance), body_pos_m(stepping(90, fps=NET_FPS)), NET_FPS) > 0.01


def test_distance_known_by_hand():
    pos = body_pos_m(swaying(60, fps=NET_FPS))
    arm = pos.copy()
    arm[:, 20, 1] += 0.21  # a wrist, one of 21 joints
    assert joint_distance_m(pos, arm, NET_FPS) == pytest.approx(0.01)
    assert joint_distance_m(pos, arm[:30], NET_FPS) == pytest.approx(0.01, rel=1e-3)  # the longer one is cut


def test_distance_malformed():
    pos = body_pos_m(swaying(10, fps=NET_FPS))
    for one, other, fps in ((pos, pos[:0], NET_FPS), (pos[:, :5], pos, NET_FPS), (pos, pos, 0.0)):
        with pytest.raises(ParameterError) as raised:
            joint_distance_m(one, other, fps)
        assert "\n" not in str(raised.value)
