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


@pytest.mark.parametrize(("away", "matched"), [(3.9, True), (4.1, False)])
def test_beats_within_4_frames_are_matched(away, matched):
    time_map = smoothed(np.arange(30.0, 110.0)[None], [60.0 + away], [30.0])[0]
    assert (abs(time_map[30] - 60.0 - away) < 0.5) == matched


def test_candidates_use_only_their_own_beats():
    path = np.tile(np.arange(30.0, 110.0), (2, 1))
    maps = smooth_time_maps(
        path, clip_frames=159, motion_beats=np.array([61.0, 10.0]), beat_ranges=np.array([[0, 1], [1, 2]]),
        music_beats=np.array([30.0]),
    )  # fmt: skip
    assert maps[0, 30] == pytest.approx(61.0, abs=0.2)
    assert maps[1, 30] == pytest.approx(60.0, abs=0.2)


# The maps by their definition, with the whole matrix.


def limited(path, last_source):
    """The path with slopes from 0.5 to 2 and the same mean, within its clip."""
    limited = np.concatenate([[0.0], np.cumsum(np.clip(np.diff(path), 0.5, 2.0))])
    limited += path.mean() - limited.mean()
    lowest = 0.5 * np.arange(len(path))
    return np.clip(limited, lowest, last_source - lowest[::-1])


def by_definition(path, motion_beats, music_beats, last_source, *, stiffness, snap):
    """The map of one path: smoothed, then once more with the beats that match on the smooth path."""
    n, pairs = len(path), []
    bend = np.diff(np.eye(n), n=2, axis=0)
    for matched in (False, True):
        if matched:
            for source in motion_beats:
                frames = [m for m in music_beats if 0 <= m <= n - 1]
                places = np.interp(frames, np.arange(n), path)
                slopes = [path[min(int(m), n - 2) + 1] - path[min(int(m), n - 2)] for m in frames]
                gaps = np.abs(source - places) / np.maximum(slopes, 0.25)
                is_nearest = np.array(
                    [np.abs(np.asarray(motion_beats) - at).min() == abs(source - at) for at in places], bool
                )
                gaps = np.where(is_nearest & (gaps <= snap), gaps, np.inf)
                if np.isfinite(gaps).any():
                    pairs.append((frames[int(np.argmin(gaps))], source))
        anchors = np.array([np.maximum(0.0, 1.0 - np.abs(np.arange(n) - m)) for m, _ in pairs]).reshape(-1, n)
        matrix = np.eye(n) + stiffness * bend.T @ bend + 400.0 * anchors.T @ anchors
        path = limited(
            np.linalg.solve(matrix, path + 400.0 * anchors.T @ np.array([b for _, b in pairs])), last_source
        )
    return path


@pytest.mark.parametrize("stiffness", [0.0, 5.0, None])
@pytest.mark.parametrize("seed", range(12))
def test_a_map_is_the_minimum_of_its_definition(seed, stiffness):
    """Also with the stiffness and the reach of a dance, which are 40,000 frames⁴ and 4 frames."""
    given = {} if stiffness is None else {"stiffness": stiffness, "snap_frames": 3.0}
    rng = np.random.default_rng(seed)
    n = (80, 80, 7, 3)[seed % 4]
    steps = np.full(n - 1, rng.uniform(0.8, 1.5))
    if seed % 2:
        steps = rng.choice([0.25, 0.5, 1.0, 2.0, 3.0], n - 1)
    path = np.concatenate([[0.0], np.cumsum(steps)])
    path += rng.uniform(0.0, max(0.0, 159 - path[-1]))
    motion_beats = np.arange(rng.uniform(0.0, 9.0), 160.0, rng.uniform(2.0, 14.0))
    music_beats = np.arange(rng.uniform(-9.0, 3.0), n + 9.0, rng.uniform(2.0, 14.0))
    (found,) = smooth_time_maps(
        path[None], clip_frames=160, motion_beats=motion_beats, music_beats=music_beats,
        beat_ranges=np.array([[0, len(motion_beats)]]), **given,
    )  # fmt: skip
    wanted = by_definition(
        path, motion_beats, music_beats, 159.0, stiffness=given.get("stiffness", 40_000.0),
        snap=given.get("snap_frames", 4.0),
    )  # fmt: skip
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-6)


def test_slopes_stay_within_half_and_double_speed_where_the_path_does_not():
    """Steps of 3 frames and of a quarter of one, which no path of the DTW has, are followed at the limit."""
    steps = np.concatenate([np.full(20, 1.0), np.full(10, 3.0), np.full(20, 0.25), np.full(29, 1.0)])
    path = 30.0 + np.concatenate([[0.0], np.cumsum(steps)])
    (found,) = smooth_time_maps(
        path[None], clip_frames=159, motion_beats=np.zeros(0), beat_ranges=np.array([[0, 0]]),
        music_beats=np.zeros(0), stiffness=0.0,
    )  # fmt: skip
    np.testing.assert_allclose(np.diff(found), np.clip(steps, 0.5, 2.0), atol=1e-9)
    assert found.mean() == pytest.approx(path.mean())


def test_of_two_music_beats_at_one_motion_beat_only_the_nearer_is_matched():
    path = np.arange(30.0, 110.0)[None]
    for music_beats, matched, other in (([27.5, 31.0], 31, 28), ([28.5, 33.0], 28.5, 33), ([31.0], 31, 28)):
        time_map = smoothed(path, [60.0], music_beats)[0]
        assert np.interp(matched, np.arange(80), time_map) == pytest.approx(60.0, abs=0.2)
        assert abs(time_map[other] - 60.0) > 1.5


@pytest.mark.parametrize("shape", [(80,), (1, 2), (1, 1, 80)])
def test_paths_of_a_wrong_shape(shape):
    with pytest.raises(ParameterError):
        smooth_time_maps(
            np.zeros(shape), clip_frames=159, motion_beats=np.zeros(0), beat_ranges=np.zeros((1, 2), int),
            music_beats=np.zeros(0),
        )  # fmt: skip
