"""The frames of a dance as JSON to any number of WebSocket clients, and their requests. Extra `live`."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Condition, Thread
from typing import TYPE_CHECKING, Any

from choreograph.core.errors import ChoreographError, FormatError
from choreograph.live.requests import Request, of_json

if TYPE_CHECKING:
    from websockets.sync.server import ServerConnection

_MOST_BYTES = 4096  # of a request
_MOST_CLIENTS = 32
# Pages of this machine, and programs that are no browser. Any other page could connect as well.
_ORIGINS = [None, re.compile(r"https?://(localhost|127\.0\.0\.1|\[::1\])(:\d+)?")]


class Frames:
    """The latest frame, which is sent to each client as soon as it can take it.

    A slow client misses frames, and delays nobody.
    """

    def __init__(self) -> None:
        self._text, self._number, self._ended = "", 0, False
        self.n_readers = 0
        self._changed = Condition()

    def put(self, pose: dict[str, Any]) -> None:
        """Send a frame to the clients."""
        text = json.dumps(pose, separators=(",", ":"))
        with self._changed:
            self._text, self._number = text, self._number + 1
            self._changed.notify_all()

    def end(self) -> None:
        """No more frames come."""
        with self._changed:
            self._ended = True
            self._changed.notify_all()

    def __iter__(self) -> Iterator[str]:
        """The frames from now on."""
        with self._changed:
            seen = self._number
            self.n_readers += 1
        while True:
            with self._changed:
                while self._number == seen and not self._ended:
                    self._changed.wait()
                if self._ended:
                    return
                text, seen = self._text, self._number
            yield text


@contextmanager
def serving(port: int, ask: Callable[[Request], None] | None) -> Iterator[Frames]:
    """Frames are sent to the clients of a port of this machine until the block ends.

    A text that a client sends is a request such as {"genre": "salsa"}. It is answered by {"error": ...} if
    it cannot be read, or if `ask` is None. Raises `ChoreographError` without the package `websockets`, or if
    the port is in use.
    """
    try:
        from websockets.exceptions import ConnectionClosed
        from websockets.sync.server import serve
    except ImportError as error:
        raise ChoreographError(
            "expected the extra `live` for --websocket, it is not installed: pip install 'choreograph[live]'"
        ) from error
    frames, n_clients = Frames(), 0

    def send(client: ServerConnection) -> None:
        try:
            for text in frames:
                client.send(text)
            client.close()
        except ConnectionClosed:
            return

    def handle(client: ServerConnection) -> None:
        nonlocal n_clients
        n_clients += 1
        try:
            if n_clients > _MOST_CLIENTS:
                client.close(1013, "too many clients")
                return
            Thread(target=send, args=(client,), daemon=True).start()
            for text in client:
                answer = _asked(text, ask)
                if answer:
                    client.send(json.dumps({"error": answer}))
        except ConnectionClosed:
            return
        finally:
            n_clients -= 1

    try:
        server = serve(handle, "127.0.0.1", port, origins=_ORIGINS, max_size=_MOST_BYTES, compression=None)
    except OSError as error:
        raise ChoreographError(
            f"expected a free port for --websocket, got {port}: {error.strerror or error}"
        ) from None
    with server:
        thread = Thread(target=server.serve_forever, daemon=True)
        thread.start()
        try:
            yield frames
        finally:
            frames.end()
            server.shutdown()
            thread.join()


def _asked(text: str | bytes, ask: Callable[[Request], None] | None) -> str:
    """Take the requests of a text. Returns what is wrong with it, or nothing."""
    if ask is None:
        return "this dance was made before, and cannot be changed"
    try:
        requests = of_json(text)
    except FormatError as error:
        return str(error)
    for request in requests:
        ask(request)
    return ""
