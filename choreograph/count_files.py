"""`NAME.counts.csv`: the counts and figures of a take as a table, written by hand or by `inspect --counts`.

A row a count, in order:

    time_s,number,figure
    0.480,1,basic
    0.962,2,
    1.445,3,
    1.927,4,
    2.410,1,-

`time_s` is in seconds from the take's first frame, `number` the count in the bar (1 on the downbeat; 0 in
every row if bars are not known). The metre is the largest number. `figure`, optional, names the figure that
begins there, which lasts to the next name; "-" ends it where none follows.
"""

from __future__ import annotations

import csv
import reprlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from choreograph.counts import ANNOTATED, MAX_METRE, Counts, Figure, make_counts
from choreograph.errors import FormatError, ParameterError
from choreograph.files import atomic_path
from choreograph.tables import Row, as_number, read_table

SUFFIX = ".counts.csv"
_COLUMNS = ("time_s", "number", "figure")
_END = "-"  # no figure from here on


def read_counts(path: str | Path) -> tuple[Counts, tuple[Figure, ...]]:
    """The counts of a file, source "annotation" and confidence 1, and its figures.

    Raises `ParameterError` if there is no such file; `FormatError`, naming the line, if a column is missing
    or unknown, a cell is no number, times do not increase, or a number is not 0 to 12.
    """
    path = Path(path)
    if not path.exists():
        raise ParameterError(f"no file {path}")
    times_s: list[float] = []
    numbers: list[int] = []
    names: list[str] = []
    for row in read_table(path, "a table of counts", required=_COLUMNS[:2], optional=_COLUMNS[2:]):
        time_s, number = _number(row, "time_s"), _number(row, "number")
        if not number.is_integer() or not 0 <= number <= MAX_METRE:
            got = reprlib.repr(row.cells["number"])
            raise FormatError(f"{row.where}: expected a number from 0 to {MAX_METRE}, got {got}")
        if time_s < 0 or (times_s and time_s <= times_s[-1]):
            raise FormatError(
                f"{row.where}: expected seconds that increase from 0 on, got {time_s:g}: unsorted?"
            )
        times_s.append(time_s)
        numbers.append(int(number))
        names.append(row.cells.get("figure", ""))
    if not times_s:
        raise FormatError(f"{path}: expected a row for each count, got none")
    if min(numbers) == 0 < max(numbers):
        raise FormatError(f"{path}: expected a number in the bar in every row or 0 in every row, got both")
    return make_counts(times_s, numbers, max(numbers), source=ANNOTATED), _figures(times_s, names)


def write_counts(path: str | Path, counts: Counts, figures: Sequence[Figure] = ()) -> None:
    """Write counts and figures; a figure begins and ends on the counts nearest to where it does.

    Raises `ParameterError` if there are no counts, or the file's folder is missing.
    """
    if not len(counts):
        raise ParameterError(f"expected counts to write to {path}, got none: the take is not counted")
    names = [""] * len(counts)
    for figure in figures:
        names[_nearest(counts, figure.end_s)] = _END
    for figure in figures:
        names[_nearest(counts, figure.start_s)] = figure.name
    with atomic_path(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(_COLUMNS)
        rows = zip(counts.times_s, counts.numbers, names, strict=True)
        writer.writerows((f"{time_s:.6f}", number, name) for time_s, number, name in rows)


def _number(row: Row, column: str) -> float:
    value = as_number(row.cells[column])
    if not np.isfinite(value):
        raise FormatError(
            f"{row.where}: expected a number in {column}, got {reprlib.repr(row.cells[column])}"
        )
    return value


def _figures(times_s: Sequence[float], names: Sequence[str]) -> tuple[Figure, ...]:
    borders = [i for i, name in enumerate(names) if name]
    ends = [*borders[1:], len(times_s) - 1]
    return tuple(
        Figure(names[start], times_s[start], times_s[end], end - start)
        for start, end in zip(borders, ends, strict=False)
        if names[start] != _END and end > start
    )


def _nearest(counts: Counts, time_s: float) -> int:
    return int(np.argmin(np.abs(counts.times_s - time_s)))
