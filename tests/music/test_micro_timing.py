"""Accents landed on counts: planted motion beats beside the count, and bodies that rest elsewhere."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from choreograph.music.count_grids import MAX_SHIFT_S, accent_shifts_s, accents_lie_on_counts

COUNTS_S = 0.5 * np.arange(40)
INSIDE_S = COUNTS_S[:-1]


@pytest.mark.parametrize("early_or_late_s", [-0.04, 0.0, 0.03])
def test_accents_just_beside_the_count_are_landed(early_or_late_s):
    shifts_s = accent_shifts_s(INSIDE_S + early_or_late_s, COUNTS_S)
    np.testing.assert_allclose(shifts_s[1:-1], early_or_late_s)


def test_no_accent_is_moved_by_more_than_50_ms():
    far_s = INSIDE_S + np.where(np.arange(len(INSIDE_S)) % 8 == 3, 0.09, 0.01)
    shifts_s = accent_shifts_s(far_s, COUNTS_S)
    assert shifts_s[3] == MAX_SHIFT_S
    assert np.isclose(shifts_s[4], 0.01)


def test_where_counts_are_close_together_accents_are_moved_less():
    counts_s = 0.3 * np.arange(40)
    beats_s = counts_s[:-1] + np.where(np.arange(39) % 8 == 3, 0.06, 0.01)
    assert accent_shifts_s(beats_s, counts_s)[3] == pytest.approx(0.12 * 0.3)


def test_a_count_without_an_accent_stays():
    beats_s = np.delete(INSIDE_S + 0.02, 7)
    shifts_s = accent_shifts_s(beats_s, COUNTS_S)
    assert shifts_s[7] == 0.0
    assert np.isclose(shifts_s[8], 0.02)


@pytest.mark.parametrize(
    "beats_s",
    [
        INSIDE_S + 0.2,  # between the counts, as rumba's steps
        np.sort(np.random.default_rng(0).uniform(0, COUNTS_S[-1], 40)),
        np.zeros(0),
    ],
    ids=["late", "anywhere", "none"],
)
def test_bodies_that_rest_elsewhere_are_left_as_they_dance(beats_s):
    assert not accents_lie_on_counts(beats_s, COUNTS_S)
    np.testing.assert_array_equal(accent_shifts_s(beats_s, COUNTS_S), 0.0)


def test_a_take_without_counts_has_nothing_to_land_on():
    np.testing.assert_array_equal(accent_shifts_s(np.array([0.5]), np.zeros(1)), [0.0])
    assert accent_shifts_s(np.array([0.5]), np.zeros(0)).shape == (0,)


@given(st.lists(st.floats(0, 20), max_size=60), st.floats(0.2, 1.0))
def test_time_never_runs_backwards(beats_s, period_s):
    counts_s = period_s * np.arange(30)
    landed_s = counts_s + accent_shifts_s(np.sort(np.array(beats_s, float)), counts_s)
    assert (np.diff(landed_s) > 0).all()
