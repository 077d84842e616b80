"""What keeps the memory of an hour of song small: free memory is returned, and arrays are in temporary files.

A dance to a song of more than ten minutes is the same as it would be otherwise. It is only made with less
memory, and takes a little longer.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from tempfile import TemporaryFile
from threading import Event, Lock, Thread
from typing import Any, cast, overload

import numpy as np
from numpy.typing import NDArray

LONG_S = 600.0


def is_long(duration_s: float) -> bool:
    """Whether a song is made with less memory. In ten minutes, samples are 53 MB and poses of nodes 85 MB."""
    return duration_s > LONG_S


# Memory that is free is given to the system, which a long song needs for the large arrays of its next stage.


_EVERY_S = 0.5

# Parameters of `mallopt` of the GNU C library, and their values in bytes: within a long song, and as the
# library would have set them itself once a large array was freed.
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
_IN_LONG_SONG = {_TRIM_THRESHOLD: 1 << 24, _MMAP_THRESHOLD: 1 << 20}
_USUAL = {_TRIM_THRESHOLD: 1 << 26, _MMAP_THRESHOLD: 1 << 25}


@contextmanager
def memory_returned(duration_s: float) -> Iterator[None]:
    """Give memory that is free to the system in the block, for a long song and where the C library can.

    Otherwise, the library keeps arrays of up to 32 MB for later ones, between which gaps remain. Smaller ones
    leave gaps, too, which are returned twice a second: they have 0.6 GB in an hour of song.
    """
    if not is_long(duration_s) or sys.platform != "linux":
        yield
        return
    ended = Event()
    returning = Thread(target=_return_memory, args=(ended,), name="free memory", daemon=True)
    _set(_IN_LONG_SONG)
    returning.start()
    try:
        yield
    finally:
        ended.set()
        returning.join()
        _set(_USUAL)


def _return_memory(ended: Event) -> None:
    with suppress(OSError, AttributeError):  # of another C library
        is_last = False
        while not is_last:
            is_last = ended.wait(_EVERY_S)
            ctypes.CDLL(None).malloc_trim(0)


def _set(parameters: dict[int, int]) -> None:
    with suppress(OSError, AttributeError):  # of another C library
        for parameter, value in parameters.items():
            ctypes.CDLL(None).mallopt(parameter, value)


# Arrays in a temporary file, where they take no memory of the process.


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
