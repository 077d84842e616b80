"""Clocks of counts: planted jitter, ramps, borders of figures, and takes counted in part."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_counts import counted

from choreograph.core.counts import NO_COUNTS, Counts, Figure, make_counts, numbers_in_bar
from choreograph.core.timebase import SEGMENT_S
from choreograph.music.count_grids import SongGrid, TakeGrids, steady_times_s


def test_a_song_of_few_beats_has_no_grid():
    assert SongGrid.of(NO_COUNTS, 10.0) is None
    assert SongGrid.of(counted(0.5, length_s=1.2), 10.0) is None


@settings(max_examples=50)
@given(st.lists(st.floats(0.25, 1.2), min_size=4, max_size=60), st.floats(0, 30), st.floats(0, 60))
def test_the_grid_of_any_song_reaches_beyond_both_ends(gaps_s, first_s, after_s):
    times_s = first_s + np.cumsum(gaps_s)
    duration_s = times_s[-1] + after_s
    grid = SongGrid.of(make_counts(times_s, numbers_in_bar(len(times_s), 4, first=2), 4), duration_s)
    assert (np.diff(grid.times_s) > 0).all()
    assert grid.times_s[0] < 0 and grid.times_s[-1] > duration_s + SEGMENT_S
    assert ((np.diff(grid.numbers) == 1) | ((grid.numbers[:-1] == 4) & (grid.numbers[1:] == 1))).all()
    index = np.linspace(0, len(grid.times_s) - 1, 50)
    times = np.array([grid.time_at(i) for i in index])
    assert grid.index_at(times) == pytest.approx(index, abs=1e-6)


def test_jitter_of_a_tracker_is_evened_out():
    rng = np.random.default_rng(0)
    true_s = 1.0 + 0.5 * np.arange(100)
    jittered_s = true_s + rng.normal(0, 0.01, 100)
    steady_s = steady_times_s(jittered_s)
    assert np.abs(steady_s - true_s).mean() < 0.6 * np.abs(jittered_s - true_s).mean()
    assert np.diff(steady_s, 2).std() < 0.2 * np.diff(jittered_s, 2).std()


@given(st.floats(0.3, 1.0), st.floats(-0.2, 0.3), st.integers(2, 80))
def test_an_exact_ramp_is_kept(period_s, change, n_beats):
    """Periods that grow or shrink evenly have no third difference."""
    periods_s = period_s * (1 + change * np.linspace(0, 1, n_beats))
    times_s = 0.7 + np.cumsum(periods_s)
    assert steady_times_s(times_s) == pytest.approx(times_s, abs=1e-6)


@given(st.lists(st.floats(0.25, 1.2), min_size=1, max_size=60))
def test_beats_are_not_moved_far_and_stay_in_order(gaps_s):
    times_s = np.cumsum(gaps_s)
    steady_s = steady_times_s(times_s)
    assert steady_s.shape == times_s.shape and (np.diff(steady_s) > 0).all()
    assert np.abs(steady_s - times_s).max() <= 0.03 + 1e-9


PADDING = 64


def penalties(counts: Counts, figures=()) -> list[float]:
    """Of the take's own counts."""
    grids = TakeGrids([counts], [figures])
    index = PADDING + np.arange(len(counts))
    return grids.phrase_penalty_at(np.array([0]), index[None])[0].tolist()


def test_takes_change_at_borders_of_figures():
    counts = counted(0.5, length_s=10.0)  # 21 counts
    figures = [Figure("C-1", 1.0, 5.0, 8), Figure("C-2", 5.0, 8.0, 6)]
    wanted = np.where(counts.numbers == 1, 0.6, 1.0)
    wanted[[2, 10, 16]] = 0.0
    assert penalties(counts, figures) == wanted.tolist()


def test_takes_change_at_bars_where_no_figures_are_known():
    counts = counted(0.5, first=3, length_s=10.0)
    assert penalties(counts) == np.where(counts.numbers == 1, 0.0, 1.0).tolist()
    assert penalties(counted(0.5, metre=0, length_s=10.0)) == [1.0] * 21


def test_accents_of_a_take_counted_in_part_are_those_of_that_part():
    part = counted(0.5, first_s=10.0, length_s=20.0)
    elsewhere_s = np.sort(np.random.default_rng(0).uniform(0.0, 10.0, 15))
    grids = TakeGrids([part], [()], [np.r_[elsewhere_s, part.times_s[:-1] + 0.03]])
    shift_s = grids.accents_at(np.zeros(1, int), np.arange(len(grids.times_s) - 1)[None])[0][0]
    known = np.isin(np.round(grids.times_s[:-1], 6), np.round(part.times_s[:-1], 6))
    np.testing.assert_allclose(shift_s[known], 0.03, atol=1e-9)
    assert shift_s[~known][:-1] == pytest.approx(0.0)


def test_the_index_changes_its_speed_gradually_between_long_and_short_counts():
    """A waltz on a song in four: slow, quick, quick."""
    times_s = np.cumsum(np.tile([0.5, 1.0, 0.5], 10))
    counts = make_counts(times_s, numbers_in_bar(30, 3, first=2), 3)
    grid = SongGrid.of(counts, 20.0, eased=True)
    first = int(np.searchsorted(grid.times_s, 1e-9))
    assert grid.times_s[first : first + 30].tolist() == times_s.tolist()
    assert grid.index_at(times_s[1:-1]) - first == pytest.approx(np.arange(1, 29), abs=0.07)
    speed = np.diff(grid.index_at(np.arange(2.0, 18.0, 0.05))) / 0.05
    assert speed.min() == pytest.approx(1.0) and speed.max() == pytest.approx(2.0)
    assert np.abs(np.diff(speed)).max() < 0.5
