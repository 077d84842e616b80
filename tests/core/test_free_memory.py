"""Free memory is returned to the system in long songs only."""

from __future__ import annotations

import sys
import threading
from contextlib import suppress
from pathlib import Path

import pytest

from choreograph.core import free_memory
from choreograph.core.free_memory import LONG_S, memory_returned

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
    monkeypatch.setattr(free_memory, "_set", set_to.append)
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
