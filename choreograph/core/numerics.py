"""Numerics for several rooms: default settings, blocks of frames, distances, ranks, interpolation."""

from __future__ import annotations

import hashlib
import sys
from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import fields, is_dataclass
from pathlib import PurePath
from threading import Lock
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

# Types of arrays that most modules have in their signatures.
Floats = NDArray[np.float64]
AnyFloats = NDArray[np.floating]
AnyInts = NDArray[np.integer]
Indices = NDArray[np.int64]

# Settings of NumPy and torch.
#
# Both libraries keep settings for the whole process or thread. Results do not depend on settings of the
# caller, which are restored afterwards. Random numbers are drawn from generators of our own. The state of
# torch's global generator is forked.


@contextmanager
def default_numerics() -> Iterator[None]:
    """Use the default settings of NumPy and torch in the block. It decorates functions, too.

    These are NumPy's handling of floating-point errors, and torch's default type and device, precision of
    matrix products, autocast and recording of gradients. It does not import torch.
    """
    with ExitStack() as stack:
        stack.enter_context(np.errstate(divide="warn", over="warn", under="ignore", invalid="warn"))
        if "torch" in sys.modules:
            stack.enter_context(_default_torch())
        yield


@contextmanager
def _default_torch() -> Iterator[None]:
    import torch

    dtype, precision = torch.get_default_dtype(), torch.get_float32_matmul_precision()
    with ExitStack() as stack:
        # Settings of the whole process are changed only where they differ, because other threads share them.
        if dtype != torch.float32:
            stack.callback(torch.set_default_dtype, dtype)
            torch.set_default_dtype(torch.float32)
        if precision != "highest":
            stack.callback(torch.set_float32_matmul_precision, precision)
            torch.set_float32_matmul_precision("highest")
        if torch.get_default_device().type != "cpu":
            stack.enter_context(torch.device("cpu"))
        if torch.is_autocast_enabled("cpu"):
            stack.enter_context(torch.autocast("cpu", enabled=False))
        stack.enter_context(torch.inference_mode(False))
        stack.enter_context(torch.enable_grad())
        yield


@contextmanager
def one_thread() -> Iterator[None]:
    """Use the settings of `default_numerics`, and one thread in BLAS and torch.

    The order of sums then does not depend on the number of cores. More threads do not make a dance faster,
    because its arrays are small and the planner has threads of its own. It does not import torch. If torch is
    imported in the block, `torch_imported` is to be called.
    """
    with ExitStack() as block:
        block.enter_context(default_numerics())
        _one_thread_blocks.append(block)
        block.callback(_one_thread_blocks.remove, block)
        if "torch" in sys.modules:
            torch_imported()
        block.enter_context(threadpool_limits(1, user_api="blas"))
        yield


_one_thread_blocks: list[ExitStack] = []  # those in progress


def torch_imported() -> None:
    """Limit torch to one thread until the end of the outermost block of `one_thread`, if there is one."""
    import torch

    if _one_thread_blocks and torch.get_num_threads() > 1:
        _one_thread_blocks[0].callback(torch.set_num_threads, torch.get_num_threads())
        torch.set_num_threads(1)


# Blocks of frames, so that temporary arrays do not grow with the length of a song or motion.


BLOCK_FRAMES = 4096  # 68 s at 60 fps


def frame_blocks(n_frames: int, size: int = BLOCK_FRAMES) -> Iterator[slice]:
    """Consecutive slices of at most `size` frames that cover frames 0 to `n_frames` - 1."""
    for start in range(0, n_frames, size):
        yield slice(start, min(start + size, n_frames))


def sums_before(blocks: Iterable[AnyFloats], frames: AnyInts) -> Floats:
    """Sums (..., D) of all rows before each of `frames` (...), 0 to T, of rows (T, D) in blocks.

    Rows are added one after another, so that the result does not depend on the sizes of the blocks.
    """
    sums = np.zeros((*np.shape(frames), 0))
    before, position = np.zeros(0), 0
    for block in blocks:  # (T_b, D)
        if position == 0:
            before = np.zeros(block.shape[1])
            sums = np.zeros((*np.shape(frames), block.shape[1]))
        running = np.cumsum(np.concatenate([before[None], block]), axis=0)  # (T_b + 1, D)
        inside = (frames > position) & (frames <= position + len(block))
        sums[inside] = running[frames[inside] - position]
        before, position = running[-1], position + len(block)
    return sums


