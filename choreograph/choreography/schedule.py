"""What changes by section in a scene: texts such as `chorus=v`, and the parts of the song they are for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Generic, TypeVar

import numpy as np

from choreograph.core.arguments import unexpected
from choreograph.core.counts import counts_later_s
from choreograph.core.errors import ParameterError
from choreograph.core.timebase import parse_seconds
from choreograph.music.places import PLACE, Places
from choreograph.music.song_features import SongFeatures

Value = TypeVar("Value")
_ALL = ("section", "chorus", "verse", "phrase")  # without a number, all of them
_PHRASE_COUNTS = 16  # of a song whose phrases are not known
_SHORTEST_S = 2.0  # between two borders
_JUST_S = 0.01  # after a border, a part that begins there holds


@dataclass(frozen=True)
class Scheduled(Generic[Value]):
    """A value for a part of the song, or with an empty `when` for all that is not named otherwise."""

    when: str
    value: Value


def parse_schedule(what: str, given: Sequence[str], default: str) -> list[Scheduled[str]]:
    """The texts `VALUE` or `WHEN=VALUE` of an option, of which one at most is without WHEN.

    Raises `ParameterError` for an empty part, or two values for the same part of the song.
    """
    found: dict[str, str] = {"": default}
    seen: set[str] = set()
    for text in given:
        when, equals, value = text.rpartition("=")
        when, value = " ".join(when.split()).lower(), value.strip()
        if not value or (equals and not when):
            raise unexpected(f"{what} as VALUE or WHEN=VALUE, such as chorus=v", text)
        if when in seen:
            raise ParameterError(
                f"expected one {what} for {when or 'the whole song'}, got {found[when]} and {value}"
            )
        seen.add(when)
        found[when] = value
    return [Scheduled(when, value) for when, value in found.items()]


def spans_of(when: str, places: Places, duration_s: float) -> list[tuple[float, float]]:
    """The spans of a song that a text names.

    It is a kind of place, such as `chorus` for all of them, one place, `chorus 2`, two times or places with a
    hyphen, `bar 9-bar 17` or `30-45`, or one bar or time, from which on it holds.

    Raises `ParameterError` for anything else, and for a place that the song does not have.
    """
    if when in _ALL:
        spans = places.spans_s.get(when, ())
        if not spans:
            raise ParameterError(f"expected a song in which a {when} was found, got one without")
        return list(spans)
    place = PLACE.fullmatch(when)
    if place and place[1].lower() != "bar":
        return [places.span_s(place[1].lower(), int(place[2]))]
    ends = when.split("-")
    if len(ends) > 2:
        raise unexpected("a part of the song with one hyphen, such as bar 9-bar 17", when)
    times_s = [_time_s(end, places) for end in ends]
    start_s, end_s = (*times_s, duration_s)[:2]
    if not 0.0 <= start_s < min(end_s, duration_s):
        raise unexpected(f"a part of the song of {duration_s:.1f} s, the start first", when)
    return [(start_s, end_s)]


def _time_s(text: str, places: Places) -> float:
    place = PLACE.fullmatch(text.strip())
    if place:
        return places.span_s(place[1].lower(), int(place[2]))[0]
    return parse_seconds(text)


def borders_s(
    features: SongFeatures, schedules: Sequence[Sequence[Scheduled[Any]]], places: Places
) -> list[float]:
    """Where dancers come to their places: the start, borders of phrases, and those of the schedules."""
    counts, duration_s = features.counts, features.duration_s
    phrases = [phrase.start_s for phrase in features.form.phrases]
    if not phrases:
        n_phrases = int(duration_s / _SHORTEST_S) + 1
        starts_s = (
            float(counts_later_s(counts.times_s, 0.0, index * _PHRASE_COUNTS)) for index in range(n_phrases)
        )
        phrases = [start_s for start_s in starts_s if start_s < duration_s]
    named = [
        time_s
        for schedule in schedules
        for entry in schedule
        if entry.when
        for span_s in spans_of(entry.when, places, duration_s)
        for time_s in span_s
    ]
    fixed = [0.0, *sorted(s for s in named if _SHORTEST_S < s < duration_s - _SHORTEST_S)]
    kept = [one for one, after in pairwise([*fixed, np.inf]) if after - one > 1e-3]
    for start_s in phrases:
        if all(abs(start_s - one) >= _SHORTEST_S for one in (*kept, duration_s)):
            kept.append(start_s)
    return sorted(kept)


def values_at(
    what: str,
    schedule: Sequence[Scheduled[Value]],
    starts_s: Sequence[float],
    places: Places,
    duration_s: float,
) -> list[Value]:
    """The value from each of the starts on: the last one given for a span that contains it.

    Raises `ParameterError` for a value of a part of the song that then holds nowhere.
    """
    spans_s = [spans_of(entry.when, places, duration_s) if entry.when else [] for entry in schedule]
    held = [
        max(
            index
            for index, of_entry in enumerate(spans_s)
            if not index or any(start_s - 1e-3 <= time_s + _JUST_S < end_s for start_s, end_s in of_entry)
        )
        for time_s in starts_s
    ]
    for index, entry in enumerate(schedule):
        if entry.when and index not in held:
            raise ParameterError(
                f"expected a part of the song for the {what} at {entry.when}, got one that a later {what} "
                f"covers, or within {_SHORTEST_S:g} s of the start or end: name another part"
            )
    return [schedule[index].value for index in held]
