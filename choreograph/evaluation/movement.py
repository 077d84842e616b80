"""How a repertoire moves, beside the ranges of real dancing.

Every measure describes one window of a take by one number (`evaluation.movement_measures`). A genre of a
repertoire is described by the median of its windows, and it is inside the real range if that lies between the
5th and the 95th percentile of the windows of real takes. The ranges are in `movement_ranges.json`, which
`research/movement_ranges.py` makes. They are numbers that say nothing of single takes.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files

import numpy as np

from choreograph.core.arguments import check_kind
from choreograph.core.numerics import default_numerics
from choreograph.evaluation.movement_measures import MEASURES, measured, windows_of
from choreograph.library.repertoire import Repertoire


@dataclass(frozen=True)
class Range:
    """The values of a measure in real dancing: percentiles of windows."""

    low: float
    """5th percentile."""

    median: float
    """Median."""

    high: float
    """95th percentile."""

    def holds(self, value: float) -> bool:
        """Whether a value is inside the range."""
        return self.low <= value <= self.high


ALL_REAL = "all"  # genres of the real takes together


def real_ranges() -> dict[str, dict[str, Range]]:
    """The ranges of real dancing by genre and measure. `ALL_REAL` are all genres."""
    text = files("choreograph.evaluation").joinpath("movement_ranges.json").read_text(encoding="utf-8")
    return {
        genre: {name: Range(*values) for name, values in of_genre.items()}
        for genre, of_genre in json.loads(text)["ranges"].items()
    }


@dataclass(frozen=True)
class Cell:
    """A measure of a genre beside the real range."""

    genre: str
    """Name of the genre."""

    measure: str
    """Name of the measure."""

    unit: str
    """Unit of the values."""

    value: float
    """Median of the windows."""

    real: Range
    """The range of real takes."""

    of_genre: bool
    """Whether the range is that of real takes of the same genre."""

    @property
    def is_inside(self) -> bool:
        """Whether the value is inside the real range."""
        return self.real.holds(self.value)


@default_numerics()
def movement(repertoire: Repertoire) -> tuple[Cell, ...]:
    """Compare how each genre of a repertoire moves with real dancing.

    Measures that a genre cannot have, such as copies of bars without counts, are left out.

    Raises `RepertoireError` if the file is damaged, and `ParameterError` if it is not a `Repertoire`.

    Examples
    --------
    >>> cells = cg.movement(cg.starter_repertoire())
    >>> sorted({cell.genre for cell in cells})[:3]
    ['Charleston', 'Viennese waltz', 'cha-cha']
    >>> len([cell for cell in cells if cell.genre == "waltz"])
    44
    """
    check_kind("a repertoire", repertoire, Repertoire)
    return cells_beside(real_ranges(), repertoire)


def cells_beside(ranges: Mapping[str, Mapping[str, Range]], repertoire: Repertoire) -> tuple[Cell, ...]:
    """As `movement`, with other ranges by genre and measure."""
    values: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    for take, info in enumerate(repertoire.takes):
        for window in windows_of(repertoire.body_pos_m(take), repertoire.counts(take)):
            for name, value in measured(window).items():
                if np.isfinite(value):
                    values[info.credits.genre][name].append(value)
    cells = []
    for genre in sorted(values):
        own = ranges.get(genre, {})
        for name, (unit, _) in MEASURES.items():
            if values[genre][name] and (name in own or name in ranges[ALL_REAL]):
                real = own.get(name) or ranges[ALL_REAL][name]
                cells.append(
                    Cell(genre, name, unit, float(np.median(values[genre][name])), real, name in own)
                )
    return tuple(cells)


def movement_table(cells: Sequence[Cell]) -> list[str]:
    """A line for each measure with the range of all real takes, and the value of each genre.

    A value outside of the range of its cell is marked with a star. The first lines are the shares of cells
    inside.
    """
    genres = list(dict.fromkeys(cell.genre for cell in cells))
    by_name: dict[str, dict[str, Cell]] = defaultdict(dict)
    for cell in cells:
        by_name[cell.measure][cell.genre] = cell
    own = [cell.is_inside for cell in cells if cell.of_genre]
    inside = (
        f"{np.mean([cell.is_inside for cell in cells]):.2f} of {len(cells)} values are inside the real range"
    )
    lines = [
        inside + (f", {np.mean(own):.2f} of the {len(own)} with a range of their own genre" if own else "")
    ]
    width = max(len(name) for name in MEASURES) + 8
    columns = [max(len(genre), 8) for genre in genres]
    head = "  ".join(f"{genre or '-':>{column}}" for genre, column in zip(genres, columns, strict=True))
    lines.append(f"{'':<{width}}  {'real, all':>15}  {head}")
    everywhere = real_ranges()[ALL_REAL]
    for name, of_name in by_name.items():
        unit, real = MEASURES[name][0], everywhere.get(name)
        text = "" if real is None else f"{real.low:.3g} to {real.high:.3g}"
        values = [
            f"{_marked(of_name.get(genre)):>{column}}" for genre, column in zip(genres, columns, strict=True)
        ]
        lines.append(f"{name + (f', {unit}' if unit else ''):<{width}}  {text:>15}  {'  '.join(values)}")
    lines.append("* outside of the range, which is that of real takes of the genre where there are enough")
    return lines


def _marked(cell: Cell | None) -> str:
    return "-" if cell is None else f"{cell.value:.3g}{' ' if cell.is_inside else '*'}"
