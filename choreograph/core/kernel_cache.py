"""Where compiled kernels are kept between runs, ours and librosa's.

numba's own cache is not safe against processes that compile at the same time: each may write half of an
index, or the wrapper of a gufunc that calls the function inside by a name that only the other process knows.
Such a cache crashes every later run, and a damaged file does so, too. Here an entry is one file, named by all
that it depends on, written at once and read only if its checksum holds. One process compiles at a time, and
the others read what it compiled. Where nothing can be written, kernels are compiled anew, and a note says so.
"""

from __future__ import annotations

import hashlib
import logging
import os
import pickle
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar

import numba
from numba.core import caching
from numba.core.serialize import dumps
from numba.core.sigutils import normalize_signature

from choreograph.core import __version__
from choreograph.core.errors import ChoreographError
from choreograph.core.files import atomic_path

_DIGEST_BYTES = 32
_WAIT_S = 60.0  # for another process that compiles, before this one does so beside it
_WRAPPER = "guf-"  # begins the names of gufuncs' wrappers

_log = logging.getLogger("choreograph")
_patching = threading.RLock()


def njit(**options: Any) -> Callable[[Callable], Any]:
    """`numba.njit`, cached here."""

    def compiled(function: Callable) -> Any:
        with kernel_cache():
            return numba.njit(cache=True, **options)(function)

    return compiled


@contextmanager
def kernel_cache() -> Iterator[None]:
    """Caches here what the block defines with numba's `cache=True`: librosa is imported in such blocks."""
    numba_caching: Any = caching
    with _patching:
        kept = numba_caching.IndexDataCacheFile, numba_caching.CacheImpl._locator_classes
        numba_caching.IndexDataCacheFile, numba_caching.CacheImpl._locator_classes = _Entries, [_Locator]
        try:
            yield
        finally:
            numba_caching.IndexDataCacheFile, numba_caching.CacheImpl._locator_classes = kept


class _Locator(caching._SourceFileBackedLocatorMixin, caching._CacheLocator):
    """Accepts every function of a source file, whether or not its entries can be written."""

    def __init__(self, py_func: Callable, py_file: str) -> None:
        self._py_file = py_file
        self._lineno = py_func.__code__.co_firstlineno
        self._cache_path = self.get_suitable_cache_subpath(py_file)  # inside the folder

    @classmethod
    def from_function(cls, py_func: Callable, py_file: str) -> _Locator:
        return cls(py_func, py_file)

    def ensure_cache_path(self) -> None:
        """Made when an entry is written."""

    def get_cache_path(self) -> str:
        return self._cache_path


class _Entries:
    """The entries of one function, one for each signature; in place of numba's `IndexDataCacheFile`.

    numba loads, and after a miss compiles and saves. From the miss to the saving this process has the lock.
    """

    _loaded: ClassVar[dict[tuple[str, str, str], str]] = {}  # digests of this process's entries

    def __init__(self, cache_path: str, filename_base: str, source_stamp: object) -> None:
        self._subfolder, self._name, self._stamp = cache_path, filename_base, source_stamp

    def flush(self) -> None:
        """No entry is ever out of date: its name would be another."""

    def load(self, key: tuple) -> Any:
        """What was compiled, or None."""
        path = self._path(key)
        if path is None:
            return None
        payload = _read(path)
        if payload is None and _lock().acquire():
            payload = _read(path)  # another process may have compiled it meanwhile
            if payload is not None:
                _lock().release()
        if payload is None:
            return None
        self._note(key, payload)
        return pickle.loads(payload)

    def save(self, key: tuple, data: Any) -> None:
        """Write an entry; a note if that fails."""
        path = self._path(key)
        if path is None:
            return
        payload = dumps(data)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with atomic_path(path) as temporary:
                temporary.write_bytes(hashlib.sha256(payload).digest() + payload)
            self._note(key, payload)
        except (OSError, ChoreographError) as error:
            _note_once(f"compiled code is not kept, every run compiles it again: {error}")
        finally:
            _lock().release()

    def _note(self, key: tuple, payload: bytes) -> None:
        self._loaded[self._subfolder, self._name, _arguments(key)] = hashlib.sha256(payload).hexdigest()

    def _path(self, key: tuple) -> Path | None:
        """The file of a key's entry; a wrapper's is named by the very function that it calls, too."""
        folder = _folder()
        if folder is None:
            return None
        inside = (self._subfolder, self._name.removeprefix(_WRAPPER), _arguments(key))
        wrapped = self._loaded.get(inside, "") if self._name.startswith(_WRAPPER) else ""
        depends_on = hashlib.sha256(repr((str(key[0]), *key[1:], self._stamp, wrapped)).encode())
        return folder / self._subfolder / f"{self._name}.{depends_on.hexdigest()[:32]}"


