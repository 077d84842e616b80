"""Caches: values are kept under all that they depend on, so that the same work is not done again.

The key of a value is the `digest` of its inputs. A cache is bounded in bytes, and what was not used for the
longest time leaves first. Threads may share a cache.

- `Memory` keeps values in the process: dances to one song have most of their parts in common.
- `DiskCache` keeps them in files of the user, for later processes. A value is written at once and with a
  checksum. One that is damaged, or that cannot be read or written, is made again. Several processes may use
  one folder. The program is part of each key, so that another version makes its own values.
- `CachedRows` keeps blocks of the rows of an array in the process.

`each_cached` maps a function over inputs, and makes only the results that are not in the cache of `caching`.
"""

from __future__ import annotations

import copyreg
import hashlib
import logging
import os
import pickle
import re
import sys
from collections import Counter, OrderedDict
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import fields, is_dataclass
from functools import lru_cache, partial
from importlib.metadata import PackageNotFoundError, requires, version
from io import BytesIO
from pathlib import Path, PurePath
from threading import Lock
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import ChoreographError
from choreograph.core.files import atomic_path, cache_folder
from choreograph.core.numerics import AnyInts
from choreograph.core.pickles import Named, Unbuilt, unpickled
from choreograph.core.workers import FEWEST, each

PACKAGE = __name__.partition(".")[0]
_log = logging.getLogger(PACKAGE)

_Input = TypeVar("_Input")
_Value = TypeVar("_Value")


def digest(*values: object) -> bytes:
    """A digest of the content of values: numbers, text, paths, arrays, dataclasses, and collections of these.

    Raises `TypeError` for anything else.
    """
    hashed = hashlib.blake2b(digest_size=16)
    for value in values:
        _add_content(value, hashed.update)
    return hashed.digest()


def _add_content(value: object, add: Callable[[Any], None]) -> None:
    if isinstance(value, np.ndarray) and value.dtype.kind != "O":
        add(f"{value.dtype.str}{value.shape}".encode())
        add(np.ascontiguousarray(value).data.cast("B") if value.size else b"")
    elif isinstance(value, bytes):
        add(f"b{len(value)}:".encode() + value)
    elif value is None or isinstance(value, str | int | float | np.generic | PurePath):
        text = f"{type(value).__name__}{value!r}"
        add(f"{len(text)}:{text}".encode())
    elif isinstance(value, Mapping):
        _add_content(list(value.items()), add)
    elif isinstance(value, tuple | list):
        add(f"[{len(value)}".encode())
        for item in value:
            _add_content(item, add)
    elif is_dataclass(value) and not isinstance(value, type):
        _add_content([type(value).__qualname__, *(getattr(value, f.name) for f in fields(value))], add)
    else:
        raise TypeError(f"expected a value with a content, got {type(value).__name__}")


# Values in the process.


_LAST_VALUES = 4  # of the same common inputs, from which parts are taken


class Memory:
    """Keeps values by the inputs that they were computed from, up to a number of bytes.

    A value is computed again only if an input has another content. It must depend on nothing else, and must
    not be changed. With 0 bytes, nothing is kept. A copy in another process is empty.
    """

    def __init__(self, most_bytes: int = 0) -> None:
        self._whole, self._inputs = self, b""
        self._most_bytes, self._n_bytes = most_bytes, 0
        self._items: OrderedDict[Hashable, tuple[Any, int]] = OrderedDict()
        self._lock = Lock()

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self._whole._most_bytes,), {"_inputs": self._inputs}

    @property
    def is_on(self) -> bool:
        """Whether values are kept."""
        return self._whole._most_bytes > 0

    @property
    def n_bytes(self) -> int:
        """The size of the values that are kept: see `keep`."""
        return self._whole._n_bytes

    def of(self, *inputs: object) -> Memory:
        """The same memory, for values that all depend on these inputs. See `digest`."""
        if not self.is_on:
            return self
        part = Memory()
        part._whole, part._inputs = self._whole, digest(self._inputs, *inputs)
        return part

    def key(self, *inputs: object) -> bytes:
        """The key of a value by its inputs, or nothing if no values are kept."""
        return digest(self._inputs, *inputs) if self.is_on else b""

    def value(self, compute: Callable[[], _Value], *inputs: object) -> _Value:
        """The value that `compute` returns, or the one that it returned for the same inputs."""
        if not self.is_on:
            return compute()
        key = self.key(*inputs)
        found: tuple[_Value] | None = self.get(key)
        if found is None:
            found = (compute(),)
            self.keep(key, found)
        return found[0]

    def value_from_last(
        self, compute: Callable[[list[_Value]], _Value], common: Sequence[object], *inputs: object
    ) -> _Value:
        """As `value`, of the `common` inputs and the others. `compute` may take parts of other values.

        It gets the last values that were used with the same `common` inputs, the latest first, as far as
        they are kept.
        """
        if not self.is_on:
            return compute([])
        latest, key = self.key("latest", *common), self.key(*common, *inputs)
        keys: tuple[bytes, ...] = self.get(latest) or ()
        kept = [item for item in map(self.get, keys) if item is not None]
        value = self.value(lambda: compute([item[0] for item in kept]), *common, *inputs)
        keys = (key, *(other for other in keys if other != key))[:_LAST_VALUES]
        self.keep(latest, keys)
        return value

    def get(self, key: Hashable) -> Any:
        """The item with this key, or None if it is not kept."""
        whole = self._whole
        with whole._lock:
            if key not in whole._items:
                return None
            whole._items.move_to_end(key)
            return whole._items[key][0]

    def keep(self, key: Hashable, item: object, n_bytes: int | None = None) -> None:
        """Keep an item, in place of one with its key, of those not used for longest, or not if too large.

        `n_bytes` is its size, by default that of its arrays, with some bytes for every object.
        """
        whole, n_bytes = self._whole, _n_bytes(item) if n_bytes is None else n_bytes
        with whole._lock:
            if key in whole._items:
                whole._n_bytes -= whole._items.pop(key)[1]
            if n_bytes > whole._most_bytes:
                return
            whole._items[key] = item, n_bytes
            whole._n_bytes += n_bytes
            while whole._n_bytes > whole._most_bytes:
                whole._n_bytes -= whole._items.popitem(last=False)[1][1]


