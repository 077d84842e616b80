"""Half and double tempo are told by what takes can be danced at."""

import numpy as np
import pytest
import soxr

from choreograph.core.counts import Counts, make_counts, numbers_in_bar
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.music.bars import (
    between,
    choose_level,
    joined,
    metrical_levels,
    tempo_bpm,
    track_bars,
    with_eighths,
)
from choreograph.music.mel import log_mel
from content.songs.known_songs import BENCHMARK_SONGS, FIRST_SEED
from content.songs.metre_styles import SIX_BALLAD
from content.songs.synthesis.song import render_song


def counted(bpm: float, metre: int = 4) -> Counts:
    return make_counts(np.arange(32) * 60 / bpm, numbers_in_bar(32, metre), metre)


def takes(**tempi_bpm: list[float]):
    """Tempi by metre (m3, m4), all of equal weight."""
    tempi = {int(name[1:]): np.array(values) for name, values in tempi_bpm.items()}
    return tempi, {metre: np.ones(len(values)) for metre, values in tempi.items()}


@pytest.mark.parametrize(
    ("tempi", "expected"),
    [
        ([170.0, 175.0], 168),  # half of what the takes are danced at
        ([90.0], 84),
        ([118.0], 84),  # doubled is as far: what was tracked stays
        ([40.0, 45.0], 42),
    ],
)
def test_the_nearest_level_is_chosen_if_it_is_clearly_nearer(tempi, expected):
    levels = (counted(84), counted(42), counted(168))
    assert tempo_bpm(choose_level(levels, *takes(m4=tempi))) == pytest.approx(expected)


def test_a_level_is_held_against_takes_of_its_own_metre():
    levels = (counted(84), counted(168, metre=3))
    assert choose_level(levels, *takes(m4=[170.0])) is levels[0]
    assert choose_level(levels, *takes(m3=[170.0])) is levels[1]  # nothing can be danced in four
    assert choose_level(levels, *takes()) is levels[0]


def test_a_bar_of_six_is_danced_as_two_of_three():
    levels = (counted(180, metre=6), counted(60))
    assert choose_level(levels, *takes(m3=[170.0], m4=[60.0])) is levels[0]
    assert choose_level(levels, *takes(m4=[60.0])) is levels[1]


def test_bars_heard_wrongly_do_not_double_the_tempo():
    """A song in four that was tracked in three: takes in four are not danced at twice their tempo for it."""
    heard_in_three, doubled = counted(108, metre=3), counted(216)
    assert choose_level((heard_in_three, doubled), *takes(m4=[100.0])) is heard_in_three
    assert choose_level((heard_in_three, doubled), *takes(m4=[180.0])) is doubled
    in_three, halved = counted(170, metre=3), counted(85)
    assert choose_level((in_three, halved), *takes(m4=[90.0])) is halved


def test_takes_without_weight_do_not_matter():
    levels = (counted(84), counted(168))
    tempi = {4: np.array([170.0, 84.0])}
    assert choose_level(levels, tempi, {4: np.array([1.0, 0.0])}) is levels[1]
    assert choose_level(levels, tempi, {4: np.array([0.0, 1.0])}) is levels[0]
    assert choose_level(levels, tempi, {4: np.zeros(2)}) is levels[0]


