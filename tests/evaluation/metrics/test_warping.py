"""Slopes of synthetic time maps, shares at the limits, and errors of recovered warps in milliseconds."""

from __future__ import annotations

import numpy as np
import pytest
from golden.regenerate import golden, warping_scores
from hypothesis import assume, given
from hypothesis import strategies as st

from choreograph.core.errors import ParameterError
from choreograph.evaluation.metrics import warping


@given(slope=st.floats(0.5, 2.0), start=st.floats(-50, 50))
def test_an_even_map_has_one_slope(slope, start):
    assume(min(abs(slope - 0.51), abs(slope - 1.96)) > 1e-9)
    maps = start + slope * np.arange(80) * np.ones((3, 1))
    shares = warping.slope_histogram(maps)
    assert shares.sum() == pytest.approx(1) and np.count_nonzero(shares > 0.01) <= 2
    scores = warping.evaluate(maps)
    assert [scores["slope_median"], scores["slope_p95"]] == pytest.approx([slope, slope])
    assert scores["share_at_slowest"] == (slope <= 0.51) and scores["share_at_fastest"] == (slope >= 1.96)


def test_identity_is_perfect():
    maps = np.arange(40.0)
    assert warping.share_at_limits(maps) == (0, 0)
    assert warping.slope_histogram(maps)[len(warping.SLOPE_EDGES) // 2] == 1
    assert warping.summary_ms(warping.recovery_errors_ms(maps, maps, 20.0)) == {
        "median_ms": 0, "mean_ms": 0, "p90_ms": 0,
    }  # fmt: skip


def test_a_staircase_runs_along_and_beyond_the_limits():
    maps = np.cumsum([0, 2, 0.5, 2, 1, 3, 0, 1, 1])
    assert warping.share_at_limits(maps) == (2 / 8, 3 / 8)
    shares = warping.slope_histogram(maps)
    assert shares[0] == 2 / 8 and shares[-1] == 3 / 8


def test_errors_are_in_milliseconds_of_the_source():
    true = np.arange(10.0)
    errors = warping.recovery_errors_ms(true + np.array([1.0] * 9 + [-4.0]), true, 20.0)
    assert errors.tolist() == [50.0] * 9 + [200.0]
    assert warping.summary_ms(errors)["mean_ms"] == pytest.approx(65)


@given(fps=st.floats(1, 200), shift=st.floats(-5, 5))
def test_the_rate_does_not_matter(fps, shift):
    true_s = np.linspace(0, 4, 50)
    errors = warping.recovery_errors_ms((true_s + shift) * fps, true_s * fps, fps)
    assert errors == pytest.approx(1000 * abs(shift), abs=1e-6)


@pytest.mark.parametrize(
    "maps", [np.zeros((0, 5)), np.zeros(1), np.float64(1.0), np.array([0.0, np.nan]), np.array([1.0, 0.0])]
)
def test_broken_maps_are_refused(maps):
    with pytest.raises(ParameterError, match="time maps"):
        warping.evaluate(maps)


def test_broken_pairs_are_refused():
    for found, true, fps in (
        (np.zeros(3), np.zeros(4), 20.0),
        (np.zeros(0), np.zeros(0), 20.0),
        (np.zeros(3), np.full(3, np.inf), 20.0),
        (np.zeros(3), np.zeros(3), 0.0),
    ):
        with pytest.raises(ParameterError):
            warping.recovery_errors_ms(found, true, fps)
    with pytest.raises(ParameterError, match="none"):
        warping.summary_ms(np.zeros(0))


def test_golden():
    assert warping_scores() == pytest.approx(golden("warping"))
