"""Playback speeds of synthetic time maps."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from choreograph.evaluation.plan_scores import playback_speed_scores


@given(slope=st.floats(0.5, 2.0), start=st.floats(-50, 50))
def test_an_even_map_has_one_slope(slope, start):
    assume(min(abs(slope - 0.51), abs(slope - 1.96)) > 1e-9)
    scores = playback_speed_scores(start + slope * np.arange(80) * np.ones((3, 1)))
    assert [scores["slope_median"], scores["slope_p95"]] == pytest.approx([slope, slope])
    assert scores["share_at_slowest"] == (slope <= 0.51) and scores["share_at_fastest"] == (slope >= 1.96)


def test_a_staircase_runs_along_and_beyond_the_limits():
    scores = playback_speed_scores(np.cumsum([[0, 2, 0.5, 2, 1, 3, 0, 1, 1]], axis=1))
    assert (scores["share_at_slowest"], scores["share_at_fastest"]) == (2 / 8, 3 / 8)
