"""What a scene is asked to be: who dances what when, and where.

A formation gives each dancer a place on the stage, so that the audience sees all of them. A relation says
which dance each of them dances: the one of the leader, its mirror image, the same some counts later, or in
turns with the leader, or a dance of its own. Both may change with the sections of the song.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Generic, Literal, TypeVar

import numpy as np

from choreograph.core.arguments import is_number, unexpected
from choreograph.core.counts import counts_later_s, index_at
from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.files import read_text
from choreograph.core.numerics import Floats
from choreograph.core.timebase import parse_seconds
from choreograph.music.song_features import PLACE, Places, SongFeatures
from choreograph.plan.scenes import DancerPart

# Formations: places on the ground, x and z in metres. The audience is in the direction +Z, and the axis of
# the stage is x = 0. Places come in the order of dancers: one on the axis if their number is odd, then pairs
# of places left and right of the axis that mirror each other, as the built-in formations are symmetric.

_V_DEPTH = 0.6  # of the spacing, by which each dancer of a V stands behind the one before it
_COUPLES_APART = 2.0  # of the spacing, from the middle of a couple to that of the next one
_FARTHEST_M = 100.0  # from the middle of the stage, of a place in a file
_EYE_AWAY_M = 8.0  # at least, from the front row
_EYE_OF_WIDTH = 1.2  # of the width of the formation, if that is more
_SEEN_M = 0.45  # from one body to the line of sight past another one, so that at most a half is hidden
_IN_FRONT_M = 0.4  # a body that is nearer to the audience by less hides nobody
_PASSES = 200


def _line(n: int) -> Floats:
    return np.stack([np.arange(n) - (n - 1) / 2, np.zeros(n)], axis=1)


def _v(n: int) -> Floats:
    x = np.arange(n) - (n - 1) / 2
    return np.stack([x, -_V_DEPTH * (np.abs(x) - np.abs(x).min())], axis=1)


def _circle(n: int) -> Floats:
    """Neighbours are one spacing apart. An odd number has one dancer in front."""
    angles = (np.arange(n) + 0.5 * (n % 2 == 0)) * 2 * np.pi / n
    radius = 0.0 if n == 1 else 0.5 / np.sin(np.pi / n)
    return radius * np.stack([np.sin(angles), np.cos(angles)], axis=1)


def _pairs(n: int) -> Floats:
    """Couples side by side, in a V. A dancer without a partner stands in front."""
    couples = _v(n // 2) * _COUPLES_APART if n > 1 else np.zeros((0, 2))
    half = np.array([0.5, 0.0])
    places = np.concatenate([couples + half, couples - half])
    return np.concatenate([[[0.0, 1.0]], places]) if n % 2 else places


FORMATIONS: dict[str, Callable[[int], Floats]] = {"line": _line, "v": _v, "circle": _circle, "pairs": _pairs}


def formation_places(formation: str | Path, n_dancers: int) -> tuple[Floats, bool]:
    """The places (N, 2) of a formation, and whether they are in metres. Otherwise they are in spacings.

    A name of `FORMATIONS` gives places in spacings, and the path of a .json file, a list of N pairs [x, z],
    places in metres. Raises `ParameterError` for another name or number of places, and `FormatError` for a
    file that cannot be read.
    """
    name = str(formation)
    if name.lower() in FORMATIONS:
        return _in_order(FORMATIONS[name.lower()](n_dancers)), False
    if not name.lower().endswith(".json"):
        raise unexpected(f"a formation among {', '.join(FORMATIONS)}, or a .json file of places", name)
    text = read_text(Path(name), "a file of places")
    try:
        data = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise FormatError(f"{name}: expected places (JSON), could not parse it: {error}") from None
    if not isinstance(data, list) or not all(_is_place(place) for place in data):
        raise FormatError(f"{name}: expected a list of places [x, z] in metres, within {_FARTHEST_M:g} m")
    if len(data) != n_dancers:
        raise ParameterError(f"{name}: expected {n_dancers} places, one for each dancer, got {len(data)}")
    return np.array(data, np.float64), True


def _is_place(place: object) -> bool:
    return (
        isinstance(place, list)
        and len(place) == 2
        and all(is_number(value) and abs(value) <= _FARTHEST_M for value in place)
    )


def _in_order(places: Floats) -> Floats:
    """The places (N, 2) in the order of dancers, front and middle first, with their middle at the origin."""
    places = places - [0.0, (places[:, 1].min() + places[:, 1].max()) / 2]
    side, away = places[:, 0] < -1e-9, np.abs(places[:, 0]).round(6)
    ordered: Floats = places[np.lexsort((side, -places[:, 1].round(6), away))]
    return ordered


def eye_of(places_m: Floats) -> Floats:
    """Where the eyes of the audience are, (2,) x and z, for places (N, 2)."""
    width_m = float(np.ptp(places_m[:, 0]))
    return np.array([0.0, places_m[:, 1].max() + max(_EYE_AWAY_M, _EYE_OF_WIDTH * width_m)])


def in_windows(places_m: Floats) -> Floats:
    """The places (N, 2), moved to the sides so that no one stands behind another one for the audience.

    Symmetric places remain symmetric: of two in line, the one behind moves to the axis.
    """
    places = places_m.copy()
    eye = eye_of(places)
    for _ in range(_PASSES):
        away = eye[1] - places[:, 1]  # (N,)
        seen = places[:, 0] / away  # x at distance 1
        push = np.zeros(len(places))
        for front, back in zip(*np.nonzero(away[:, None] + _IN_FRONT_M < away[None, :]), strict=True):
            apart = (seen[back] - seen[front]) * away[back]
            short = _SEEN_M - abs(apart)
            if short > 1e-6:
                side = np.sign(apart) if abs(apart) > 1e-3 else -np.sign(places[back, 0]) or 1.0
                push[back] += 0.5 * short * side
                push[front] -= 0.25 * short * side
        if not push.any():
            break
        places[:, 0] += 0.5 * push
    return places


# Relations: which dance each dancer dances in each part of the song, and how far behind.

Kind = Literal["unison", "mirror", "canon", "call-and-response", "free"]
_TEXT = re.compile(r"(unison|mirror|call-and-response|free)|canon:(\d{1,2})", re.IGNORECASE)
MOST_DELAY_COUNTS = 32  # of one dancer behind the one before
CALM = 0.35  # size of the movement of those who wait for their turn


@dataclass(frozen=True)
class Relation:
    """A relation of the dancers of a scene. `delay_counts` are those of a canon."""

    kind: Kind
    delay_counts: int = 0

    @classmethod
    def parse(cls, text: str) -> Relation:
        """Read unison, mirror, canon:N (in counts), call-and-response or free.

        Raises `ParameterError` for anything else.
        """
        found = _TEXT.fullmatch(text.strip()) if isinstance(text, str) else None
        if found is None or (found[2] is not None and not 1 <= int(found[2]) <= MOST_DELAY_COUNTS):
            raise unexpected(
                "a relation among unison, mirror, canon:N with 1 to "
                f"{MOST_DELAY_COUNTS} counts, call-and-response and free",
                text,
            )
        if found[2] is not None:
            return cls("canon", int(found[2]))
        return cls(found[1].lower())  # type: ignore[arg-type]  # one of the kinds


def is_mirrored(dancer: int, n_dancers: int) -> bool:
    """Whether a dancer is on the side of the axis that is the mirror image of the leader's.

    Places are in the order of `formations`: one on the axis if the number is odd, then pairs.
    """
    on_axis = n_dancers % 2
    return dancer >= on_axis and (dancer - on_axis) % 2 == 1


def pair_of(dancer: int, n_dancers: int) -> int:
    """How many pairs stand between the axis and a dancer: 0 for the leader."""
    return (dancer + n_dancers % 2) // 2


def dancer_parts(
    dancer: int,
    n_dancers: int,
    relations: Sequence[Relation],
    bounds_s: Sequence[float],
    beats_s: Sequence[float],
    opening_s: float,
) -> tuple[DancerPart, ...]:
    """The parts of a dancer, `relations` (P,) being those of the spans between `bounds_s` (P + 1,).

    `beats_s` (Q,) are the counts of the song, and `opening_s` the time of the first one that is danced. Dance
    0 is the leader's, and dance i that of dancer i in free relations.
    """
    parts: list[DancerPart] = []
    turn = 0
    since_s = bounds_s[0]  # when the relation began
    for index, relation in enumerate(relations):
        start_s, end_s = float(bounds_s[index]), float(bounds_s[index + 1])
        if index and relation != relations[index - 1]:
            turn, since_s = 0, start_s
        part = DancerPart(start_s, end_s, 0)
        if relation.kind == "free":
            part = replace(part, dance=dancer)
        elif relation.kind == "mirror":
            part = replace(part, mirrored=is_mirrored(dancer, n_dancers))
        elif relation.kind == "call-and-response":
            answers = is_mirrored(dancer, n_dancers)
            delay = n_counts(beats_s, bounds_s[index - 1], start_s) if turn % 2 else 0
            if answers == bool(turn % 2):
                part = replace(part, delay_counts=delay if answers else 0)
            else:
                part = replace(part, size=CALM)
            turn += 1
        elif relation.kind == "canon":
            delay = relation.delay_counts * pair_of(dancer, n_dancers)
            parts += _canon(part, delay, beats_s, since_s, opening_s)
            continue
        parts.append(part)
    return _merged(parts)


def _canon(
    part: DancerPart, delay_counts: int, beats_s: Sequence[float], since_s: float, opening_s: float
) -> list[DancerPart]:
    """A part of a canon. From the start of the canon, a dancer waits for as many counts as it is behind."""
    behind = replace(part, delay_counts=delay_counts)
    if since_s <= opening_s or not delay_counts:  # at the start, all hold the first pose until their count
        return [behind]
    begins_s = float(counts_later_s(beats_s, since_s, delay_counts))
    if part.end_s <= begins_s:
        return [replace(part, held=True)]
    if part.start_s >= begins_s:
        return [behind]
    return [replace(part, end_s=begins_s, held=True), replace(behind, start_s=begins_s)]


def _merged(parts: Sequence[DancerPart]) -> tuple[DancerPart, ...]:
    """The parts, with those joined that go on in the same way."""
    merged: list[DancerPart] = []
    for part in parts:
        last = merged[-1] if merged else None
        if last is not None and replace(last, start_s=part.start_s, end_s=part.end_s) == part:
            merged[-1] = replace(last, end_s=part.end_s)
        else:
            merged.append(part)
    return tuple(merged)


def n_counts(beats_s: Sequence[float], start_s: float, end_s: float) -> int:
    """The number of counts from one time to another, rounded. Without two beats, a count lasts 0.5 s."""
    beats = np.asarray(beats_s if len(beats_s) > 1 else (0.0, 0.5), np.float64)
    start, end = index_at(beats, np.array([start_s, end_s]))
    return round(float(end - start))


# What changes by section: texts such as `chorus=v`, and the parts of the song they are for.

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
