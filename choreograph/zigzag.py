"""Zigzag encoding: signed 16-bit integers as unsigned ones, small magnitudes as small numbers.

0, -1, 1, -2, … become 0, 1, 2, 3, …: the high byte of a small number is then 0 whatever its sign, so that
differences compress well.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def zigzag_encode(integers: NDArray[np.int16]) -> NDArray[np.uint16]:
    """Signed integers (...) int16 as unsigned ones (...) uint16."""
    return ((integers << 1) ^ (integers >> 15)).view(np.uint16)


def zigzag_decode(encoded: NDArray[np.uint16]) -> NDArray[np.int16]:
    """The integers (...) int16 that `zigzag_encode` was given."""
    return ((encoded >> 1) ^ -(encoded & 1)).view(np.int16)
