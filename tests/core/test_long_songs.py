"""Long songs take less memory: what is free is returned, and arrays in files are those that were written."""

from __future__ import annotations

import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from choreograph.core import long_songs
from choreograph.core.long_songs import LONG_S, ScratchFile, StoredArrays, memory_returned

PIECE_BYTES = 1 << 12


def resident_bytes() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096


@pytest.mark.skipif(sys.platform != "linux", reason="other C libraries keep their free memory")
def test_gaps_between_small_pieces_are_returned():
    pieces = [bytes(PIECE_BYTES) for _ in range(20_000)]
    kept = pieces[::50]
    del pieces
    before = resident_bytes()
    with memory_returned(LONG_S):
        pass
    assert before - resident_bytes() < 1e6
    with memory_returned(LONG_S + 1):
        pass
    assert before - resident_bytes() > 40e6
    assert len(kept) == 400


def test_another_c_library_is_left_as_it_is(monkeypatch):
    monkeypatch.setattr("ctypes.CDLL", lambda name: object())
    with memory_returned(2 * LONG_S):
        pass


@pytest.mark.skipif(sys.platform != "linux", reason="other C libraries have other parameters")
def test_parameters_are_set_within_a_long_song_alone(monkeypatch):
    set_to = []
    monkeypatch.setattr(long_songs, "_set", set_to.append)
    n_threads = threading.active_count()
    with memory_returned(LONG_S):
        assert threading.active_count() == n_threads
    assert set_to == []
    with suppress(KeyError), memory_returned(LONG_S + 1):
        assert len(set_to) == 1
        raise KeyError
    assert len(set_to) == 2 and set_to[0].keys() == set_to[1].keys()
    assert all(set_to[0][name] < set_to[1][name] for name in set_to[0])
    assert threading.active_count() == n_threads


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

    monkeypatch.setattr(long_songs, "TemporaryFile", missing)
    same(list(stored(ARRAYS)), ARRAYS)


def test_a_file_that_was_changed_is_an_error():
    file = ScratchFile()
    begin = file.append(np.arange(4))
    with pytest.raises(OSError, match="temporary file"):
        file.read_into(np.empty(5, np.int64), begin)
