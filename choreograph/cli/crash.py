"""What the command line does about exceptions that nobody expected: one line, and a log of the traceback."""

from __future__ import annotations

import os
import platform
import sys
import tempfile
import time
import traceback
from contextlib import suppress
from pathlib import Path
from types import TracebackType

from choreograph.cli.present import line_of, printable

DEBUG_VARIABLE = "CHOREOGRAPH_DEBUG"


def report_crash(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """A `sys.excepthook`: says in one line what happened and where its traceback is; status 1 follows.

    The traceback itself is shown if CHOREOGRAPH_DEBUG is set, or if no log can be written.
    """
    traced = _printable_lines("".join(traceback.format_exception(kind, error, trace)))
    log = None if os.environ.get(DEBUG_VARIABLE) else _write_log(_about() + traced)
    if log is None or not issubclass(kind, Exception):
        print(traced, end="", file=sys.stderr)
        return
    said = " ".join(str(error).split())
    where = f"a fault of this program, or of this machine? The traceback is in {log}"
    shown = line_of(f"choreograph: unexpected {kind.__name__}{': ' if said else ''}{said}: {where}")
    print(shown, file=sys.stderr)


def _about() -> str:
    from choreograph._version import __version__

    about = f"choreograph {__version__}, Python {platform.python_version()}, {platform.platform()}"
    return _printable_lines(f"{about}\n{sys.argv}\n")


def _printable_lines(text: str) -> str:
    return "".join(f"{printable(line)}\n" for line in text.split("\n")[:-1])


def _write_log(text: str) -> Path | None:
    """The new file in the user's folder of logs, else in the temporary one; None if neither can be had."""
    name = f"choreograph-{time.strftime('%Y%m%d-%H%M%S')}-{os.getpid()}.log"
    for folder in _log_folders():
        try:
            folder.mkdir(parents=True, exist_ok=True)
            path = folder / name
            with path.open("x", encoding="utf-8", errors="backslashreplace") as file:
                file.write(text)
        except OSError:
            continue
        return path
    return None


def _log_folders() -> list[Path]:
    from platformdirs import user_log_path

    folders = [user_log_path("choreograph", appauthor=False)]
    with suppress(FileNotFoundError):  # no temporary folder can be written
        folders.append(Path(tempfile.gettempdir()))
    return [folder for folder in folders if folder.is_absolute()]
