"""What commands share: notes on stderr, progress bars, examples in their help, lists of names."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from choreograph.files import read_text

if TYPE_CHECKING:
    from rich.progress import Progress


def show_notes(notes: Iterable[str]) -> None:
    """Print the notes on stderr, one line each."""
    for note in notes:
        click.echo(f"note: {note}", err=True)


def examples(*lines: str) -> str:
    """Example lines for a command's help, which click must not wrap."""
    return "\b\n" + "\n".join(["Examples:", *(f"  {line}" for line in lines)])


def given_options(*, except_for: Collection[str] = ()) -> list[str]:
    """The flags that the user gave to the running command, in the order of its help; not `except_for`."""
    context = click.get_current_context()
    return [
        max(option.opts, key=len)
        for option in context.command.params
        if option.name not in except_for
        and option.name is not None
        and context.get_parameter_source(option.name) is ParameterSource.COMMANDLINE
    ]


def names_of(given: tuple[str, ...]) -> tuple[str, ...]:
    """The names given, each @FILE replaced by the names in it; `FormatError` if one cannot be read."""
    names: list[str] = []
    for name in given:
        if not name.startswith("@"):
            names.append(name)
            continue
        lines = read_text(name[1:], "a list of names").splitlines()
        names += [line.strip() for line in lines if line.strip() and not line.startswith("#")]
    return tuple(names)


class Stages:
    """A progress bar for each stage."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._bars: dict[str, Any] = {}

    def report(self, stage: str, done: int, total: int, detail: str = "") -> None:
        """Move a stage's bar to `done` of `total` (0: not known)."""
        if stage not in self._bars:
            self._bars[stage] = self._progress.add_task(stage, total=total or None, detail="")
        self._progress.update(self._bars[stage], completed=done, total=total or None, detail=detail)

    def training(self, state: Any) -> None:
        """Show a `TrainingProgress`."""
        self.report(f"training {state.name}", state.step, state.n_steps, f"loss {state.loss:.4f}")


class StageLines:
    """A line on stderr for each report, `STAGE DONE/TOTAL`, for a program that runs this one."""

    def report(self, stage: str, done: int, total: int, detail: str = "") -> None:
        """Print how much of a stage is done, of `total` (0: not known)."""
        click.echo(f"{stage} {done}/{total}", err=True)


@contextmanager
def stages(*, quiet: bool) -> Iterator[Stages]:
    """Show progress on stderr while the block runs; nothing if `quiet`, or if stderr is no terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description:<24}"), BarColumn(), TextColumn("{task.completed:.0f}/{task.total}"),
        TimeElapsedColumn(), TimeRemainingColumn(), TextColumn("{task.fields[detail]}"),
    )  # fmt: skip
    with Progress(*columns, console=console, disable=quiet or not console.is_terminal) as progress:
        yield Stages(progress)
