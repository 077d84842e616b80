"""Experts' dances: planted takes that rest on their counts, aligned with songs of clicks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic_motions import stepping
from synthetic_repertoire import write_clicks

from choreograph.core.counts import NO_COUNTS, Figure, make_counts, numbers_in_bar
from choreograph.core.errors import ParameterError
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Credits, Take
from choreograph.motion.motion_beats import motion_beat_times_s
from choreograph.music.song import Song, load_song
from research.pieces_on_beats import expert_from_figures, expert_from_take

DURATION_S = 20.0
BPM = 108.0


@pytest.fixture(scope="module")
def song(tmp_path_factory) -> Song:
    path = tmp_path_factory.mktemp("songs") / "clicks.wav"
    return load_song(write_clicks(path, duration_s=DURATION_S, bpm=BPM))


def take(name: str, period_s: float, *, figures=(), seed: int = 0, first: int = 1) -> Take:
    """A take that rests on every count, in figures of (name, first count, counts)."""
    motion = stepping(30 * 16, period_s=period_s, seed=seed)
    n_counts = int(motion.duration_s / period_s)
    counts = make_counts(period_s * np.arange(n_counts), numbers_in_bar(n_counts, 4, first=first), 4)
    named = tuple(Figure(name, i * period_s, (i + n) * period_s, n) for name, i, n in figures)
    return Take(name, motion, Credits(), counts=counts, figures=named)


def rests_off_counts_s(expert) -> np.ndarray:
    """How far the dance's rests, between its first and last count, are from its counts."""
    rests_s = motion_beat_times_s(body_pos_m(expert.motion), expert.motion.fps)
    counts_s = expert.counts.times_s
    inside = rests_s[(rests_s > counts_s[0] + 0.1) & (rests_s < counts_s[-1] - 0.1)]
    assert len(inside) > 0.7 * len(counts_s)
    return np.abs(inside[:, None] - counts_s).min(axis=1)


def off_clicks_s(counts) -> np.ndarray:
    period_s = 60.0 / BPM
    return np.abs(counts.times_s - period_s * np.round(counts.times_s / period_s))


@pytest.mark.parametrize("first", [1, 3])
def test_a_take_is_laid_on_the_beats_of_the_song(song, first):
    expert = expert_from_take(take("a", 0.6, first=first), song)
    assert expert.motion.duration_s == pytest.approx(DURATION_S, abs=1 / 60) and expert.motion.fps == 60
    assert expert.listed_share == 1.0
    assert (expert.counts.metre, expert.counts.source) == (4, "expert")
    assert expert.counts.numbers.tolist() == numbers_in_bar(len(expert.counts), 4).tolist()
    assert off_clicks_s(expert.counts).max() < 0.07
    assert np.median(rests_off_counts_s(expert)) < 0.03


def test_a_take_counted_unevenly_is_laid_count_by_count(song):
    """The take slows down from 120 to 86 BPM; in the dance its counts are as even as the clicks."""
    even = take("a", 0.5)
    stretched = np.cumsum(np.linspace(0.5, 0.7, 25)) - 0.5
    frames = np.interp(np.arange(0.0, stretched[-1], 1 / 30), stretched, 0.5 * np.arange(25)) * 30
    slowing = replace(
        even,
        motion=even.motion.sampled(frames),
        counts=make_counts(stretched, numbers_in_bar(25, 4), 4),
    )
    expert = expert_from_take(slowing, song)
    assert np.median(rests_off_counts_s(expert)) < 0.03


FIGURES = [("C-1-a", 0, 8), ("C-2-a", 8, 4), ("C-3-a", 12, 8)]


def figures_laid(listed, song, *, recordings=None, seed: int = 0):
    recordings = recordings or [take("one", 0.6, figures=FIGURES), take("two", 0.5, figures=[("R-1", 0, 8)])]
    return expert_from_figures(listed, recordings, song, rng=np.random.default_rng(seed))


def test_listed_figures_are_laid_one_after_another(song):
    expert = figures_laid([("C-3-a", 8), ("C-1-a", 8), ("C-2-a", 4)], song)
    assert expert.listed_share == 1.0
    assert len(expert.counts) == 21 and expert.counts.numbers[0] == 1
    assert off_clicks_s(expert.counts).max() < 0.07
    assert np.median(rests_off_counts_s(expert)) < 0.03


def test_figures_that_are_not_recorded_are_replaced_by_others_as_long(song):
    # A variant of C-1, any other of 8 counts, twice the one of 4 counts; nothing has 5 counts.
    as_listed = figures_laid([("C-1-a", 8), ("C-3-a", 8)], song)
    variant = figures_laid([("C-1-b", 8), ("C-3-a", 8)], song)
    assert (as_listed.listed_share, variant.listed_share) == (1.0, 0.5)
    assert np.array_equal(as_listed.motion.root_pos_m, variant.motion.root_pos_m)
    other = figures_laid([("C-9-x", 8), ("C-3-a", 8)], song)
    assert other.listed_share == 0.5 and len(other.counts) == 17
    only_fours = [take("one", 0.6, figures=FIGURES[1:2])]
    doubled = figures_laid([("C-1-a", 8), ("C-2-a", 4), ("C-4", 5)], song, recordings=only_fours)
    assert len(doubled.counts) == 13 and doubled.listed_share == pytest.approx(1 / 3)


def test_figures_of_another_genre_are_not_danced(song):
    recordings = [take("one", 0.6, figures=FIGURES), take("two", 0.5, figures=[("R-1", 0, 8)], seed=3)]
    for name in ("R-1", "R-7"):
        rumba = figures_laid([(name, 8), ("", 8)], song, recordings=recordings)
        again = figures_laid([("R-1", 8), ("R-1", 8)], song, recordings=recordings)
        assert np.allclose(rumba.motion.root_pos_m, again.motion.root_pos_m)


def test_the_seed_decides_between_figures_that_fit(song):
    listed = [("C-9", 8)] * 3
    laid = [figures_laid(listed, song, seed=seed).motion.root_pos_m for seed in (0, 0, 1, 2)]
    assert np.array_equal(laid[0], laid[1])
    assert not all(np.array_equal(laid[0], other) for other in laid[2:])


@pytest.mark.parametrize(
    ("listed", "recordings"),
    [
        ([("T-1", 8)], None),  # no figure of the genre
        ([("C-1-a", 7)], None),  # none of the length, nor of half of it
        ([], []),
        ([("C-1-a", 8)], [replace(take("one", 0.6, figures=FIGURES), counts=NO_COUNTS)]),
    ],
)
def test_figures_that_cannot_be_danced_are_reported_in_one_line(song, listed, recordings):
    with pytest.raises(ParameterError, match="expected") as raised:
        expert_from_figures(
            listed, [take("one", 0.6, figures=FIGURES)] if recordings is None else recordings, song,
            rng=np.random.default_rng(0),
        )  # fmt: skip
    assert "\n" not in str(raised.value)


def test_takes_without_counts_and_songs_without_beats_are_reported_in_one_line(song):
    silent = Song(np.zeros(10 * SAMPLE_RATE_HZ, np.float32), "silent")
    uncounted = replace(take("a", 0.6), counts=NO_COUNTS)
    for one, to in ((uncounted, song), (take("a", 0.6), silent)):
        with pytest.raises(ParameterError, match="expected") as raised:
            expert_from_take(one, to)
        assert "\n" not in str(raised.value)
