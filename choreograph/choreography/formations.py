"""Formations: the places of several dancers on the stage, seen by the audience without hiding one another.

Places are on the ground, x and z in metres. The audience is in the direction +Z, and the axis of the stage is
x = 0. Places come in the order of dancers: one on the axis if their number is odd, then pairs of places left
and right of the axis that mirror each other, as the built-in formations are symmetric.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

from choreograph.core.arguments import is_number, unexpected
from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.files import read_text
from choreograph.core.numerics import Floats

MOST_DANCERS = 32
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
