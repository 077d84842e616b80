"""Smoothed time maps: laws, beats on beats, and motion as smooth as its source."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_motions import stepping

from choreograph.choreography.graph.warping import smooth_time_maps, subsequence_dtw
from choreograph.core.errors import ParameterError
from choreograph.core.timebase import CLIP_FRAMES, MAX_SLOPE, MIN_SLOPE, NET_FPS, SEGMENT_FRAMES
from choreograph.motion.body import body_pos_m
from choreograph.music.song_features import bumps


def smoothed(paths, motion_beats, music_beats):
    """Time maps (K, Tq) of paths (K, Tq) that all have the same motion beats."""
    ranges = np.tile([0, len(motion_beats)], (len(paths), 1))
    return smooth_time_maps(
        paths, clip_frames=CLIP_FRAMES - 1, motion_beats=np.asarray(motion_beats, float), beat_ranges=ranges,
        music_beats=np.asarray(music_beats, float),
    )  # fmt: skip


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(5.0, 30.0), st.floats(5.0, 30.0))
def test_laws_of_the_map(seed, motion_gap, music_gap):
    rng = np.random.default_rng(seed)
    paths, _ = subsequence_dtw(rng.normal(size=SEGMENT_FRAMES), rng.normal(size=(3, CLIP_FRAMES)))
    maps = smoothed(paths, np.arange(rng.uniform(0, 5), 160, motion_gap), np.arange(-5.0, 85.0, music_gap))
    assert maps.shape == paths.shape
    assert maps.min() >= -1e-9
    assert maps.max() <= CLIP_FRAMES - 2 + 1e-9
    slopes = np.diff(maps, axis=1)
    assert slopes.min() >= MIN_SLOPE - 1e-9
    assert slopes.max() <= MAX_SLOPE + 1e-9


@pytest.mark.parametrize(("motion_gap", "music_gap"), [(10, 10), (12, 10), (10, 12), (15, 11), (9, 13)])
@pytest.mark.parametrize("phase", [0.0, 2.5, 5.0])
def test_beats_fall_on_beats_within_a_frame(motion_gap, music_gap, phase):
    motion_beats = np.arange(phase, 160, motion_gap)
    music_beats = np.arange(4.0, 80, music_gap)
    query = bumps(np.arange(80) / NET_FPS, music_beats / NET_FPS)
    target = bumps(np.arange(160) / NET_FPS, motion_beats / NET_FPS)
    paths, _ = subsequence_dtw(query, target[None])
    time_map = smoothed(paths, motion_beats, music_beats)[0]
    sounded = np.interp(music_beats, np.arange(80), time_map)  # source frame at each music beat
    slope = np.interp(music_beats, np.arange(80), np.gradient(time_map))
    gap = np.abs(sounded[:, None] - motion_beats).min(axis=1) / slope  # output frames
    assert gap.max() < 1.0


def jerk(motion, time_map_s, fps: float = 60.0) -> float:
    """Root mean square jerk of the body, m/s³, as a take is played through a map at 20 fps."""
    played_s = np.interp(np.arange(0, 3.9, 1 / fps), np.arange(len(time_map_s)) / NET_FPS, time_map_s)
    pos = body_pos_m(motion.sampled(played_s * motion.fps, fps=fps))
    return float(np.sqrt(np.mean((np.diff(pos, n=3, axis=0) * fps**3) ** 2)))


def test_motion_through_the_smoothed_map_is_as_smooth_as_the_source():
    motion = stepping(8 * 240, fps=240.0, period_s=0.6, seed=2)
    motion_beats = np.arange(0, 160, 0.6 * NET_FPS)
    music_beats = np.arange(0, 80, 0.5 * NET_FPS)  # 1.2 × faster
    query = bumps(np.arange(80) / NET_FPS, music_beats / NET_FPS)
    paths, _ = subsequence_dtw(query, bumps(np.arange(160) / NET_FPS, motion_beats / NET_FPS)[None])
    smooth = smoothed(paths, motion_beats, music_beats)[0]
    source = jerk(motion, np.arange(80) / NET_FPS)
    # At 1.2 × speed, jerk grows by 1.2³; the rest is from the map and its 20 fps knots.
    assert jerk(motion, smooth / NET_FPS) < 1.5 * 1.2**3 * source
    assert jerk(motion, paths[0] / NET_FPS) > 5 * 1.2**3 * source


def test_a_map_without_beats_follows_its_path():
    path = 20 + np.cumsum(np.tile([0.5, 1.5], 40))[None]
    time_map = smoothed(path, [], [])[0]
    assert np.abs(time_map - path[0]).max() < 1.5
    assert np.abs(np.diff(time_map, n=2)).max() < 0.1


def test_beats_too_far_apart_are_not_matched():
    path = np.arange(30.0, 110.0)[None]
    time_map = smoothed(path, [40.0, 80.0], [30.0])[0]  # the music's beat is at source frame 60
    assert np.abs(time_map - path[0]).max() < 0.5


def test_candidates_use_only_their_own_beats():
    path = np.tile(np.arange(30.0, 110.0), (2, 1))
    maps = smooth_time_maps(
        path, clip_frames=159, motion_beats=np.array([61.0, 10.0]), beat_ranges=np.array([[0, 1], [1, 2]]),
        music_beats=np.array([30.0]),
    )  # fmt: skip
    assert maps[0, 30] == pytest.approx(61.0, abs=0.2)
    assert maps[1, 30] == pytest.approx(60.0, abs=0.2)


@pytest.mark.parametrize("shape", [(80,), (1, 2), (1, 1, 80)])
def test_paths_of_a_wrong_shape(shape):
    with pytest.raises(ParameterError):
        smooth_time_maps(
            np.zeros(shape), clip_frames=159, motion_beats=np.zeros(0), beat_ranges=np.zeros((1, 2), int),
            music_beats=np.zeros(0),
        )  # fmt: skip
