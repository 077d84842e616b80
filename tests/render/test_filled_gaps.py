"""Gaps of a dance filled with other motion: laws of what is kept, and of how the filling meets it."""

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
from choreograph.render.filled_gaps import correction_speed_m_s, fill_gaps, gaps_between

N_FRAMES, FPS = 300, 30.0
KEPT = swaying(N_FRAMES, fps=FPS, seed=1)


def walking(seed: int, *, turn_rad_s: float = 0.3, speed_m_s: float = 0.4) -> Motion:
    """Another motion, which walks on a circle."""
    motion = swaying(N_FRAMES, fps=FPS, seed=seed)
    turn = turn_rad_s * np.arange(N_FRAMES) / FPS
    quat = np.array(motion.local_quat)
    quat[:, 0] = rot.multiply(rot.about_y(turn), quat[:, 0])
    steps = speed_m_s / FPS * np.stack([np.sin(turn), np.zeros(N_FRAMES), np.cos(turn)], axis=1)
    return replace(motion, root_pos_m=motion.root_pos_m + np.cumsum(steps, axis=0), local_quat=quat)


@settings(max_examples=8, deadline=None)
@given(
    st.integers(2, 5), st.floats(-1.0, 1.0),
    st.sampled_from([((0, 90), (200, 300)), ((100, 200),), ((0, 60), (130, 160), (260, 300)), ((0, 150),)]),
)  # fmt: skip
def test_what_is_kept_is_kept_to_the_bit_and_the_rest_is_continuous(seed, turn_rad_s, spans):
    filling = walking(seed, turn_rad_s=turn_rad_s)
    before = np.array(filling.root_pos_m)
    filled = fill_gaps(KEPT, filling, spans)
    for first, stop in spans:
        assert np.array_equal(filled.root_pos_m[first:stop], KEPT.root_pos_m[first:stop])
        assert np.array_equal(filled.local_quat[first:stop], KEPT.local_quat[first:stop])
    speed = np.linalg.norm(np.diff(body_pos_m(filled), axis=0), axis=-1).max(axis=1) * FPS
    own = max(np.linalg.norm(np.diff(body_pos_m(m), axis=0), axis=-1).max() * FPS for m in (KEPT, filling))
    assert speed.max() < 2.0 * own + 1.0  # a jump of 10 cm in a frame would be 3 m/s more
    assert np.array_equal(filling.root_pos_m, before)


def test_a_gap_shows_the_filling():
    filling = walking(3)
    filled = fill_gaps(KEPT, filling, ((0, 90), (210, 300)))
    middle = slice(130, 170)
    to_filling, to_kept = (
        np.mean(1.0 - np.abs(np.sum(filled.local_quat[middle, 1:] * m.local_quat[middle, 1:], axis=-1)))
        for m in (filling, KEPT)
    )
    assert to_filling < 0.2 * to_kept


def test_a_dance_filled_with_itself_stays():
    filled = fill_gaps(KEPT, KEPT, ((0, 90), (200, 300)))
    assert np.abs(filled.root_pos_m - KEPT.root_pos_m).max() < 1e-6
    assert correction_speed_m_s(KEPT, KEPT, ((0, 90), (200, 300))) < 1e-6


def test_a_filling_that_walks_elsewhere_is_led_back():
    spans = ((0, 90), (200, 300))
    away, near = walking(2, speed_m_s=1.0), walking(2, speed_m_s=0.0, turn_rad_s=0.0)
    assert correction_speed_m_s(KEPT, away, spans) > 2 * correction_speed_m_s(KEPT, near, spans)
    filled = fill_gaps(KEPT, away, spans)
    step_m = np.linalg.norm(np.diff(filled.root_pos_m[:, [0, 2]], axis=0), axis=1)
    assert step_m[199] < 3.0 / FPS  # the last one, into what is kept


def test_an_open_end_goes_wherever_it_goes():
    assert correction_speed_m_s(KEPT, walking(2), ((0, 90),)) == 0.0
    assert gaps_between(((0, 90),), 300) == [(90, 300)]
    assert gaps_between(((50, 60), (60, 90)), 100) == [(0, 50), (90, 100)]


def test_other_motions_are_refused():
    with pytest.raises(ParameterError, match="expected a filling as the dance that is kept"):
        fill_gaps(KEPT, swaying(200), ((0, 90),))
