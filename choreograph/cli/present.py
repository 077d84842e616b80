"""Functions shared by commands: kinds of options, notes on stderr, progress bars, examples in help."""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from choreograph.core.errors import ParameterError
from choreograph.core.files import check_apart, read_text
from choreograph.core.settings import from_texts
from choreograph.core.timebase import parse_seconds

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress

    _Floats = click.ParamType[float]
else:
    _Floats = click.ParamType  # not generic in every click

# The output of commands: lines, tables and notes, progress bars, examples in their help.
#
# Text for people is printed by `say`, or by `printable` and a `table_console`, because names of files, takes
# and joints may come from untrusted files and contain control characters.


MAX_LINE = 300  # characters of a printed line
_CUT = 130, 130  # characters at both ends of a line that is longer
# Characters that move a terminal's cursor or change its colours, also as single bytes of names that are not
# text, and characters that end lines or change the direction of writing.
_CONTROLS = re.compile("[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\udc80-\udc9f]")


def printable(text: str) -> str:
    """The text with its control characters as escapes, such as \\x1b."""
    return _CONTROLS.sub(lambda found: found[0].encode("unicode_escape").decode("ascii"), text)


def line_of(text: str) -> str:
    """The text as a printable line of up to `MAX_LINE` characters. The middle of a longer one is left out."""
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
    """A console that prints names unchanged, `width` characters wide if stdout is not a terminal."""
    from rich.console import Console

    console = Console(highlight=False, markup=False, emoji=False)
    console.width = min(console.width if console.is_terminal else width, MAX_LINE)
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


# Options shared by commands: options given once, times, names from files, and the formats of an option.


# Options of the command line by the option of `Dance.save` that they are for.
_SAVE_OPTIONS = {
    "character": ("--character",),
    "bvh": ("--names", "--units", "--rest", "--in-place"),
    "loop": ("--loop",),
    "click": ("--click",),
    "camera": ("--camera",),
    "target": ("--for",),
}

_NAMES_OR_FILES = {"beats", "config", "motifs", "signature"}  # options that take either


class Command(click.Command):
    """A command that raises an error for a repeated option, unless it is repeatable. Click uses the last."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse as click does. Raises `ParameterError` for an option that is given twice."""
        _, _, given = self.make_parser(ctx).parse_args(list(args))
        for option in given:
            repeatable = not isinstance(option, click.Option) or option.multiple or option.count
            if not repeatable and given.count(option) > 1:
                raise ParameterError(f"expected {_flag(option)} once, got it {given.count(option)} times")
        return super().parse_args(ctx, args)


class Seconds(_Floats):
    """A time, in seconds (`75.5`) or with minutes and hours (`1:15.5`)."""

    name = "seconds"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """The time in seconds. Reports a value that is no time as click does."""
        try:
            return parse_seconds(value) if isinstance(value, str) else float(value)
        except ParameterError as error:
            self.fail(str(error), param, ctx)


def given_options(*, of_kind: type[click.Option] = click.Option) -> list[str]:
    """The flags of a kind that the user gave to the running command, in the order of its help."""
    context = click.get_current_context()
    return [
        _flag(option)
        for option in context.command.params
        if isinstance(option, of_kind)
        and option.name is not None
        and context.get_parameter_source(option.name) is ParameterSource.COMMANDLINE
    ]


def given_settings(cls: type, options: Mapping[str, Any], assigned: Sequence[str]) -> dict[str, Any]:
    """The settings of a class that were given by options, which are then not None, or by --set.

    Raises `ParameterError` for one that was given both ways, and as `core.settings.from_texts`.
    """
    given = {name: value for name, value in options.items() if value is not None}
    values = from_texts(cls, assigned)
    for name in sorted(set(given) & set(values)):
        raise ParameterError(f"expected {name} once, got --{name.replace('_', '-')} and --set {name}")
    return {**given, **values}