# Arrays, or groups of them, that are kept for later calls.

_Item = TypeVar("_Item")


class RecentItems(Generic[_Item]):
    """Keeps the items that were used last, up to a number of bytes. Threads may share it. A copy is empty."""

    def __init__(self, most_bytes: int) -> None:
        self._most_bytes, self._n_bytes = most_bytes, 0
        self._items: OrderedDict[Hashable, tuple[_Item, int]] = OrderedDict()
        self._lock = Lock()

    def __reduce__(self) -> tuple[type[RecentItems[_Item]], tuple[int]]:
        return type(self), (self._most_bytes,)

    @property
    def n_bytes(self) -> int:
        """The size of all items."""
        return self._n_bytes

    def get(self, key: Hashable) -> _Item | None:
        """The item with this key, or None if it is not kept."""
        with self._lock:
            if key not in self._items:
                return None
            self._items.move_to_end(key)
            return self._items[key][0]

    def keep(self, key: Hashable, item: _Item, n_bytes: int) -> None:
        """Keep an item, in place of one with its key, of those not used for longest, or not if too large."""
        with self._lock:
            if key in self._items:
                self._n_bytes -= self._items.pop(key)[1]
            if n_bytes > self._most_bytes:
                return
            self._items[key] = item, n_bytes
            self._n_bytes += n_bytes
            while self._n_bytes > self._most_bytes:
                self._n_bytes -= self._items.popitem(last=False)[1][1]


_LAST_VALUES = 4  # of the same common inputs, from which parts are taken


class Memory:
    """Keeps values by the inputs that they were computed from, up to a number of bytes.

    A value is computed again only if an input has another content. It must depend on nothing else, and must
    not be changed. With 0 bytes, nothing is kept. Threads may share a memory.
    """

    def __init__(self, most_bytes: int = 0) -> None:
        self._kept: RecentItems[tuple[Any, ...]] | None = RecentItems(most_bytes) if most_bytes else None
        self._inputs = b""

    @property
    def is_on(self) -> bool:
        """Whether values are kept."""
        return self._kept is not None

    @property
    def n_bytes(self) -> int:
        """The size of the arrays that are kept."""
        return 0 if self._kept is None else self._kept.n_bytes

    def of(self, *inputs: object) -> Memory:
        """The same memory, for values that all depend on these inputs. See `digest`."""
        if self._kept is None:
            return self
        part = Memory()
        part._kept, part._inputs = self._kept, digest(self._inputs, *inputs)
        return part

    def value(self, compute: Callable[[], _Item], *inputs: object) -> _Item:
        """The value that `compute` returns, or the one that it returned for the same inputs."""
        if self._kept is None:
            return compute()
        key = self.key(*inputs)
        kept = self._kept.get(key)
        if kept is None:
            kept = (compute(),)
            self._kept.keep(key, kept, _n_bytes(kept))
        value: _Item = kept[0]
        return value

    def value_from_last(
        self, compute: Callable[[list[_Item]], _Item], common: Sequence[object], *inputs: object
    ) -> _Item:
        """As `value`, of the `common` inputs and the others. `compute` may take parts of other values.

        It gets the last values that were used with the same `common` inputs, the latest first, as far as
        they are kept.
        """
        if self._kept is None:
            return compute([])
        latest, key = self.key("latest", *common), self.key(*common, *inputs)
        keys: tuple[bytes, ...] = self._kept.get(latest) or ()
        kept = [item for item in map(self._kept.get, keys) if item is not None]
        value = self.value(lambda: compute([item[0] for item in kept]), *common, *inputs)
        keys = (key, *(other for other in keys if other != key))[:_LAST_VALUES]
        self._kept.keep(latest, keys, _n_bytes(keys))
        return value

    def key(self, *inputs: object) -> bytes:
        """The key of a value by its inputs, or nothing if no values are kept."""
        return b"" if self._kept is None else digest(self._inputs, *inputs)


NO_MEMORY = Memory()


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


