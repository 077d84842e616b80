"""Style response: whether a dance changes genre where its song does.

Conventions: there is one label per second of the dance (S,), the genre of the take danced then, and one per
second of the song, the wanted genre. A part of the song is a run of seconds with one wanted genre. Takes of
several genres may go with a song, so only songs spliced from clearly different genres can be used. The labels
are those of the takes. They do not describe a take at another tempo.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import default_numerics

Strings = NDArray[np.str_]

SWITCHED_OF_S = (3, 4)  # seconds in the new genre, of so many


def validate(danced: Sequence[str], wanted: Sequence[str]) -> None:
    """Raise `ParameterError` unless each of 1 or more seconds has one danced and one wanted genre."""
    shapes = np.shape(danced), np.shape(wanted)
    if shapes[0] != shapes[1] or len(shapes[0]) != 1 or shapes[0][0] == 0:
        raise ParameterError(f"expected a danced and a wanted genre per second, got {shapes[0]}, {shapes[1]}")


def part_bounds(wanted: Sequence[str]) -> list[tuple[int, int]]:
    """First second of each part of the song, and the one after its last."""
    labels = np.asarray(wanted)
    starts = [0, *(np.flatnonzero(labels[1:] != labels[:-1]) + 1).tolist()]
    return list(zip(starts, [*starts[1:], len(labels)], strict=True))


def own_genre_shares(danced: Sequence[str], wanted: Sequence[str]) -> list[float]:
    """Share of each part's seconds that are danced in the genre wanted, 0 … 1."""
    made, asked = _checked(danced, wanted)
    return [float(np.mean(made[a:b] == asked[a])) for a, b in part_bounds(wanted)]


def chance_shares(danced: Sequence[str], wanted: Sequence[str]) -> list[float]:
    """The shares of the same danced seconds in random order: each wanted genre's share of the dance."""
    made, asked = _checked(danced, wanted)
    return [float(np.mean(made == asked[a])) for a, _ in part_bounds(wanted)]


def seconds_to_switch(danced: Sequence[str], wanted: Sequence[str]) -> list[float]:
    """Seconds from the start of each part but the first until the dance is in its genre.

    That is the first second in the genre from which at least 3 of 4 s are, all within the part. It is nan if
    there is none.
    """
    made, asked = _checked(danced, wanted)
    needed, window = SWITCHED_OF_S
    waits = []
    for start, stop in part_bounds(wanted)[1:]:
        inside = made[start:stop] == asked[start]
        found = (
            s for s in range(len(inside) - window + 1) if inside[s] and inside[s : s + window].sum() >= needed
        )
        waits.append(float(next(found, float("nan"))))
    return waits


@default_numerics()
def evaluate(danced: Sequence[str], wanted: Sequence[str]) -> dict[str, float]:
    """Means over the song's parts: own genre with its chance, the worst part's, and time to switch."""
    shares, waits = own_genre_shares(danced, wanted), seconds_to_switch(danced, wanted)
    switched = [wait for wait in waits if not np.isnan(wait)]
    return {
        "part_genre": float(np.mean(shares)),
        "part_genre_chance": float(np.mean(chance_shares(danced, wanted))),
        "part_genre_worst": min(shares),
        "switched": len(switched) / len(waits) if waits else float("nan"),
        "seconds_to_switch": float(np.mean(switched)) if switched else float("nan"),
    }


def _checked(danced: Sequence[str], wanted: Sequence[str]) -> tuple[Strings, Strings]:
    validate(danced, wanted)
    return np.asarray(danced, np.str_), np.asarray(wanted, np.str_)