def input_files(*, except_for: Collection[str], with_songs: Collection[str] = ()) -> list[Path]:
    """The files and folders that the running command reads.

    They are the paths in its arguments and options, except the outputs, `except_for`. The options
    `with_songs` may name a motion file, with which the song beside it is read as well.
    """
    from choreograph.formats.folder import SongsByName
    from choreograph.formats.register import read_beside

    files: list[Path] = []
    for name, given in click.get_current_context().params.items():
        values = () if name in except_for else given if isinstance(given, tuple) else (given,)
        if name == "assigned":  # NAME=VALUE, which may be a file
            values = tuple(Path(value.partition("=")[2].strip() or "=") for value in values)
        lists = [Path(value[1:]) for value in values if isinstance(value, str) and value.startswith("@")]
        named = [
            Path(value) for value in values if isinstance(value, Path) or (value and name in _NAMES_OR_FILES)
        ]
        found = [path for path in (*lists, *named) if os.path.exists(path)]
        files += [*found, *(file for path in found for file in read_beside(path))]
        if name in with_songs:
            songs = (SongsByName.in_folder(path.parent).of(path.stem) for path in found)
            files += filter(None, songs)
    return files


def check_outputs_apart(
    outputs: Sequence[Path | None], *, named_by: Collection[str], with_songs: Collection[str] = ()
) -> None:
    """Raise `ParameterError` before any work if an output is an input or another output of the command.

    `outputs` are the requested files, given by the options `named_by`. `with_songs` is as for `input_files`.
    """
    check_apart(
        [path for path in outputs if path is not None],
        input_files(except_for=named_by, with_songs=with_songs),
    )


def _flag(option: click.Parameter) -> str:
    return max(option.opts, key=len)


def names_of(given: tuple[str, ...]) -> tuple[str, ...]:
    """The names given, each @FILE replaced by the names in it. Raises `FormatError` if one cannot be read."""
    names: list[str] = []
    for name in given:
        if not name.startswith("@"):
            names.append(name)
            continue
        lines = read_text(name[1:], "a list of names").splitlines()
        names += [line.strip() for line in lines if line.strip() and not line.startswith("#")]
    return tuple(names)


def check_output_options(outputs: Sequence[Path]) -> tuple[str, ...]:
    """A note on the options that some of the files do not use, or none if all files use all of them.

    Raises `ParameterError` for an option that no file uses, and for a character together with USD files,
    which would contain the mannequin.
    """
    from choreograph.pipeline.saving import format_of, used_by

    formats = list(dict.fromkeys(format_of(path) for path in outputs))
    given = set(given_options())
    without: dict[tuple[str, ...], list[str]] = {}  # formats -> flags that have no effect on them
    for option, flags in _SAVE_OPTIONS.items():
        asked = [flag for flag in flags if flag in given]
        unused = tuple(format for format in formats if format not in used_by(option))
        if asked and len(unused) == len(formats):
            raise ParameterError(
                f"expected {_suffixes(used_by(option), 'or')} for {_listed(asked, 'and')}, got "
                f"{_suffixes(formats, 'and')}: add -o NAME.{used_by(option)[0]}"
            )
        if option == "character" and asked and {"usda", "usdc"} & set(unused):
            raise ParameterError(
                "expected no USD file with --character, got one: characters are only "
                f"written to {_suffixes(used_by(option), 'and')}"
            )
        if asked and unused:
            without.setdefault(unused, []).extend(asked)
    parts = []
    for others, useless in without.items():
        verb = "have" if len(useless) > 1 else "has"
        parts.append(f"{_listed(useless, 'and')} {verb} no effect on {_suffixes(others, 'and')}")
    return ("; ".join(parts),) if parts else ()


def _suffixes(formats: Sequence[str], word: str) -> str:
    return _listed([f".{format}" for format in formats], word)


def _listed(items: Sequence[str], word: str) -> str:
    return f" {word} ".join(part for part in (", ".join(items[:-1]), items[-1]) if part)
