"""Arrays of long songs in a temporary file, where they take no memory of the process."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from tempfile import TemporaryFile
from threading import Lock
from typing import Any, cast, overload

import numpy as np
from numpy.typing import NDArray


class ScratchFile:
    """A temporary file of bytes, which ends with the object. Threads may share it."""

    def __init__(self) -> None:
        """Raises `OSError` if the system has no folder for temporary files."""
        self._file = TemporaryFile(buffering=0)  # noqa: SIM115 - it is open as long as the object is used
        self._lock = Lock()
        self.n_bytes = 0

    def append(self, array: NDArray[Any]) -> int:
        """Write an array, and return where it begins. Raises `OSError` if there is no room for it."""
        contiguous = np.ascontiguousarray(array)
        left = _bytes_of(contiguous)
        with self._lock:
            begin = self.n_bytes
            self._file.seek(begin)
            while left:
                left = left[self._file.write(left) :]
            self.n_bytes = begin + contiguous.nbytes
        return begin

    def read_into(self, array: NDArray[Any], begin: int) -> None:
        """Read the bytes from `begin` on into a contiguous array. Raises `OSError` if they cannot be read."""
        left = _bytes_of(array)
        with self._lock:
            self._file.seek(begin)
            while left:
                n_read = self._file.readinto(left)
                if not n_read:
                    raise OSError("expected the rest of a temporary file, got its end: it was changed")
                left = left[n_read:]

    def mapped(self, dtype: np.dtype[Any]) -> NDArray[Any]:
        """All that was written, as an array (N,), which the system reads where it is used."""
        return np.asarray(np.memmap(self._file, dtype, mode="c"))


def _bytes_of(contiguous: NDArray[Any]) -> memoryview:
    return contiguous.data.cast("B") if contiguous.size else memoryview(b"")  # which cannot be cast


def scratch_file() -> ScratchFile | None:
    """A new file, or None where there is no folder for one."""
    with suppress(OSError):
        return ScratchFile()
    return None


class StoredArrays(Sequence[NDArray[Any]]):
    """A list of arrays in a temporary file. Those for which there is no room there are kept in memory."""

    def __init__(self, *, in_memory: bool = False) -> None:
        """With `in_memory`, it is an ordinary list."""
        self._file = None if in_memory else scratch_file()
        self._items: list[NDArray[Any] | _Place] = []

    def __len__(self) -> int:
        return len(self._items)

    @overload
    def __getitem__(self, index: int) -> NDArray[Any]: ...
    @overload
    def __getitem__(self, index: slice) -> list[NDArray[Any]]: ...
    def __getitem__(self, index: int | slice) -> NDArray[Any] | list[NDArray[Any]]:
        if isinstance(index, slice):
            return [self._read(item) for item in self._items[index]]
        return self._read(self._items[index])

    def __setitem__(self, index: int, array: NDArray[Any]) -> None:
        self._items[index] = self._stored(array)

    def append(self, array: NDArray[Any]) -> None:
        """Add an array."""
        self._items.append(self._stored(array))

    def clear(self) -> None:
        """Remove all arrays, and their file."""
        self._file = None
        self._items.clear()

    def _stored(self, array: NDArray[Any]) -> NDArray[Any] | _Place:
        if self._file is None:
            return array
        try:
            return self._file.append(array), array.shape, array.dtype
        except OSError:  # the disk is full
            return array

    def _read(self, item: NDArray[Any] | _Place) -> NDArray[Any]:
        if isinstance(item, np.ndarray) or self._file is None:
            return cast(NDArray[Any], item)
        begin, shape, dtype = item
        array = np.empty(shape, dtype)
        self._file.read_into(array, begin)
        return array


_Place = tuple[int, tuple[int, ...], np.dtype[Any]]  # where an array begins in the file, and what it is
