"""Atomic writing of files, and checksums."""

from __future__ import annotations

import hashlib
import os
import platform
import re
import reprlib
import uuid
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from choreograph.errors import ChoreographError, ParameterError


def as_path(what: str, path: object) -> Path:
    """The path of `what`; `ParameterError` for anything but text or a `Path`."""
    if not isinstance(path, str | Path):
        raise ParameterError(f"expected the path of {what}, got {reprlib.repr(path)}")
    return Path(path)


def check_target(path: str | Path) -> Path:
    """The path as a `Path`; `ParameterError` if its folder is missing or it is a folder itself."""
    path = Path(path)
    if not path.parent.is_dir():
        raise ParameterError(f"cannot write {path}: there is no folder {path.parent}")
    if path.is_dir():
        raise ParameterError(f"cannot write {path}: it is a folder")
    return path


@contextmanager
def writing(path: str | Path) -> Iterator[None]:
    """Turn an `OSError` of the body (disk full, no permission) into a `ChoreographError` on `path`."""
    try:
        yield
    except OSError as error:
        raise ChoreographError(f"cannot write {path}: {error.strerror or error}") from error


@contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """A temporary path beside `path`, renamed to it at the end and removed if anything fails.

    What killed processes left of such files is removed first.

    Raises `ParameterError` as `check_target` does, and `ChoreographError` for an `OSError` in the body or
    while renaming.
    """
    path = check_target(path)
    remove_leftovers(path)
    temporary = path.with_name(f".{path.stem}.{_writer()}-{uuid.uuid4().hex[:8]}{path.suffix}")
    try:
        with writing(path):
            yield temporary
            temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def remove_leftovers(path: Path) -> None:
    """Remove temporary files of `path` whose writers were killed on this machine."""
    machine, _ = _writer().split("-")
    pattern = re.compile(rf"\.{re.escape(path.stem)}\.{machine}-(\d+)-[0-9a-f]{{8}}{re.escape(path.suffix)}")
    with suppress(OSError):  # a folder that cannot be listed, or a file that another process removes
        for name in os.listdir(path.parent):
            left = pattern.fullmatch(name)
            if left and not is_running(int(left[1])):
                (path.parent / name).unlink(missing_ok=True)


def _writer() -> str:
    """This process in the names of its temporary files: machine and process id."""
    return f"{zlib.crc32(platform.node().encode()):08x}-{os.getpid()}"


def is_running(pid: int) -> bool:
    """Whether there is a process with this id; True where it cannot be asked without harm."""
    if os.name == "nt":  # there, signal 0 ends the process
        return True
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        return True
    return True


def sha256_of(path: str | Path) -> str:
    """SHA-256 of a file's bytes, hexadecimal."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
