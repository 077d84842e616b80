"""Paths of single feet: rolling over the toes, pointing in the air, landing on heel or toes."""

from __future__ import annotations

import numpy as np
import pytest

from content.moves.curves import Tempo
from content.moves.feet import BALL_OVER_FLOOR_M, FootPath, foot_path
from content.moves.keyframes import FootPlant

FPS = 100.0
TIMES_S = np.arange(0.0, 3.0, 1.0 / FPS)
TOES_M = 0.07  # of the skeleton, from the ball to the tip
LANDS_S = 2.0


def stepped(forward_m: float, *, swing: float = 1.0, **more: float) -> FootPath:
    """A foot that stands from 0 s on and lands `forward_m` farther at 2 s, a count after it has left."""
    plants = [
        FootPlant(0.0, (0.1, 0.0), 0.0, 0.0, 0.0, 0.5, 0.0, (0.0, 0.0), True),
        FootPlant(LANDS_S, (0.1, forward_m), 0.0, 0.0, 0.0, swing, 0.05, (0.0, 0.0), False, **more),
    ]
    return foot_path(plants, Tempo(np.arange(4.0)), TIMES_S)


def tip_m(path: FootPath) -> np.ndarray:
    """The tip of the toes (T, 3) of a foot that points along Z, over its height on the floor."""
    pitch = path.toe_pitch_rad
    ahead = np.stack([np.zeros_like(pitch), -np.sin(pitch), np.cos(pitch)], axis=-1)
    return path.ball_m - [0.0, BALL_OVER_FLOOR_M, 0.0] + TOES_M * ahead


def test_a_foot_rolls_over_the_tip_of_its_toes_before_it_leaves() -> None:
    path = stepped(0.5)
    rolls = ~path.planted & (TIMES_S < 1.0)
    assert 0.05 < rolls.sum() / FPS < 0.2
    assert path.ball_m[rolls, 1].max() > BALL_OVER_FLOOR_M + 0.02
    np.testing.assert_allclose(tip_m(path)[rolls], [[0.1, 0.0, TOES_M]] * rolls.sum(), atol=1e-9)


def test_a_foot_that_stands_briefly_does_not_roll() -> None:
    assert stepped(0.5, swing=1.8).planted[TIMES_S < 0.2].all()


@pytest.mark.parametrize("forward_m", [0.5, 0.2, -0.5])
@pytest.mark.parametrize("point_deg", [0.0, 60.0])
def test_toes_heel_and_ball_stay_over_the_floor(forward_m: float, point_deg: float) -> None:
    path = stepped(forward_m, point_rad=np.radians(point_deg))
    assert path.over_floor_m().min() > -1e-9
    assert tip_m(path)[:, 1].min() > -1e-9


def test_toes_point_and_turn_in_the_air_and_not_on_the_floor() -> None:
    plain, pointed = stepped(0.5), stepped(0.5, point_rad=0.6, sweep_rad=0.3)
    flies = (TIMES_S > 1.0) & (TIMES_S < LANDS_S)
    assert (pointed.pitch_rad - plain.pitch_rad)[flies].max() == pytest.approx(0.6, abs=0.01)
    assert pointed.yaw_rad[flies].max() == pytest.approx(0.3, abs=0.01)
    for of in ("pitch_rad", "yaw_rad", "ball_m"):
        np.testing.assert_allclose(getattr(pointed, of)[~flies], getattr(plain, of)[~flies], atol=1e-9)


def test_a_short_swing_points_less() -> None:
    long, short = (stepped(0.5, swing=swing, point_rad=0.6).pitch_rad.max() for swing in (1.0, 0.2))
    assert short < long - 0.3


@pytest.mark.parametrize(("forward_m", "sign"), [(0.5, -1), (-0.5, 1), (0.05, 0)])
def test_a_step_forward_lands_on_the_heel_and_one_back_on_the_toes(forward_m: float, sign: int) -> None:
    pitch = stepped(forward_m).pitch_rad
    at = int(LANDS_S * FPS)
    assert np.sign(np.round(pitch[at], 6)) == sign
    np.testing.assert_allclose(pitch[at + 25 :], 0.0, atol=1e-9)
