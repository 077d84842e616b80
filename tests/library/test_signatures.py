"""Signatures, templates, equation 11 and transitions: laws, and values computed by hand."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import chi_square_distance
from choreograph.library.words import checked_signature, signature, template, transition_matrix

K = 6
dances = st.lists(st.integers(0, K - 1), min_size=1, max_size=30).map(np.array)
libraries = st.lists(dances, min_size=1, max_size=5)


@given(dances, dances)
def test_chi_square_is_a_distance_between_0_and_1(a, b):
    a, b = signature(a, K), signature(b, K)
    assert chi_square_distance(a, b) == pytest.approx(chi_square_distance(b, a))
    assert chi_square_distance(a, a) == 0.0
    assert 0.0 <= chi_square_distance(a, b) <= 1.0 + 1e-12
    assert (chi_square_distance(a, b) < 1e-12) == np.allclose(a, b)


def test_chi_square_by_hand_and_over_leading_axes():
    a, b = np.array([0.5, 0.5, 0.0]), np.array([0.25, 0.25, 0.5])
    # ½ (0.0625 / 0.75 · 2 + 0.25 / 0.5) = ½ (1/6 + 1/2)
    assert chi_square_distance(a, b) == pytest.approx(1 / 3)
    assert chi_square_distance(np.array([1.0, 0, 0]), np.array([0, 1.0, 0])) == 1.0
    np.testing.assert_allclose(chi_square_distance(np.stack([a, b]), b), [1 / 3, 0.0])


@given(libraries)
def test_signatures_and_templates_sum_to_1(library):
    for dance in library:
        assert signature(dance, K).sum() == pytest.approx(1.0)
    mean = template(library, K)
    assert mean.sum() == pytest.approx(1.0)
    checked_signature(mean, K)


@given(libraries)
def test_rows_of_transitions_sum_to_1_and_only_observed_ones_have_a_probability(library):
    steps = transition_matrix(library, K)
    np.testing.assert_allclose(steps.sum(axis=1), 1.0)
    pairs = {(int(a), int(b)) for dance in library for a, b in pairwise(dance)}
    for a in {a for a, _ in pairs} - {int(dance[-1]) for dance in library}:
        assert set(np.flatnonzero(steps[a])) == {b for c, b in pairs if c == a}


def test_a_template_weights_all_dances_equally():
    np.testing.assert_allclose(
        template([np.zeros(100, int), np.array([1, 1]), np.zeros(0, int)], 3), [0.5, 0.5, 0]
    )


def test_transitions_by_hand_and_none_across_dances():
    steps = transition_matrix([np.array([0, 1, 0, 2]), np.array([1, 1])], 3)
    np.testing.assert_allclose(steps[0], [0, 0.5, 0.5])
    anything = np.array([2, 3, 1]) / 6
    np.testing.assert_allclose(steps[1], (np.array([1, 1, 0]) + anything) / 3)  # a dance ended there
    np.testing.assert_allclose(steps[2], anything)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: signature(np.zeros(0, int), 3),
        lambda: signature(np.array([3]), 3),
        lambda: signature(np.array([-1]), 3),
        lambda: signature(np.array([0.5]), 3),
        lambda: signature(np.zeros((2, 2), int), 3),
        lambda: template([], 3),
        lambda: template([np.zeros(0, int)], 3),
        lambda: transition_matrix([], 3),
        lambda: transition_matrix([np.array([9])], 3),
        lambda: checked_signature(np.array([0.5, 0.4]), 2),
        lambda: checked_signature(np.array([1.5, -0.5]), 2),
        lambda: checked_signature(np.array([np.nan, 1.0]), 2),
        lambda: checked_signature(np.array([1.0]), 2),
    ],
)
def test_malformed_input_is_refused(wrong):
    with pytest.raises(ParameterError):
        wrong()
