"""Warped segments: clips that match the music, one that cannot, and the measures of each quarter."""

from __future__ import annotations

import numpy as np
import pytest

from choreograph.features.density import bumps, music_density
from choreograph.warping import MAX_SLOPE, MIN_SLOPE, ClipBeats, warp_segments

GAPS = (10.0, 12.0, 70.0)  # frames between the beats of clips 0, 1, 2
N_SECONDS = 3


def clip_beats() -> list[np.ndarray]:
    return [np.arange(3.0, 160.0, gap) for gap in GAPS]


def density(clips):
    return np.stack([bumps(np.arange(160) / 20, clip_beats()[clip] / 20) for clip in clips])


def speed(clips):
    """Mean joint speed that is zero at every beat."""
    rows = [np.abs(np.sin(np.pi * (np.arange(160) - 3.0) / GAPS[clip])) for clip in clips]
    return np.stack(rows).astype(np.float32)


@pytest.fixture(scope="module")
def segments():
    beats = clip_beats()
    stops = np.cumsum([len(b) for b in beats])
    ranges = np.stack([stops - [len(b) for b in beats], stops], axis=1)
    music_beats_s = np.arange(0.25, 8.0, 0.5)
    clip = np.tile([0, 1, 2], (N_SECONDS, 1))
    return warp_segments(
        clip, music_density(N_SECONDS, music_beats_s), music_beats_s, density, speed,
        ClipBeats(np.concatenate(beats), ranges),
    )  # fmt: skip


def test_shapes_and_slopes(segments):
    assert segments.time_maps.shape == (N_SECONDS, 3, 81)
    for name in ("density_mismatch", "unmatched_beat", "first_beat", "last_beat"):
        assert getattr(segments, name).shape == (N_SECONDS, 3, 4)
    slopes = np.diff(segments.time_maps, axis=2)
    assert slopes.min() > MIN_SLOPE - 1e-4
    assert slopes.max() < MAX_SLOPE + 1e-4
    assert segments.time_maps.min() >= 0
    assert segments.time_maps.max() <= 159


def test_clips_that_can_be_warped_to_the_beat_match_and_others_do_not(segments):
    assert segments.unmatched_beat[:, :2].max() < 0.05
    assert segments.unmatched_beat[:, 2].mean() > 0.3
    assert segments.unmatched_beat.min() >= 0
    assert segments.unmatched_beat.max() <= 1
    assert segments.density_mismatch[:, :2].max() < 0.05
    assert segments.density_mismatch[:, 2].mean() > 2 * segments.density_mismatch[:, :2].mean()


def test_first_and_last_beats_are_frames_of_their_quarter(segments):
    # The music's beats are at 5 and 15 frames of every second, and clips 0 and 1 follow.
    assert np.allclose(segments.first_beat[:, :2], 5.0, atol=1.5)
    assert np.allclose(segments.last_beat[:, :2], 15.0, atol=1.5)
    # 70 frames apart, at most at double speed: some quarters have no beat at all.
    assert np.isnan(segments.first_beat[:, 2]).any()
    assert np.array_equal(np.isnan(segments.first_beat), np.isnan(segments.last_beat))
    both = ~np.isnan(segments.first_beat)
    assert (segments.first_beat[both] <= segments.last_beat[both]).all()


def test_a_song_without_beats_gives_finite_time_maps():
    seen = []
    segments = warp_segments(
        np.array([[0]]), music_density(1, np.zeros(0)), np.zeros(0), density, speed,
        ClipBeats(np.zeros(0), np.zeros((3, 2), int)), report=lambda done, total: seen.append((done, total)),
    )  # fmt: skip
    assert np.isfinite(segments.time_maps).all()
    assert seen == [(1, 1)]
