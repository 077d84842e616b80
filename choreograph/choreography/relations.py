"""Relations: which dance each dancer of a scene dances in each part of the song, and how far behind.

The leader's dance is planned first. In a relation, the others dance the same, its mirror image, the same some
counts later, or in turns with the leader, or each a dance of its own.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from choreograph.core.arguments import unexpected
from choreograph.core.counts import counts_later_s, index_at
from choreograph.plan.scenes import DancerPart

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
