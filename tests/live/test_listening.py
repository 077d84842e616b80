"""Requests by OSC on a port of this machine, and typed lines."""

from __future__ import annotations

import socket
import time

import pytest

from choreograph.core.errors import ChoreographError
from choreograph.live.listening import listening, take_lines
from choreograph.live.osc import Message, bundle
from choreograph.live.requests import Request


def test_requests_arrive_and_other_packets_are_noted():
    asked, notes = [], []
    with listening(0, asked.append, notes.append) as port, socket.socket(type=socket.SOCK_DGRAM) as out:
        for packet in (
            Message("/dance/genre", ("salsa",)).to_bytes(),
            b"no packet of OSC",
            bundle([Message("/dance/seed", (3,)), Message("/dance/energy", (0.5,))]),
            Message("/dance/colour", ("red",)).to_bytes(),
        ):
            out.sendto(packet, ("127.0.0.1", port))
        until = time.monotonic() + 5.0
        while (len(asked) < 3 or len(notes) < 2) and time.monotonic() < until:
            time.sleep(0.01)
    assert asked == [Request("genre", "salsa"), Request("seed", 3), Request("energy", 0.5)]
    assert len(notes) == 2 and "colour" in notes[1]


def test_a_port_in_use_is_said():
    with (
        listening(0, print, print) as port,
        pytest.raises(ChoreographError, match="free UDP port for --control"),
        listening(port, print, print),
    ):
        pass


def test_lines_are_taken_until_there_are_no_more():
    asked, notes = [], []
    take_lines(["genre house\n", "\n", "faster\n", "seed 2\n"], asked.append, notes.append)
    assert asked == [Request("genre", "house"), Request("seed", 2)]
    assert len(notes) == 1 and "faster" in notes[0]
