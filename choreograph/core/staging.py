"""Inputs that are sent together with the files that they name, to a machine that does not have the files.

There, the files lie below a temporary folder, under the paths that they have here. The absolute paths of an
input are changed before the work, and those of the result are changed back, in its messages as well.
"""

from __future__ import annotations

import io
import os
import pickle
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path, PurePath
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

from choreograph.core.errors import ParameterError

_MOST_BYTES = 1 << 30  # of a file

_Input = TypeVar("_Input")


@dataclass(frozen=True)
class Staged:
    """An input and the files that it names."""

    content: bytes  # the pickled input
    files: tuple[tuple[str, bytes], ...]  # path here, and content


def staged(one: object, files: Iterable[Path]) -> Staged:
    """An input with its files. Those that do not exist are left out, as where the input was made.

    Raises `ParameterError` for a file of more than a GiB.
    """
    contents = []
    for file in files:
        if not file.is_file():
            continue
        if (size := file.stat().st_size) > _MOST_BYTES:
            raise ParameterError(
                f"{file}: expected a file of at most {_MOST_BYTES >> 30} GiB to send along, got "
                f"{size / 2**30:.1f} GiB: leave out --stage, for workers that share a file system"
            )
        contents.append((os.path.abspath(file), file.read_bytes()))
    return Staged(pickle.dumps(one, 5), tuple(contents))


@dataclass(frozen=True)
class StagedResult:
    """The result for an input that was sent, with the paths of the machine that sent it."""

    content: bytes

    def received(self) -> Any:
        """The result."""
        return _read(self.content)


def on_staged(function: Callable[[_Input], Any], sent: Staged) -> StagedResult:
    """The result of a function for an input that was sent. Its files are removed again."""
    with TemporaryDirectory(prefix="choreograph-") as made:
        folder = os.path.realpath(made)
        for name, content in sent.files:
            path = _below(folder, Path(name))
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        one = _changed(pickle.loads(sent.content), lambda path: _there(path, folder), lambda text: text)
        result = function(one)
        return StagedResult(
            _written(result, lambda path: _back(path, folder), lambda text: text.replace(folder, ""))
        )


def _below(folder: str, path: PurePath) -> Path:
    """An absolute path below a folder."""
    return Path(folder, *path.parts[1:])


def _there(path: PurePath, folder: str) -> PurePath:
    return _below(folder, path) if path.is_absolute() else path


def _back(path: PurePath, folder: str) -> PurePath:
    return Path(path.anchor, path.relative_to(folder)) if path.is_relative_to(folder) else path


class _Writer(pickle.Pickler):
    """Writes paths and texts that are changed by a function."""

    def __init__(
        self, file: io.BytesIO, path: Callable[[PurePath], PurePath], text: Callable[[str], str]
    ) -> None:
        super().__init__(file, 5)
        self._path, self._text = path, text

    def persistent_id(self, obj: Any) -> Any:
        """What is written instead of a path or text, or None for anything else, and for what stays."""
        if isinstance(obj, PurePath):
            changed = self._path(obj)
            return None if changed == obj else ("path", str(changed))
        if type(obj) is str:
            text = self._text(obj)
            return None if text == obj else ("text", text)
        return None


class _Reader(pickle.Unpickler):
    def persistent_load(self, pid: Any) -> Any:
        """The path or text that was written."""
        kind, text = pid
        return Path(text) if kind == "path" else text


def _read(content: bytes) -> Any:
    return _Reader(io.BytesIO(content)).load()


def _written(value: Any, path: Callable[[PurePath], PurePath], text: Callable[[str], str]) -> bytes:
    file = io.BytesIO()
    _Writer(file, path, text).dump(value)
    return file.getvalue()


def _changed(value: _Input, path: Callable[[PurePath], PurePath], text: Callable[[str], str]) -> _Input:
    """A copy of a value with other paths and texts."""
    changed: _Input = _read(_written(value, path, text))
    return changed
