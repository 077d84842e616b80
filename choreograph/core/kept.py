"""Results that are kept in the user's cache, so that the same work on the same inputs is not done again.

An entry is one file, whose name is a digest of everything that the result depends on, the program included.
It is written at once, and read only if its checksum is right, so that several processes can use one folder.
The entries that were not used for the longest time are removed when all of them exceed a number of bytes.
"""

from __future__ import annotations

import hashlib
import logging
import os
import pickle
import re
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import fields, is_dataclass
from functools import lru_cache, partial
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import scipy

from choreograph.core.errors import ChoreographError
from choreograph.core.files import atomic_path, cache_folder
from choreograph.core.numerics import digest
from choreograph.core.pickles import unpickled
from choreograph.core.standins import Named, Unbuilt
from choreograph.core.workers import FEWEST, each

PACKAGE = __name__.partition(".")[0]
_DIGEST_BYTES = 32
_log = logging.getLogger(PACKAGE)

_Input = TypeVar("_Input")
_Result = TypeVar("_Result")


class KeptEntries:
    """Entries of bytes in a folder, of at most `max_bytes` together.

    An entry that was read here is not removed to make room for another one. So work on more inputs than have
    room finds those of the last time that it began with.
    """

    def __init__(self, folder: Path, max_bytes: int, suffix: str) -> None:
        self._folder, self._max_bytes, self._suffix = folder, max_bytes, suffix
        self._used: set[str] = set()
        self._n_bytes: int | None = None  # of all entries, once they were listed
        self._is_full = False  # with entries that were used here

    def has(self, key: bytes) -> bool:
        """Whether there is an entry, which is then not removed here."""
        path = self._path(key)
        try:
            os.utime(path)  # used now
        except OSError:
            return False
        self._used.add(path.name)
        return True

    def read(self, key: bytes) -> bytes | None:
        """The content of an entry, or None if there is none, or a damaged one."""
        path = self._path(key)
        try:
            stored = path.read_bytes()
        except OSError:
            return None
        checksum, content = stored[:_DIGEST_BYTES], stored[_DIGEST_BYTES:]
        if hashlib.sha256(content).digest() != checksum:
            _log.warning("a kept result was damaged and is made again: %s", path)
            return None
        self.has(key)
        return content

    def write(self, key: bytes, content: bytes) -> None:
        """Write an entry if there is room for it. A warning says if the folder cannot be written."""
        path = self._path(key)
        if not self._has_room(_DIGEST_BYTES + len(content)):
            return
        try:
            with atomic_path(path) as temporary:
                temporary.write_bytes(hashlib.sha256(content).digest() + content)
        except ChoreographError as error:
            _log.warning("a result is not kept: %s", error)
        self._used.add(path.name)

    def _path(self, key: bytes) -> Path:
        return self._folder / f"{key.hex()}{self._suffix}"

    def _has_room(self, n_bytes: int) -> bool:
        """Whether an entry of `n_bytes` has room. The oldest that were not used here are removed for it."""
        if self._n_bytes is None or self._n_bytes + n_bytes > self._max_bytes:
            self._n_bytes = self._without_oldest(n_bytes)
        if self._n_bytes + n_bytes > self._max_bytes:
            return False
        self._n_bytes += n_bytes
        return True

    def _without_oldest(self, n_bytes: int) -> int:
        """Remove entries until `n_bytes` have room, if they can have it. The bytes of those that are left."""
        if self._is_full:
            return self._max_bytes
        found = []
        for path in self._folder.glob(f"*{self._suffix}"):
            with suppress(OSError):  # another process has removed it
                of_file = path.stat()
                found.append((of_file.st_mtime_ns, of_file.st_size, path))
        total = sum(size for _, size, _ in found)
        for _, size, path in sorted(found):
            if total + n_bytes <= self._max_bytes:
                break
            if path.name not in self._used:
                with suppress(OSError):
                    path.unlink(missing_ok=True)
                    total -= size
        self._is_full = total + n_bytes > self._max_bytes
        return total


@lru_cache(maxsize=1)
def program() -> list[str]:
    """The program's sources, and the libraries that compute, as a part of keys."""
    sources = hashlib.sha256()
    for path in sorted(Path(__file__).parents[1].rglob("*.py")):
        sources.update(path.read_bytes())
    return [sources.hexdigest(), np.__version__, scipy.__version__]


@lru_cache(maxsize=1)
def libraries() -> list[str]:
    """The versions of all packages that the program may use."""
    found = []
    for name in sorted({re.split(r"[^\w.-]", text, maxsplit=1)[0] for text in requires(PACKAGE) or ()}):
        with suppress(PackageNotFoundError):
            found.append(f"{name} {version(name)}")
    return found


# Results of functions, which are dataclasses of arrays, numbers and texts.


