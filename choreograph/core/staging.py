"""Inputs that are sent together with the files that they name, to a machine that does not have the files.

There, the files lie below a temporary folder, under the paths that they have here. The absolute paths of an
input are changed before the work, and those of the result are changed back, in its messages as well. In
texts of the input, such as options, the paths of the files that were sent are changed.
"""

from __future__ import annotations

import io
import os
import pickle
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePath
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

from choreograph.core.errors import ParameterError

_MOST_BYTES = 1 << 30  # of a file

_Input = TypeVar("_Input")


SentFile = tuple[str, bytes]  # path here, and content


@dataclass(frozen=True)
class Staged:
    """An input and the files that it names."""

    content: bytes  # the pickled input
    files: tuple[SentFile, ...]


def staged(one: object, files: Iterable[Path]) -> Staged:
    """An input with its files. Raises as `sent_files`."""
    return Staged(pickle.dumps(one, 5), sent_files(files))


def sent_files(files: Iterable[Path]) -> tuple[SentFile, ...]:
    """The contents of files. Those that do not exist are left out, as where the input was made.

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
    return tuple(contents)


@dataclass(frozen=True)
class StagedResult:
    """The result for an input that was sent, with the paths of the machine that sent it."""

    content: bytes

    def received(self) -> Any:
        """The result."""
        return _read(self.content)


def on_staged(
    function: Callable[[_Input], Any], sent: Staged, shared: Iterable[SentFile] = ()
) -> StagedResult:
    """The result of a function for an input that was sent. Its files are removed again.

    `shared` are the files that all inputs name.
    """
    with TemporaryDirectory(prefix="choreograph-") as made:
        folder = os.path.realpath(made)
        there = {}
        for name, content in (*shared, *sent.files):
            path = _below(folder, Path(name))
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
            there[name] = str(path)
        one = _changed(
            pickle.loads(sent.content), lambda path: _there(path, folder), lambda text: _with(text, there)
        )
        result = function(one)
        return StagedResult(
            _written(result, lambda path: _back(path, folder), lambda text: text.replace(folder, ""))
        )


def _below(folder: str, path: PurePath) -> Path:
    """An absolute path below a folder."""
    return Path(folder, *path.parts[1:])


def _there(path: PurePath, folder: str) -> PurePath:
    return _below(folder, path) if path.is_absolute() else path


def _with(text: str, there: Mapping[str, str]) -> str:
    """A text in which the paths of the files that were sent are those below the folder."""
    for name in sorted(there, key=len, reverse=True):
        if name in text:
            return there[name].join(_with(part, there) for part in text.split(name))
    return text


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
            return None if changed == obj else ("path", str(changed).encode("utf-8", "surrogatepass"))
        if type(obj) is str:
            text = self._text(obj)
            return (
                None if text == obj else ("text", text.encode("utf-8", "surrogatepass"))
            )  # as bytes, which are not changed again
        return None


class _Reader(pickle.Unpickler):
    def persistent_load(self, pid: Any) -> Any:
        """The path or text that was written."""
        kind, text = pid[0], pid[1].decode("utf-8", "surrogatepass")
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
