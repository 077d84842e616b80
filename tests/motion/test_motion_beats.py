"""Motion beats of synthetic motions, agreement with the warper's kernel, and analytic density."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter1d
from synthetic_motions import stepping

from choreograph.choreography.graph.warp_kernels import _played_beats
from choreograph.core.errors import ParameterError
from choreograph.core.timebase import NET_FPS
from choreograph.motion.body import body_pos_at, body_pos_m
from choreograph.motion.motion_beats import (
    MIN_PROMINENCE,
    mean_joint_speed_m_s,
    motion_beat_times_s,
    speed_minima,
)
from choreograph.music.song_features import bumps, motion_density, music_density


def _swing(fps, period_s, duration_s=10.0):
    """All joints swing along X and stand still every half period, from `period_s` / 4 on."""
    times = np.arange(round(duration_s * fps)) / fps
    pos = np.zeros((len(times), 21, 3))
    pos[..., 0] = 0.5 * np.sin(2 * np.pi * times / period_s)[:, None]
    return pos


@settings(deadline=None, max_examples=25)
@given(fps=st.sampled_from([20, 25, 30, 60, 120]), period_s=st.floats(0.8, 3.0))
def test_every_standstill_is_a_beat_at_any_rate(fps, period_s):
    beats = motion_beat_times_s(_swing(fps, period_s), fps)
    expected = np.arange(period_s / 4, 10.0, period_s / 2)
    inside = expected[(expected > 0.2) & (expected < 9.8)]
    assert all(np.abs(beats - instant).min() < 0.02 for instant in inside)
    assert len(beats) <= len(expected)


def test_steady_travel_and_standing_have_no_beats():
    travel = np.zeros((100, 21, 3)) + np.arange(100)[:, None, None] * 0.05
    assert len(motion_beat_times_s(travel, 20)) == 0
    assert len(motion_beat_times_s(np.zeros((100, 21, 3)), 20)) == 0
    assert len(motion_beat_times_s(np.zeros((2, 21, 3)), 20)) == 0


def _kernel_minima(speed):
    """What the warper's kernel finds in a clip played at its recorded tempo."""
    played, frames = np.empty((2, len(speed)))
    n_beats = _played_beats(np.arange(float(len(speed))), speed, MIN_PROMINENCE, played, frames)
    return frames[:n_beats]


@settings(deadline=None, max_examples=50)
@given(st.integers(0, 2**32 - 1), st.integers(10, 160), st.floats(0.1, 4.0))
def test_the_warpers_kernel_finds_the_same_beats_on_the_same_speed_curve(seed, n_frames, smoothing):
    noise = np.random.default_rng(seed).normal(size=n_frames)
    speed = 0.5 + 0.3 * gaussian_filter1d(noise, smoothing)
    speed = np.abs(speed).astype(np.float32)  # as the repertoire stores it
    np.testing.assert_allclose(_kernel_minima(speed), speed_minima(speed, NET_FPS), atol=1e-6)


def test_the_warpers_kernel_finds_the_same_beats_of_a_motion():
    motion = stepping(600, fps=60.0)
    pos = body_pos_at(body_pos_m(motion), motion.fps, NET_FPS)
    speed = mean_joint_speed_m_s(pos, NET_FPS)
    beats = speed_minima(speed, NET_FPS)
    assert len(beats) > 5
    np.testing.assert_allclose(_kernel_minima(speed), beats, atol=1e-9)
    np.testing.assert_allclose(motion_beat_times_s(pos, NET_FPS), beats / NET_FPS)


def test_speed_is_in_metres_per_second_and_counts_travel():
    travel = np.zeros((60, 21, 3))
    travel[..., 2] = np.arange(60)[:, None] * 0.05
    np.testing.assert_allclose(mean_joint_speed_m_s(travel, 20)[5:-5], 1.0, rtol=1e-6)
    assert mean_joint_speed_m_s(np.zeros((1, 21, 3)), 20).tolist() == [0.0]
    with pytest.raises(ParameterError, match=r"\(T, J, 3\)"):
        mean_joint_speed_m_s(np.zeros((10, 3)), 20)


@settings(deadline=None)
@given(st.lists(st.floats(0, 9), max_size=12, unique=True))
def test_density_is_one_on_beats_and_music_agrees_with_motion(beats):
    beats = np.sort(np.array(beats, np.float64))
    np.testing.assert_allclose(bumps(beats, beats), np.ones(len(beats)), atol=1e-6)
    whole = motion_density(14 * 20, beats)
    assert whole.min() >= 0
    segments = music_density(10, beats)
    for second, segment in enumerate(segments):
        np.testing.assert_allclose(segment, whole[20 * second : 20 * second + 80], atol=1e-4)
