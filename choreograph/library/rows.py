"""Blocks of the rows of a stored array, which are kept in memory up to a number of bytes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.core.numerics import AnyInts

MOST_BYTES = 1 << 27  # of the rows of one array: the bodies of all clips of 4 s of a song

ReadBlocks = Callable[[Sequence[int]], Iterable[NDArray[Any]]]


class KeptBlocks:
    """Rows of an array (N, ...) by index, read in blocks of `block_rows`. Threads may share them.

    If there is no room for blocks that are needed, those that are not needed now are removed.
    """

    def __init__(
        self,
        shape: tuple[int, ...],
        dtype: str,
        block_rows: int,
        state: object,
        most_bytes: int = MOST_BYTES,
    ) -> None:
        self.state = state  # of the file that the blocks were read from
        self._of = shape, dtype, block_rows, state, most_bytes
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
