"""A cache of compiled kernels, ours and those of librosa, that is kept between runs.

numba's own cache is not safe when several processes compile at the same time. Two processes may give two
compiled functions the same file name, or save the wrapper of a gufunc that calls the inner function by a name
that only the other process has. A later run then crashes. A damaged file has the same effect. Here an entry
is one file whose name depends on everything that the code depends on. It is written at once and read only if
its checksum is right. One process compiles a kernel, and the others wait for it and read the result. If no
folder can be written, kernels are compiled in every run, and a note is logged.

numba has no public way to replace the files of its cache. The private names that are used instead are
imported below, each with its reason. They are those of numba 0.60 to 0.68, the bounds in `pyproject.toml`.
Functions of other programs keep numba's own cache.
"""

from __future__ import annotations

import hashlib
import importlib
import logging
import os
import pickle
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, ClassVar, ParamSpec, TypeVar

import numba
from filelock import FileLock, Timeout
from numba.core import caching  # where the files of a function's cache are, and how they are read and written
from numba.core.runtime.nrt import rtsys  # what a kernel needs at least before it is loaded
from numba.core.serialize import dumps  # compiled code contains functions, which pickle alone cannot write

from choreograph.core import __version__
from choreograph.core.errors import ChoreographError
from choreograph.core.files import atomic_path, cache_folder, sha256_of

_DIGEST_BYTES = 32
_WAIT_S = 60.0  # for another process that compiles, before this one does so beside it
_MOST_PROCESSES = 2  # that compile beside this one, which waits for them after the first second
_POLL_S = 0.05  # until it is looked again whether another process has ended
_OTHERS = ("librosa",)  # packages whose kernels are kept, too, if they are compiled after this import
_WRAPPER = "guf-"  # begins the names of gufuncs' wrappers

_Parameters = ParamSpec("_Parameters")
_Result = TypeVar("_Result")
_Key = tuple[Any, ...]  # of an entry: a signature first, then the processor and the function's bytecode

_log = logging.getLogger("choreograph")
_ahead: dict[Any, str] = {}  # kernels and their signatures
_sources: set[str] = set()  # files with kernels of `njit`


def njit(
    ahead: str | None = None, **options: Any
) -> Callable[[Callable[_Parameters, _Result]], Callable[_Parameters, _Result]]:
    """`numba.njit`, cached here. `compiled_ahead` compiles a kernel for the signature `ahead`."""

    def compiled(function: Callable[_Parameters, _Result]) -> Callable[_Parameters, _Result]:
        _sources.add(function.__code__.co_filename)
        decorated: Any = numba.njit(cache=True, **options)(function)
        # Its own way to load also imports what only compilation needs, which takes 0.3 s.
        decorated._cache.load_overload = partial(_loaded, decorated._cache)
        if ahead is not None:
            _ahead[decorated] = ahead
        kernel: Callable[_Parameters, _Result] = decorated
        return kernel

    return compiled


def _loaded(cache: Any, signature: Any, context: Any) -> Any:
    rtsys.initialize(context)
    return cache._load_overload(signature, context)


@contextmanager
def compiled_ahead(*modules: str) -> Iterator[None]:
    """Compiles the kernels of these modules and packages while the block runs, and loads them in a thread.

    Those that are not in the cache are compiled in other processes, because compilation would slow down the
    block in this one. Only kernels of imported modules are compiled, those with long signatures first, since
    they take longest. A kernel that the block calls before its turn is compiled at once. At the end of the
    block, the kernel that is compiled is finished, and the others are left out.
    """
    prefixes = tuple(f"{name}." for name in modules)
    longest = sorted(_ahead.items(), key=lambda item: -len(item[1]))
    kernels = {one: ahead for one, ahead in longest if f"{one.__module__}.".startswith(prefixes)}
    ended = threading.Event()
    processes = _compiling_processes(kernels)

    def load_all() -> None:
        while any(process.poll() is None for process in processes):
            if ended.wait(_POLL_S):
                return
        for kernel, ahead in kernels.items():
            if ended.is_set():
                return
            kernel.compile(_argument_types(ahead))

    thread = threading.Thread(target=load_all, name="compiled_ahead")
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
        for process in processes:
            process.communicate()  # closes its input, which ends it


