"""Endings: planted holds and movement, a single frame, malformed input."""

from __future__ import annotations

import numpy as np
import pytest

from choreograph.core.errors import ParameterError
from choreograph.evaluation.metrics.endings import (
    closing_lift_cm,
    closing_speed_m_s,
    evaluate,
    frozen_ends_share,
    held_from_s,
    hold_delay_s,
    opening_speed_m_s,
)
from choreograph.motion.body import BODY_JOINTS

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
    assert evaluate(pos, FPS, 8.95) == {
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
    assert evaluate(pos, FPS)["closing_held"] == 0.0


def test_the_last_third_of_a_second_alone_counts_for_the_closing_speed():
    pos = held_then_danced_then_held(0.5, 9.85)
    assert closing_speed_m_s(pos, FPS) == pytest.approx((1.2 + 0.05) / 2, rel=0.1)


def test_standing_still():
    still = np.repeat(BODY[None], 120, axis=0)
    assert evaluate(still, FPS, 1.0) == {
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


def test_malformed():
    pos = held_then_danced_then_held(0.5, 9.0)
    for bad, count in ((pos[:, :5], 1.0), (pos * np.nan, 1.0), (pos, np.nan)):
        with pytest.raises(ParameterError) as raised:
            evaluate(bad, FPS, count)
        assert "\n" not in str(raised.value)
