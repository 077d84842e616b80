"""Dances that loop: they end where they begin, on bars, without a jump."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_motions import swaying

from choreograph.core.errors import ParameterError
from choreograph.motion import rotations as rot
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion
from choreograph.render.filled_gaps import looped

FPS = 30.0
BARS_S = np.arange(0.5, 14.0, 2.0)


def wandering(seed: int, *, turn_rad_s: float) -> Motion:
    """A motion that ends elsewhere than it begins, facing another way."""
    motion = swaying(450, fps=FPS, seed=seed)
    turn = turn_rad_s * np.arange(450) / FPS
    quat = np.array(motion.local_quat)
    quat[:, 0] = rot.multiply(rot.about_y(turn), quat[:, 0])
    steps = 0.2 / FPS * np.stack([np.sin(turn), np.zeros(450), np.cos(turn)], axis=1)
    return replace(motion, root_pos_m=motion.root_pos_m + np.cumsum(steps, axis=0), local_quat=quat)


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 50), st.floats(-0.4, 0.4))
def test_a_loop_ends_where_it_begins_without_a_jump(seed, turn_rad_s):
    motion = wandering(seed, turn_rad_s=turn_rad_s)
    loop = looped(motion, BARS_S)
    body = body_pos_m(loop.motion)
    assert np.allclose(body[-1], body[0], atol=1e-12)
    assert loop.motion.n_frames == round((loop.end_s - loop.start_s) * FPS) + 1
    twice = np.concatenate([body[:-1], body])
    speed = np.linalg.norm(np.diff(twice, axis=0), axis=-1).max(axis=1) * FPS
    own = np.linalg.norm(np.diff(body_pos_m(motion), axis=0), axis=-1).max() * FPS
    assert speed.max() < 2.0 * own + 1.0  # a jump of 10 cm in a frame would be 3 m/s more


def test_a_loop_begins_and_ends_on_bars_and_holds_three_quarters_of_them():
    loop = looped(wandering(1, turn_rad_s=0.1), BARS_S)
    assert {loop.start_s, loop.end_s} <= set(np.round(BARS_S * FPS) / FPS)
    assert loop.n_bars == round((loop.end_s - loop.start_s) / 2.0) >= 0.75 * (len(BARS_S) - 1)


def test_the_bars_that_are_most_alike_are_taken():
    period = swaying(60, fps=FPS, seed=3)
    again = np.tile(np.arange(60), 6)
    motion = Motion(
        period.skeleton, period.root_pos_m[again], period.local_quat[again] + 0.0, FPS
    )  # the same two seconds over and over
    loop = looped(motion, [0.3, 2.3, 4.3, 6.3, 8.3, 8.9])  # the last bar is another place of the period
    assert loop.end_s == pytest.approx(8.3, abs=0.5 / FPS)


@pytest.mark.parametrize("bars_s", [(), (2.0,), (2.0, 14.9), (-1.0, 3.0)])
def test_less_than_two_bars_do_not_loop(bars_s):
    with pytest.raises(ParameterError, match="two bars"):
        looped(swaying(450, fps=FPS), bars_s)