_PATHS = {(of, name) for of in ("pathlib", "pathlib._local") for name in ("PosixPath", "WindowsPath")}


class _UnbuiltFields(Unbuilt):
    """A dataclass of this program, whose state is the values of its fields."""

    def __init__(self, of: type) -> None:
        super().__init__()
        self._of = of

    def build(self, state: Any) -> Any:
        """An object with these values. Nothing of the class is called."""
        if type(state) is not dict or state.keys() != {field.name for field in fields(self._of)}:
            raise ValueError(f"the fields of another {self._of.__name__}")
        made: Any = object.__new__(self._of)
        made.__dict__.update(state)
        return made


def _named(module: str, name: str) -> Named | None:
    """The stand-in of a path, or of a dataclass of this program."""
    if (module, name) in _PATHS:
        return Named(Path)
    found = getattr(sys.modules.get(module), name, None) if module.startswith(f"{PACKAGE}.") else None
    if not (isinstance(found, type) and is_dataclass(found)):
        return None
    return Named(partial(_UnbuiltFields, found))


class KeptResults:
    """Results of functions in a folder, and how many were read there."""

    def __init__(self, folder: Path, max_bytes: int) -> None:
        self._entries = KeptEntries(folder, max_bytes, ".result")
        self.n_read: Counter[str] = Counter()  # by the name of the function

    def has(self, key: bytes | None) -> bool:
        """Whether there is a result."""
        return key is not None and self._entries.has(key)

    def read(self, key: bytes) -> Any:
        """A result, or None if there is none any more, or it is something else than values."""
        content = self._entries.read(key)
        try:
            return None if content is None else unpickled(content, named=_named, max_opcodes=len(content))
        except pickle.UnpicklingError as error:
            _log.warning("a kept result is made again: %s", error)
            return None

    def write(self, key: bytes, result: object) -> None:
        """Write a result if there is room for it."""
        self._entries.write(key, pickle.dumps(result, 5))


def key_of(function: Callable[..., Any], *values: object) -> bytes | None:
    """The key of the result of a function, which depends on its arguments and on `values` alone.

    Values are numbers, texts, paths, arrays, dataclasses, and collections of these. The key is None for a
    function of another package, which may change without its version.
    """
    given = function if isinstance(function, partial) else partial(function)
    if not given.func.__module__.startswith(f"{PACKAGE}."):
        return None
    named = given.func.__module__, given.func.__qualname__, given.args, given.keywords
    return digest(program(), libraries(), *named, *values)


_kept: ContextVar[KeptResults | None] = ContextVar("kept", default=None)


@contextmanager
def keeping(max_gb: float) -> Iterator[KeptResults | None]:
    """Inside, `each_kept` keeps results of up to `max_gb` gigabytes, or none if this is 0."""
    folder, why_not = kept_folder() if max_gb > 0.0 else (None, "")
    if why_not and folder is None:
        _log.warning("results are not kept: %s", why_not)
    results = None if folder is None else KeptResults(folder, int(max_gb * 1e9))
    token = _kept.set(results)
    try:
        yield results
    finally:
        _kept.reset(token)


def kept_folder() -> tuple[Path | None, str]:
    """The folder of the results of functions, as `cache_folder`."""
    return cache_folder("results")


def each_kept(
    function: Callable[[_Input], _Result],
    inputs: Iterable[_Input],
    *,
    key: Callable[[_Input], bytes | None],
    is_kept: Callable[[_Result], bool] = lambda _: True,
    killed: Callable[[_Input], _Result] | None = None,
    named: Callable[[_Input], str] = str,
    fewest: int = FEWEST,
    files: Callable[[_Input], Iterable[Path]] | None = None,
) -> Iterator[_Result]:
    """As `workers.each`. Inside of `keeping`, results of earlier calls with the same inputs are read.

    `key(input)` is the `key_of` its result, or None for one that is not kept. Only results for which
    `is_kept` is true are written.
    """
    results = _kept.get()
    if results is None:
        yield from each(function, inputs, killed=killed, named=named, fewest=fewest, files=files)
        return
    inputs = list(inputs)
    keys = [key(one) for one in inputs]
    known = [results.has(key) for key in keys]
    new = [one for one, is_known in zip(inputs, known, strict=True) if not is_known]
    made = each(function, new, killed=killed, named=named, fewest=fewest, files=files)
    for one, of_one, is_known in zip(inputs, keys, known, strict=True):
        result = results.read(of_one) if is_known and of_one is not None else None
        if result is not None:
            results.n_read[_name_of(function)] += 1
            yield result
            continue
        result = function(one) if is_known else next(made)
        if of_one is not None and is_kept(result):
            results.write(of_one, result)
        yield result


def _name_of(function: Callable[..., Any]) -> str:
    return str((function.func if isinstance(function, partial) else function).__name__)
