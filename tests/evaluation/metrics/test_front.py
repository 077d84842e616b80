"""Front: planted headings, a turning dancer, a front elsewhere, malformed input, chance."""

from __future__ import annotations

import numpy as np
import pytest

from choreograph.core.errors import ParameterError
from choreograph.evaluation.metrics.front import (
    evaluate,
    heading_rad,
    last_heading_deg,
    outside_share,
    turned_away_share,
    uniform_chance,
    usual_front_rad,
)
from choreograph.motion.body import BODY_JOINTS
from choreograph.motion.body import heading_rad as body_heading_rad

FPS = 60.0
LEFT, RIGHT = BODY_JOINTS.index("left_hip"), BODY_JOINTS.index("right_hip")


def turned(headings_deg: np.ndarray) -> np.ndarray:
    """A pelvis with those headings (T,), whose other joints say nothing, (T, 21, 3)."""
    angle = np.radians(headings_deg)
    pos = np.random.default_rng(0).normal(size=(len(angle), len(BODY_JOINTS), 3))
    across = 0.1 * np.stack([np.cos(angle), np.zeros_like(angle), -np.sin(angle)], axis=1)
    pos[:, LEFT], pos[:, RIGHT] = across, -across
    return pos


def test_perfect():
    assert evaluate(turned(np.full(120, 10.0)), FPS) == {
        "turned_away_share": 0.0, "last_heading_deg": pytest.approx(10.0), "ends_to_front": 1.0,
    }  # fmt: skip


def test_a_turned_back():
    assert evaluate(turned(np.full(120, -170.0)), FPS) == {
        "turned_away_share": 1.0, "last_heading_deg": pytest.approx(170.0), "ends_to_front": 0.0,
    }  # fmt: skip


def test_known_by_hand():
    pos = turned(np.array([0.0, 90.0, -99.0, 101.0, -120.0, 180.0, 270.0, 360.0 + 44.0]))
    assert turned_away_share(pos, FPS) == 3 / 8
    assert turned_away_share(pos, FPS, beyond_deg=80) == 6 / 8
    assert last_heading_deg(pos, FPS) == pytest.approx(44.0)
    assert turned_away_share(pos[:1], FPS) == 0.0


def test_the_heading_is_that_of_the_body():
    pos = turned(np.linspace(-170, 170, 30))
    left, right = BODY_JOINTS.index("left_shoulder"), BODY_JOINTS.index("right_shoulder")
    pos[:, left], pos[:, right] = pos[:, LEFT], pos[:, RIGHT]
    assert heading_rad(pos) == pytest.approx(body_heading_rad(pos))


def test_the_front_of_a_recorded_dance_is_where_it_faces_most():
    rng = np.random.default_rng(1)
    headings = np.concatenate([rng.normal(175.0, 20.0, 700), rng.uniform(-180, 180, 300)])
    front = usual_front_rad(turned(headings), FPS)
    assert abs((np.degrees(front) - 175.0 + 180) % 360 - 180) <= 10
    away = turned_away_share(turned(headings), FPS, front_rad=front)
    assert away == pytest.approx(0.3 * 80 / 180, abs=0.03)
    assert away < turned_away_share(turned(headings), FPS)


def test_chance_is_a_dance_turned_at_random():
    rng, chance = np.random.default_rng(0), uniform_chance()
    scores = [evaluate(turned(heading + np.zeros(2)), FPS) for heading in rng.uniform(-180, 180, 4000)]
    for name, level in chance.items():
        assert np.mean([s[name] for s in scores]) == pytest.approx(level, rel=0.05)


def test_a_dancer_is_off_the_stage_beyond_any_of_its_sides():
    pos_m = np.zeros((50, 21, 3))
    pos_m[:10, 0, 0], pos_m[10:20, 0, 0], pos_m[20:30, 0, 2], pos_m[30:40, 0, 2] = 2.1, -2.1, 1.6, -1.6
    pos_m[40:, 0] = 1.9, 5.0, 1.4
    assert outside_share(pos_m, 4.0, 3.0) == 0.8
    assert outside_share(pos_m, 5.0, 5.0) == 0.0
    assert outside_share(pos_m, 5.0, 3.0) == 0.4


@pytest.mark.parametrize(
    ("pos", "fps", "front"),
    [
        (np.zeros((0, 21, 3)), FPS, 0.0),
        (np.zeros((4, 20, 3)), FPS, 0.0),
        (np.full((4, 21, 3), np.nan), FPS, 0.0),
        (np.zeros((4, 21, 3)), 0.0, 0.0),
        (np.zeros((4, 21, 3)), FPS, np.nan),
    ],
)
def test_malformed(pos, fps, front):
    with pytest.raises(ParameterError) as raised:
        evaluate(pos, fps, front_rad=front)
    assert "\n" not in str(raised.value)
