"""`choreograph`: the group of commands, and how errors are shown."""

from __future__ import annotations

import errno
import io
import logging
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module

import click

from choreograph.cli.crash import report_crash
from choreograph.cli.present import examples, line_of, say, show_notes
from choreograph.errors import ChoreographError

_COMMANDS = {
    "build-db": "build_db", "build-starter": "build_starter", "convert": "characters:convert",
    "dance": "dance", "evaluate": "evaluate", "inspect": "inspect", "retarget": "characters:retarget",
    "songs": "songs", "study": "study",
}  # fmt: skip


class _Commands(click.Group):
    """Imports a command when it is used, so that the others do not slow it down."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(_COMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        if name not in _COMMANDS:
            return None
        module, _, command = _COMMANDS[name].partition(":")
        return getattr(import_module(f"choreograph.cli.{module}"), command or "command")

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        with _printable_usage():
            return super().parse_args(ctx, args)

    def invoke(self, ctx: click.Context):
        try:
            with _printable_usage():
                return super().invoke(ctx)
        except ChoreographError as error:
            for line in error.lines:
                say(f"choreograph: {' '.join(line.split())}", err=True)
            sys.exit(2)
        except OSError as error:
            if error.errno != errno.ENAMETOOLONG:
                raise
            say(
                f"choreograph: {error.filename}: expected a name that this system allows, got a longer one",
                err=True,
            )
            sys.exit(2)
        except KeyboardInterrupt:
            say("choreograph: interrupted", err=True)
            sys.exit(128 + signal.SIGINT)


@contextmanager
def _printable_usage() -> Iterator[None]:
    """Make click's own messages, which quote what was typed, printable lines."""
    try:
        yield
    except click.ClickException as error:
        error.message = line_of(error.message)  # type: ignore[misc]  # final, but shown as it is
        raise


@click.group(
    cls=_Commands,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog=examples(
        "choreograph dance song.mp3 --open         dances with the built-in takes, shows it in the browser",
        "choreograph build-db TAKES -o rep.h5      makes a repertoire of your own motion library",
        "choreograph dance song.mp3 --db rep.h5    dances with it",
    ),
)
@click.version_option(package_name="choreograph")
def main() -> None:
    """Make dances for music from a motion library, and explain every second of them."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="surrogateescape")  # names of files need not be text


class _Notes(logging.Handler):
    """Shows what the library logs as notes."""

    def emit(self, record: logging.LogRecord) -> None:
        show_notes([record.getMessage()])


def run() -> None:
    """The program: `main`, with the library's warnings as notes, and the unexpected in one line."""
    sys.excepthook = report_crash
    logging.getLogger("choreograph").addHandler(_Notes())
    main(prog_name="choreograph")
