"""`choreograph`, the group of commands, and the output of errors, including unexpected ones."""

from __future__ import annotations

import errno
import gc
import io
import logging
import os
import platform
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from types import FrameType, TracebackType
from typing import Any

import click

from choreograph.cli.present import examples, line_of, printable, say, show_notes
from choreograph.core.errors import ChoreographError

# Unexpected exceptions: one line is printed, and the traceback goes to a log.


DEBUG_VARIABLE = "CHOREOGRAPH_DEBUG"


def report_crash(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """A `sys.excepthook` that prints the error and the path of the traceback in one line. The status is 1.

    The traceback itself is shown if CHOREOGRAPH_DEBUG is set, or if no log can be written.
    """
    traced = _printable_lines("".join(traceback.format_exception(kind, error, trace)))
    log = None if os.environ.get(DEBUG_VARIABLE) else _write_log(_about() + traced)
    if log is None or not issubclass(kind, Exception):
        print(traced, end="", file=sys.stderr)
        return
    said = " ".join(str(error).split())
    where = f"this is a bug, or a problem of this machine. The traceback is in {log}"
    shown = line_of(f"choreograph: unexpected {kind.__name__}{': ' if said else ''}{said}: {where}")
    print(shown, file=sys.stderr)


def _about() -> str:
    from choreograph.core import __version__

    about = f"choreograph {__version__}, Python {platform.python_version()}, {platform.platform()}"
    return _printable_lines(f"{about}\n{sys.argv}\n")


def _printable_lines(text: str) -> str:
    return "".join(f"{printable(line)}\n" for line in text.split("\n")[:-1])


def _write_log(text: str) -> Path | None:
    """The new file in the user's folder of logs, else in the temporary one, or None if both fail."""
    name = f"choreograph-{time.strftime('%Y%m%d-%H%M%S')}-{os.getpid()}.log"
    from platformdirs import user_log_path

    folders = [user_log_path("choreograph", appauthor=False)]
    with suppress(FileNotFoundError):  # there is no writable temporary folder
        folders.append(Path(tempfile.gettempdir()))
    for folder in filter(Path.is_absolute, folders):
        try:
            folder.mkdir(parents=True, exist_ok=True)
            path = folder / name
            with path.open("x", encoding="utf-8", errors="backslashreplace") as file:
                file.write(text)
        except OSError:
            continue
        return path
    return None


# `choreograph`, the group of commands, and the output of errors.


_COMMANDS = {
    "build-db": "build_db", "convert": "characters:convert", "count": "characters:count",
    "dance": "dance", "evaluate": "evaluate", "get": "build_db:get", "inspect": "inspect",
    "library": "inspect:library", "live": "live", "retarget": "characters:retarget", "scene": "scene",
    "settings": "inspect:settings", "songs": "inspect:songs", "studio": "studio",
}  # fmt: skip


# New objects, after which Python looks for garbage. Imports alone make 700 over and over.
_GC_THRESHOLD = 10_000


class _Commands(click.Group):
    """Imports a command when it is used, so that the others do not slow it down."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(_COMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        if name not in _COMMANDS:
            return None
        module, _, command = _COMMANDS[name].partition(":")
        found: click.Command = getattr(import_module(f"choreograph.cli.{module}"), command or "command")
        return found

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        with _printable_usage():
            return super().parse_args(ctx, args)

    def invoke(self, ctx: click.Context) -> Any:
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
                f"choreograph: {error.filename}: expected a name that this system allows, got a too long one",
                err=True,
            )
            sys.exit(2)
        except KeyboardInterrupt:
            say("choreograph: interrupted", err=True)
            sys.exit(128 + signal.SIGINT)


@contextmanager
def _printable_usage() -> Iterator[None]:
    """Make the messages of click, which quote the command line, printable lines."""
    try:
        yield
    except click.ClickException as error:
        error.message = line_of(error.message)  # type: ignore[misc]  # final, but shown as it is
        raise


@click.group(
    cls=_Commands,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
    epilog=examples(
        "choreograph dance song.mp3 --open         makes a dance and opens it in the browser",
        "choreograph build-db TAKES -o rep.h5      builds a repertoire from your motion library",
        "choreograph dance song.mp3 --db rep.h5    makes a dance from it",
    ),
)
@click.version_option(package_name="choreograph")
def main() -> None:
    """Make dances for music from a motion library, and explain every second of them."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="surrogateescape")  # names of files need not be text


class _Notes(logging.Handler):
    """Shows the log of the library as notes."""

    def emit(self, record: logging.LogRecord) -> None:
        show_notes([record.getMessage()])


def _end(number: int, _: FrameType | None) -> None:
    sys.exit(128 + number)


def run() -> None:
    """The program: `main`, with warnings of the library as notes and unexpected errors in one line."""
    sys.excepthook = report_crash
    logging.getLogger("choreograph").addHandler(_Notes())
    gc.set_threshold(_GC_THRESHOLD)
    signal.signal(signal.SIGTERM, _end)  # as SIGINT does, so that temporary files are removed
    try:
        main(prog_name="choreograph")
    finally:
        gc.freeze()  # Python would look for garbage once more at its end, for 0.2 s
