"""What commands print: lines, notes on stderr, tables, progress bars, examples in help."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, nullcontext
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress

# The output of commands: lines, tables and notes, progress bars, examples in their help.
#
# Text for people is printed by `say`, or by `printable` and a `table_console`, because names of files, takes
# and joints may come from untrusted files and contain control characters.


MAX_LINE = 2000  # characters of a printed line
MAX_TABLE_WIDTH = 300
_LONG_WORD = re.compile(r"\S{501,}")  # a path or a value that may hide what is said of it
# Characters that move a terminal's cursor or change its colours, also as single bytes of names that are not
# text, characters that end lines or change the direction of writing, and those that no encoding has.
_CONTROLS = re.compile(
    "[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udc9f\udd00-\udfff]"
)


def printable(text: str) -> str:
    """The text with its control characters as escapes, such as \\x1b."""
    return _CONTROLS.sub(lambda found: found[0].encode("unicode_escape").decode("ascii"), text)


def line_of(text: str) -> str:
    """The text as a printable line of up to `MAX_LINE` characters.

    The middle of longer paths and values is left out, and then that of a longer line.
    """
    return _ends(_LONG_WORD.sub(lambda word: _ends(word[0], 200), printable(text)), MAX_LINE)


def _ends(text: str, longest: int) -> str:
    if len(text) <= longest:
        return text
    n = longest // 2 - 20
    return f"{text[:n]} [{len(text) - 2 * n} characters left out] {text[-n:]}"


def say(text: str, *, err: bool = False) -> None:
    """Print one line, on stderr if `err`."""
    click.echo(line_of(text), err=err)


def show(facts: object, lines: Iterable[str], *, as_json: bool) -> None:
    """Print facts as JSON, or what they say to people, line by line."""
    if as_json:
        click.echo(json.dumps(facts, indent=1))
    else:
        for line in lines:
            say(line)


def show_notes(notes: Iterable[str]) -> None:
    """Print the notes on stderr, one line each."""
    for note in notes:
        say(f"note: {note}", err=True)


def table_console(width: int = MAX_TABLE_WIDTH) -> Console:
    """A console that prints names unchanged, `width` characters wide if stdout is not a terminal."""
    from rich.console import Console

    console = Console(highlight=False, markup=False, emoji=False)
    console.width = min(console.width if console.is_terminal else width, MAX_TABLE_WIDTH)
    return console


def examples(*lines: str) -> str:
    """Example lines for the help of a command, which click does not wrap."""
    return "\b\n" + "\n".join(["Examples:", *(f"  {line}" for line in lines)])


class Stages:
    """A progress bar for each stage, or nothing without `progress`."""

    def __init__(self, progress: Progress | None) -> None:
        self._progress = progress
        self._bars: dict[str, Any] = {}

    def report(self, stage: str, done: int, total: int, detail: str = "") -> None:
        """Move the bar of a stage to `done` of `total`, which is 0 if it is not known."""
        if self._progress is None:
            return
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
        """Print the progress of a stage, `done` of `total`, which is 0 if it is not known."""
        say(f"{stage} {done}/{total}", err=True)


@contextmanager
def stages(*, quiet: bool) -> Iterator[Stages]:
    """Show progress on stderr while the block runs, or nothing if `quiet`, or if stderr is no terminal."""
    if quiet:
        yield Stages(None)
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description:<24}"), BarColumn(), TextColumn("{task.completed:.0f}/{task.total}"),
        TimeElapsedColumn(), TimeRemainingColumn(), TextColumn("{task.fields[detail]}", markup=False),
    )  # fmt: skip
    is_shown = console.is_terminal
    progress = Progress(*columns, console=console, disable=not is_shown)
    # Not even a disabled one is started: older versions of rich end it with a blank line.
    with progress if is_shown else nullcontext():
        yield Stages(progress)
