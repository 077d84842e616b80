"""Phases of beat and bar: 0 on the count and on count 1, continued beyond the counts, 0, 0 where unknown."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from choreograph.core.counts import NO_COUNTS, count_phase, index_at, make_counts, numbers_in_bar, time_at


def counts_of(metre, n=17, period_s=0.5, first_s=1.0):
    return make_counts(first_s + period_s * np.arange(n), numbers_in_bar(n, metre), metre)


@pytest.mark.parametrize("metre", [3, 4])
def test_on_the_count_and_on_the_downbeat_the_phase_is_0(metre):
    counts = counts_of(metre)
    phase = count_phase(counts, counts.times_s)
    assert np.allclose(phase[:, :2], [1, 0], atol=1e-5)
    assert np.allclose(phase[counts.numbers == 1, 2:], [1, 0], atol=1e-5)
    half = count_phase(counts, counts.times_s[:1] + 0.25)[0]
    assert np.allclose(half[:2], [-1, 0], atol=1e-5)
    assert np.arctan2(half[3], half[2]) == pytest.approx(np.pi / metre, abs=1e-5)


def test_phases_go_on_before_the_first_count_and_after_the_last():
    counts = counts_of(4)
    inside = count_phase(counts, np.array([1.6]))
    for bars in (-3, 20):
        assert np.allclose(count_phase(counts, np.array([1.6 + 2.0 * bars])), inside, atol=1e-4)


def test_what_is_not_known_is_0():
    times_s = np.linspace(0, 5, 11)
    assert not count_phase(NO_COUNTS, times_s).any()
    without_bars = make_counts(np.arange(5.0), np.zeros(5, int), 0)
    phase = count_phase(without_bars, times_s)
    assert phase[:, 0].any() and not phase[:, 2:].any()


@given(
    st.lists(st.floats(0.2, 2.0), min_size=2, max_size=20),
    st.lists(st.floats(-20, 60), min_size=1, max_size=20),
)
def test_time_and_index_are_inverse(periods_s, times_s):
    instants_s = np.cumsum(periods_s)
    times_s = np.array(times_s)
    assert np.allclose(time_at(instants_s, index_at(instants_s, times_s)), times_s, atol=1e-6)
