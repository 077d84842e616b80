"""Free memory is returned to the system in long songs only."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from choreograph.core.free_memory import LONG_S, return_memory

PIECE_BYTES = 1 << 12


def resident_bytes() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096


@pytest.mark.skipif(sys.platform != "linux", reason="other C libraries keep their free memory")
def test_gaps_between_small_pieces_are_returned():
    pieces = [bytes(PIECE_BYTES) for _ in range(20_000)]
    kept = pieces[::50]
    del pieces
    before = resident_bytes()
    return_memory(LONG_S)
    assert before - resident_bytes() < 1e6
    return_memory(LONG_S + 1)
    assert before - resident_bytes() > 40e6
    assert len(kept) == 400


def test_another_c_library_is_left_as_it_is(monkeypatch):
    monkeypatch.setattr("ctypes.CDLL", lambda name: object())
    return_memory(2 * LONG_S)