def _arguments(key: tuple) -> str:
    """The argument types of a key's signature, which wrappers and what they call write in two ways."""
    return str(normalize_signature(key[0])[0])


def _read(path: Path) -> bytes | None:
    """An entry without its checksum; None if it is not there or does not hold."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    if hashlib.sha256(content[_DIGEST_BYTES:]).digest() == content[:_DIGEST_BYTES]:
        return content[_DIGEST_BYTES:]
    _note_once(f"compiled code in {path.parent.parent} was damaged: it is compiled again")
    return None


class _Lock:
    """Lets one process compile at a time; without a lock after the first that could not be had."""

    def __init__(self, folder: Path) -> None:
        from filelock import FileLock

        self._held = 0
        self._lock: Any = FileLock(folder / "lock", timeout=_WAIT_S, thread_local=False)

    def acquire(self) -> bool:
        from filelock import Timeout

        if self._lock is not None:
            try:
                self._lock.acquire()
                self._held += 1
            except (OSError, NotImplementedError, Timeout):  # entries are safe without it
                self._lock = None
        return self._lock is not None

    def release(self) -> None:
        if self._lock is not None and self._held:
            self._held -= 1
            self._lock.release()


@lru_cache(maxsize=1)
def _lock() -> _Lock:
    folder = _folder()
    assert folder is not None
    return _Lock(folder)


@lru_cache(maxsize=1)
def _folder() -> Path | None:
    """This version's folder, in the user's cache or else the temporary folder; None if neither can be had."""
    name = f"kernels-{__version__}-numba-{numba.__version__}"
    refused: list[str] = []
    for base in _bases():
        why_not = _why_unusable(base, base / name)
        if why_not is None:
            if refused:
                _note_once(f"compiled code is kept in {base}: {refused[0]}")
            return base / name
        refused.append(f"{base} cannot be used ({why_not})")
    _note_once(f"compiled code is not kept, every run compiles it again: {refused[0]}")
    return None


def _bases() -> list[Path]:
    """Where to keep entries, best first."""
    from platformdirs import user_cache_path

    given = getattr(numba.config, "CACHE_DIR", "")  # NUMBA_CACHE_DIR
    bases = [Path(given) if given else user_cache_path("choreograph", appauthor=False)]
    user = os.getuid() if hasattr(os, "getuid") else "user"
    with suppress(FileNotFoundError):  # no temporary folder can be written
        bases.append(Path(tempfile.gettempdir()) / f"choreograph-{user}")
    return bases


def _why_unusable(base: Path, folder: Path) -> str | None:
    """Why entries cannot be kept in a folder. They are code: others may not be able to write there."""
    if not base.is_absolute():
        return "no home folder"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
        owners = {path.stat().st_uid for path in (base, folder)}
    except OSError as error:
        return error.strerror or str(error)
    if hasattr(os, "getuid") and not owners <= {os.getuid(), 0}:
        return "it belongs to another user"
    return None


@lru_cache
def _note_once(text: str) -> None:
    _log.warning(text)
