"""Atomic writing of files, and checksums."""

from __future__ import annotations

import hashlib
import reprlib
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
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
def atomic_path(path: str | Path) -> Iterator[Path]:
    """A temporary path beside `path`, renamed to it at the end and removed if anything fails.

    Raises `ParameterError` as `check_target` does, and `ChoreographError` for an `OSError` in the body or
    while renaming (disk full, no permission).
    """
    path = check_target(path)
    temporary = path.with_name(f".{path.stem}.{uuid.uuid4().hex[:8]}{path.suffix}")
    try:
        yield temporary
        temporary.replace(path)
    except OSError as error:
        raise ChoreographError(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        temporary.unlink(missing_ok=True)


def sha256_of(path: str | Path) -> str:
    """SHA-256 of a file's bytes, hexadecimal."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
