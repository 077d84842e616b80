"""Gives memory that is free to the system, which a long song needs for the large arrays of its next stage."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from threading import Event, Thread

LONG_S = 600.0  # of a song whose free memory is returned
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
    if duration_s <= LONG_S or sys.platform != "linux":
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
