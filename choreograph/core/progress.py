"""Progress reports, numbers with plurals, representations of objects on one line, and HTML tables."""

from __future__ import annotations

import reprlib
from collections.abc import Callable, Sequence
from dataclasses import MISSING, fields, is_dataclass
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

REPR_CHARACTERS = 120  # of one line
_SIMPLE = (str, int, float, bool, Path, type(None))

# Called with the name of the stage, the steps that are done and their total, which is 0 if it is not known.
ProgressReport = Callable[[str, int, int], None]
StepReport = Callable[[int, int], None]  # the same for one stage


def substage(report: ProgressReport | None, stage: str) -> StepReport | None:
    """The report of one stage, or None without a report."""
    return None if report is None else lambda done, total: report(stage, done, total)


def part(report: StepReport | None, start: int, stop: int, total: int) -> StepReport | None:
    """The report of a part of a stage, from step `start` to `stop` of `total`, or None without a report."""
    if report is None:
        return None
    return lambda done, steps: report(start + (stop - start) * done // steps, total)


def counted(number: int, one: str, several: str = "") -> str:
    """A number with its noun, such as "1 take" or "2,048 clips". `several` is an irregular plural."""
    return f"{number:,} {one if number == 1 else several or one + 's'}"


def one_line(instance: Any) -> str:
    """Return the class and the fields that differ from their defaults, on one line of 120 characters.

    Arrays are shown by their shape, long collections by their length. Fields that do not fit are counted.
    """
    shown = [
        f"{field.name}={_brief(getattr(instance, field.name))}"
        for field in fields(instance)
        if field.repr and not _is_default(getattr(instance, field.name), field)
    ]
    for n_shown in range(len(shown), -1, -1):
        left = len(shown) - n_shown
        parts = [*shown[:n_shown], *([f"{left} more" if n_shown else counted(left, "field")] if left else [])]
        line = f"{type(instance).__name__}({', '.join(parts)})"
        if len(line) <= REPR_CHARACTERS:
            break
    return line


def _is_default(value: Any, field: Any) -> bool:
    default = field.default if field.default_factory is MISSING else field.default_factory()
    if isinstance(value, tuple | dict):
        return type(value) is type(default) and not value and not default
    return isinstance(value, _SIMPLE) and type(value) is type(default) and value == default


def _brief(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"<array {value.shape}>"
    if isinstance(value, tuple | list | dict) and len(value) > 3:
        return f"<{len(value)} items>"
    if isinstance(value, _SIMPLE) or is_dataclass(value):
        return reprlib.repr(value) if isinstance(value, str) else repr(value)
    return reprlib.repr(value).replace("\n", " ")


def cut_line(line: str) -> str:
    """A representation such as "<Repertoire rep.h5>", shortened to one line of 120 characters."""
    return line if len(line) <= REPR_CHARACTERS else f"{line[: REPR_CHARACTERS - 4]}...>"


# A small HTML table, for notebooks.


def html_table(caption: str, header: Sequence[str], rows: Sequence[Sequence[str]], *, max_rows: int) -> str:
    """The table as HTML with all text escaped, and after `max_rows` rows the number of those left out."""
    head = "".join(f"<th>{escape(text)}</th>" for text in header)
    body = "".join(f"<tr>{''.join(f'<td>{escape(t)}</td>' for t in row)}</tr>" for row in rows[:max_rows])
    if len(rows) > max_rows:
        body += f'<tr><td colspan="{len(header)}">… and {len(rows) - max_rows:,} more</td></tr>'
    top = f"<caption>{escape(caption)}</caption><thead><tr>{head}</tr></thead>"
    return f"<table>{top}<tbody>{body}</tbody></table>"
