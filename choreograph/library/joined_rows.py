"""Rows of an array that are rows of a repertoire file and new ones, which are read when they are written."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from choreograph.library.store import RepertoireFile

BLOCK_ROWS = 1 << 16  # that are read at once


class JoinedRows:
    """An array of rows (N, ...) in several parts: rows of an array of a file, or arrays in memory.

    It has the shape and the dtype of the array, and `np.asarray` returns all of it.

    Parameters
    ----------
    file : the repertoire that some of the rows are in
    name : the array there
    parts : ranges (start, stop) of rows of the file, and arrays, in the order of the result
    dtype : of the result
    """

    def __init__(
        self,
        file: RepertoireFile,
        name: str,
        parts: Sequence[tuple[int, int] | NDArray[Any]],
        dtype: DTypeLike,
    ) -> None:
        self.file, self.name = file, name
        self.dtype = np.dtype(dtype)
        self._parts = [part for part in parts if _length(part) > 0]
        self._ends = np.cumsum([0, *map(_length, self._parts)])  # where each part ends
        self.shape = (int(self._ends[-1]), *file.shapes[name][1:])

    def __len__(self) -> int:
        return self.shape[0]

    @property
    def size(self) -> int:
        """The number of values."""
        return int(np.prod(self.shape, dtype=np.int64))

    @property
    def nbytes(self) -> int:
        """The number of bytes of the whole array."""
        return self.size * self.dtype.itemsize

    @property
    def new_parts(self) -> list[NDArray[Any]]:
        """The arrays in memory."""
        return [part for part in self._parts if not isinstance(part, tuple)]

    @property
    def n_kept(self) -> int:
        """How many rows at the beginning are the first rows of the file."""
        kept = 0
        for part in self._parts:
            if not isinstance(part, tuple) or part[0] != kept:
                return kept
            kept = part[1]
        return kept

    def rows(self, start: int, stop: int) -> NDArray[Any]:
        """Rows `start` to `stop`. Raises `RepertoireError` if a block of the file is damaged."""
        found = []
        for part, (first, end) in zip(self._parts, pairwise(self._ends.tolist()), strict=True):
            low, high = max(start, first) - first, min(stop, end) - first
            if low < high and isinstance(part, tuple):
                found.append(self.file.read(self.name, slice(part[0] + low, part[0] + high)))
            elif low < high and not isinstance(part, tuple):
                found.append(part[low:high])
        if not found:
            return np.zeros((0, *self.shape[1:]), self.dtype)
        return np.concatenate(found, dtype=self.dtype, casting="unsafe")

    def blocks(self, start: int, n_rows: int) -> Iterator[tuple[int, NDArray[Any]]]:
        """First row and rows of blocks from row `start` on, of multiples of `n_rows` that fit in memory."""
        n_rows *= max(1, BLOCK_ROWS // n_rows)
        for first in range(start, len(self), n_rows):
            yield first, self.rows(first, min(first + n_rows, len(self)))

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        return self.rows(0, len(self)).astype(self.dtype if dtype is None else dtype, copy=False)


Rows = NDArray[Any] | JoinedRows


def _length(part: tuple[int, int] | NDArray[Any]) -> int:
    return part[1] - part[0] if isinstance(part, tuple) else len(part)
