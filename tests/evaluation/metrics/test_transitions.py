"""Transitions: planted ones at bars and figures, none, malformed input, chance."""

from __future__ import annotations

import numpy as np
import pytest

from choreograph.core.counts import numbers_in_bar
from choreograph.core.errors import ParameterError
from choreograph.evaluation.metrics.transitions import (
    at_bar_borders,
    at_borders,
    at_figure_borders,
    evaluate,
    mean_gap_s,
    on_counts,
    transitions_per_minute,
    uniform_chance,
)

NONE = np.zeros(0)
BEATS_S = 0.5 * np.arange(121)  # a minute of 4 in a bar
NUMBERS = numbers_in_bar(121, 4)


def test_perfect():
    transitions_s = np.arange(4.0, 60.0, 4.0)
    assert evaluate(transitions_s, 60.0, BEATS_S, NUMBERS, transitions_s) == {
        "transitions_per_minute": 14.0, "transition_gap_s": 4.0, "transitions_on_counts": 1.0,
        "transitions_at_bar_borders": 1.0, "transitions_at_figure_borders": 1.0,
        "transitions_at_borders": 1.0,
    }  # fmt: skip


def test_known_by_hand():
    # At a bar; on count 2; 0.06 s = 0.12 beat before a bar; 0.1 s = 0.2 beat after one.
    transitions_s = np.array([2.0, 4.5, 7.94, 12.1])
    assert on_counts(transitions_s, BEATS_S) == 3 / 4
    assert at_bar_borders(transitions_s, BEATS_S, NUMBERS) == 2 / 4
    assert at_figure_borders(transitions_s, BEATS_S, [4.5, 12.13]) == 2 / 4
    assert at_borders(transitions_s, BEATS_S, NUMBERS, [4.5, 12.13]) == 1.0
    assert at_borders(transitions_s, BEATS_S, NUMBERS, [2.0]) == 2 / 4
    assert mean_gap_s(transitions_s) == pytest.approx(10.1 / 3)
    assert transitions_per_minute(transitions_s, 30.0) == 8.0


def test_nothing_known():
    scores = evaluate(NONE, 60.0, BEATS_S, NUMBERS)
    assert scores.pop("transitions_per_minute") == 0.0
    assert all(np.isnan(value) for value in scores.values())
    without_bars = evaluate([2.0, 4.0], 60.0, BEATS_S, np.zeros(121))
    assert np.isnan(without_bars["transitions_at_bar_borders"])
    assert np.isnan(without_bars["transitions_at_borders"])
    assert without_bars["transitions_at_figure_borders"] == 0.0
    assert at_borders([2.0, 4.0], BEATS_S, np.zeros(121), [2.0]) == 0.5
    without_beats = evaluate([2.0, 4.0], 60.0, NONE, NONE, [2.0])
    assert without_beats["transitions_at_figure_borders"] == 0.0  # no beat, so nothing to be within


@pytest.mark.parametrize(
    "given",
    [
        ([2.0, 1.0], 60.0, BEATS_S, NUMBERS),
        ([1.0, np.nan], 60.0, BEATS_S, NUMBERS),
        ([1.0], 0.0, BEATS_S, NUMBERS),
        ([1.0], 60.0, BEATS_S[::-1], NUMBERS),
        ([1.0], 60.0, BEATS_S, NUMBERS[1:]),
        ([1.0], 60.0, BEATS_S, NUMBERS, [np.inf]),
    ],
)
def test_malformed(given):
    with pytest.raises(ParameterError) as raised:
        evaluate(*given)
    assert "\n" not in str(raised.value)


def test_chance():
    transitions_s = np.sort(np.random.default_rng(0).uniform(0, 60, 4000))
    scores = evaluate(np.unique(transitions_s), 60.0, BEATS_S, NUMBERS)
    for name, level in uniform_chance(4).items():
        assert scores[name] == pytest.approx(level, abs=0.02)
    with pytest.raises(ParameterError):
        uniform_chance(0)
