"""The palette: parts of takes and motifs to choose from, by genre, energy, level, travel and name."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats, Indices
from choreograph.core.timebase import NET_FPS
from choreograph.library.repertoire import Repertoire
from choreograph.motion.body import ground_pos_m
from choreograph.motion.motion import Credits
from choreograph.studio.facts import motion_data

THIRDS = ("low", "middle", "high")
_COUNTS = 8  # of a part, in takes without figures
_COUNT_S = 0.5  # where counts are not known
_SHORTEST_S = 1.0
_MOST_PARTS = 20_000  # of a large library, evenly from all its takes
_LONGEST_SHOWN_S = 12.0
_MOST_MOTIFS = 200


@dataclass(frozen=True)
class PalettePart:
    """A part of a take. Energy, level and travel are thirds of all parts: 0 is the lowest."""

    take: str
    figure: str  # its name, or empty
    credits: Credits
    from_s: float
    to_s: float
    travel_m: float
    energy: int
    level: int  # of the hips above the floor
    travel: int

    @property
    def text(self) -> str:
        """What a search finds it by, in lower case."""
        return " ".join((self.take, self.figure, self.credits.genre, self.credits.performer)).lower()

    @property
    def facts(self) -> dict[str, Any]:
        """The part as JSON."""
        return {
            "take": self.take, "figure": self.figure or None, "genre": self.credits.genre,
            "performer": self.credits.performer, "licence": self.credits.licence, "from_s": self.from_s,
            "to_s": self.to_s, "energy": THIRDS[self.energy], "level": THIRDS[self.level],
            "travel": THIRDS[self.travel], "travel_m": self.travel_m,
        }  # fmt: skip


class Palette:
    """The parts and the motifs of a repertoire."""

    def __init__(self, repertoire: Repertoire) -> None:
        """Measure all parts."""
        self.parts = _parts(repertoire)
        self.motifs = _motifs(repertoire)

    def found(
        self, *, text: str, genre: str, energy: str, level: str, travel: str, offset: int, limit: int
    ) -> dict[str, Any]:
        """A page of the parts that have all of these. An empty text is any.

        Raises `ParameterError` for a third that is none.
        """
        wanted = {"energy": energy, "level": level, "travel": travel}
        for name, third in wanted.items():
            if third and third not in THIRDS:
                raise ParameterError(f"expected {name} among {', '.join(THIRDS)}, got {third[:20]!r}")
        words = text.lower().split()
        kept = [
            part
            for part in self.parts
            if (not genre or part.credits.genre == genre)
            and all(not third or THIRDS[getattr(part, name)] == third for name, third in wanted.items())
            and all(word in part.text for word in words)
        ]
        motifs = [motif for motif in self.motifs if not genre or motif["genre"] == genre]
        return {
            "total": len(kept), "takes": [part.facts for part in kept[offset : offset + limit]],
            "motifs": motifs[:_MOST_MOTIFS] if offset == 0 and not text else [],
        }  # fmt: skip


def part_motion(repertoire: Repertoire, take: str, from_s: float, to_s: float) -> dict[str, Any]:
    """The motion of a part of a take for a small figure.

    Raises `RepertoireError` for an unknown take, and `ParameterError` for a part that it does not have.
    """
    index = repertoire.take_index(take)
    duration_s = repertoire.takes[index].duration_s
    if not 0 <= from_s < to_s <= duration_s + 0.1:
        raise ParameterError(
            f"expected a part of {take}, which lasts {duration_s:.1f} s, got {from_s:g} to {to_s:g}"
        )
    motion, first_s = repertoire.motion(index, from_s, min(to_s, from_s + _LONGEST_SHOWN_S))
    return {"from_s": first_s, **motion_data(motion, small=True)}


def _parts(repertoire: Repertoire) -> list[PalettePart]:
    spans = [(i, *span) for i in range(len(repertoire.takes)) for span in _spans(repertoire, i)]
    spans = spans[:: -(-len(spans) // _MOST_PARTS)] if spans else []
    measured = np.zeros((len(spans), 3))  # metres a second of all joints, metres above the floor, metres
    take = -1
    body: Floats = np.zeros((0, 21, 3))
    for row, (index, from_s, to_s, _) in enumerate(spans):
        if index != take:
            take, body = index, np.asarray(repertoire.body_pos_m(index), np.float64)
        measured[row] = _measured(body[round(from_s * NET_FPS) : round(to_s * NET_FPS) + 1])
    thirds = np.stack([_thirds(measured[:, 0]), _thirds(measured[:, 1]), _thirds(measured[:, 2])], axis=1)
    found = []
    for (index, from_s, to_s, figure), values, third in zip(spans, measured, thirds.tolist(), strict=True):
        info, travel_m = repertoire.takes[index], round(float(values[2]), 2)
        span = round(from_s, 3), round(to_s, 3)
        found.append(PalettePart(info.name, figure, info.credits, *span, travel_m, *third))
    return found


def _spans(repertoire: Repertoire, index: int) -> list[tuple[float, float, str]]:
    """The parts of a take: its figures, or else eight counts each."""
    duration_s = repertoire.takes[index].duration_s
    figures = repertoire.figures(index)
    if figures:
        spans = [(figure.start_s, min(figure.end_s, duration_s), figure.name) for figure in figures]
    else:
        counts_s = repertoire.counts(index).times_s
        if len(counts_s) <= _COUNTS:
            counts_s = np.arange(0.0, duration_s, _COUNT_S)
        borders = [float(time_s) for time_s in counts_s[::_COUNTS] if time_s <= duration_s]
        spans = [(a, b, "") for a, b in pairwise(borders)]
    return [span for span in spans if span[1] - span[0] >= _SHORTEST_S]


def _measured(body_m: Floats) -> tuple[float, float, float]:
    """Speed of the joints, height of the hips and way of poses (T, 21, 3) at 20 fps."""
    if len(body_m) < 2:
        return 0.0, 0.0, 0.0
    ground_m = ground_pos_m(body_m)
    speed = np.linalg.norm(np.diff(body_m, axis=0), axis=-1).mean() * NET_FPS
    height_m = (body_m[:, 0, 1] - body_m[..., 1].min(axis=1)).mean()
    way_m = np.linalg.norm(ground_m[-1] - ground_m[0])
    return float(speed), float(height_m), float(way_m)


def _thirds(values: Floats) -> Indices:
    """The third (N,) of all values (N,) that each is in."""
    if len(values) == 0:
        return np.zeros(0, np.int64)
    borders = np.quantile(values, [1 / 3, 2 / 3])
    return np.searchsorted(borders, values, side="right").astype(np.int64)


def _motifs(repertoire: Repertoire) -> list[dict[str, Any]]:
    """Each motif with the word of a take that represents it."""
    if not repertoire.has_vocabulary:
        return []
    vocabulary = repertoire.vocabulary
    shown = []
    for motif in range(vocabulary.n_motifs):
        word = int(vocabulary.motifs.words[motif])
        info = repertoire.takes[int(vocabulary.word_take[word])]
        shown.append(
            {
                "motif": motif, "words": int(vocabulary.motifs.counts[motif]), "take": info.name,
                "genre": info.credits.genre, "from_s": round(float(vocabulary.word_start_s[word]), 3),
                "to_s": round(float(vocabulary.word_end_s[word]), 3),
            }
        )  # fmt: skip
    return shown
