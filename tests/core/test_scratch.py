"""Laws of arrays in temporary files: they are those that were written, also if the disk is full."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from choreograph.core import scratch
from choreograph.core.scratch import ScratchFile, StoredArrays

RNG = np.random.default_rng(0)
ARRAYS = [
    RNG.normal(size=(3, 5)).astype(np.float32), np.zeros((0, 4)), np.arange(7), RNG.normal(size=(2, 3, 4)).T,
    np.array([[True, False]]),
]  # fmt: skip


def same(found, wanted):
    assert [one.dtype for one in found] == [one.dtype for one in wanted]
    assert all(np.array_equal(one, other) for one, other in zip(found, wanted, strict=True))


def stored(arrays, **options):
    made = StoredArrays(**options)
    for array in arrays:
        made.append(array)
    return made


@pytest.mark.parametrize("in_memory", [False, True])
def test_arrays_are_those_that_were_stored(in_memory):
    made = stored(ARRAYS, in_memory=in_memory)
    same(list(made), ARRAYS)
    same(made[1:3], ARRAYS[1:3])
    same([made[-1]], ARRAYS[-1:])
    assert len(made) == len(ARRAYS)
    with pytest.raises(IndexError):
        made[len(ARRAYS)]
    made[1] = np.ones((9, 9))
    same(list(made), [ARRAYS[0], np.ones((9, 9)), *ARRAYS[2:]])
    made.clear()
    assert list(made) == []


def test_what_was_read_may_be_changed():
    made = stored(ARRAYS)
    made[0][:] = 0.0
    same([made[0]], ARRAYS[:1])


def test_threads_read_one_file():
    arrays = [np.full((64, 64), number, np.float32) for number in range(200)]
    made = stored(arrays)
    with ThreadPoolExecutor(4) as pool:
        same(list(pool.map(made.__getitem__, range(200))), arrays)


def test_arrays_without_room_on_disk_are_kept_in_memory(monkeypatch):
    append, n_calls = ScratchFile.append, []

    def full(self, array):
        n_calls.append(1)
        if len(n_calls) % 2:
            raise OSError("no space left on device")
        return append(self, array)

    monkeypatch.setattr(ScratchFile, "append", full)
    same(list(stored(ARRAYS)), ARRAYS)
    assert len(n_calls) == len(ARRAYS)


def test_without_a_folder_for_temporary_files_arrays_are_kept_in_memory(monkeypatch):
    def missing(**_):
        raise FileNotFoundError("no usable temporary directory found")

    monkeypatch.setattr(scratch, "TemporaryFile", missing)
    same(list(stored(ARRAYS)), ARRAYS)


def test_a_file_that_was_changed_is_an_error():
    file = ScratchFile()
    begin = file.append(np.arange(4))
    with pytest.raises(OSError, match="temporary file"):
        file.read_into(np.empty(5, np.int64), begin)
