"""Counts aligned with beats: planted takes and songs whose counts, bars and figures are known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_counts import counted

from choreograph.choreography.graph.warping import CountedClips, count_time_maps
from choreograph.core.counts import NO_COUNTS, Counts, make_counts, numbers_in_bar
from choreograph.core.timebase import CLIP_FRAMES, MAX_SLOPE, MIN_SLOPE, NET_FPS, SEGMENT_S
from choreograph.music.count_grids import SongGrid, TakeGrids

N_SECONDS = 20
SONG_S = float(N_SECONDS)


def laid(song: Counts, takes: list[Counts], figures=None, *, joins_s=None) -> CountedClips:
    """All clips, one every second, of takes of 30 s."""
    starts = np.arange(0, 30 * NET_FPS - CLIP_FRAMES + 1, NET_FPS)
    joins_s = np.arange(N_SECONDS + SEGMENT_S + 1.0) if joins_s is None else joins_s
    return CountedClips.of(
        np.repeat(np.arange(len(takes)), len(starts)),
        np.tile(starts, len(takes)),
        TakeGrids(takes, figures or [()] * len(takes)),
        SongGrid.of(song, SONG_S),
        joins_s,
    )


def maps_at(second: int, clips: CountedClips):
    return count_time_maps(second, np.arange(len(clips.take)), clips)


def on_beats(maps, second: int, song: Counts, clips: CountedClips):
    """Times in their takes (K', Q) at the song's beats in the 4 s, and which beats those are."""
    beats = np.flatnonzero((song.times_s >= second) & (song.times_s <= second + SEGMENT_S))
    frames = (song.times_s[beats] - second) * NET_FPS
    of_clip = [np.interp(frames, np.arange(maps.time_maps.shape[1]), row) for row in maps.time_maps]
    return clips.start_s[maps.candidates, None] + np.array(of_clip) / NET_FPS, beats


def nearest_count(take: Counts, times_s: np.ndarray) -> np.ndarray:
    return np.abs(take.times_s[:, None] - times_s.ravel()).argmin(axis=0).reshape(times_s.shape)


@pytest.mark.parametrize("second", [0, 7, 19])
@pytest.mark.parametrize("period_s", [0.4, 0.5, 0.63])
def test_counts_lie_on_beats_and_bars_on_bars(second, period_s):
    song = counted(0.5, first_s=0.17, first=3, length_s=26.0)
    take = counted(period_s, first_s=0.31, first=2, length_s=30.0)
    clips = laid(song, [take])
    maps = maps_at(second, clips)
    assert len(maps.candidates) >= 20  # of 23: beyond the take's ends counts go on, too
    source_s, beats = on_beats(maps, second, song, clips)
    inside = (source_s > take.times_s[0] - 0.01) & (source_s < take.times_s[-1] + 0.01)
    count = nearest_count(take, source_s)
    assert np.abs(take.times_s[count] - source_s)[inside].max() < 1e-3
    wanted = np.broadcast_to(song.numbers[beats], count.shape)
    assert np.array_equal(take.numbers[count][inside], wanted[inside])
    assert not maps.off_bar.any()


@settings(max_examples=40)
@given(
    st.floats(0.3, 0.9), st.floats(0.3, 0.9), st.floats(0.0, 0.9), st.integers(1, 4),
    st.sampled_from([0, 3, 4]), st.integers(0, N_SECONDS - 1),
)  # fmt: skip
def test_every_map_puts_counts_on_beats_within_its_clip_and_slopes(
    song_s, take_s, first_s, first, metre, second
):
    song = counted(song_s, first_s=first_s, first=first, length_s=27.0)
    take = counted(take_s, metre=metre, length_s=30.0)
    clips = laid(song, [take])
    maps = maps_at(second, clips)
    if MIN_SLOPE + 0.01 < take_s / song_s < MAX_SLOPE - 0.01 and SEGMENT_S * take_s / song_s < 6.5:
        assert len(maps.candidates)
    if not len(maps.candidates):
        return
    assert maps.time_maps.min() >= 0 and maps.time_maps.max() <= CLIP_FRAMES - 1
    slopes = np.diff(maps.time_maps, axis=1)
    assert slopes.min() >= MIN_SLOPE and slopes.max() <= MAX_SLOPE
    source_s, _ = on_beats(maps, second, song, clips)
    inside = (source_s > take.times_s[0] - 0.01) & (source_s < take.times_s[-1] + 0.01)
    if inside.any():
        off_s = np.abs(take.times_s[nearest_count(take, source_s)] - source_s)
        assert off_s[inside].max() < 1e-3


def begin_by_definition(second: int, clip: int, clips: CountedClips) -> float | None:
    """The frame of a clip at which its 4 s begin: each shift is tried, and the earlier one of two as good."""
    song, grid, take = clips.song, clips.takes, clips.take[[clip]]
    ends = song.index_at(second + np.array([0.0, SEGMENT_S]))
    middle = grid.index_at(take, clips.start_s[[clip]] + 2.0)[0]
    nearest, beats = round(middle - ends[0]), np.arange(np.ceil(ends[0] - 1e-9), np.ceil(ends[1] - 1e-9))
    best, least = None, np.inf
    for shift in range(nearest - 8, nearest + 9):
        danced_s = grid.count_s(take, ends[None] + shift)[0] - clips.start_s[clip]
        known = grid.n_counts[take[0]] - 2 * 64  # counts, of which four more may be danced at either end
        if danced_s[0] < 0 or danced_s[1] > (CLIP_FRAMES - 1) / NET_FPS:
            continue
        if ends[0] + shift < 64 - 4 or ends[1] + shift > 64 + known - 1 + 4:
            continue
        rows = beats.astype(int)
        numbers = grid.numbers[grid.start[take[0]] + rows + shift]
        off = (numbers != song.numbers[rows]) & (numbers > 0) & (song.numbers[rows] > 0)
        cost = 100.0 * off.mean() + abs(shift + ends[0] - middle)
        if cost < least:
            best, least = float(danced_s[0] * NET_FPS), cost
    return best


@pytest.mark.parametrize("second", [0, 6, 13])
@pytest.mark.parametrize(
    ("song_s", "take_s", "metres"),
    [
        (0.5, 0.47, (4, 4)),
        (0.5, 0.6, (4, 3)),
        (0.9, 0.95, (4, 4)),  # bars of 3.8 s: the nearest one may begin before the clip, or end after it
        (1.0, 1.1, (4, 4)),
        (0.8, 0.83, (6, 6)),
        (0.55, 0.5, (4, 0)),
        (0.4, 0.3, (12, 12)),  # half a bar, six counts, fits beside the middle of a clip
    ],
)
def test_a_clip_gets_the_best_shift_within_it(song_s, take_s, metres, second):
    song = counted(song_s, first_s=0.13, first=2, metre=metres[0], length_s=27.0)
    take = counted(take_s, first_s=0.37, metre=metres[1], length_s=28.0)
    clips = laid(song, [counted(1.2 * song_s), take])
    maps = maps_at(second, clips)
    found = dict(zip(maps.candidates.tolist(), maps.time_maps[:, 0].tolist(), strict=True))
    wanted = {clip: begin_by_definition(second, clip, clips) for clip in range(len(clips.take))}
    assert found == pytest.approx({clip: begin for clip, begin in wanted.items() if begin is not None})
    assert len(found) > 30


@pytest.mark.parametrize("later", [-2.0, 1.0, 3.0])
def test_a_second_that_begins_later_in_the_bar_has_clips_from_later_counts_on(later):
    song, take = counted(0.5, metre=0, length_s=26.0), counted(0.5, first_s=0.1, metre=0)
    starts = np.arange(0, 30 * NET_FPS - CLIP_FRAMES + 1, NET_FPS)
    grids = TakeGrids([take], [()]), SongGrid.of(song, SONG_S), np.arange(N_SECONDS + 5.0)
    of_clips = np.zeros(len(starts), int), starts
    later_counts = np.zeros(N_SECONDS)
    later_counts[6] = later
    usual, changed = CountedClips.of(*of_clips, *grids), CountedClips.of(*of_clips, *grids, later_counts)
    begins = {clips: maps_at(6, clips).time_maps[:, 0] for clips in (usual, changed)}
    assert begins[changed] - begins[usual] == pytest.approx(0.5 * later * NET_FPS)
    assert np.array_equal(maps_at(5, changed).time_maps, maps_at(5, usual).time_maps)


def test_a_pause_of_a_take_is_not_danced_at_more_than_double_speed():
    """One count of 1.2 s among those of 0.5 s, in which the take is still within its clip."""
    times_s = np.cumsum(np.where(np.arange(55) == 30, 1.2, 0.5))
    take = make_counts(times_s, numbers_in_bar(55, 4), 4)
    maps = maps_at(6, clips := laid(counted(0.5, length_s=26.0), [take]))
    source_s = clips.start_s[maps.candidates, None] + maps.time_maps[:, [0, -1]] / NET_FPS
    assert len(source_s) > 10
    assert not ((source_s[:, 0] < times_s[30] - 0.1) & (source_s[:, 1] > times_s[29] + 0.1)).any()


@pytest.mark.parametrize("late_s", [-0.04, 0.04])
def test_no_accent_is_moved_beyond_its_clip(late_s):
    take = counted(0.95, first_s=0.4)
    starts = np.arange(0, 30 * NET_FPS - CLIP_FRAMES + 1, NET_FPS)
    grids = TakeGrids([take], [()], [take.times_s + late_s])
    for first_s in np.arange(0.0, 0.9, 0.02):
        song = SongGrid.of(counted(0.9, first_s=first_s, length_s=26.0), SONG_S)
        clips = CountedClips.of(np.zeros(len(starts), int), starts, grids, song, np.arange(N_SECONDS + 5.0))
        maps = maps_at(6, clips).time_maps
        assert maps.min() >= 0.0 and maps.max() <= CLIP_FRAMES - 1


@pytest.mark.parametrize("period_s", [0.2, 1.1])
def test_takes_too_far_from_the_songs_tempo_get_no_map(period_s):
    maps = maps_at(5, laid(counted(0.5, length_s=26.0), [counted(period_s)]))
    assert len(maps.candidates) == len(maps.time_maps) == len(maps.time_map_id) == 0


def test_a_take_and_shift_is_one_continuous_map_over_all_seconds():
    """A song that gets faster, a take that gets slower: overlapping segments of one time map agree."""
    beats = np.cumsum(np.linspace(0.6, 0.45, 50))
    song = make_counts(beats[beats < 25], numbers_in_bar(int((beats < 25).sum()), 4), 4)
    times_s = np.cumsum(np.linspace(0.45, 0.6, 55))
    clips = laid(song, [make_counts(times_s, numbers_in_bar(55, 4), 4)])
    before, shared = {}, 0
    for second in range(N_SECONDS - 1):
        maps = maps_at(second, clips)
        source_s = clips.start_s[maps.candidates, None] + maps.time_maps / NET_FPS  # (K', 81)
        by_time_map = dict(zip(maps.time_map_id.tolist(), source_s, strict=True))
        for time_map_id in by_time_map.keys() & before.keys():
            assert by_time_map[time_map_id][:-NET_FPS] == pytest.approx(
                before[time_map_id][NET_FPS:], abs=1e-9
            )
            shared += 1
        for same in np.unique(maps.time_map_id):  # and so do clips of one second that share a time map
            assert np.ptp(source_s[maps.time_map_id == same], axis=0).max() < 1e-9
        before = by_time_map
    assert shared >= 2 * (N_SECONDS - 2)


def test_shifts_of_different_takes_are_different_time_map_ids():
    maps = maps_at(4, laid(counted(0.5, length_s=26.0), [counted(0.5), counted(0.5)]))
    takes = maps.candidates // 23
    assert not set(maps.time_map_id[takes == 0]) & set(maps.time_map_id[takes == 1])


def test_takes_of_another_metre_are_off_the_bar():
    clips = laid(counted(0.5, length_s=26.0), [counted(0.5, metre=3), counted(0.5, metre=4)])
    maps = maps_at(3, clips)
    waltz = clips.take[maps.candidates] == 0
    # Eight beats: three numbers of four agree at first, then one number in four does.
    assert maps.off_bar[waltz].mean(axis=1).min() > 0.3
    assert not maps.off_bar[~waltz].any()


def test_bars_that_are_not_known_are_not_off():
    for song_metre, take_metre in ((0, 4), (4, 0), (0, 0)):
        song = counted(0.5, metre=song_metre, length_s=26.0)
        maps = maps_at(3, laid(song, [counted(0.5, metre=take_metre)]))
        assert len(maps.candidates) and not maps.off_bar.any()


def test_off_bar_is_counted_quarter_by_quarter():
    """After a bar of three in a song of four, numbers disagree: beats on borders are in the later quarter."""
    numbers = np.r_[numbers_in_bar(20, 4), 1, 2, 3, numbers_in_bar(40, 4)]
    song = make_counts(0.5 * np.arange(len(numbers)), numbers, 4)
    maps = maps_at(8, laid(song, [counted(0.5)]))  # the bar of three is from 10.0 to 11.5 s
    # 8.0 to 11.5 s as in the take, and then the song's 1 is the take's 4.
    assert np.unique(maps.off_bar, axis=0).tolist() == [[0, 0, 0, 0.5]]


def test_takes_without_counts_get_no_map():
    clips = laid(counted(0.5, length_s=26.0), [counted(0.5), NO_COUNTS, counted(0.5, length_s=1.0)])
    maps = maps_at(2, clips)
    assert set(clips.take[maps.candidates]) == {0}
    assert clips.takes.counted.tolist() == [True, False, False]
    assert len(maps_at(2, laid(counted(0.5), [NO_COUNTS])).candidates) == 0


@pytest.mark.parametrize("period_s", [0.4, 0.5])
def test_a_part_of_a_take_that_nobody_counted_is_not_laid_on_beats(period_s):
    """Of a take of 30 s, 10 to 20 s are counted: four counts more at either end may be danced."""
    known = counted(period_s, first_s=10.0, length_s=20.0)
    clips = laid(counted(0.5, length_s=26.0), [known])
    maps = maps_at(5, clips)
    source_s = clips.start_s[maps.candidates, None] + maps.time_maps / NET_FPS
    more_s = 4 * period_s + 1e-6
    assert source_s.min() >= known.times_s[0] - more_s and source_s.max() <= known.times_s[-1] + more_s
    assert source_s.min() < known.times_s[0] < known.times_s[-1] < source_s.max()
    laid_s = clips.start_s[maps.candidates]
    assert set(range(8, 15)) <= set(laid_s) and laid_s.min() >= 2 and laid_s.max() <= 20


def test_penalties_of_a_map_are_those_at_the_joins():
    """Joins at the downbeat near each second: bars on bars, so that all of them are free."""
    song = counted(0.5, first_s=0.25, length_s=26.0)
    on_bars = 2.0 * np.arange(13) + 0.25
    for joins_s, free in ((np.repeat(on_bars, 2), True), (np.repeat(on_bars, 2) + 0.5, False)):
        maps = maps_at(4, laid(song, [counted(0.5)], joins_s=joins_s))
        assert maps.phrase_penalty.shape == (len(maps.candidates), 5)
        assert (maps.phrase_penalty == (0.0 if free else 1.0)).all()


def test_penalties_of_a_map_are_those_of_its_seconds():
    """Joins on every second: bars begin on every other one."""
    clips = laid(counted(0.5, length_s=26.0), [counted(0.5)])
    for second, wanted in ((4, [0.0, 1.0, 0.0, 1.0, 0.0]), (5, [1.0, 0.0, 1.0, 0.0, 1.0])):
        assert np.unique(maps_at(second, clips).phrase_penalty, axis=0).tolist() == [wanted]


@pytest.mark.parametrize("away_s", [0.04, -0.04])
def test_accents_are_landed_on_beats_and_the_time_map_has_no_corners(away_s):
    take, song = counted(0.5), counted(0.55)
    late_s = take.times_s + np.where(np.arange(len(take)) % 2, away_s, 0.0)
    starts = np.arange(0, 30 * NET_FPS - CLIP_FRAMES + 1, NET_FPS)
    grids = TakeGrids([take], [()], [late_s[:-1]])
    clips = CountedClips.of(
        np.zeros(len(starts), int), starts, grids, SongGrid.of(song, SONG_S), np.arange(N_SECONDS + 5.0)
    )
    maps = maps_at(6, clips)
    danced_s, beats = on_beats(maps, 6, song, clips)
    which = nearest_count(take, danced_s)
    assert len(beats) >= 7
    np.testing.assert_allclose(danced_s, late_s[which], atol=0.01)
    assert np.abs(np.diff(maps.time_maps, 2)).max() < 0.1  # frames


def test_accents_keep_no_take_from_being_danced_at_a_tempo_that_its_counts_allow():
    take, song = counted(0.38), counted(0.7)  # at 0.54 of its tempo
    beats_s = take.times_s + np.tile([0.0, 0.044, 0.043, 0.0], len(take))[: len(take)]
    starts = np.arange(0, 30 * NET_FPS - CLIP_FRAMES + 1, NET_FPS)

    def n_maps(motion_beats_s):
        clips = CountedClips.of(
            np.zeros(len(starts), int), starts, TakeGrids([take], [()], motion_beats_s),
            SongGrid.of(song, SONG_S), np.arange(N_SECONDS + 5.0),
        )  # fmt: skip
        return len(maps_at(6, clips).candidates)

    assert n_maps([beats_s]) == n_maps(None) == len(starts)


def test_no_count_of_a_slow_dance_is_further_from_its_beat_than_accents_may_be():
    take, song = counted(0.42), counted(0.8)
    grids = TakeGrids([take], [()], [take.times_s[:-1] + 0.04])
    starts = np.arange(0, 30 * NET_FPS - CLIP_FRAMES + 1, NET_FPS)
    clips = CountedClips.of(
        np.zeros(len(starts), int), starts, grids, SongGrid.of(song, SONG_S), np.arange(N_SECONDS + 5.0)
    )
    maps = maps_at(6, clips)
    danced_s, _ = on_beats(maps, 6, song, clips)
    late_s = (danced_s - take.times_s[nearest_count(take, danced_s)]) * 0.8 / 0.42  # of the song
    assert len(danced_s)
    np.testing.assert_allclose(late_s, 0.05, atol=0.01)
