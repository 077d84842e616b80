"""Softened songs: a soft middle third on bar lines, beats as true as ever."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from choreograph.core.errors import ParameterError
from content.songs.known_songs import FIRST_SOFTENED_SEED as FIRST_SEED
from content.songs.known_songs import softened_song
from content.songs.synthesis.composition import Section
from content.songs.synthesis.song import STYLES, render_song
from content.songs.synthesis.sounds import RATE_HZ

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("genre", ["house", "waltz"])
def test_the_middle_third_is_soft(genre):
    song = softened_song(genre, seed=FIRST_SEED, duration_s=30.0)
    assert [section.name for section in song.sections] == ["chorus", "break", "chorus"]
    assert song.duration_s == pytest.approx(30.0, abs=6.0)
    bounds = np.rint(song.bar_times_s[[*(s.first_bar for s in song.sections), song.n_bars]] * RATE_HZ).astype(
        int
    )
    level_db = [10 * np.log10(np.square(song.samples[start:stop]).mean()) for start, stop in pairwise(bounds)]
    assert level_db[1] < min(level_db[0], level_db[2]) - 12.0  # the gain, and fewer instruments
    assert np.diff(song.beat_times_s) == pytest.approx(60.0 / np.mean(STYLES[genre].bpm), abs=1e-4)


@pytest.mark.parametrize(
    "sections",
    [[], [Section("verse", 0, 3, 0.5)], [Section("verse", 1, 4, 0.5)], [Section("verse", 0, 4, 0.5)] * 2],
)
def test_sections_that_do_not_fill_the_song(sections):
    with pytest.raises(ParameterError, match="expected"):
        render_song("house", n_bars=4, sections=sections)
