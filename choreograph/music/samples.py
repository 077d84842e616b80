"""Mono samples of songs: arrays, or those of a long song in a temporary file, of which slices are read."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from contextlib import suppress
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from choreograph.core.free_memory import LONG_S
from choreograph.core.numerics import frame_blocks
from choreograph.core.scratch import ScratchFile, scratch_file
from choreograph.core.timebase import SAMPLE_RATE_HZ

_MOST_IN_MEMORY = round(LONG_S * SAMPLE_RATE_HZ)  # samples: 53 MB
_BLOCK_SAMPLES = 1 << 20
_BYTES = 4  # of a sample


class Samples(Protocol):
    """Samples (S,) of a song, whose slices without steps are arrays."""

    @property
    def shape(self) -> tuple[int, ...]:
        """(S,)."""
        ...

    def __len__(self) -> int: ...

    def __getitem__(self, part: slice, /) -> Any: ...


class StoredSamples:
    """Samples (S,) in a temporary file. A slice of them is read when it is used."""

    def __init__(self, file: ScratchFile) -> None:
        """The samples that were written to a file."""
        self._file = file
        self.shape = (file.n_bytes // _BYTES,)

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, part: slice, /) -> NDArray[np.float32]:
        first, stop, step = part.indices(len(self))
        samples = np.empty(max(0, stop - first), np.float32)
        self._file.read_into(samples, _BYTES * first)
        return samples[::step]


def as_samples(samples: Samples) -> Samples:
    """Samples (S,) as float32, those of a file unchanged."""
    return samples if isinstance(samples, StoredSamples) else np.asarray(samples, np.float32)


def joined_samples(blocks: Iterable[NDArray[np.float32]]) -> Samples:
    """Blocks (S_b,) as one array, or in a temporary file if they are long and there is room for it."""
    parts: list[NDArray[np.float32]] = []
    n_samples, file, has_room = 0, None, True
    for block in blocks:
        parts.append(block)
        n_samples += len(block)
        if n_samples > _MOST_IN_MEMORY and has_room:
            file = file or scratch_file()
            has_room = file is not None and _moved(parts, file)
    if file is None:
        return concatenated(parts)
    stored = StoredSamples(file)
    return stored if has_room else concatenated([stored[:], *parts])


def _moved(parts: list[NDArray[np.float32]], file: ScratchFile) -> bool:
    """Whether all parts had room in a file. Those that are written are removed from the list."""
    with suppress(OSError):  # the disk is full
        while parts:
            file.append(parts[0])
            parts.pop(0)
    return not parts


def concatenated(parts: list[NDArray[np.float32]]) -> NDArray[np.float32]:
    """Concatenate and empty `parts`, so that peak memory is one song and not two."""
    samples = np.empty(sum(map(len, parts)), np.float32)
    end = len(samples)
    while parts:
        part = parts.pop()
        samples[end - len(part) : end] = part
        end -= len(part)
    return samples


def sample_blocks(samples: Samples) -> Iterator[NDArray[np.float32]]:
    """Consecutive blocks (S_b,) of all samples."""
    for part in frame_blocks(len(samples), _BLOCK_SAMPLES):
        yield samples[part]


def peak_of(samples: Samples) -> float:
    """The largest magnitude of samples (S,), of which there is one or more. NaN if one is NaN."""
    return float(np.max([max(block.max(), -block.min()) for block in sample_blocks(samples)]))


def sha256_of_samples(samples: Samples) -> bytes:
    """A checksum of samples (S,), which takes half the time of `core.cache.digest`."""
    checksum = hashlib.sha256()
    for block in sample_blocks(samples):
        checksum.update(np.ascontiguousarray(block).data)
    return checksum.digest()