def _argument_types(signature: Any) -> tuple[Any, ...]:
    """The argument types of a signature, as calls have them. It may be text, or have a type of the result."""
    found = eval(signature, {}, vars(numba.types)) if isinstance(signature, str) else signature
    return tuple(getattr(found, "args", found))


def _compiling_processes(kernels: Mapping[Any, str]) -> list[subprocess.Popen[bytes]]:
    """Processes that compile kernels that are not in the cache, if it can be used, until their input ends."""
    processes: list[subprocess.Popen[bytes]] = []
    folder = _folder()
    if folder is None or "python" not in Path(sys.executable).name:
        return processes
    missing = [(one.__module__, one.__name__) for one in kernels if not _is_kept(one, folder)]
    same = {"PYTHONPATH": os.pathsep.join(sys.path), "NUMBA_CACHE_DIR": _given_folder()}
    n = min(_MOST_PROCESSES, os.cpu_count() or 1, len(missing))
    with suppress(OSError):
        for first in range(n):
            code = f"import {__name__} as it\nit.compile_while_wanted({missing[first::n]})"
            processes.append(subprocess.Popen(
                [sys.executable, "-c", code], env={**os.environ, **same},
                stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            ))  # fmt: skip
    return processes


def _is_kept(kernel: Any, folder: Path) -> bool:
    """Whether the cache has code of a kernel. It may be of older sources, which are compiled when loaded."""
    entries = (folder / kernel.stats.cache_path).glob(f"*.{kernel.__qualname__}-*.py*")
    return any(entry.suffix != ".lock" for entry in entries)


def compile_while_wanted(names: Sequence[tuple[str, str]]) -> None:
    """Compile the kernels of these modules and names, one after another, until the standard input ends."""
    ended = threading.Event()

    def wait_for_end() -> None:
        sys.stdin.read()
        ended.set()

    threading.Thread(target=wait_for_end, daemon=True).start()
    for module, name in names:
        if ended.is_set():
            return
        kernel = getattr(importlib.import_module(module), name)
        kernel.compile(_argument_types(_ahead[kernel]))


class _Folder(str):
    """A folder in the cache, for each folder of sources."""


class _Locator:
    """Tells numba where the entries of our functions are. Has the methods of numba's own locators."""

    def __init__(self, py_func: Callable[..., object], py_file: str) -> None:
        self._source = Path(py_file)
        self._lineno = py_func.__code__.co_firstlineno

    @classmethod
    def from_function(cls, py_func: Callable[..., object], py_file: str) -> _Locator | None:
        is_kept = py_file in _sources or py_func.__module__.partition(".")[0] in _OTHERS
        return cls(py_func, py_file) if is_kept else None

    def ensure_cache_path(self) -> None:
        """Does nothing, since the folder is made when an entry is written."""

    def get_cache_path(self) -> str:
        sources = self._source.absolute().parent
        return _Folder(f"{sources.name}_{hashlib.sha256(str(sources).encode()).hexdigest()[:32]}")

    def get_source_stamp(self) -> str:
        return sha256_of(self._source)

    def get_disambiguator(self) -> str:
        return str(self._lineno)


