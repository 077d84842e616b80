"""Spliced songs: halves on bar lines, true beats and genres, seeds of their own."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from content.moves.genres import GENRES as STARTER_GENRES
from content.songs.known_songs import FIRST_SPLICED_SEED as FIRST_SEED
from content.songs.known_songs import HALF_S, SPLICED_SONGS
from content.songs.synthesis.sounds import RATE_HZ


@pytest.fixture(scope="module")
def spliced():
    return SPLICED_SONGS[0].render()


def test_halves_meet_on_a_bar_line(spliced):
    assert spliced.genres == ("house", "waltz")
    assert spliced.splice_s == pytest.approx(HALF_S, abs=1.1)
    assert spliced.duration_s == pytest.approx(2 * HALF_S, abs=2.2)
    times_s, numbers = spliced.counts.times_s, spliced.counts.numbers
    assert (np.diff(times_s) > 0).all() and times_s[0] == 0.0
    at_splice = int(np.argmin(np.abs(times_s - spliced.splice_s)))
    assert times_s[at_splice] == pytest.approx(spliced.splice_s)
    assert numbers[at_splice - 4 : at_splice].tolist() == [1, 2, 3, 4]
    assert numbers[at_splice : at_splice + 4].tolist() == [1, 2, 3, 1]


def test_wanted_genres_change_at_the_splice(spliced):
    change = spliced.wanted.index("waltz")
    assert set(spliced.wanted[:change]) == {"house"} and set(spliced.wanted[change:]) == {"waltz"}
    assert change == pytest.approx(spliced.splice_s, abs=0.51)


def test_no_click_and_no_silence_at_the_splice(spliced):
    at = round(spliced.splice_s * RATE_HZ)
    steps = np.abs(np.diff(spliced.samples, axis=0)).max(axis=1)
    assert np.abs(spliced.samples[at - 1]).max() < 1e-3
    around = slice(at - RATE_HZ, at + RATE_HZ)
    assert np.sqrt(np.mean(spliced.samples[around] ** 2)) > 0.02
    assert steps[at - 1000 : at].max() < 0.5


def test_every_spliced_genre_is_danced_and_comes_first_once_and_second_once():
    spliced = {song.genres[0] for song in SPLICED_SONGS}
    assert len(spliced) == 8 and spliced <= set(STARTER_GENRES)
    for half in (0, 1):
        assert Counter(song.genres[half] for song in SPLICED_SONGS) == dict.fromkeys(spliced, 1)
    seeds = [song.seed + half for song in SPLICED_SONGS for half in (0, 1)]
    assert len(set(seeds)) == len(seeds) and min(seeds) == FIRST_SEED
