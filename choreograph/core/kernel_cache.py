"""A cache of compiled kernels, ours and those of librosa, that is kept between runs.

numba's own cache is not safe when several processes compile at the same time. Two processes may give two
compiled functions the same file name, or save the wrapper of a gufunc that calls the inner function by a name
that only the other process has. A later run then crashes. A damaged file has the same effect. Here an entry
is one file whose name depends on everything that the code depends on. It is written at once and read only if
its checksum is right. One process compiles a kernel, and the others read the result. If no folder can be
written, kernels are compiled in every run, and a note is logged.

numba has no public way to replace the files of its cache, so `kernel_cache` replaces three of its private
names while functions are decorated. A gufunc without signatures, such as those of librosa 1.0, makes its
wrapper when it is called, so its builder replaces them again then. `_why_not_replaced` first checks that
they are as in the supported versions (0.60 to 0.68). With any other numba, nothing is cached, and a note is
logged.
"""

from __future__ import annotations

import hashlib
import importlib
import inspect
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

from choreograph.core import __version__
from choreograph.core.errors import ChoreographError
from choreograph.core.files import atomic_path, cache_folder, sha256_of

_DIGEST_BYTES = 32
_WAIT_S = 60.0  # for another process that compiles, before this one does so beside it
_MOST_PROCESSES = 2  # that compile beside this one, which waits for them after the first second
_POLL_S = 0.05  # until it is looked again whether another process has compiled a kernel
_WRAPPER = "guf-"  # begins the names of gufuncs' wrappers
# The private names of numba that are used here, each with the parameters that it must have.
_PRIVATE = {
    "core.caching.IndexDataCacheFile": ["cache_path", "filename_base", "source_stamp"],
    "core.caching.IndexDataCacheFile.load": ["self", "key"],
    "core.caching.IndexDataCacheFile.save": ["self", "key", "data"],
    "core.caching.IndexDataCacheFile.flush": ["self"],
    "core.caching.Cache._index_key": ["self", "sig", "codegen"],
    "core.caching.Cache._load_overload": ["self", "sig", "target_context"],
    "core.caching.Cache.load_overload": ["self", "sig", "target_context"],
    "core.runtime.nrt.rtsys.initialize": ["ctx"],
    "core.serialize.dumps": ["obj"],
    "core.sigutils.normalize_signature": ["sig"],
    "np.ufunc.gufunc.GUFuncBuilder.build_ufunc": ["self"],
}
_LOCATOR_METHODS = {"get_cache_path", "get_disambiguator", "get_source_stamp"}
_DECORATORS = ("jit", "njit", "vectorize", "guvectorize")  # that take `cache=True`

_Parameters = ParamSpec("_Parameters")
_Result = TypeVar("_Result")
_Key = tuple[Any, ...]  # of an entry: a signature first, then the processor and the function's bytecode

_log = logging.getLogger("choreograph")
_patching = threading.RLock()
_ahead: dict[Any, str] = {}  # kernels and their signatures


def njit(
    ahead: str | None = None, **options: Any
) -> Callable[[Callable[_Parameters, _Result]], Callable[_Parameters, _Result]]:
    """`numba.njit`, cached here. `compiled_ahead` compiles a kernel for the signature `ahead`."""

    def compiled(function: Callable[_Parameters, _Result]) -> Callable[_Parameters, _Result]:
        with kernel_cache():
            decorated: Callable[_Parameters, _Result] = numba.njit(cache=True, **options)(function)
        if _why_not_replaced() is None:
            decorated._cache.load_overload = partial(_loaded, decorated._cache)  # type: ignore[attr-defined]
        if ahead is not None:
            _ahead[decorated] = ahead
        return decorated

    return compiled


def _loaded(cache: Any, signature: Any, context: Any) -> Any:
    """As numba's `Cache.load_overload`, without what only compilation needs, which takes 0.3 s to import."""
    _private("core.runtime.nrt.rtsys.initialize")(context)
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
        for kernel, ahead in kernels.items():
            while any(one.poll() is None for one in processes) and not _is_kept(kernel, ahead):
                if ended.wait(_POLL_S):
                    return
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


def _argument_types(signature: Any) -> Any:
    """The argument types of a signature, as calls have them."""
    return _private("core.sigutils.normalize_signature")(signature)[0]


def _is_kept(kernel: Any, ahead: str) -> bool:
    """Whether the cache has the code of a kernel for a signature."""
    cache = kernel._cache
    path = cache._cache_file._path(cache._index_key(_argument_types(ahead), kernel.targetctx.codegen()))
    return path is not None and path.exists()


def _compiling_processes(kernels: Mapping[Any, str]) -> list[subprocess.Popen[bytes]]:
    """Processes that compile kernels that are not in the cache, if it can be used, until their input ends."""
    processes: list[subprocess.Popen[bytes]] = []
    if _why_not_replaced() is not None or _folder() is None or "python" not in Path(sys.executable).name:
        return processes
    missing = [(one.__module__, one.__name__) for one, ahead in kernels.items() if not _is_kept(one, ahead)]
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
        if not _is_kept(kernel, _ahead[kernel]):
            kernel.compile(_argument_types(_ahead[kernel]))


