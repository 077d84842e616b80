"""Runs `choreograph` as a user does, and checks how it fails, and that it says which files it uses.

While a command runs, each file that Python opens is compared with what the command declares: a file that was
there before is read only if it is an input, and replaced only if it is an output.
"""

import os
import re
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import click
from click.testing import CliRunner, Result

from choreograph.cli import declared
from choreograph.cli.main import main

_NEW = re.compile(r"-new(-\d+)?(?=\.\w+$)")  # in a name that is taken instead of that of another file
_WRITES = os.O_WRONLY | os.O_RDWR
_FOLDER = os.path.realpath(os.path.join(tempfile.gettempdir(), "pytest-of-"))  # of the files of tests


def run(*arguments: object) -> Result:
    """The result of `choreograph ARGUMENTS`."""
    with _watched():
        return CliRunner().invoke(main, [str(argument) for argument in arguments])


def all_commands() -> dict[str, click.Command]:
    """Every command by the words that run it."""
    found: dict[str, click.Command] = {}
    context = click.Context(main)
    for name in main.list_commands(context):
        command = main.get_command(context, name)
        if isinstance(command, click.Group):
            found |= {f"{name} {sub}": one for sub, one in command.commands.items()}
        elif command is not None:
            found[name] = command
    return found


def assert_one_line(result: Result, *, says: str) -> None:
    """Exit status 2, and one line on stderr that says what was wrong."""
    assert result.exit_code == 2, result.output
    lines = result.stderr.strip().splitlines()
    assert len(lines) == 1, result.stderr
    assert says in lines[0], lines[0]
    assert "Traceback" not in result.output


class _Watch:
    """The files that were there before a command opens them: those that it reads, and those it replaces."""

    def __init__(self) -> None:
        self.read: set[str] = set()
        self.replaced: set[str] = set()
        self.made: set[str] = set()
        self.inputs: list[Path] = []
        self.outputs: list[Path] = []

    def opened(self, path: object, flags: int) -> None:
        self._found(path, self.read if not flags & _WRITES else self.replaced)

    def renamed(self, path: object) -> None:
        self._found(path, self.replaced)

    def _found(self, path: object, into: set[str]) -> None:
        if not isinstance(path, str | bytes | os.PathLike):
            return
        name = os.path.realpath(os.fsdecode(path))
        if not name.startswith(_FOLDER) or name in self.made:
            return
        if os.path.isfile(name):
            into.add(name)
        else:
            self.made.add(name)

    def check(self) -> None:
        """No file of others was used that the command does not declare."""
        read, written = ([os.path.realpath(one) for one in of] for of in (self.inputs, self.outputs))
        for name in sorted(self.read):
            assert _is_among(name, [*read, *written]), f"{name} is read, and no input: {read}"
        for name in sorted(self.replaced):
            assert _is_among(name, written), f"{name} is replaced, and no output: {written}"


def _is_among(name: str, known: list[str]) -> bool:
    name = _NEW.sub("", name)
    # Beside an output is its work folder, such as a.h5.build.
    return any(name == one or name.startswith((one + os.sep, f"{one}.")) for one in known)


_watch: _Watch | None = None


def _hook(event: str, arguments: tuple[object, ...]) -> None:
    if _watch is None:
        return
    if event == "open":
        path, _, flags = arguments
        _watch.opened(path, flags)
    elif event == "os.rename":
        _watch.renamed(arguments[1])


sys.addaudithook(_hook)


@contextmanager
def _watched() -> Iterator[None]:
    global _watch
    found, invoke = _Watch(), declared.Command.invoke

    def watched(self: declared.Command, context: object) -> object:
        global _watch
        found.inputs = declared.inputs()
        found.outputs = [*declared.outputs(), *declared.default_outputs()]
        _watch = found
        try:
            return invoke(self, context)
        finally:
            _watch = None

    declared.Command.invoke = watched
    try:
        yield
    finally:
        declared.Command.invoke = invoke
    found.check()
