"""Requests for a dance that runs."""

from __future__ import annotations

import json
import socket
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

import choreograph as cg
from choreograph.core.errors import ChoreographError, FormatError
from choreograph.live.requests import KINDS, Request, listening, of_json, of_line, of_message, take_lines
from choreograph.live.vmc import Message, bundle

WANTED = [
    ("genre", "salsa", Request("genre", "salsa")),
    ("genre", "", Request("genre", "")),
    ("energy", 0.7, Request("energy", 0.7)),
    ("energy", 9.0, Request("energy", 1.1)),
    ("seed", 3, Request("seed", 3)),
    ("pin", "take:house-01", Request("pin", "take:house-01")),
    ("pin", "motif:41", Request("pin", "motif:41")),
]


@pytest.mark.parametrize(("kind", "value", "request_"), WANTED)
def test_all_ways_say_the_same(kind, value, request_):
    assert of_message(Message(f"/dance/{kind}", (value,))) == request_
    assert of_json(json.dumps({kind: value})) == [request_]
    assert of_line(f"{kind} {value}\n") == request_


def test_an_object_has_several_requests():
    assert of_json('{"genre": "house", "seed": 2}') == [Request("genre", "house"), Request("seed", 2)]


@pytest.mark.parametrize(
    ("kind", "value"),
    [
        ("genre", 3), ("energy", "much"), ("energy", float("nan")), ("energy", True), ("seed", 1.5),
        ("seed", -1), ("pin", "house-01"), ("pin", "motif:x"), ("pin", "take:"), ("speed", 2),
        ("seed", 10**3999), ("seed", -(10**3999)), ("energy", 10**3999), ("seed", float("inf")),
        ("seed", [10**3999]), ("pin", "motif:" + "9" * 5000), ("pin", "motif:" + "9" * 30),
        ("x" * 100_000, 1),
    ],
)  # fmt: skip
def test_other_values_are_refused(kind, value):
    with pytest.raises(FormatError, match="expected genre salsa") as raised:
        Request.of(kind, value)
    assert len(str(raised.value)) < 300


@pytest.mark.parametrize(
    "number", ["9" * 4000, "-" + "9" * 4000, "9" * 5000, "1e400", "NaN", "[" * 900 + "]" * 900]
)
@pytest.mark.parametrize("kind", ["seed", "energy"])
def test_numbers_of_any_length_are_refused(kind, number):
    with pytest.raises(FormatError):
        of_json(f'{{"{kind}": {number}}}')
    with pytest.raises(FormatError):
        of_line(f"{kind} {number}")


def test_other_messages_and_texts_are_refused():
    for message in (
        Message("/VMC/Ext/OK", (1,)),
        Message("/dance/genre"),
        Message("/dance/x", (1,)),
    ):
        with pytest.raises(FormatError):
            of_message(message)
    for text in ("", "[]", "{}", "{", "3", "[" * 100_000):
        with pytest.raises(FormatError, match="expected an object"):
            of_json(text)


@given(st.text() | st.binary())
def test_no_text_is_an_error_of_another_kind(text):
    lines = [text] if isinstance(text, str) else []
    for read, given_text in ((of_json, text), *((of_line, line) for line in lines)):
        try:
            found = read(given_text)
        except FormatError:
            continue
        assert all(request.kind in KINDS for request in ([found] if read is of_line else found))


def test_a_pin_is_of_its_phrase():
    assert Request("pin", "take:a").pin(8.0, 16.0) == cg.TakePin(8.0, 16.0, "a")
    assert Request("pin", "motif:4").pin(8.0, 16.0) == cg.MotifPin(8.0, 4)


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