def _n_bytes(value: object) -> int:
    """The size of the arrays in a value, with some bytes for every object."""
    if isinstance(value, np.ndarray):
        return value.nbytes + 128
    if isinstance(value, tuple | list):
        return 64 + sum(map(_n_bytes, value))
    if isinstance(value, Mapping):
        return 64 + sum(map(_n_bytes, value.values()))
    if is_dataclass(value) and not isinstance(value, type):
        return 64 + sum(_n_bytes(getattr(value, f.name)) for f in fields(value))
    return 64


# Distances. `squared_distances` is 2 to 15 times faster than `scipy.spatial.distance.cdist` for many vectors.
# Use cdist where both sides are small or equal vectors must be at a distance of exactly 0.


def squared_distances(a: AnyFloats, b: AnyFloats, *, b_squares: AnyFloats | None = None) -> AnyFloats:
    """Squared Euclidean distances (N, M) of vectors (N, D) and (M, D), never below 0.

    They are computed as |a|² + |b|² - 2 a·b, with the rounding error of |a|² + |b|², also for equal vectors.
    `b_squares` (M,) are |b|², for callers that pass the same `b` many times.
    """
    if b_squares is None:
        b_squares = np.sum(b**2, axis=1)
    squared: AnyFloats = np.sum(a**2, axis=1)[:, None] + b_squares - 2.0 * a @ b.T
    return np.maximum(squared, 0.0)


def chi_square_distance(a: Floats, b: Floats) -> Floats:
    """Chi-square distance (...) of histograms (..., K) that sum to 1, from 0 (equal) to 1 (disjoint).

    It is ½ Σ_k (a_k - b_k)² / (a_k + b_k), our reading of Rhythm is a Dancer, equation 11. Bins that are
    empty in both add nothing. The arrays broadcast.
    """
    a, b = np.asarray(a, np.float64), np.asarray(b, np.float64)
    both = a + b
    distance: Floats = 0.5 * np.sum(np.square(a - b) / np.where(both > 0, both, 1.0), axis=-1)
    return distance


def mean_ranks(values: AnyFloats) -> Floats:
    """Ranks (N,) from 1 on of values (N,). Equal values have the mean of their ranks."""
    _, which, n_equal = np.unique(values, return_inverse=True, return_counts=True)
    ranks: Floats = (np.cumsum(n_equal) - 0.5 * (n_equal - 1))[which]
    return ranks


# Linear interpolation at fractional frames.


def frame_weights(frames: AnyFloats, n_frames: int) -> tuple[Indices, Indices, Floats]:
    """Indices of the frames before and after fractional `frames` (...), and the weight of the latter.

    Each has the shape of `frames`, which is clamped to 0 to `n_frames` - 1.
    """
    inside: Floats = np.clip(np.asarray(frames, np.float64), 0.0, n_frames - 1)
    low: Indices = np.minimum(inside.astype(np.int64), max(n_frames - 2, 0))
    high: Indices = np.minimum(low + 1, n_frames - 1)
    return low, high, inside - low


def interpolate_frames(values: AnyFloats, frames: AnyFloats) -> Floats:
    """`values` (T, ...) at fractional `frames` (F...), clamped to the first and last: (F..., ...)."""
    low, high, weight = frame_weights(frames, len(values))
    weight = weight.reshape((*weight.shape, *[1] * (values.ndim - 1)))
    return values[low] * (1 - weight) + values[high] * weight


# Hierarchies of joints or bones, every parent before its children.


def descendants(parents: NDArray[np.int64], top: int) -> list[int]:
    """A joint and all joints below it, in order, of a hierarchy with parents (J,), -1 for a root."""
    found = {top}
    for joint in range(top + 1, len(parents)):
        if int(parents[joint]) in found:
            found.add(joint)
    return sorted(found)


# Zigzag encoding of signed 16-bit integers as unsigned ones: 0, -1, 1, -2 become 0, 1, 2, 3.
#
# The high byte of a small number is 0 for both signs, so that differences compress well.


def zigzag_encode(integers: NDArray[np.int16]) -> NDArray[np.uint16]:
    """Signed integers (...) int16 as unsigned ones (...) uint16."""
    return ((integers << 1) ^ (integers >> 15)).view(np.uint16)


def zigzag_decode(encoded: NDArray[np.uint16]) -> NDArray[np.int16]:
    """The integers (...) int16 that `zigzag_encode` has encoded."""
    return ((encoded >> 1) ^ -(encoded & 1)).view(np.int16)
