"""Rows of numbers as text with five decimals, several times as fast as `%`, with the same characters."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.motion.rotations import compiled

_MANY = 1 << 18  # numbers, for which it takes less time to compile a kernel than to do without it
_LARGEST = 1e6  # number that the kernel writes
_UNSURE = 1e-4  # distance from the middle of two decimals, within which the kernel could round otherwise
_WIDTH = 14  # characters of a number at most: sign, six digits, point, five decimals, and what follows it


class DecimalRows:
    """Writes rows of numbers, in blocks, as lines of text with a space between two numbers."""

    def __init__(self, n_numbers: int) -> None:
        """`n_numbers` are in all blocks together."""
        self._is_compiled = n_numbers >= _MANY

    def text(self, rows: NDArray[np.float64]) -> bytes:
        """The lines of rows (N, C), each with its end."""
        line = " ".join(["%.5f"] * rows.shape[1]) + "\n"
        if not self._is_compiled:
            return "".join([line % tuple(row) for row in rows.tolist()]).encode()
        text, ends = np.empty(_WIDTH * rows.size, np.uint8), np.empty(len(rows), np.int64)
        compiled(_write)(np.ascontiguousarray(rows, np.float64), text, ends)
        pieces, begin = [], 0
        for index in np.flatnonzero(ends < 0).tolist():  # in which a number could be rounded otherwise
            end = -1 - int(ends[index])
            pieces += [text[begin:end].tobytes(), (line % tuple(rows[index].tolist())).encode()]
            begin = end
        last = int(ends[-1]) if len(ends) else 0
        return b"".join([*pieces, text[begin : last if last >= 0 else -1 - last].tobytes()])


def _write(
    rows: NDArray[np.float64], text: NDArray[np.uint8], ends: NDArray[np.int64]
) -> None:  # pragma: no cover - compiled
    """Set `text`, and the end of each row in it (N,). The end is -1 - end of a row that is left out."""
    at = 0
    for index in range(len(rows)):
        begin, is_sure = at, True
        for value in rows[index]:
            size = abs(value)
            if not size < _LARGEST:
                is_sure = False
                break
            scaled = size * 1e5
            whole = int(scaled)
            past = scaled - whole
            if abs(past - 0.5) < _UNSURE:
                is_sure = False
                break
            if past > 0.5:
                whole += 1
            if value < 0 or (value == 0 and np.copysign(1.0, value) < 0):
                text[at] = 45
                at += 1
            n_digits, rest = 6, whole // 1_000_000
            while rest > 0:
                n_digits, rest = n_digits + 1, rest // 10
            for digit in range(n_digits):  # from the last to the first, around the point
                place = at + n_digits - digit - (1 if digit >= 5 else 0)
                text[place] = 48 + whole % 10
                whole //= 10
            text[at + n_digits - 5] = 46
            at += n_digits + 1
            text[at] = 32
            at += 1
        if is_sure:
            text[at - 1] = 10
            ends[index] = at
        else:
            at = begin
            ends[index] = -1 - at
