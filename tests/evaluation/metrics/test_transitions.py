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
    closing_lift_cm,
    closing_speed_m_s,
    evaluate,
    evaluate_ends,
    frozen_ends_share,
    held_from_s,
    hold_delay_s,
    mean_gap_s,
    on_counts,
    opening_speed_m_s,
    transitions_per_minute,
    uniform_chance,
)
from choreograph.motion.body import BODY_JOINTS

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


# Endings: planted holds and movement, a single frame, malformed input.


FPS = 60.0
BODY = np.random.default_rng(0).normal(size=(len(BODY_JOINTS), 3))


FEET = [[BODY_JOINTS.index(f"{side}_{part}") for part in ("ankle", "foot")] for side in ("left", "right")]
LIFT_CM = 100 * abs(np.subtract(*((BODY[foot, 1] - [0.07, 0.0]).min() for foot in FEET)))


def moving(speed_m_s: np.ndarray) -> np.ndarray:
    """A body that slides at those speeds (T - 1,) from frame to frame at 60 fps, (T, 21, 3)."""
    path = np.concatenate([[0.0], np.cumsum(speed_m_s) / FPS])
    return BODY + path[:, None, None] * np.array([1.0, 0.0, 0.0])


def held_then_danced_then_held(opening_s: float, closing_s: float, length_s: float = 10.0) -> np.ndarray:
    times_s = np.arange(round(length_s * FPS)) / FPS
    return moving(np.where((times_s >= opening_s) & (times_s < closing_s), 1.2, 0.05))


def test_planted():
    pos = held_then_danced_then_held(0.5, 9.0)
    assert evaluate_ends(pos, FPS, 8.95) == {
        "opening_speed_m_s": pytest.approx(0.05),
        "closing_speed_m_s": pytest.approx(0.05),
        "closing_held": 1.0,
        "closing_lift_cm": pytest.approx(LIFT_CM),
        "frozen_ends_share": 0.0,  # it moves at 0.05 m/s there
        "hold_delay_s": pytest.approx(0.05),
    }
    assert held_from_s(pos, FPS) == pytest.approx(9.0)
    assert hold_delay_s(pos, FPS, 9.5) == pytest.approx(-0.5)


def test_no_hold():
    pos = held_then_danced_then_held(0.0, 10.0)
    assert [opening_speed_m_s(pos, FPS), closing_speed_m_s(pos, FPS)] == pytest.approx([1.2, 1.2])
    assert np.isnan(held_from_s(pos, FPS)) and np.isnan(hold_delay_s(pos, FPS, 9.0))
    assert evaluate_ends(pos, FPS)["closing_held"] == 0.0


def test_the_last_third_of_a_second_alone_counts_for_the_closing_speed():
    pos = held_then_danced_then_held(0.5, 9.85)
    assert closing_speed_m_s(pos, FPS) == pytest.approx((1.2 + 0.05) / 2, rel=0.1)


def test_standing_still():
    still = np.repeat(BODY[None], 120, axis=0)
    assert evaluate_ends(still, FPS, 1.0) == {
        "opening_speed_m_s": 0.0, "closing_speed_m_s": 0.0, "closing_held": 1.0,
        "closing_lift_cm": pytest.approx(LIFT_CM), "frozen_ends_share": 1.0, "hold_delay_s": -1.0,
    }  # fmt: skip
    assert np.isnan(opening_speed_m_s(BODY[None], FPS)) and held_from_s(BODY[None], FPS) == 0.0


def test_frozen_ends():
    times_s = np.arange(10 * 60) / FPS
    still = moving(np.where((times_s >= 1.5) & (times_s < 8.0), 1.2, 0.0))
    assert frozen_ends_share(still, FPS) == pytest.approx(0.35, abs=0.002)
    assert frozen_ends_share(still[::3], 20.0) == pytest.approx(0.35, abs=0.03)
    stops = moving(np.where((times_s >= 4.0) & (times_s < 6.0), 0.0, 1.2))
    assert frozen_ends_share(stops, FPS) == 0.0  # a pause is no end
    breathing = BODY + 0.004 * np.sin(2 * np.pi * 0.3 * times_s)[:, None, None] * [1.0, 0.0, 3.0]
    assert frozen_ends_share(breathing, FPS) == pytest.approx(0.64, abs=0.02)  # it turns slowly
    assert frozen_ends_share(3 * breathing, FPS) < 0.2
    assert frozen_ends_share(BODY[None], FPS) == 1.0


def test_the_last_pose_on_one_leg():
    pos = np.repeat(BODY[None], 30, axis=0)
    pos[:, FEET[0], 1] = pos[:, FEET[1], 1] = np.array([0.09, 0.02])
    assert closing_lift_cm(pos, FPS) == pytest.approx(0.0)
    pos[:, FEET[1], 1] += 0.2
    assert closing_lift_cm(pos, FPS) == pytest.approx(20.0)
    pos[-1, FEET[1][1], 1] = 0.02  # the toes are on the floor, behind the other foot
    assert closing_lift_cm(pos, FPS) == pytest.approx(0.0)


def test_other_rates_read_the_same():
    pos = held_then_danced_then_held(0.5, 9.0)
    assert held_from_s(pos[::3], 20.0) == pytest.approx(9.0, abs=0.06)
    assert opening_speed_m_s(pos[::3], 20.0) == pytest.approx(0.05, abs=0.01)


def test_malformed_ends():
    pos = held_then_danced_then_held(0.5, 9.0)
    for bad, count in ((pos[:, :5], 1.0), (pos * np.nan, 1.0), (pos, np.nan)):
        with pytest.raises(ParameterError) as raised:
            evaluate_ends(bad, FPS, count)
        assert "\n" not in str(raised.value)
