"""Beats of a song from a text file, one a line, with or without their numbers in the bar.

`12.34` or `12.34 1` (a time in seconds and a number, as beat trackers write them), or `12.34 12.34 1` (start,
end and label, as label tracks of audio editors are saved), separated by spaces, tabs, commas or semicolons;
what follows a `#` is a comment. A first line of names is passed over, and so are labels that are words, such
as `beat`, where no beat has a number. Labels may count bars and beats, as in `3.1`. Where only some beats
have a number, the others count on from them.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from choreograph.counts import ANNOTATED, MAX_METRE, Counts
from choreograph.errors import FormatError
from choreograph.files import MAX_TABLE_BYTES, read_text

Floats = NDArray[np.float64]

_CELL = re.compile(r'"[^"]*"|[^\s,;"]+')
_BAR_AND_BEAT = re.compile(r"\d+\.([1-9]\d?)")
_LAYOUT = "a time in seconds and, optionally, a number in the bar on every line"


def read_beats(path: str | Path, *, start_s: float = 0.0, duration_s: float = np.inf) -> Counts:
    """Beats from a file; the metre is the highest number, 0 if there are none.

    Times in the file are those of the song file; those returned begin at `start_s`, and beats outside
    [start_s, start_s + duration_s] are left out. Raises `FormatError` if the file cannot be read, times do
    not increase, or numbers are not those of bars.
    """
    path = Path(path)
    rows = _rows(path)
    times_s = np.array([time_s for _, time_s, _ in rows])  # (Q,)
    if not np.isfinite(times_s).all() or (np.diff(times_s) <= 0).any() or (times_s < 0).any():
        raise FormatError(f"{path}: expected increasing times from 0 s on, got others: unsorted or doubled?")
    numbers, metre = _numbered(path, _numbers(path, rows))
    inside = (times_s >= start_s) & (times_s <= start_s + duration_s)
    return Counts(times_s[inside] - start_s, numbers[inside], metre, ANNOTATED, 1.0)


def _rows(path: Path) -> list[tuple[int, float, str]]:
    """Line number, time and label, "" if there is none, of each beat."""
    text = read_text(path, _LAYOUT, fallback="cp1252", max_bytes=MAX_TABLE_BYTES)
    # Label tracks have lines that begin with a backslash: frequencies of the label before.
    lines = [
        line.split("#")[0].strip(" \t\r,;")
        for line in text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    ]
    numbered = [(i, line) for i, line in enumerate(lines, start=1) if line and not line.startswith("\\")]
    if len(numbered) > 1 and not any(map(_is_number, _fields(numbered[0][1]))):
        del numbered[0]  # names of columns
    return [_parsed(path, i, line) for i, line in numbered]


def _fields(line: str) -> list[str]:
    """The cells of a line; in cells between tabs or semicolons, a comma is a decimal one."""
    separator = next((mark for mark in "\t;" if mark in line), None)
    cells = _CELL.findall(line) if separator is None else line.split(separator)
    fields = [cell.strip(' "') for cell in cells]
    return [field.replace(",", ".") for field in fields] if separator else fields


def _is_number(field: str) -> bool:
    try:
        float(field)
    except ValueError:
        return False
    return True


def _parsed(path: Path, line_number: int, line: str) -> tuple[int, float, str]:
    fields = _fields(line)
    times, label = (fields, "") if len(fields) == 1 else (fields[:-1], "".join(fields[-1:]))
    if not 1 <= len(times) <= 2 or not all(map(_is_number, times)):
        raise _unexpected(path, line_number, line)
    return line_number, float(times[0]), label


def _unexpected(path: Path, line_number: int, got: str) -> FormatError:
    return FormatError(f"{path}, line {line_number}: expected {_LAYOUT}, got {got[:40]!r}")


def _numbers(path: Path, rows: list[tuple[int, float, str]]) -> list[int | None]:
    """The number in the bar of each beat, None where there is none."""
    labels = [label for _, _, label in rows if label]
    if not any(map(_is_number, labels)):
        return [None] * len(rows)
    counted = [_BAR_AND_BEAT.fullmatch(label) for label in labels]
    if all(counted) and any(label.endswith(".1") for label in labels):
        rows = [(line, time_s, label.partition(".")[2]) for line, time_s, label in rows]
    return [_number(path, line, label) if label else None for line, _, label in rows]


def _number(path: Path, line_number: int, label: str) -> int:
    value = float(label) if _is_number(label) else np.nan
    if value not in range(1, MAX_METRE + 1):
        raise _unexpected(path, line_number, label)
    return int(value)


def _numbered(path: Path, given: list[int | None]) -> tuple[NDArray[np.int64], int]:
    """Numbers (Q,) and metre; beats without a number count on from those with one, or back to the first."""
    first = next((i for i, number in enumerate(given) if number is not None), None)
    numbers = np.zeros(len(given), np.int64)
    if first is None:
        return numbers, 0
    for i in range(first, len(given)):
        number = given[i]
        numbers[i] = numbers[i - 1] + 1 if number is None else number
    metre = int(numbers.max())
    if not 2 <= metre <= MAX_METRE:
        reason = "only downbeats?" if metre == 1 else "a downbeat may lack its 1"
        raise FormatError(f"{path}: expected bars of 2 to {MAX_METRE} beats, got {metre}: {reason}")
    numbers[:first] = (numbers[first] - 1 - np.arange(first, 0, -1)) % metre + 1
    return numbers, metre
