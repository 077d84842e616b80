"""Drawn motif sequences: pins are kept, transitions are observed ones, the signature is approached."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from choreograph.choreography.motif_sequences import NEEDS, draw_motifs
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import chi_square_distance
from choreograph.library.vocabulary import signature, template, transition_matrix

K = 8


def _library(seed, n_motifs=K):
    """Dances whose motifs follow each other by few rules: every motif has three that may come next."""
    rng = np.random.default_rng(seed)
    nexts = np.stack([rng.choice(n_motifs, 3, replace=False) for _ in range(n_motifs)])
    nexts[:, 0] = (np.arange(n_motifs) + 1) % n_motifs  # so that every motif can be reached
    library = []
    for _ in range(6):
        dance = [int(rng.integers(n_motifs))]
        while len(dance) < 120:
            dance.append(int(rng.choice(nexts[dance[-1]])))
        library.append(np.array(dance))
    return template(library, n_motifs), transition_matrix(library, n_motifs)


GOAL, STEPS = _library(0)


def _is_observed(motifs, steps=STEPS):
    return np.all(steps[motifs[:-1], motifs[1:]] > 0)


@settings(max_examples=60, deadline=None)
@given(
    st.integers(1, 60).flatmap(
        lambda n: st.tuples(
            st.just(n), st.dictionaries(st.integers(0, n - 1), st.integers(0, K - 1), max_size=n)
        )
    ),
    st.integers(0, 99),
    st.sampled_from(NEEDS),
)
def test_any_pins_are_kept(size_and_pins, seed, need):
    n, pins = size_and_pins
    motifs = draw_motifs(n, GOAL, STEPS, rng=np.random.default_rng(seed), pins=pins, need=need)
    assert motifs.shape == (n,) and motifs.min() >= 0 and motifs.max() < K
    assert all(motifs[position] == motif for position, motif in pins.items())


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.dictionaries(st.integers(0, 29), st.integers(0, K - 1), max_size=3))
def test_only_possible_motifs_are_drawn_and_observed_transitions_lead_to_them(seed, pins):
    rng = np.random.default_rng(seed)
    possible = rng.random((30, K)) < 0.5
    possible[7] = False  # nothing is: everything may be
    motifs = draw_motifs(30, GOAL, STEPS, rng=rng, pins=pins, possible=possible)
    free = [n for n in range(30) if n not in pins and possible[n].any()]
    assert possible[free, motifs[free]].all()
    assert all(motifs[position] == motif for position, motif in pins.items())


def test_a_motif_that_is_possible_only_later_is_led_up_to():
    steps = np.array([[0.0, 0.5, 0.5], [0.5, 0.5, 0.0], [0.0, 0.0, 1.0]])  # nothing leaves 2
    possible = np.ones((10, 3), bool)
    possible[9] = [True, False, False]
    for seed in range(20):
        motifs = draw_motifs(10, np.ones(3) / 3, steps, rng=np.random.default_rng(seed), possible=possible)
        assert motifs[9] == 0 and _is_observed(motifs, steps)


@pytest.mark.parametrize("need", NEEDS)
def test_a_dance_approaches_its_signature_by_observed_transitions(need):
    ends = []
    for seed in range(5):
        motifs = draw_motifs(250, GOAL, STEPS, rng=np.random.default_rng(seed), need=need)
        assert _is_observed(motifs)
        far = [float(chi_square_distance(signature(motifs[:n], K), GOAL)) for n in (10, 250)]
        assert far[1] < far[0]
        ends.append(far[1])
    assert np.mean(ends) < (
        0.002 if need == "missing" else 0.1
    )  # read literally, equation 5 also moves away from it


def test_a_custom_signature_is_approached_where_transitions_allow():
    goal = np.full(K, 0.5 / (K - 1))
    goal[3] = 0.5
    free = np.full((K, K), 1 / K)
    motifs = draw_motifs(200, goal, free, rng=np.random.default_rng(0))
    assert chi_square_distance(signature(motifs, K), goal) < 0.001


def test_gaps_between_pins_are_filled_with_observed_transitions():
    for seed in range(100):
        rng = np.random.default_rng(seed)
        real = draw_motifs(80, GOAL, STEPS, rng=rng)
        pins = {int(at): int(real[at]) for at in rng.choice(80, 25, replace=False)}
        motifs = draw_motifs(80, GOAL, STEPS, rng=rng, pins=pins)
        assert _is_observed(motifs)  # the pins come from a dance, so it is possible
        assert not np.array_equal(motifs, real)


def test_a_motif_that_ends_a_dance_is_not_absorbing():
    dances = [np.array([0, 1, 2, 3, 4, 4, 4, 4, 4]), np.array([3, 2, 1, 0, 1, 2])]
    goal, steps = template(dances, 5), transition_matrix(dances, 5)
    for seed in range(10):
        motifs = draw_motifs(200, goal, steps, rng=np.random.default_rng(seed))
        assert chi_square_distance(signature(motifs, 5), goal) < 0.01


def test_the_only_sequence_to_a_pin_is_found():
    # 0 is followed by 1 or 2; only 2 leads to 4, through 3.
    steps = np.zeros((5, 5))
    steps[0, [1, 2]] = 0.9, 0.1
    steps[1, 1] = steps[2, 3] = steps[3, 4] = steps[4, 0] = 1.0
    goal = np.full(5, 0.2)
    for seed in range(10):
        motifs = draw_motifs(4, goal, steps, rng=np.random.default_rng(seed), pins={0: 0, 3: 4})
        np.testing.assert_array_equal(motifs, [0, 2, 3, 4])


def test_distant_pins_are_reached_without_unseen_transitions():
    goal, steps = _library(7, n_motifs=60)
    for seed in range(10):
        rng = np.random.default_rng(seed)
        pins = {0: int(rng.integers(60)), 30: int(rng.integers(60)), 90: int(rng.integers(60))}
        assert _is_observed(draw_motifs(120, goal, steps, rng=rng, pins=pins), steps)


def test_pins_that_need_an_unseen_transition_are_kept():
    steps = np.eye(3)[[1, 2, 0]]  # 0, 1, 2, 0, ...
    motifs = draw_motifs(6, np.full(3, 1 / 3), steps, rng=np.random.default_rng(0), pins={0: 0, 5: 0})
    assert motifs[0] == motifs[5] == 0
    assert np.sum(steps[motifs[:-1], motifs[1:]] == 0) == 1  # one unseen transition is enough


def test_pinning_every_position_recreates_the_dance():
    dance = np.random.default_rng(5).integers(0, K, 40)
    pins = dict(enumerate(dance.tolist()))
    np.testing.assert_array_equal(
        draw_motifs(40, GOAL, STEPS, rng=np.random.default_rng(0), pins=pins), dance
    )


def test_the_seed_determines_the_dance():
    dances = [draw_motifs(100, GOAL, STEPS, rng=np.random.default_rng(seed)) for seed in (1, 1, 2)]
    np.testing.assert_array_equal(dances[0], dances[1])
    assert np.mean(dances[0] != dances[2]) > 0.3


def test_banned_motifs_do_not_occur():
    motifs = draw_motifs(100, GOAL, STEPS, rng=np.random.default_rng(0), banned={0, 1, 5}, pins={50: 2})
    assert not np.isin(motifs, [0, 1, 5]).any()
    only = draw_motifs(5, np.eye(3)[0], np.eye(3), rng=np.random.default_rng(0), banned=[0, 1])
    np.testing.assert_array_equal(only, 2)  # the signature has only what is banned


def test_no_words_are_an_empty_dance():
    assert draw_motifs(0, GOAL, STEPS, rng=np.random.default_rng(0)).shape == (0,)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"n_words": -1}, "-1"),
        ({"pins": {10: 0}}, "word 10"),
        ({"pins": {-1: 0}}, "word -1"),
        ({"pins": {1: K}}, f"motif {K}"),
        ({"banned": [99]}, "motif 99"),
        ({"pins": {2: 3}, "banned": [3]}, "motif 3, pinned at word 2"),
        ({"banned": range(K)}, "all 8 banned"),
        ({"signature": GOAL * 0.9}, "sum"),
        ({"signature": GOAL[:-1] / GOAL[:-1].sum()}, "transitions"),
        ({"transitions": STEPS * 0.5}, "rows"),
        ({"transitions": STEPS[:, :3]}, "transitions"),
        ({"need": "some"}, "some"),
        ({"possible": np.ones((9, K), bool)}, "possible motifs"),
    ],
)
def test_infeasible_requests_are_refused_in_one_line(changes, named):
    wanted = {"n_words": 10, "signature": GOAL, "transitions": STEPS, "rng": np.random.default_rng(0)}
    with pytest.raises(ParameterError, match=named) as caught:
        draw_motifs(**{**wanted, **changes})
    assert "\n" not in str(caught.value)
