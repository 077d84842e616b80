"""Long songs and motions in blocks of frames: what is only needed on the way does not grow with them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

BLOCK_FRAMES = 4096  # 68 s at 60 fps


def frame_blocks(n_frames: int, size: int = BLOCK_FRAMES) -> Iterator[slice]:
    """Consecutive slices of at most `size` frames that cover frames 0 … `n_frames` - 1."""
    for start in range(0, n_frames, size):
        yield slice(start, min(start + size, n_frames))


def sums_before(blocks: Iterable[NDArray[np.floating]], frames: NDArray[np.integer]) -> NDArray[np.float64]:
    """Sums (..., D) of all rows before each of `frames` (...), from 0 to T, of rows (T, D) in blocks.

    Rows are added one after another, so that the blocks' sizes change no bit.
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
