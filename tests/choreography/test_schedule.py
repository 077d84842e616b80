"""What changes by section: texts of options, the parts of the song they name, borders."""

from __future__ import annotations

import pytest

from choreograph.choreography.schedule import parse_schedule, spans_of, value_at
from choreograph.core.errors import ParameterError
from choreograph.music.places import Places

PLACES = Places(
    {
        "bar": tuple((2.0 * bar, 2.0 * bar + 2.0) for bar in range(20)),
        "chorus": ((8.0, 16.0), (24.0, 32.0)),
        "verse": (),
    }
)


def test_a_value_without_a_part_is_for_the_rest():
    schedule = parse_schedule("formation", ("chorus=v", "circle", "Bar 9 =places.json"), "line")
    assert [(entry.when, entry.value) for entry in schedule] == [
        ("", "circle"), ("chorus", "v"), ("bar 9", "places.json"),
    ]  # fmt: skip
    assert [value_at(schedule, t, PLACES, 40.0) for t in (0.0, 8.0, 15.9, 16.0, 30.0)] == [
        "circle", "v", "v", "places.json", "places.json",
    ]  # fmt: skip


@pytest.mark.parametrize("given", [("",), ("=v",), ("chorus=",), ("v", "line"), ("chorus=v", "chorus=line")])
def test_other_texts_are_refused(given):
    with pytest.raises(ParameterError, match="expected"):
        parse_schedule("formation", given, "line")


@pytest.mark.parametrize(
    ("when", "spans_s"),
    [
        ("chorus", [(8.0, 16.0), (24.0, 32.0)]),
        ("chorus 2", [(24.0, 32.0)]),
        ("bar 3", [(4.0, 40.0)]),
        ("bar 3-bar 5", [(4.0, 8.0)]),
        ("bar 3-chorus 1", [(4.0, 8.0)]),
        ("5-0:07.5", [(5.0, 7.5)]),
        ("30", [(30.0, 40.0)]),
    ],
)
def test_parts_of_the_song(when, spans_s):
    assert spans_of(when, PLACES, 40.0) == spans_s


@pytest.mark.parametrize("when", ["verse", "chorus 3", "bar 21", "9-3", "soon", "50", "-4", "1-2-3"])
def test_parts_that_the_song_does_not_have_are_refused(when):
    with pytest.raises(ParameterError, match="expected"):
        spans_of(when, PLACES, 40.0)
