"""Places of a song by name, in seconds."""

from __future__ import annotations

import numpy as np
import pytest

from choreograph.core.errors import ParameterError
from choreograph.music.form import Sections
from choreograph.music.song_features import Places, bar_spans_s, chorus_and_verse, names_place

PLACES = Places(
    {
        "bar": bar_spans_s([0.5, 2.5, 4.5], 6.0),
        "chorus": ((2.5, 4.5), (10.0, 14.25)),
        "verse": (),
        "phrase": (),
    }
)


@pytest.mark.parametrize(
    ("text", "is_span", "expected"),
    [
        ("bar 2", False, "2.500000"),
        ("Bar 1-chorus 2", True, "0.500000-10.000000"),
        ("chorus 2", True, "10.000000-14.250000"),
        ("bar 3", True, "4.500000-6.000000"),
        ("chorus 2=take:bar 1", True, "10.000000-14.250000=take:bar 1"),
        ("1:02.5-bar2", True, "1:02.5-2.500000"),
        ("12-14", True, "12-14"),
    ],
)
def test_names_become_seconds(text, is_span, expected):
    assert PLACES.in_seconds(text, is_span=is_span) == expected
    assert names_place(text) == (text != "12-14")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("bar 4", "expected bar 1 to 3, got bar 4"),
        ("bar 0", "expected bar 1 to 3"),
        ("verse 1", "expected a song in which a verse was found, got verse 1: write the time in seconds"),
        ("section 1", "expected a song in which a section was found"),
    ],
)
def test_places_that_the_song_does_not_have(text, said):
    with pytest.raises(ParameterError, match=said):
        PLACES.in_seconds(text)


def test_other_words_name_no_place():
    assert not any(map(names_place, ("bars 2", "barn", "3=take:chorus 2", "30-38=take:x")))


def test_the_chorus_is_the_loudest_music_that_returns():
    sections = Sections(np.array([0.0, 4.0, 8.0, 12.0, 16.0, 20.0]), np.array([3, 1, 3, 1, 0]))
    energy = np.repeat([0.4, 0.8, 0.5, 0.7, 1.0], 4)
    assert chorus_and_verse(sections, energy) == (1, 3)
    assert chorus_and_verse(Sections(np.array([0.0, 9.0]), np.array([0])), energy) == (-1, -1)
    assert chorus_and_verse(Sections(np.zeros(0), np.zeros(0, np.int64)), energy) == (-1, -1)
