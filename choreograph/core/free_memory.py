"""Gives memory that is free to the system, which a long song needs for the large arrays of its next stage."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress

LONG_S = 600.0  # of a song whose free memory is returned

# Parameters of `mallopt` of the GNU C library, and their values in bytes: within a long song, and as the
# library would have set them itself once a large array was freed.
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
_IN_LONG_SONG = {_TRIM_THRESHOLD: 1 << 24, _MMAP_THRESHOLD: 1 << 20}
_USUAL = {_TRIM_THRESHOLD: 1 << 26, _MMAP_THRESHOLD: 1 << 25}


@contextmanager
def large_arrays_returned(duration_s: float) -> Iterator[None]:
    """Give the memory of arrays of 1 MB or more to the system when they are freed, in a long song.

    Otherwise, the C library keeps arrays of up to 32 MB for later ones, between which gaps remain.
    """
    if not _is_long(duration_s):
        yield
        return
    _set(_IN_LONG_SONG)
    try:
        yield
    finally:
        _set(_USUAL)


def return_memory(duration_s: float) -> None:
    """Give memory that is free to the system, in a long song and where the C library can: 0.6 GB in an hour.

    It would stay in small gaps, which the large arrays of the next stage do not fit into.
    """
    if _is_long(duration_s):
        with suppress(OSError, AttributeError):  # of another C library
            ctypes.CDLL(None).malloc_trim(0)


def _is_long(duration_s: float) -> bool:
    return duration_s > LONG_S and sys.platform == "linux"


def _set(parameters: dict[int, int]) -> None:
    with suppress(OSError, AttributeError):  # of another C library
        for parameter, value in parameters.items():
            ctypes.CDLL(None).mallopt(parameter, value)
