"""Beats of a song from a text file, one a line, with or without their numbers in the bar.

`12.34` or `12.34 1` (a time in seconds and a number, as beat trackers write them), or `12.34 12.34 1` (start,
end and label, as label tracks of audio editors are saved), separated by spaces, tabs or commas; what follows
a `#` is a comment. Where only some beats have a number, the others count on from them.
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

_SEPARATOR = re.compile(r"[\s,;]+")
_LAYOUT = "a time in seconds and, optionally, a number in the bar on every line"


def read_beats(path: str | Path, *, start_s: float = 0.0, duration_s: float = np.inf) -> Counts:
    """Beats from a file; the metre is the highest number, 0 if there are none.

    Times in the file are those of the song file; those returned begin at `start_s`, and beats outside
    [start_s, start_s + duration_s] are left out. Raises `FormatError` if the file cannot be read, times do
    not increase, or numbers are not those of bars.
    """
    path = Path(path)
    rows = [_parsed(path, i, line) for i, line in enumerate(_lines(path), start=1) if line]
    times_s = np.array([time_s for time_s, _ in rows])  # (Q,)
    if not np.isfinite(times_s).all() or (np.diff(times_s) <= 0).any() or (times_s < 0).any():
        raise FormatError(f"{path}: expected increasing times from 0 s on, got others: unsorted or doubled?")
    numbers, metre = _numbered(path, [number for _, number in rows])
    inside = (times_s >= start_s) & (times_s <= start_s + duration_s)
    return Counts(times_s[inside] - start_s, numbers[inside], metre, ANNOTATED, 1.0)


def _lines(path: Path) -> list[str]:
    """The lines without comments and outer spaces."""
    text = read_text(path, _LAYOUT, fallback="cp1252", max_bytes=MAX_TABLE_BYTES)
    return [line.split("#")[0].strip(" \t\r,;") for line in text.split("\n")]


def _parsed(path: Path, line_number: int, line: str) -> tuple[float, int | None]:
    """Time and number, None if there is none."""
    fields = _SEPARATOR.split(line)
    try:
        values = [float(field) for field in fields]
        number = None if len(values) == 1 else int(values[-1])
        if len(values) > 3 or (number is not None and (number != values[-1] or not 1 <= number <= MAX_METRE)):
            raise ValueError(f"got {line!r}")
    except (ValueError, OverflowError) as error:
        raise FormatError(f"{path}, line {line_number}: expected {_LAYOUT}, got {line[:40]!r}") from error
    return values[0], number


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
