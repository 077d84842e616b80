"""Amplitudes scale a motion smoothly with its feet in place. Stops stand still and keep the counts."""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic_motions import swaying

import choreograph as cg
from choreograph.choreography.engine import amplitudes
from choreograph.core.numerics import frame_blocks
from choreograph.evaluation.metrics.energy_response import speed_within_m_s
from choreograph.evaluation.metrics.physical import foot_slide_cm_s, jumps_per_minute
from choreograph.motion.body import BODY_JOINTS, body_pos_m
from choreograph.motion.contacts import foot_contacts, lock_feet
from choreograph.plan.runs import STOP_EASE_S, Run, with_stops
from choreograph.render.dynamics import hold_stops_in_place, with_amplitudes

FPS = 60.0
ANKLES = [BODY_JOINTS.index(f"{side}_ankle") for side in ("left", "right")]
TAKES = cg.starter_repertoire()
MOTION = TAKES.motion(TAKES.take_index("house-09"), 8.0, 20.0)[0].resampled(FPS).sliced(0, 720)
CONTACTS = foot_contacts(body_pos_m(MOTION), FPS)


def test_amplitudes_follow_the_energy_of_the_song_within_their_range():
    rising = amplitudes(np.linspace(0.0, 1.0, 40), 1.0)
    assert rising == tuple(sorted(rising)) and rising[0] < 0.7 and rising[-1] == 1.1
    energy = np.repeat([0.9, 0.1, 0.9], [20, 8, 12])
    with_break = np.array(amplitudes(energy, 1.0))
    assert (with_break[20:28] == 0.5).all() and (with_break[:20] == 1.0).all()
    assert (with_break[28:30] == 1.1).all() and (with_break[31:] == 1.0).all()  # the accent of a drop
    half = np.array(amplitudes(energy, 0.5))
    assert half[22] == pytest.approx(0.75) and half[28] == pytest.approx(1.05)


def test_songs_of_one_loudness_and_the_strength_0_have_no_amplitudes():
    noise = np.random.default_rng(0).uniform(0.97, 1.0, 60)
    assert amplitudes(noise, 1.0) == () and amplitudes(np.linspace(0, 1, 60), 0.0) == ()


def test_fixed_seconds_keep_their_size():
    softer = np.r_[np.ones(30), np.zeros(10)]
    assert amplitudes(softer, 1.0, fixed=[33, 34, 99])[32:36] == (0.5, 1.0, 1.0, 0.5)


@pytest.mark.parametrize(("amplitude", "least", "greatest"), [(0.5, 0.45, 0.7), (1.1, 1.03, 1.2)])
def test_a_motion_is_smaller_or_larger_and_its_feet_do_not_slide_more(amplitude, least, greatest):
    made = with_amplitudes(MOTION, [amplitude] * 12)
    before, after = (body_pos_m(lock_feet(motion, CONTACTS)) for motion in (MOTION, made))
    ratio = speed_within_m_s(after, FPS, (1.0, 11.0)) / speed_within_m_s(before, FPS, (1.0, 11.0))
    assert least < ratio < greatest
    assert foot_slide_cm_s(after, FPS) < max(1.0, 1.05 * amplitude) * foot_slide_cm_s(before, FPS)
    assert jumps_per_minute(after, FPS) <= jumps_per_minute(before, FPS)


def test_a_motion_is_scaled_in_blocks_as_at_once(monkeypatch):
    scale = [1.0, 0.5, 0.7, 1.1, 0.6, 0.9] * 2
    at_once = with_amplitudes(MOTION, scale)
    module = sys.modules["choreograph.render.dynamics"]  # `cg.render` is a function
    monkeypatch.setattr(module, "frame_blocks", partial(frame_blocks, size=100))
    in_blocks = with_amplitudes(MOTION, scale)
    assert np.array_equal(in_blocks.local_quat, at_once.local_quat)
    assert np.array_equal(in_blocks.root_pos_m, at_once.root_pos_m)


def test_a_change_of_amplitude_is_smooth():
    made = with_amplitudes(MOTION, [1.0] * 6 + [0.5] * 6)
    acceleration = [np.linalg.norm(np.diff(body_pos_m(m), 2, axis=0), axis=-1).max() for m in (MOTION, made)]
    assert acceleration[1] < 1.1 * acceleration[0]
    np.testing.assert_allclose(body_pos_m(made)[:120], body_pos_m(MOTION)[:120], atol=0.01)
    assert with_amplitudes(MOTION, ()) is MOTION


def a_run(**changes: object) -> Run:
    return replace(Run("a", 0.0, 12.0, np.linspace(20.0, 32.0, 241)), **changes)


@given(st.floats(1.0, 5.0), st.floats(1.0, 5.0))
def test_a_run_rests_in_a_stop_and_continues_from_the_same_pose(rests_s, length_s):
    (run,) = with_stops([a_run()], [(rests_s, rests_s + length_s)])
    times_s = np.arange(0.0, 12.0, 0.01)
    played_s = run.source_s(times_s) - 20.0
    slopes = np.diff(played_s) / 0.01
    assert slopes.min() > -0.05 and slopes.max() < 1.1
    before, after = times_s <= rests_s - STOP_EASE_S, times_s >= rests_s + length_s + 0.05
    np.testing.assert_allclose(played_s[before], times_s[before], atol=0.01)
    np.testing.assert_allclose(played_s[after], times_s[after] - length_s, atol=0.02)
    held = (times_s >= rests_s + 0.05) & (times_s <= rests_s + length_s - STOP_EASE_S - 0.05)
    assert np.abs(np.diff(played_s[held])).max() < 1e-3


def test_a_run_that_begins_during_a_stop_follows_when_the_dance_sets_off():
    runs = [
        a_run(stop_s=5.0, source_times_s=np.linspace(20, 25, 101)),
        Run("b", 5.0, 5.8, np.linspace(0.0, 0.8, 17)),
        Run("c", 5.8, 12.0, np.linspace(3.0, 9.2, 125)),
    ]
    first, last = with_stops(runs, [(4.0, 7.0)])
    assert (first.take, last.take, first.stop_s, last.start_s) == (
        "a",
        "c",
        7.0 - STOP_EASE_S,
        7.0 - STOP_EASE_S,
    )
    assert last.source_s(np.array([8.0]))[0] == pytest.approx(5.2, abs=0.01)  # as planned
    assert first.source_s(np.array([4.5]))[0] == pytest.approx(first.source_s(np.array([6.0]))[0], abs=0.01)


def test_a_locked_run_does_not_stop():
    runs = [a_run(locked=True)]
    assert with_stops(runs, [(4.0, 7.0)]) == runs and with_stops(runs, []) == runs


def test_a_stop_breathes_on_both_feet():
    motion = swaying(round(8 * FPS), fps=FPS)
    frames = np.clip(np.arange(8 * FPS), 0, 3 * FPS)  # still from 3 s on
    still = motion.sampled(frames)
    hold_stops_in_place(still, [(3.0, 7.0)], STOP_EASE_S)
    held = body_pos_m(still)
    assert 0.005 < speed_within_m_s(held, FPS, (3.5, 6.0)) < 0.15
    assert np.linalg.norm(np.diff(held[190:390, ANKLES], axis=0), axis=-1).max() < 1e-3  # ankles