NO_MEMORY = Memory()


def _n_bytes(value: object) -> int:
    if isinstance(value, np.ndarray):
        return value.nbytes + 128
    if isinstance(value, tuple | list):
        return 64 + sum(map(_n_bytes, value))
    if isinstance(value, Mapping):
        return 64 + sum(map(_n_bytes, value.values()))
    if is_dataclass(value) and not isinstance(value, type):
        return 64 + sum(_n_bytes(getattr(value, f.name)) for f in fields(value))
    return 64


def rows_from(
    last: Sequence[Mapping[str, NDArray[Any]]],
    ids: Sequence[AnyInts],
    wanted: AnyInts,
    make: Callable[[NDArray[np.bool_]], dict[str, NDArray[Any]]],
) -> dict[str, NDArray[Any]]:
    """Arrays by name whose rows have the `wanted` ids (K,), from `last` arrays, whose rows have these `ids`.

    Rows that none of them has are made by `make`, which gets a mask (K,) of them.
    """
    found: dict[str, NDArray[Any]] = {}
    new = np.ones(len(wanted), bool)

    def put(here: NDArray[np.bool_], rows: Mapping[str, NDArray[Any]]) -> None:
        for name, values in rows.items():
            if name not in found:
                found[name] = np.empty((len(wanted), *values.shape[1:]), values.dtype)
            found[name][here] = values

    for arrays, of_rows in zip(last, ids, strict=True):
        order = np.argsort(of_rows)
        at = order[np.minimum(np.searchsorted(of_rows, wanted, sorter=order), len(order) - 1)]
        here = new & (of_rows[at] == wanted)
        if here.all():
            return {name: values[at] for name, values in arrays.items()}
        if here.any():
            put(here, {name: values[at[here]] for name, values in arrays.items()})
            new &= ~here
    if new.all():
        return make(new)
    if new.any():
        put(new, make(new))
    return found


MOST_ROW_BYTES = 1 << 27  # of the rows of one array: the bodies of all clips of 4 s of a song

ReadBlocks = Callable[[Sequence[int]], Iterable[NDArray[Any]]]


