"""Gives memory that is free to the system, which a long song needs for the large arrays of its next stage."""

from __future__ import annotations

import ctypes
import sys
from contextlib import suppress

LONG_S = 600.0  # of a song whose free memory is returned


def return_memory(duration_s: float) -> None:
    """Give memory that is free to the system, in a long song and where the C library can: 0.6 GB in an hour.

    It would stay in small gaps, which the large arrays of the next stage do not fit into.
    """
    if duration_s > LONG_S and sys.platform == "linux":
        with suppress(OSError, AttributeError):  # of another C library
            ctypes.CDLL(None).malloc_trim(0)
