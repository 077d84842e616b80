"""Warped segments: clips that match the music, one that cannot, counted ones, the measures of quarters."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from choreograph.choreography.graph import segments as module
from choreograph.choreography.graph.segments import ClipBeats, warp_segments
from choreograph.choreography.graph.warp_kernels import segment_beats
from choreograph.choreography.graph.warping import (
    NO_TIME_MAP,
    CountedClips,
    subsequence_dtw,
    warp_by_density,
)
from choreograph.core import long_songs
from choreograph.core.cache import Memory
from choreograph.core.counts import NO_COUNTS, make_counts, numbers_in_bar
from choreograph.core.timebase import MAX_SLOPE, MIN_SLOPE
from choreograph.motion.motion_beats import MIN_PROMINENCE
from choreograph.music.count_grids import SongGrid, TakeGrids
from choreograph.music.song_features import bumps, music_density

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


MUSIC_BEATS_S = np.arange(0.25, 8.0, 0.5)


def warped(clip=(0, 1, 2), density=density, **options):
    beats = clip_beats()
    stops = np.cumsum([len(b) for b in beats])
    ranges = np.stack([stops - [len(b) for b in beats], stops], axis=1)
    clips = np.tile(clip, (N_SECONDS, 1))
    return warp_segments(
        clips, music_density(N_SECONDS, MUSIC_BEATS_S), MUSIC_BEATS_S, density, speed,
        ClipBeats(np.concatenate(beats), ranges), **options,
    )  # fmt: skip


@pytest.fixture(scope="module")
def segments():
    return warped()


def test_shapes_and_slopes(segments):
    assert segments.time_maps.shape == (N_SECONDS, 3, 81)
    for name in ("density_mismatch", "unmatched_beat", "first_beat", "last_beat"):
        assert getattr(segments, name).shape == (N_SECONDS, 3, 4)
    slopes = np.diff(segments.time_maps, axis=2)
    assert slopes.min() > MIN_SLOPE - 1e-4
    assert slopes.max() < MAX_SLOPE + 1e-4
    assert segments.time_maps.min() >= 0
    assert segments.time_maps.max() <= 159


def test_raw_maps_are_the_paths_of_the_dtw():
    raw = warped(smoothed=False)
    slopes = np.diff(raw.time_maps, axis=2)
    assert np.isin(slopes, [0.5, 1.0, 2.0]).all()
    assert (slopes == 2.0).any()  # clip 1 is slower than the music
    assert raw.time_maps.max() <= 159
    query, target = music_density(1, MUSIC_BEATS_S)[0], density([1])[0]
    path, _ = subsequence_dtw(query, target[:-1])
    np.testing.assert_array_equal(raw.time_maps[0, 1, :-1], path)


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


def test_a_beat_counts_in_full_from_250_ms_on_and_not_at_all_up_to_50_ms():
    rests = [10.0, 30.0, 50.0, 66.0]
    frames = np.arange(160.0)
    speeds = 1.0 - np.exp(-(((frames[:, None] - rests) / 2.0) ** 2)).sum(axis=1)
    beats = np.array([-1.0, 0.0, 10.9, 33.0, 58.0, 66.0, 78.0, 80.0])  # the last one is of the next second
    unmatched, first, last = segment_beats(
        np.arange(81.0)[None], speeds[None].astype(np.float32), beats, 1.0, 5.0, MIN_PROMINENCE
    )
    # 0 has no partner. 33 and its partner are 3 frames apart, and 58 and 50 are 8. 78 has none.
    np.testing.assert_allclose(unmatched, [[1 / 3, 0.5, 1.0, 1 / 3]], atol=1e-3)
    np.testing.assert_allclose(first, [[10.0, 10.0, 10.0, 6.0]], atol=1e-3)
    np.testing.assert_array_equal(first, last)


def test_a_clip_at_a_steady_speed_has_a_beat_where_it_is_played_slowly():
    slopes = 1.0 - 0.5 * np.exp(-(((np.arange(80) - 44.5) / 3.0) ** 2))
    time_map = np.concatenate([[0.0], np.cumsum(slopes)])
    _, first, last = segment_beats(
        time_map[None], np.ones((1, 160), np.float32), np.zeros(0), 1.0, 5.0, MIN_PROMINENCE
    )
    np.testing.assert_allclose(first, [[np.nan, np.nan, 5.0, np.nan]], atol=0.01)
    np.testing.assert_array_equal(first, last)


@pytest.mark.parametrize("smoothed", [True, False])
@pytest.mark.parametrize("first", [0, 1])
def test_a_clip_at_double_speed_ends_within_its_frames(first, smoothed):
    """Its densities are those of the music at every other frame, up to the last but one or the last frame."""
    query = np.random.default_rng(0).normal(size=80).cumsum().astype(np.float32)
    target = np.interp(np.arange(160), np.arange(first, 160, 2), query).astype(np.float32)
    maps, _ = warp_by_density(
        query, target[None], np.zeros(0), np.zeros(0), np.zeros((1, 2), np.int64), as_recorded=False,
        smoothed=smoothed,
    )  # fmt: skip
    assert maps.shape == (1, 81) and maps.max() <= 159.0
    assert np.diff(maps).min() >= MIN_SLOPE - 1e-9 and np.median(np.diff(maps)) > 1.9


def test_clips_as_recorded_are_their_middle_4_s():
    recorded = warped(as_recorded=True)
    assert (recorded.time_maps == np.arange(40.0, 121.0)).all()


def test_a_song_without_beats_gives_finite_time_maps():
    seen = []
    segments = warp_segments(
        np.array([[0]]), music_density(1, np.zeros(0)), np.zeros(0), density, speed,
        ClipBeats(np.zeros(0), np.zeros((3, 2), int)), report=lambda done, total: seen.append((done, total)),
    )  # fmt: skip
    assert np.isfinite(segments.time_maps).all()
    assert seen == [(1, 1)]


def counted_clips():
    """Clip 0 is counted, clip 1 is not, and clip 2 at a tempo that is too far from the song's."""
    takes = [
        make_counts(beats / 20, numbers_in_bar(len(beats), 4), 4) if counted else NO_COUNTS
        for beats, counted in zip(clip_beats(), (True, False, False), strict=True)
    ]
    takes[2] = make_counts(0.1 * np.arange(80), numbers_in_bar(80, 4), 4)
    song = make_counts(MUSIC_BEATS_S, numbers_in_bar(len(MUSIC_BEATS_S), 4), 4)
    grid = SongGrid.of(song, float(N_SECONDS))
    return CountedClips.of(
        np.arange(3), np.zeros(3, int), TakeGrids(takes, [()] * 3), grid, np.arange(N_SECONDS + 5.0)
    )