@contextmanager
def kernel_cache() -> Iterator[None]:
    """Caches the functions that the block defines with numba's `cache=True`, such as those of librosa."""
    with _patching:
        why_not = _why_not_replaced()
        if why_not is None:
            replaced: list[tuple[Any, str, Any]] = [
                (_private("core.caching"), "IndexDataCacheFile", _Entries),
                (_private("core.caching.CacheImpl"), "_locator_classes", [_Locator]),
                (_private("np.ufunc.gufunc"), "GUFuncBuilder", _builder()),
            ]
        else:
            _note_once(f"compiled code is not kept, every run compiles it again: {why_not}")
            replaced = [(numba, name, _uncached(getattr(numba, name))) for name in _DECORATORS]
        kept = [getattr(owner, name) for owner, name, _ in replaced]
        try:
            for owner, name, value in replaced:
                setattr(owner, name, value)
            yield
        finally:
            for (owner, name, _), value in zip(replaced, kept, strict=True):
                setattr(owner, name, value)


@lru_cache(maxsize=1)
def _why_not_replaced() -> str | None:
    """The first private name of numba that is not as expected, or None if all are."""
    version = f"numba {numba.__version__} is not a known version"
    for path, parameters in _PRIVATE.items():
        found = _private(path)
        if not callable(found) or list(inspect.signature(found).parameters) != parameters:
            return f"{version} (numba.{path})"
    locators = _private("core.caching.CacheImpl._locator_classes")
    if not isinstance(locators, list) or not all(set(dir(one)) >= _LOCATOR_METHODS for one in locators):
        return f"{version} (numba.core.caching.CacheImpl._locator_classes)"
    return None


def _private(path: str) -> Any:
    """The object of this name within `numba`, or None if there is none."""
    import numba.core.caching
    import numba.core.runtime.nrt
    import numba.core.serialize
    import numba.core.sigutils
    import numba.np.ufunc.gufunc

    found: Any = numba
    for name in path.split("."):
        found = getattr(found, name, None)
    return found


@lru_cache(maxsize=1)
def _builder() -> type:
    """numba's builder of gufuncs, except that what it compiles at a later call is kept here, too."""
    builder: Any = _private("np.ufunc.gufunc.GUFuncBuilder")

    def build_ufunc(self: Any) -> Any:
        with kernel_cache():  # before numba's own lock, as wherever functions are decorated
            return builder.build_ufunc(self)

    return type("_Builder", (builder,), {"build_ufunc": build_ufunc})


def _uncached(decorator: Callable[..., Any]) -> Callable[..., Any]:
    """A decorator of numba that ignores `cache=True`."""

    def decorate(*arguments: Any, **options: Any) -> Any:
        return decorator(*arguments, **{**options, "cache": False})

    return decorate


class _Locator:
    """Tells numba where the entries of a function are. It does not check whether they can be written.

    Has the methods of numba's own locators.
    """

    def __init__(self, py_func: Callable[..., object], py_file: str) -> None:
        self._source = Path(py_file)
        self._lineno = py_func.__code__.co_firstlineno

    @classmethod
    def from_function(cls, py_func: Callable[..., object], py_file: str) -> _Locator:
        return cls(py_func, py_file)

    def ensure_cache_path(self) -> None:
        """Does nothing, since the folder is made when an entry is written."""

    def get_cache_path(self) -> str:
        """A folder in the cache, for each folder of sources."""
        sources = self._source.absolute().parent
        return f"{sources.name}_{hashlib.sha256(str(sources).encode()).hexdigest()[:32]}"

    def get_source_stamp(self) -> str:
        return sha256_of(self._source)

    def get_disambiguator(self) -> str:
        return str(self._lineno)


class _Entries:
    """The entries of one function, one for each signature. It replaces numba's `IndexDataCacheFile`.

    numba loads, and after a miss compiles and saves. From the miss to the saving this process has the lock of
    the entry.
    """

    _loaded: ClassVar[dict[tuple[str, str, str], str]] = {}  # digests of this process's entries
    _locks: ClassVar[dict[Path, Any]] = {}  # of the entries that this process compiles

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
        if payload is None:
            payload = self._read_or_lock(path)
        if payload is None:
            return None
        self._note(key, payload)
        return pickle.loads(payload)

    def _read_or_lock(self, path: Path) -> bytes | None:
        """An entry that another process compiles now, or None with its lock, or without after `_WAIT_S`."""
        from filelock import Timeout

        with suppress(OSError, NotImplementedError):  # entries are safe without a lock
            lock = _lock_of(path)
            for _ in range(round(_WAIT_S / _POLL_S)):
                with suppress(Timeout):
                    lock.acquire()
                    self._locks[path] = lock
                payload = _read(path)
                if payload is not None:
                    self._unlock(path)
                if payload is not None or path in self._locks:
                    return payload
        return None

    def _unlock(self, path: Path) -> None:
        lock = self._locks.pop(path, None)
        if lock is not None:
            lock.release()

    def save(self, key: _Key, data: Any) -> None:
        """Write an entry. Logs a note if that fails."""
        path = self._path(key)
        if path is None:
            return
        payload: bytes = _private("core.serialize.dumps")(data)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with atomic_path(path) as temporary:
                temporary.write_bytes(hashlib.sha256(payload).digest() + payload)
            self._note(key, payload)
        except (OSError, ChoreographError) as error:
            _note_once(f"compiled code is not kept, every run compiles it again: {error}")
        finally:
            self._unlock(path)

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


def _lock_of(path: Path) -> Any:
    """A lock for the process that compiles an entry."""
    from filelock import FileLock

    path.parent.mkdir(parents=True, exist_ok=True)
    return FileLock(path.with_name(f"{path.name}.lock"), timeout=_POLL_S, thread_local=False)


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
