"""Errors of recovered warps in milliseconds."""

from __future__ import annotations

import numpy as np
import pytest
from golden.regenerate import golden, warping_scores
from hypothesis import given
from hypothesis import strategies as st

from choreograph.core.errors import ParameterError
from research.warp_scores import recovery_errors_ms, summary_ms


def test_identity_is_perfect():
    maps = np.arange(40.0)
    assert summary_ms(recovery_errors_ms(maps, maps, 20.0)) == {"median_ms": 0, "mean_ms": 0, "p90_ms": 0}


def test_errors_are_in_milliseconds_of_the_source():
    true = np.arange(10.0)
    errors = recovery_errors_ms(true + np.array([1.0] * 9 + [-4.0]), true, 20.0)
    assert errors.tolist() == [50.0] * 9 + [200.0]
    assert summary_ms(errors)["mean_ms"] == pytest.approx(65)


@given(fps=st.floats(1, 200), shift=st.floats(-5, 5))
def test_the_rate_does_not_matter(fps, shift):
    true_s = np.linspace(0, 4, 50)
    errors = recovery_errors_ms((true_s + shift) * fps, true_s * fps, fps)
    assert errors == pytest.approx(1000 * abs(shift), abs=1e-6)


def test_broken_pairs_are_refused():
    for found, true, fps in (
        (np.zeros(3), np.zeros(4), 20.0),
        (np.zeros(0), np.zeros(0), 20.0),
        (np.zeros(3), np.full(3, np.inf), 20.0),
        (np.zeros(3), np.zeros(3), 0.0),
    ):
        with pytest.raises(ParameterError):
            recovery_errors_ms(found, true, fps)
    with pytest.raises(ParameterError, match="none"):
        summary_ms(np.zeros(0))


def test_golden():
    assert warping_scores() == pytest.approx(golden("warping"))