class _Entries:
    """The entries of one function, one for each signature. Has the methods of numba's `IndexDataCacheFile`.

    numba loads, and after a miss compiles and saves. From the miss to the saving this process has the lock of
    the entry. Entries are safe without a lock, which only saves work.
    """

    _loaded: ClassVar[dict[tuple[str, str, str], str]] = {}  # digests of this process's entries
    _locks: ClassVar[dict[Path, FileLock]] = {}  # of the entries that this process compiles

    def __init__(self, cache_path: str, filename_base: str, source_stamp: object) -> None:
        self._subfolder, self._name, self._stamp = cache_path, filename_base, source_stamp

    def flush(self) -> None:
        """No entry is ever out of date, since its name would differ."""

    def load(self, key: _Key) -> Any:
        """The compiled code, or None."""
        path = self._path(key)
        if path is None:
            return None
        payload = _read(path)
        if payload is None and path not in self._locks:
            with suppress(OSError, NotImplementedError, Timeout):
                path.parent.mkdir(parents=True, exist_ok=True)
                lock = FileLock(path.with_name(f"{path.name}.lock"), timeout=_WAIT_S, thread_local=False)
                lock.acquire()
                self._locks[path] = lock
            payload = _read(path)  # which another process may have compiled
            if payload is not None:
                self._unlock(path)
        if payload is None:
            return None
        self._note(key, payload)
        return pickle.loads(payload)

    def save(self, key: _Key, data: Any) -> None:
        """Write an entry. Logs a note if that fails."""
        path = self._path(key)
        if path is None:
            return
        payload: bytes = dumps(data)  # type: ignore[no-untyped-call]
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with atomic_path(path) as temporary:
                temporary.write_bytes(hashlib.sha256(payload).digest() + payload)
            self._note(key, payload)
        except (OSError, ChoreographError) as error:
            _note_once(f"compiled code is not kept, every run compiles it again: {error}")
        finally:
            self._unlock(path)

    def _unlock(self, path: Path) -> None:
        lock = self._locks.pop(path, None)
        if lock is not None:
            lock.release()

    def _note(self, key: _Key, payload: bytes) -> None:
        types = str(_argument_types(key[0]))
        self._loaded[self._subfolder, self._name, types] = hashlib.sha256(payload).hexdigest()

    def _path(self, key: _Key) -> Path | None:
        """The file of a key's entry. Of a wrapper, the name also contains the function that it calls."""
        folder = _folder()
        if folder is None:
            return None
        types = str(_argument_types(key[0]))  # which wrappers and what they call write in two ways
        inside = (self._subfolder, self._name.removeprefix(_WRAPPER), types)
        wrapped = self._loaded.get(inside, "") if self._name.startswith(_WRAPPER) else ""
        depends_on = hashlib.sha256(repr((str(key[0]), *key[1:], self._stamp, wrapped)).encode())
        return folder / self._subfolder / f"{self._name}.{depends_on.hexdigest()[:32]}"


def _entries(cache_path: str, filename_base: str, source_stamp: object) -> Any:
    kind = _Entries if isinstance(cache_path, _Folder) else _OTHER_ENTRIES
    return kind(cache_path=cache_path, filename_base=filename_base, source_stamp=source_stamp)


_of_numba: Any = caching
_OTHER_ENTRIES = _of_numba.IndexDataCacheFile
_of_numba.IndexDataCacheFile = _entries
_of_numba.CacheImpl._locator_classes.insert(0, _Locator)


def _read(path: Path) -> bytes | None:
    """An entry without its checksum, or None if it does not exist or the checksum is wrong."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    if hashlib.sha256(content[_DIGEST_BYTES:]).digest() == content[:_DIGEST_BYTES]:
        return content[_DIGEST_BYTES:]
    _note_once(f"compiled code in {path.parent.parent} was damaged: it is compiled again")
    return None


@lru_cache(maxsize=1)
def _folder() -> Path | None:
    """This version's folder in the user's cache, else in the temporary folder, or None if both fail."""
    folder, why_not = cache_folder(f"kernels-{__version__}-numba-{numba.__version__}", _given_folder())
    if folder is None:
        _note_once(f"compiled code is not kept, every run compiles it again: {why_not}")
    elif why_not:
        _note_once(f"compiled code is kept in {folder.parent}: {why_not}")
    return folder


def _given_folder() -> str:
    return getattr(numba.config, "CACHE_DIR", "")  # NUMBA_CACHE_DIR


@lru_cache
def _note_once(text: str) -> None:
    _log.warning(text)
