"""Cuts to another tempo or metre are found at their beat; ramps, slips of the tracker and breaks are none."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from choreograph.core.counts import NO_COUNTS, Counts, make_counts, numbers_in_bar
from choreograph.music.bars import change_times_s, part_metre


def song_of(*parts: tuple[float, int, int]) -> tuple[Counts, list[float]]:
    """A song of parts of (BPM, metre, beats), and the first beat of each."""
    times_s, numbers, starts_s, now_s = [], [], [], 0.5
    for bpm, metre, n_beats in parts:
        starts_s.append(now_s)
        times_s.append(now_s + np.arange(n_beats) * 60 / bpm)
        numbers.append(numbers_in_bar(n_beats, metre))
        now_s = times_s[-1][-1] + 60 / bpm
    return make_counts(np.concatenate(times_s), np.concatenate(numbers), max(p[1] for p in parts)), starts_s


@pytest.mark.parametrize(
    "parts",
    [
        [(120, 4, 32), (88, 4, 32)],
        [(88, 4, 24), (120, 4, 32)],
        [(120, 4, 32), (120, 3, 30)],
        [(132, 3, 30), (120, 4, 32), (175, 4, 40)],
    ],
)
def test_changes_are_found_at_their_beat(parts):
    counts, starts_s = song_of(*parts)
    assert change_times_s(counts) == pytest.approx(starts_s[1:])


@given(st.floats(60, 200), st.floats(0.9, 1.1), st.sampled_from([3, 4]))
def test_a_change_of_tempo_counts_from_six_percent_on(bpm, ratio, metre):
    counts, starts_s = song_of((bpm, metre, 36), (bpm * ratio, metre, 36))
    octaves = abs(np.log2(ratio))
    if abs(octaves - 0.085) > 1e-3:
        assert change_times_s(counts) == pytest.approx(starts_s[1:] if octaves > 0.085 else [])


def test_a_ramp_is_no_change():
    times_s = [0.3]
    while times_s[-1] < 50:
        times_s.append(times_s[-1] + 60 / (90 + times_s[-1]))
    counts = make_counts(np.array(times_s), numbers_in_bar(len(times_s), 4), 4)
    assert len(change_times_s(counts)) == 0


def test_a_lost_beat_is_no_change():
    times_s = np.delete(0.5 * np.arange(64), [20, 41])
    numbers = np.r_[numbers_in_bar(20, 4), numbers_in_bar(20, 4), numbers_in_bar(22, 4)]
    assert len(change_times_s(make_counts(times_s, numbers, 4))) == 0
    slipped = np.r_[numbers_in_bar(29, 4), numbers_in_bar(35, 4)]  # a bar of one beat more
    assert len(change_times_s(make_counts(0.5 * np.arange(64), slipped, 4))) == 0


def test_few_beats_have_no_changes():
    few = (NO_COUNTS, make_counts([0.5], [1], 4), make_counts([0.5, 1.0, 4.0], [0, 0, 0], 0))
    assert all(len(change_times_s(counts)) == 0 for counts in few)


@pytest.mark.parametrize(
    ("bars", "metre", "expected"),
    [
        ([3, 3, 3, 5, 3], 4, 3),
        ([3, 4, 3, 4], 4, 4),  # not clearly most
        ([4, 4, 7, 7, 7], 3, 4),  # no bar of seven
        ([5, 5, 5], 4, 4),
        ([3], 4, 4),
        ([], 3, 3),
    ],
)
def test_a_part_keeps_the_songs_metre_unless_most_bars_have_another(bars, metre, expected):
    assert part_metre(np.array(bars, np.int64), metre) == expected
