"""Tables as spreadsheets write them, and `NAME.counts.csv`, the counts and figures of a take."""

from __future__ import annotations

import csv
import io
import os
import re
import reprlib
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np

from choreograph.core.counts import ANNOTATED, MAX_METRE, Counts, Figure, make_counts
from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.files import MAX_TABLE_BYTES, atomic_path, read_text
from choreograph.motion.motion import Take

# Tables of text.
#
# Cells are separated by commas, semicolons or tabs, whichever is most frequent in the header. Column names
# may be in capitals. Blank rows, blank columns without a name and a first line `sep=;` are ignored. The text
# is in UTF-8 or UTF-16, or else in Windows-1252, which spreadsheets write. Numbers may have a decimal comma.


_SEPARATORS = ",;\t"
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+")
_SHOWN = 80  # characters of a header in an error


@dataclass(frozen=True)
class Row:
    """A row of a table."""

    where: str  # file and line, for errors
    cells: dict[str, str]  # by column, without spaces around them
    error: FormatError | None = None  # if there are more or fewer cells than columns


def read_table(
    path: Path,
    what: str,
    *,
    required: Collection[str],
    optional: Collection[str] | None = None,
    other_names: Mapping[str, str] = MappingProxyType({}),
    keep_wrong: bool = False,
) -> list[Row]:
    """The rows of a table that are not blank, each with a cell for every named column.

    If `optional` is None, further columns may have any name. `other_names` are synonyms of columns. Rows with
    more or fewer cells than the header raise an error, or have it as `error` if `keep_wrong` is true.

    Raises `FormatError` as `read_text` does, and if a required column is missing, or a column occurs twice or
    is not among `optional`.
    """
    text = read_text(path, what, fallback="cp1252", max_bytes=MAX_TABLE_BYTES)
    text = text.replace("\0", "").replace("\r\n", "\n").replace("\r", "\n")  # the csv module fails on NUL
    first = next((line for line in text.split("\n") if line.strip()), "")
    states_separator = len(first) == len("sep=;") and first.lower().startswith("sep=")
    separator = first[-1] if states_separator else max(_SEPARATORS, key=first.count)
    lines = _lines(path, what, text, separator)[int(states_separator) :]
    columns = ["_".join(re.split(r"[\s_-]+", name.lower())) for name in lines[0][1]] if lines else []
    columns = [other_names.get(name, name) for name in columns]
    while columns and not columns[-1]:
        columns.pop()
    _check_columns(path, what, [name for name in columns if name], required, optional)
    rows = [_row(f"{path}, line {line}", columns, cells) for line, cells in lines[1:]]
    for row in rows:
        if row.error is not None and not keep_wrong:
            raise row.error
    return rows


def as_number(cell: str) -> float:
    """The number in a cell, NaN if it is not a number."""
    try:
        return float(cell.replace(",", ".") if _DECIMAL_COMMA.fullmatch(cell) else cell)
    except ValueError:
        return np.nan


def _lines(path: Path, what: str, text: str, separator: str) -> list[tuple[int, list[str]]]:
    """Line numbers and cells of rows that are not blank."""
    reader = csv.reader(io.StringIO(text), delimiter=separator, skipinitialspace=True)
    try:
        lines = [(reader.line_num, [cell.strip() for cell in cells]) for cells in reader]
    except csv.Error as error:  # such as a cell without an end
        raise FormatError(f"{path}, line {reader.line_num}: expected {what}, got {error}") from None
    return [(line, cells) for line, cells in lines if any(cells)]


def _check_columns(
    path: Path, what: str, columns: list[str], required: Collection[str], optional: Collection[str] | None
) -> None:
    known = ", ".join(required) + (f" and any of {', '.join(optional)}" if optional else "")
    wrong = [f"no {name}" for name in required if name not in columns]
    wrong += [f"{name!r} twice" for name, n_times in Counter(columns).items() if n_times > 1]
    if optional is not None:
        wrong += [repr(name[:_SHOWN]) for name in columns if name not in (*required, *optional)]
    if wrong:
        raise FormatError(f"{path}: expected {what} with the header {known}, got {wrong[0]}")


def _row(where: str, columns: list[str], cells: list[str]) -> Row:
    named = {column: cell for column, cell in zip(columns, cells, strict=False) if column}
    nameless = [cell for column, cell in zip(columns, cells, strict=False) if cell and not column]
    error = None
    if nameless:
        error = FormatError(f"{where}: expected a name for the column of {nameless[0][:_SHOWN]!r}, got ''")
    elif len(cells) < len(columns) or any(cells[len(columns) :]):
        error = FormatError(
            f"{where}: expected {len(columns)} cells, got {len(cells)}: a cell with a separator needs quotes"
        )
    return Row(where, named, error)


# `NAME.counts.csv`: the counts and figures of a take, written by hand or by `inspect --counts`.
#
# There is a row for each count, in order:
#
#     time_s,number,figure
#     0.480,1,basic
#     0.962,2,
#     1.445,3,
#     1.927,4,
#     2.410,1,-
#
# `time_s` is in seconds from the first frame of the take. `number` is the count in the bar, 1 on the
# downbeat, or 0 in every row if bars are not known. The metre is the largest number. The optional `figure`
# names the figure that begins there and lasts to the next name. "-" ends a figure that no other follows.


SUFFIX = ".counts.csv"
_COLUMNS = ("time_s", "number", "figure")
_END = "-"


def read_counts(path: str | Path) -> tuple[Counts, tuple[Figure, ...]]:
    """The counts of a file, with source "annotation" and confidence 1, and its figures.

    Raises `ParameterError` if the file does not exist. Raises `FormatError`, with the line, if a column is
    missing or unknown, a cell is not a number, times do not increase, or a number is not from 0 to 12.
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
                f"{row.where}: expected increasing seconds of 0 or more, got {time_s:g}: unsorted?"
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
    """Write counts and figures. A figure begins and ends at the nearest counts.

    Raises `ParameterError` if there are no counts, or the folder is missing.
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


_BEYOND_S = 0.1  # the last count may be annotated a little after the last frame


def with_counts_beside(take: Take) -> Take:
    """The take with the counts in NAME.counts.csv beside its motion, if there is such a file.

    They replace those of a data set, but not those of a manifest. Raises `FormatError` if the file is
    damaged.
    """
    if take.counts.source == ANNOTATED or not take.source_paths:
        return take
    beside = take.source_paths[0].with_suffix(SUFFIX)
    return with_counts_of(take, beside) if os.path.exists(beside) else take


def with_counts_of(take: Take, path: Path) -> Take:
    """The take with the counts of a file. Raises `FormatError` if it is damaged or of another take."""
    counts, figures = read_counts(path)
    check_within(take, counts, str(path))
    return replace(take, counts=counts, figures=figures, source_paths=(*take.source_paths, path))


def check_within(take: Take, counts: Counts, where: str) -> None:
    """Raise `FormatError` if a count is outside of the take."""
    if counts.times_s[0] < 0 or counts.times_s[-1] > take.motion.duration_s + _BEYOND_S:
        raise FormatError(
            f"{where}: expected counts within the {take.motion.duration_s:.2f} s of {take.name}, got "
            f"{counts.times_s[0]:.2f} to {counts.times_s[-1]:.2f} s: times are from the first frame of the "
            "take, not of the song"
        )
