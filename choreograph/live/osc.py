"""Open Sound Control 1.0: messages of numbers and texts, and bundles of them, as bytes.

Texts are padded with zeros to a multiple of four bytes, and numbers are big-endian (specification, "OSC
Packets"). python-osc is not used, because it takes seven times as long for a frame of a body, 1 to 2 ms.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from choreograph.core.errors import FormatError

Argument = int | float | str
_BUNDLE = b"#bundle\0"
_AT_ONCE = 1  # the time tag of a bundle that is handled when it arrives
_MAX_DEPTH = 8  # of bundles in bundles


@dataclass(frozen=True)
class Message:
    """An address, such as /VMC/Ext/T, and its arguments."""

    address: str
    arguments: tuple[Argument, ...] = ()

    def to_bytes(self) -> bytes:
        """The message. Floats have 32 bits."""
        tags, data = ",", b""
        for argument in self.arguments:
            if isinstance(argument, str):
                tags, data = tags + "s", data + _text(argument)
            elif isinstance(argument, int):
                tags, data = tags + "i", data + struct.pack(">i", argument)
            else:
                tags, data = tags + "f", data + struct.pack(">f", argument)
        return _text(self.address) + _text(tags) + data


def bundle(messages: Sequence[Message]) -> bytes:
    """Messages in one packet, to be handled at once."""
    parts = [message.to_bytes() for message in messages]
    return _BUNDLE + struct.pack(">Q", _AT_ONCE) + b"".join(struct.pack(">i", len(p)) + p for p in parts)


def messages_of(packet: bytes) -> list[Message]:
    """The messages of a packet. Raises `FormatError` if it is not of OSC."""
    try:
        return list(_messages(packet, _MAX_DEPTH))
    except (struct.error, UnicodeDecodeError, ValueError) as error:
        raise FormatError(f"expected a packet of OSC, got another: {error}") from None


def _messages(packet: bytes, depth: int) -> Iterator[Message]:
    if not packet.startswith(_BUNDLE):
        yield _message(packet)
        return
    if depth == 0:
        raise ValueError("bundles in bundles")
    at = len(_BUNDLE) + 8
    while at < len(packet):
        (size,) = struct.unpack_from(">i", packet, at)
        if not 0 < size <= len(packet) - at - 4:
            raise ValueError(f"a part of {size} bytes")
        yield from _messages(packet[at + 4 : at + 4 + size], depth - 1)
        at += 4 + size


def _message(packet: bytes) -> Message:
    address, at = _read_text(packet, 0)
    tags, at = _read_text(packet, at) if at < len(packet) else (",", at)
    if not address.startswith("/") or not tags.startswith(","):
        raise ValueError("no address and types")
    arguments: list[Argument] = []
    for tag in tags[1:]:
        if tag == "s":
            text, at = _read_text(packet, at)
            arguments.append(text)
        elif tag in "if":
            arguments.append(struct.unpack_from(f">{tag}", packet, at)[0])
            at += 4
        else:
            raise ValueError(f"an argument of type {tag!r}")
    return Message(address, tuple(arguments))


def _text(text: str) -> bytes:
    data = text.encode() + b"\0"
    return data + b"\0" * (-len(data) % 4)


def _read_text(packet: bytes, at: int) -> tuple[str, int]:
    end = packet.index(b"\0", at)
    return packet[at:end].decode(), at + (end - at) // 4 * 4 + 4
