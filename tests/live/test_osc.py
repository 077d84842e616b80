"""Open Sound Control: bytes of the specification, round trips, and packets of others."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from choreograph.core.errors import FormatError
from choreograph.live.osc import Message, bundle, messages_of

TEXTS = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=12)
NUMBERS = st.integers(-(2**31), 2**31 - 1) | st.floats(width=32, allow_nan=False)
MESSAGES = st.builds(
    Message, TEXTS.map(lambda text: f"/{text}"), st.lists(NUMBERS | TEXTS, max_size=5).map(tuple)
)


def test_the_examples_of_the_specification():
    """OSC 1.0, "OSC Message Examples"."""
    first = Message("/oscillator/4/frequency", (440.0,)).to_bytes()
    assert first == b"/oscillator/4/frequency\0,f\0\0\x43\xdc\0\0"
    second = Message("/foo", (1000, -1, "hello", 1.234, 5.678)).to_bytes()
    numbers = bytes.fromhex("000003e8ffffffff68656c6c6f0000003f9df3b640b5b22d")
    assert second == b"/foo\0\0\0\0,iisff\0\0" + numbers


@given(st.lists(MESSAGES, max_size=4))
def test_what_is_written_is_read(messages):
    packet = bundle(messages)
    assert len(packet) % 4 == 0
    assert messages_of(packet) == messages
    assert messages_of(bundle([])) == []
    for message in messages:
        assert messages_of(message.to_bytes()) == [message]


@given(st.binary(max_size=60))
def test_other_packets_are_refused_or_read(packet):
    for data in (packet, b"#bundle\0" + packet, b"/a\0\0" + packet):
        try:
            messages_of(data)
        except FormatError:
            continue


def test_bundles_in_bundles_end():
    packet = Message("/a").to_bytes()
    for _ in range(20):
        packet = b"#bundle\0" + struct.pack(">Qi", 1, len(packet)) + packet
    with pytest.raises(FormatError, match="bundles in bundles"):
        messages_of(packet)
