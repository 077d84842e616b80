"""What changes by section: texts of options, the parts of the song they name, borders."""

from __future__ import annotations

import pytest

from choreograph.choreography.scenes import parse_schedule, spans_of, values_at
from choreograph.core.errors import ParameterError
from choreograph.music.song_features import Places

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
    starts_s = (0.0, 8.0, 15.9, 16.0, 30.0)
    assert values_at("formation", schedule, starts_s, PLACES, 40.0) == [
        "circle", "v", "v", "places.json", "places.json",
    ]  # fmt: skip


@pytest.mark.parametrize("given", [("10-12=v", "8-16=line"), ("v", "0.5-1.5=line")])
def test_a_value_that_would_hold_nowhere_is_refused(given):
    schedule, starts_s = parse_schedule("formation", given, "circle"), (0.0, 8.0, 10.0, 12.0, 16.0)
    with pytest.raises(ParameterError, match=r"a part of the song for the formation at (10-12|0\.5)"):
        values_at("formation", schedule, starts_s, PLACES, 40.0)
    shadowed = parse_schedule("formation", ("8-16=v", "10-12=line"), "circle")
    assert values_at("formation", shadowed, starts_s, PLACES, 40.0) == ["circle", "v", "line", "v", "circle"]


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
