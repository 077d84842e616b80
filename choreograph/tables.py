"""Tables of text: CSV as this program, spreadsheets and people write it.

Cells are separated by commas, semicolons or tabs, whichever the header has most of. Column names may be in
capitals. Blank rows, blank columns without a name and a first line `sep=;` are passed over. The text is UTF-8
or UTF-16; what is neither is read as Windows-1252, which spreadsheets write. Numbers may have a decimal
comma.
"""

from __future__ import annotations

import csv
import io
import re
from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np

from choreograph.errors import FormatError
from choreograph.files import MAX_TABLE_BYTES, read_text

_SEPARATORS = ",;\t"
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+")
_SHOWN = 80  # letters of a header in an error


@dataclass(frozen=True)
class Row:
    """A row of a table."""

    where: str  # file and line, for errors
    cells: dict[str, str]  # column -> cell, without the spaces around it
    error: FormatError | None = None  # on other cells than the columns'


def read_table(
    path: Path,
    what: str,
    *,
    required: Collection[str],
    optional: Collection[str] | None = None,
    other_names: Mapping[str, str] = MappingProxyType({}),
    keep_wrong: bool = False,
) -> list[Row]:
    """The rows of a table that are not blank, each with a cell for every column that has a name.

    Without `optional`, other columns may have any name. `other_names` of columns are read as theirs.

    Raises `FormatError` as `read_text` does, and if a required column is missing, another is there twice or
    not among `optional`, or a row has more or fewer cells than the header. Such rows have `error` instead if
    they are kept.
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
    """The number in a cell, NaN if there is none."""
    try:
        return float(cell.replace(",", ".") if _DECIMAL_COMMA.fullmatch(cell) else cell)
    except ValueError:
        return np.nan


def _lines(path: Path, what: str, text: str, separator: str) -> list[tuple[int, list[str]]]:
    """Line numbers and cells of what is not blank."""
    reader = csv.reader(io.StringIO(text), delimiter=separator, skipinitialspace=True)
    try:
        lines = [(reader.line_num, [cell.strip() for cell in cells]) for cells in reader]
    except csv.Error as error:  # a cell without end, for one
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
        error = FormatError(f"{where}: expected a name of the column of {nameless[0][:_SHOWN]!r}, got ''")
    elif len(cells) < len(columns) or any(cells[len(columns) :]):
        error = FormatError(
            f"{where}: expected {len(columns)} cells, got {len(cells)}: a cell with a separator needs quotes"
        )
    return Row(where, named, error)