class CachedRows:
    """Rows of an array (N, ...) by index, read in blocks of `block_rows`.

    If there is no room for blocks that are needed, those that are not needed now are removed. A copy in
    another process is empty.
    """

    def __init__(
        self, shape: tuple[int, ...], dtype: str, block_rows: int, most_bytes: int = MOST_ROW_BYTES
    ) -> None:
        self._of = shape, dtype, block_rows, most_bytes
        self._block_rows = block_rows
        n_blocks = -(-shape[0] // block_rows)
        block_bytes = block_rows * np.dtype(dtype).itemsize * int(np.prod(shape[1:], dtype=np.int64))
        n_slots = min(max(1, most_bytes // max(1, block_bytes)), max(1, n_blocks))
        self._blocks = np.empty((n_slots, block_rows, *shape[1:]), dtype)  # no memory until it is filled
        self._slots = np.full(n_blocks, -1, np.int64)  # of each block, or -1
        self._owners = np.full(n_slots, -1, np.int64)  # the block in each slot, or -1
        self._lock = Lock()

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), self._of

    def rows(self, rows: AnyInts, read: ReadBlocks) -> NDArray[Any]:
        """Copies of rows (...). Blocks that are not kept are read by `read`, which gets their numbers."""
        block, row = np.divmod(rows, self._block_rows)
        needed = np.flatnonzero(np.bincount(block.ravel(), minlength=len(self._slots)))
        with self._lock:
            if len(needed) <= len(self._owners):
                self._load(needed, read)
                return self._blocks[self._slots[block], row]
            found = np.empty((*np.shape(rows), *self._blocks.shape[2:]), self._blocks.dtype)
            for part in np.array_split(needed, -(-len(needed) // len(self._owners))):
                self._load(part, read)
                here = (block >= part[0]) & (block <= part[-1])
                found[here] = self._blocks[self._slots[block[here]], row[here]]
            return found

    def _load(self, needed: NDArray[np.int64], read: ReadBlocks) -> None:
        missing = needed[self._slots[needed] < 0]
        if len(missing) == 0:
            return
        if (self._owners < 0).sum() < len(missing):
            unneeded = ~np.isin(self._owners, needed)
            self._slots[self._owners[unneeded & (self._owners >= 0)]] = -1
            self._owners[unneeded] = -1
        free = np.flatnonzero(self._owners < 0)
        for slot, block, array in zip(free.tolist(), missing.tolist(), read(missing.tolist()), strict=False):
            self._blocks[slot, : len(array)] = array
            self._owners[slot], self._slots[block] = block, slot


# Values in files.


_DIGEST_BYTES = 32


class DiskCache:
    """Values in the files of a folder, of at most `max_bytes` together. Without a folder, nothing is kept.

    Values are arrays, numbers, texts, paths, dataclasses of this program, and collections of these. Reading
    one runs no code of the file.

    A value that was used here is not removed to make room for another one. So work on more inputs than have
    room finds those of the last time that it began with.
    """

    def __init__(self, folder: Path | None, max_bytes: int) -> None:
        self._folder, self._max_bytes = folder, max_bytes
        self._used: set[str] = set()
        self._n_bytes: int | None = None  # of all files, once they were listed
        self._is_full = False  # with values that were used here
        self.n_read: Counter[str] = Counter()  # in `each_cached`, by the name of the function

    @classmethod
    def of_user(cls, name: str, max_bytes: int) -> DiskCache:
        """The cache of this name. A warning says if the user has no folder for caches."""
        folder, why_not = cache_folder(name)
        if folder is None:
            _warn_once(why_not)
        return cls(folder, max_bytes)

    @property
    def is_on(self) -> bool:
        """Whether there is a folder."""
        return self._folder is not None

    def value(self, make: Callable[[], _Value], *inputs: object) -> _Value:
        """The value, not None, that `make` returns, or the one that it returned for the same inputs."""
        if not self.is_on:
            return make()
        key = digest(program(), *inputs)
        found: _Value | None = self.read(key)
        if found is None:
            found = make()
            self.write(key, found)
        return found

    def has(self, key: bytes | None) -> bool:
        """Whether there is a value, which is then not removed here."""
        if self._folder is None or key is None:
            return False
        path = _path(self._folder, key)
        try:
            os.utime(path)  # used now
        except OSError:
            return False
        self._used.add(path.name)
        return True

    def read(self, key: bytes) -> Any:
        """A value, or None if there is none, a damaged one, or something else than a value."""
        if self._folder is None:
            return None
        path = _path(self._folder, key)
        try:
            stored = path.read_bytes()
        except OSError:
            return None
        checksum, content = stored[:_DIGEST_BYTES], stored[_DIGEST_BYTES:]
        if hashlib.sha256(content).digest() != checksum:
            _log.warning("a kept value was damaged and is made again: %s", path)
            return None
        self.has(key)
        try:
            return unpickled(content, named=_named, max_opcodes=len(content))
        except pickle.UnpicklingError as error:
            _log.warning("a kept value is made again: %s", error)
            return None

    def write(self, key: bytes, value: object) -> None:
        """Write a value if there is room for it. A warning says if the folder cannot be written."""
        if self._folder is None:
            return
        content = BytesIO()
        _FieldsPickler(content, 5).dump(value)
        if not self._has_room(self._folder, _DIGEST_BYTES + content.tell()):
            return
        path = _path(self._folder, key)
        try:
            with atomic_path(path) as temporary:
                temporary.write_bytes(hashlib.sha256(content.getbuffer()).digest() + content.getbuffer())
        except ChoreographError as error:
            _log.warning("a value is not kept: %s", error)
        self._used.add(path.name)

    def _has_room(self, folder: Path, n_bytes: int) -> bool:
        """Whether a file of `n_bytes` has room. The oldest that were not used here are removed for it."""
        if self._n_bytes is None or self._n_bytes + n_bytes > self._max_bytes:
            self._n_bytes = self._without_oldest(folder, n_bytes)
        if self._n_bytes + n_bytes > self._max_bytes:
            return False
        self._n_bytes += n_bytes
        return True

    def _without_oldest(self, folder: Path, n_bytes: int) -> int:
        """Remove files until `n_bytes` have room, if they can have it. The bytes of those that are left."""
        if self._is_full:
            return self._max_bytes
        found = []
        for path in folder.glob("[!.]*"):  # not what is being written
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


NO_CACHE = DiskCache(None, 0)


@lru_cache
def _warn_once(why_not: str) -> None:
    _log.warning("values are not kept: %s", why_not)


def _path(folder: Path, key: bytes) -> Path:
    return folder / f"{key.hex()}.value"


@lru_cache(maxsize=1)
def program() -> list[str]:
    """The program's sources, and the versions of all packages that it may use, as a part of keys."""
    sources = hashlib.sha256()
    for path in sorted(Path(__file__).parents[1].rglob("*")):
        if path.suffix in (".py", ".json"):  # code, and numbers that it reads
            sources.update(path.read_bytes())
    found = [sources.hexdigest()]
    for name in sorted({re.split(r"[^\w.-]", text, maxsplit=1)[0] for text in requires(PACKAGE) or ()}):
        with suppress(PackageNotFoundError):
            found.append(f"{name} {version(name)}")
    return found


class _FieldsPickler(pickle.Pickler):
    """Writes the fields of a dataclass alone, not what it has computed from them."""

    def reducer_override(self, value: Any) -> Any:
        if is_dataclass(value) and not isinstance(value, type):
            state = {field.name: getattr(value, field.name) for field in fields(value)}
            return copyreg.__newobj__, (type(value),), state  # type: ignore[attr-defined]
        return NotImplemented


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


# Results of functions over many inputs.


def key_of(function: Callable[..., Any], *values: object) -> bytes | None:
    """The key of the result of a function, which depends on its arguments and on `values` alone.

    The key is None for a function of another package, which may change without its version.
    """
    given = function if isinstance(function, partial) else partial(function)
    if not given.func.__module__.startswith(f"{PACKAGE}."):
        return None
    named = given.func.__module__, given.func.__qualname__, given.args, given.keywords
    return digest(program(), *named, *values)


_cache: ContextVar[DiskCache] = ContextVar("cache", default=NO_CACHE)


@contextmanager
def caching(max_gb: float) -> Iterator[DiskCache]:
    """Inside, `each_cached` keeps results of up to `max_gb` gigabytes, or none if this is 0."""
    results = results_cache(int(max_gb * 1e9)) if max_gb > 0.0 else NO_CACHE
    token = _cache.set(results)
    try:
        yield results
    finally:
        _cache.reset(token)


def results_cache(max_bytes: int) -> DiskCache:
    """The user's cache of the results of functions."""
    return DiskCache.of_user("results", max_bytes)


def each_cached(
    function: Callable[[_Input], _Value],
    inputs: Iterable[_Input],
    *,
    key: Callable[[_Input], bytes | None],
    is_kept: Callable[[_Value], bool] = lambda _: True,
    killed: Callable[[_Input], _Value] | None = None,
    named: Callable[[_Input], str] = str,
    fewest: int = FEWEST,
    files: Callable[[_Input], Iterable[Path]] | None = None,
) -> Iterator[_Value]:
    """As `workers.each`. Inside of `caching`, results of earlier calls with the same inputs are read.

    `key(input)` is the `key_of` its result, or None for one that is not kept. Only results for which
    `is_kept` is true are written.
    """
    cache = _cache.get()
    if not cache.is_on:
        yield from each(function, inputs, killed=killed, named=named, fewest=fewest, files=files)
        return
    inputs = list(inputs)
    keys = [key(one) for one in inputs]
    known = [cache.has(key) for key in keys]
    new = [one for one, is_known in zip(inputs, known, strict=True) if not is_known]
    made = each(function, new, killed=killed, named=named, fewest=fewest, files=files)
    for one, of_one, is_known in zip(inputs, keys, known, strict=True):
        result = cache.read(of_one) if is_known and of_one is not None else None
        if result is not None:
            cache.n_read[(function.func if isinstance(function, partial) else function).__name__] += 1
            yield result
            continue
        result = function(one) if is_known else next(made)
        if of_one is not None and is_kept(result):
            cache.write(of_one, result)
        yield result
