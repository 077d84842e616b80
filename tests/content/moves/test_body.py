"""Legs of dancers: knees bend softly, feet on the floor stay, and none is below it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from content.moves.body import _smoothed, _softly_bent
from content.moves.feet import BALL_OVER_FLOOR_M, FootPath

FPS, N, LEAVES = 25.0, 60, 20
HIP_M = np.array([0.1, 0.92, 0.0])


def snatched(up_m: float) -> FootPath:
    """A foot under the hip, with the heel up, that is `up_m` higher from one frame to the next."""
    ball_m = np.tile([0.1, BALL_OVER_FLOOR_M, 0.05], (N, 1))
    ball_m[LEAVES:, 1] += up_m
    planted = np.arange(N) < LEAVES
    return FootPath(ball_m, np.zeros(N), np.full(N, 0.1), np.zeros(N), planted, np.zeros(N, bool))


def knee_rad(foot: FootPath) -> np.ndarray:
    """How far a knee (T,) is bent between bones of 0.42 m."""
    apart = np.linalg.norm(foot.ankle_m() - HIP_M, axis=-1)
    return 2.0 * np.arccos(np.clip(apart / 0.84, 0.0, 1.0))


def test_a_knee_bends_softly_and_a_foot_on_the_floor_stays():
    foot = snatched(0.15)
    soft = _softly_bent(foot, np.tile(HIP_M, (N, 1)), FPS)
    np.testing.assert_array_equal(soft.ball_m[:LEAVES], foot.ball_m[:LEAVES])
    np.testing.assert_allclose(soft.ball_m[-10:], foot.ball_m[-10:], atol=0.003)
    sudden, softly = (np.abs(np.diff(knee_rad(path), n=2)).max() for path in (foot, soft))
    assert softly < 0.75 * sudden


def test_no_foot_comes_below_the_floor():
    """Where a foot comes down suddenly, a soft knee would be ahead of it."""
    foot = replace(snatched(0.0), planted=np.zeros(N, bool))
    foot.ball_m[:LEAVES, 1] += 0.1
    soft = _softly_bent(foot, np.tile(HIP_M, (N, 1)), FPS)
    assert np.abs(soft.ball_m - foot.ball_m).max() > 0.005
    assert soft.over_floor_m().min() > -1e-9


def test_a_foot_out_of_reach_stays_there():
    foot = snatched(0.15)
    far = np.tile(HIP_M + np.array([0.0, 0.5, 0.0]), (N, 1))
    np.testing.assert_array_equal(_softly_bent(foot, far, FPS).ball_m, foot.ball_m)


def test_the_smoothed_values_are_those_of_the_least_squares():
    rng = np.random.default_rng(0)
    values, weights = rng.normal(size=40), rng.uniform(0.5, 2.0, 40)
    bends = np.diff(np.eye(40), n=2, axis=0)
    expected = np.linalg.solve(np.diag(weights) + 3.0 * bends.T @ bends, weights * values)
    assert _smoothed(values, weights, 3.0) == pytest.approx(expected, abs=1e-12)
    assert _smoothed(np.arange(40.0), weights, 3.0) == pytest.approx(np.arange(40.0), abs=1e-9)
