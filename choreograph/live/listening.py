"""Requests that arrive while a dance runs: messages of OSC on a port of this machine, and typed lines."""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from threading import Thread

from choreograph.core.errors import ChoreographError, FormatError
from choreograph.live.osc import messages_of
from choreograph.live.requests import Request, of_line, of_message

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
