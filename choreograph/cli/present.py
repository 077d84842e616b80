"""What commands show: lines, tables and notes, progress bars, examples in their help.

What is printed for people goes through `say`, or through `printable` to a `table_console`: names of files,
takes and joints may come from strangers and hold control characters.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress

MAX_LINE = 300  # characters of a printed line
_CUT = 130, 130  # characters at both ends of a line that is longer
# What moves a terminal's cursor or changes its colours, also as single bytes of names that are no text; what
# ends lines; what changes the direction of writing.
_CONTROLS = re.compile("[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\udc80-\udc9f]")


def printable(text: str) -> str:
    """The text with its control characters as escapes, such as \\x1b."""
    return _CONTROLS.sub(lambda found: found[0].encode("unicode_escape").decode("ascii"), text)


def line_of(text: str) -> str:
    """The text as a printable line of up to `MAX_LINE` characters; the middle of a longer one is left out."""
    text = printable(text)
    if len(text) <= MAX_LINE:
        return text
    first, last = _CUT
    return f"{text[:first]} [{len(text) - first - last} characters left out] {text[-last:]}"


def say(text: str, *, err: bool = False) -> None:
    """Print one line, on stderr if `err`."""
    click.echo(line_of(text), err=err)


def show_notes(notes: Iterable[str]) -> None:
    """Print the notes on stderr, one line each."""
    for note in notes:
        say(f"note: {note}", err=True)


def table_console(width: int = MAX_LINE) -> Console:
    """A console that takes names as they are; `width` characters wide where stdout is no terminal."""
    from rich.console import Console

    console = Console(highlight=False, markup=False, emoji=False)
    console.width = min(console.width if console.is_terminal else width, MAX_LINE)
    return console


def examples(*lines: str) -> str:
    """Example lines for a command's help, which click must not wrap."""
    return "\b\n" + "\n".join(["Examples:", *(f"  {line}" for line in lines)])


class Stages:
    """A progress bar for each stage."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._bars: dict[str, Any] = {}

    def report(self, stage: str, done: int, total: int, detail: str = "") -> None:
        """Move a stage's bar to `done` of `total` (0: not known)."""
        if stage not in self._bars:
            self._bars[stage] = self._progress.add_task(stage, total=total or None, detail="")
        self._progress.update(
            self._bars[stage], completed=done, total=total or None, detail=printable(detail)
        )

    def training(self, state: Any) -> None:
        """Show a `TrainingProgress`."""
        self.report(f"training {state.name}", state.step, state.n_steps, f"loss {state.loss:.4f}")


class StageLines:
    """A line on stderr for each report, `STAGE DONE/TOTAL`, for a program that runs this one."""

    def report(self, stage: str, done: int, total: int, detail: str = "") -> None:
        """Print how much of a stage is done, of `total` (0: not known)."""
        say(f"{stage} {done}/{total}", err=True)


@contextmanager
def stages(*, quiet: bool) -> Iterator[Stages]:
    """Show progress on stderr while the block runs; nothing if `quiet`, or if stderr is no terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description:<24}"), BarColumn(), TextColumn("{task.completed:.0f}/{task.total}"),
        TimeElapsedColumn(), TimeRemainingColumn(), TextColumn("{task.fields[detail]}", markup=False),
    )  # fmt: skip
    with Progress(*columns, console=console, disable=quiet or not console.is_terminal) as progress:
        yield Stages(progress)
