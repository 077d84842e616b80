"""Sources of takes at addresses, such as `s3://bucket/takes`, which are copied before they are read.

Needs the package `fsspec`, and for some protocols another one that it names, such as `s3fs`.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import Any

from choreograph.core.errors import ChoreographError, ParameterError
from choreograph.core.files import writing
from choreograph.core.progress import ProgressReport

_FOLDER = "fetched"  # in the work folder


def is_address(source: str | os.PathLike[str]) -> bool:
    """Whether a source is an address with a protocol, rather than a path."""
    protocol, found, _ = str(source).partition("://")
    return isinstance(source, str) and bool(found) and protocol.replace("+", "").isalnum()


@contextmanager
def local_sources(
    sources: Sequence[str | Path], work: Path, report: ProgressReport | None = None
) -> Iterator[tuple[Path, ...]]:
    """The sources as paths. What is at an address is copied to the folder `work`, and removed at the end.

    Raises `ParameterError` for an address that cannot be read, or without the package that reads it.
    """
    folder = work / _FOLDER
    try:
        yield tuple(
            _copied(source, folder / str(index), report)
            if isinstance(source, str) and is_address(source)
            else Path(source)
            for index, source in enumerate(sources)
        )
    finally:
        if folder.exists():
            shutil.rmtree(folder, ignore_errors=True)


def _copied(address: str, folder: Path, report: ProgressReport | None) -> Path:
    """The copy of a file or folder at an address, in a folder, under its own name."""
    try:
        from fsspec.core import url_to_fs
    except ImportError as error:
        raise ParameterError(
            f"{address}: expected the package fsspec to read addresses, it is not installed: pip install "
            "'choreograph[remote]'"
        ) from error
    try:
        filesystem, path = url_to_fs(address)
        is_folder = filesystem.isdir(path)
        files = sorted(filesystem.find(path)) if is_folder else [path]
        if not files or not (is_folder or filesystem.exists(path)):
            raise ParameterError(f"expected takes at {address}, got nothing: there is no such file or folder")
        name = PurePosixPath(path.rstrip("/")).name
        name = "takes" if name in ("", "..") else name
        for done, file in enumerate(files):
            inside = PurePosixPath(file).relative_to(path) if is_folder else PurePosixPath()
            _copy(filesystem, file, folder / name / _checked(inside, address))
            if report is not None:
                report("copying takes", done + 1, len(files))
    except ChoreographError:
        raise
    except Exception as error:  # each protocol raises its own
        is_clear = isinstance(error, ImportError | ValueError | OSError) and str(error)
        reason = " ".join((str(error) if is_clear else f"{type(error).__name__}: {error}").split())
        raise ParameterError(f"{address}: expected takes, could not read them: {reason}") from error
    return folder / name


def _checked(inside: PurePosixPath, address: str) -> PurePosixPath:
    if ".." in inside.parts or inside.is_absolute():
        raise ParameterError(f"{address}: expected files below it, got {str(inside)[:80]!r}")
    return inside


def _copy(filesystem: Any, file: str, target: Path) -> None:
    with writing(target):
        target.parent.mkdir(parents=True, exist_ok=True)
    try:
        filesystem.get_file(file, str(target))
    except FileNotFoundError as error:
        raise ChoreographError(f"expected {file} where it was listed, it is gone") from error