@pytest.fixture(scope="module")
def mixed():
    return warped(counted=counted_clips())


@pytest.mark.parametrize("few", [0, 2, 8])
@pytest.mark.parametrize("recent", [1, 2])
def test_the_time_maps_of_a_long_song_are_made_again_where_they_are_read(mixed, few, recent, monkeypatch):
    monkeypatch.setattr(long_songs, "LONG_S", 0.0)
    for name, value in (("_RECENT_S", recent), ("_FEW", few)):
        monkeypatch.setattr(module, name, value)
    long = warped(counted=counted_clips())
    assert long.time_maps.shape == (N_SECONDS, 3, 0)
    for start, rank in (([0, 2, 2, 1], [1, 0, 2, 2]), ([2], [1]), ([0, 0, 0, 1], [2, 1, 0, 0])):
        found = long.maps(np.array(start), np.array(rank))
        assert np.array_equal(found, mixed.time_maps[start, rank])
        assert np.array_equal(found, mixed.maps(np.array(start), np.array(rank)))


def test_counted_clips_are_laid_and_the_others_warped_as_before(mixed, segments):
    assert (mixed.time_map_id[:, 0] >= 0).all() and (mixed.time_map_id[:, 1:] == NO_TIME_MAP).all()
    assert np.array_equal(mixed.time_maps[:, 1:], segments.time_maps[:, 1:])
    assert np.array_equal(mixed.density_mismatch[:, 1:], segments.density_mismatch[:, 1:])
    assert not mixed.density_mismatch[:, 0].any()
    assert not np.array_equal(mixed.time_maps[:, 0], segments.time_maps[:, 0])
    # The music's beats are at frames 5 and 15 of every second, and so are the clip's counts.
    on_beats = mixed.time_maps[:, 0, 5::10]
    assert (on_beats - 3.0) / GAPS[0] == pytest.approx(np.round((on_beats - 3.0) / GAPS[0]), abs=2e-3)
    assert mixed.unmatched_beat[:, 0].max() < 0.05


def test_bars_and_phrases_of_takes_without_counts_are_those_of_chance(mixed):
    assert not mixed.off_bar[:, 0].any()
    assert (mixed.off_bar[:, 1:] == 0.75).all()
    assert mixed.phrase_penalty.shape == (N_SECONDS, 3, 5)
    assert (mixed.phrase_penalty[:, 1:] == 1.0).all()


def test_without_counted_takes_there_is_no_track(segments):
    assert (segments.time_map_id == NO_TIME_MAP).all() and (segments.off_bar == 0.75).all()


def test_only_other_candidates_are_warped_again():
    made, memory = [], Memory(1 << 20)

    def asked(clips):
        made.append(tuple(clips))
        return density(clips)

    for clips, warped_again in (([1, 0], [1, 0]), ([2, 1], [2]), ([2, 1], []), ([1, 2], [])):
        made.clear()
        found = warped(clips, asked, memory=memory)
        assert made == [tuple(warped_again)] * N_SECONDS * bool(warped_again)
        alone = warped(clips)
        for name in (field.name for field in fields(alone) if field.name not in ("inputs", "made_again")):
            assert getattr(found, name).tobytes() == getattr(alone, name).tobytes(), name
        assert not alone.inputs.any() and found.inputs.any()