def groove(bpm: float, n_beats: int = 64) -> tuple[np.ndarray, np.ndarray]:
    """Kick on 1 and 3, snare on 2 and 4, hats between, a new chord on every 1."""
    rng = np.random.default_rng(0)
    n = np.arange(5000) / SAMPLE_RATE_HZ
    kick, hat = np.sin(2 * np.pi * 55 * n) * np.exp(-12 * n), np.diff(rng.normal(size=5001)) * np.exp(-90 * n)
    snare = rng.normal(size=5000) * np.exp(-25 * n)
    beats_s = 0.3 + np.arange(n_beats) * 60 / bpm
    samples = np.zeros(round((beats_s[-1] + 1) * SAMPLE_RATE_HZ))
    for i, time_s in enumerate(beats_s):
        pitch_hz = 220 * 2 ** ((0, 5, 7, 3)[i // 4 % 4] / 12)
        tone = 0.2 * np.sin(
            2 * np.pi * pitch_hz * np.arange(round(50 / bpm * SAMPLE_RATE_HZ)) / SAMPLE_RATE_HZ
        )
        drum = (1.2 * kick, 0.4 * snare, 0.7 * kick, 0.4 * snare)[i % 4]
        for at_s, sound in ((time_s, tone), (time_s, drum), (time_s + 30 / bpm, 0.05 * hat)):
            room = samples[round(at_s * SAMPLE_RATE_HZ) :][: len(sound)]
            room += sound[: len(room)]
    return samples, beats_s


@pytest.mark.parametrize(("tracked_at", "level"), [("half", 168.0), ("double", 84.0)])
def test_beats_of_another_level_are_numbered_anew(tracked_at, level):
    samples, beats_s = groove(168.0 if tracked_at == "half" else 84.0)
    downbeats_s = beats_s[::4]
    twice = np.interp(np.arange(127) / 2, np.arange(64), beats_s)
    given = beats_s[::2] if tracked_at == "half" else twice
    mel = log_mel(samples)
    levels = metrical_levels(samples, mel, track_bars(samples, mel, given))
    chosen = choose_level(levels, *takes(m4=[level]))
    assert chosen is not levels[0] and tempo_bpm(chosen) == pytest.approx(level, rel=0.01)
    assert chosen.metre == 4
    assert np.abs(chosen.downbeat_times_s[1:-1, None] - downbeats_s).min(axis=1).max() < 0.01


@pytest.mark.parametrize("first", [1, 2, 3, 4])
def test_four_fast_beats_are_two_counts_from_the_downbeat_on(first):
    """Wherever the strong beats of the music are: here they are on 1 and 3 of the music's own bars."""
    samples, beats_s = groove(164.0)
    tracked = make_counts(beats_s, numbers_in_bar(len(beats_s), 4, first=first), 4)
    _, halved = metrical_levels(samples, log_mel(samples), tracked)
    assert halved.metre == 4 and tempo_bpm(halved) == pytest.approx(82.0)
    assert set(halved.times_s) == set(beats_s[np.isin(tracked.numbers, [1, 3])])
    assert set(halved.downbeat_times_s) < set(tracked.downbeat_times_s)
    assert set(np.diff(np.flatnonzero(halved.numbers == 1))) == {4}


def test_three_fast_beats_are_one_count():
    samples, beats_s = groove(172.0)
    tracked = make_counts(beats_s, numbers_in_bar(len(beats_s), 3, first=2), 3)
    as_tracked, slower = metrical_levels(samples, log_mel(samples), tracked)
    assert as_tracked is tracked
    assert slower.metre == 4 and np.array_equal(slower.times_s, tracked.downbeat_times_s)


@pytest.mark.parametrize(
    ("metre", "bpm", "n_levels"), [(3, 100.0, 1), (5, 120.0, 1), (7, 200.0, 1), (4, 70.0, 2)]
)
def test_bars_are_never_cut(metre, bpm, n_levels):
    """Neither half of three, five or seven beats, nor count 1 of twice as many, is a bar."""
    samples, beats_s = groove(bpm)
    tracked = make_counts(beats_s, numbers_in_bar(len(beats_s), metre), metre)
    assert len(metrical_levels(samples, log_mel(samples), tracked)) == n_levels


def test_an_irregular_bar_keeps_its_downbeat_at_every_level():
    samples, beats_s = groove(110.0)
    numbers = np.r_[numbers_in_bar(31, 4), numbers_in_bar(33, 4)]  # one bar of three
    tracked = make_counts(beats_s, numbers, 4)
    _, slower, faster = metrical_levels(samples, log_mel(samples), tracked)
    assert set(tracked.downbeat_times_s) <= set(slower.times_s)
    assert set(slower.downbeat_times_s) <= set(tracked.downbeat_times_s)
    assert set(tracked.downbeat_times_s) <= set(faster.downbeat_times_s)
    assert set(faster.downbeat_times_s) == set(beats_s[np.isin(numbers, [1, 3])])


def test_without_bars_there_is_one_level():
    few = Counts(np.array([0.5, 1.0]), np.zeros(2, np.int64), 0)
    assert metrical_levels(np.zeros(40_000), np.zeros((109, 96)), few) == (few,)


def spliced() -> Counts:
    """16 s of fours at 120 BPM, then 16 s of threes at 90 BPM."""
    times_s = np.r_[np.arange(0, 16, 0.5), np.arange(16, 32, 2 / 3)]
    return make_counts(times_s, np.r_[numbers_in_bar(32, 4), numbers_in_bar(len(times_s) - 32, 3)], 4)


def test_a_part_has_its_own_metre_and_parts_are_joined_again():
    whole = spliced()
    parts = [between(whole, -np.inf, 16.0), between(whole, 16.0, np.inf)]
    assert [part.metre for part in parts] == [4, 3] and [len(part) for part in parts] == [32, 24]
    again = joined(parts)
    assert np.array_equal(again.times_s, whole.times_s) and np.array_equal(again.numbers, whole.numbers)
    assert again.metre == 4


def test_irregular_bars_do_not_change_the_metre_of_a_part():
    lost_beats = np.r_[numbers_in_bar(3, 4), numbers_in_bar(3, 4), numbers_in_bar(8, 4), numbers_in_bar(8, 4)]
    counts = make_counts(0.5 * np.arange(len(lost_beats)), lost_beats, 4)
    assert between(counts, 0.0, 7.0).metre == 4  # two whole bars of three, one of four


def test_a_beat_too_close_to_the_part_before_is_left_out():
    first, second = counted(120), counted(120)
    late = Counts(second.times_s + first.times_s[-1] + 0.1, second.numbers, 4)
    both = joined([first, late])
    assert len(both) == 63 and np.diff(both.times_s).min() > 0.3


@pytest.mark.slow
@pytest.mark.parametrize("name", ["jig in six 216", "aksak in seven 214"])
def test_bars_tracked_on_every_second_eighth_are_counted_on_every_one(name):
    song = next(song for song in BENCHMARK_SONGS if song.name == name).render()
    samples = soxr.resample(song.samples.mean(axis=1), 44100, SAMPLE_RATE_HZ)
    mel = log_mel(samples)
    tracked = track_bars(samples, mel, song.beat_times_s[:-1:2])
    assert tracked.metre == (7 if song.beats_per_bar == 7 else 3)
    counts = with_eighths(samples, mel, tracked)
    assert counts.metre == song.beats_per_bar
    assert np.abs(counts.downbeat_times_s[:, None] - song.bar_times_s).min(axis=1).max() < 0.01
    assert np.abs(song.bar_times_s[1:-1, None] - counts.downbeat_times_s).min(axis=1).max() < 0.01


@pytest.mark.slow
def test_beats_between_which_count_1_lies_are_eighths():
    song = render_song(SIX_BALLAD, bpm=180.0, duration_s=30.0, seed=FIRST_SEED + 93)
    samples = soxr.resample(song.samples.mean(axis=1), 44100, SAMPLE_RATE_HZ)
    mel = log_mel(samples)
    tracked = track_bars(samples, mel, song.beat_times_s[1:-1:2])
    assert tracked.metre == 3 and np.abs(tracked.times_s[:, None] - song.bar_times_s).min() > 0.3
    counts = with_eighths(samples, mel, tracked)
    assert counts.metre == 6
    assert np.abs(counts.downbeat_times_s[:, None] - song.bar_times_s).min(axis=1).max() < 0.01


@pytest.mark.slow
@pytest.mark.parametrize(("genre", "bpm"), [("waltz", 90.0), ("waltz", 110.0), ("house", 110.0)])
def test_other_songs_are_not_counted_in_eighths(genre, bpm):
    song = render_song(genre, bpm=bpm, duration_s=40.0, seed=FIRST_SEED + 90)
    samples = soxr.resample(song.samples.mean(axis=1), 44100, SAMPLE_RATE_HZ)
    mel = log_mel(samples)
    tracked = track_bars(samples, mel, song.beat_times_s[:-1])
    assert tracked.metre == song.beats_per_bar
    assert with_eighths(samples, mel, tracked) is tracked
