"""What is requested of a dance while it runs: by OSC, as JSON, or in typed lines.

Messages of OSC arrive on a port of this machine.
"""

from __future__ import annotations

import json
import reprlib
import socket
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from threading import Thread
from typing import Any

from choreograph.choreography.constraints import MotifPin, Pin, TakePin
from choreograph.choreography.engine import GREATEST_AMPLITUDE, LEAST_AMPLITUDE
from choreograph.core.arguments import is_number
from choreograph.core.errors import ChoreographError, FormatError
from choreograph.live.vmc import Message, messages_of

KINDS = ("genre", "energy", "pin", "seed")
_PREFIX = "/dance/"
_MOST_DIGITS = 9  # of the number of a motif
_EXAMPLES = "genre salsa, energy 0.7, pin take:NAME, pin motif:41 or seed 3"


@dataclass(frozen=True)
class Request:
    """One request, which is danced from the next phrase on.

    A genre is a name, or empty for the one that suits the song. The energy is the size of the dance, from 0.5
    to 1.1, and 1 as the takes are. A pin is take:NAME, which is danced for a phrase, or motif:NUMBER. Another
    seed gives another dance.
    """

    kind: str  # one of `KINDS`
    value: str | float | int

    @classmethod
    def of(cls, kind: str, value: object) -> Request:
        """A checked request. Raises `FormatError` for another kind, or a value that it cannot have."""
        if kind == "genre" and isinstance(value, str):
            return cls(kind, value.strip())
        if kind == "energy" and is_number(value):
            return cls(kind, min(max(float(value), LEAST_AMPLITUDE), GREATEST_AMPLITUDE))  # type: ignore[arg-type]
        if kind == "seed" and is_number(value) and float(value) == int(value) >= 0:  # type: ignore[arg-type, call-overload]
            return cls(kind, int(value))  # type: ignore[call-overload]
        if kind == "pin" and isinstance(value, str):
            of, _, name = value.partition(":")
            if name and (of == "take" or (of == "motif" and name.isdecimal() and len(name) <= _MOST_DIGITS)):
                return cls(kind, value)
        raise FormatError(f"expected {_EXAMPLES}, got {kind[:20]} {reprlib.repr(value)}")

    def pin(self, from_s: float, to_s: float) -> Pin:
        """A request for a take or a motif as a pin of the phrase between two times of the dance."""
        of, _, name = str(self.value).partition(":")
        return TakePin(from_s, to_s, name) if of == "take" else MotifPin(from_s, int(name))

    def __str__(self) -> str:
        return f"{self.kind} {self.value if self.value != '' else 'of the song'}"


def of_message(message: Message) -> Request:
    """The request of a message such as /dance/genre with one argument. Raises `FormatError`."""
    if not message.address.startswith(_PREFIX) or len(message.arguments) != 1:
        raise FormatError(f"expected {_PREFIX}genre, energy, pin or seed and a value, got {message.address}")
    return Request.of(message.address.removeprefix(_PREFIX), message.arguments[0])


def of_json(text: str | bytes) -> list[Request]:
    """The requests of an object such as {"genre": "salsa"}. Raises `FormatError` for another text."""
    try:
        content: Any = json.loads(text)
    except (ValueError, RecursionError):
        content = None
    if not isinstance(content, dict) or not content:
        raise FormatError(f'expected an object such as {{"genre": "salsa"}}, got {reprlib.repr(text)}')
    return [Request.of(str(kind), value) for kind, value in content.items()]


def of_line(line: str) -> Request:
    """The request of a typed line, such as genre salsa. Raises `FormatError` for another line."""
    kind, _, value = line.strip().partition(" ")
    if kind in ("energy", "seed"):
        try:
            return Request.of(kind, float(value))
        except ValueError:
            raise FormatError(f"expected {_EXAMPLES}, got {reprlib.repr(line.strip())}") from None
    return Request.of(kind, value)


# Requests that arrive.


_MOST_BYTES = 8192  # of a packet
_POLL_S = 0.2


@contextmanager
def listening(port: int, ask: Callable[[Request], None], note: Callable[[str], None]) -> Iterator[int]:
    """Take the requests of OSC messages to a UDP port of this machine until the block ends.

    Yields the port, which the system chooses for 0. A packet that is no request is noted. Raises
    `ChoreographError` if the port is in use.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own:
        try:
            own.bind(("127.0.0.1", port))
        except OSError as error:
            raise ChoreographError(
                f"expected a free UDP port for --control, got {port}: {error.strerror}"
            ) from None
        own.settimeout(_POLL_S)
        ended = False

        def receive() -> None:
            while not ended:
                try:
                    packet = own.recv(_MOST_BYTES)
                except TimeoutError:
                    continue
                try:
                    for message in messages_of(packet):
                        ask(of_message(message))
                except FormatError as error:
                    note(str(error))

        thread = Thread(target=receive, daemon=True)
        thread.start()
        try:
            yield int(own.getsockname()[1])
        finally:
            ended = True
            thread.join()


def take_lines(lines: Iterable[str], ask: Callable[[Request], None], note: Callable[[str], None]) -> None:
    """Take the requests of typed lines until there are no more. A line that is none is noted."""
    for line in lines:
        if line.strip():
            try:
                ask(of_line(line))
            except FormatError as error:
                note(str(error))
