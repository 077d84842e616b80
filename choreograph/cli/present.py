"""What commands show: notes on stderr, progress bars where somebody watches."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn


def show_notes(notes: Iterable[str]) -> None:
    """One line each on stderr."""
    for note in notes:
        click.echo(f"note: {note}", err=True)


def examples(*lines: str) -> str:
    """Lines of a command's help that click must not wrap."""
    return "\b\n" + "\n".join(["Examples:", *(f"  {line}" for line in lines)])


class Stages:
    """A progress bar a stage; nothing at all where stderr is no terminal or `quiet` is asked for."""

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


@contextmanager
def stages(*, quiet: bool) -> Iterator[Stages]:
    """Progress on stderr while the block runs."""
    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description:<24}"), BarColumn(), TextColumn("{task.completed:.0f}/{task.total}"),
        TimeElapsedColumn(), TimeRemainingColumn(), TextColumn("{task.fields[detail]}"),
    )  # fmt: skip
    with Progress(*columns, console=console, disable=quiet or not console.is_terminal) as progress:
        yield Stages(progress)
