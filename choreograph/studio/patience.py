"""How long the studio waits for a request: for its head, for its body, and for a body that it does not read.

Without limits, requests that never end would keep connections open, also those of others without the token.
"""

from __future__ import annotations

import asyncio
import time
from typing import Any

import h11
from starlette.exceptions import HTTPException
from starlette.types import Message, Receive
from uvicorn.protocols.http.h11_impl import H11Protocol

HEAD_S = 10.0  # until the head of a request has arrived
BODY_S = 20.0  # without a part of the body
SLOWEST_BYTES_PER_S = 10_000  # of a body, beyond the first `BODY_S`


class PatientProtocol(H11Protocol):
    """HTTP that closes connections whose next request does not arrive in time. There are no web sockets."""

    _waiting: asyncio.TimerHandle | None = None

    def connection_made(self, transport: Any) -> None:
        """Begin to wait for the first request."""
        super().connection_made(transport)
        self._wait()

    def data_received(self, data: bytes) -> None:
        """Handle a part of a request, and wait for the rest of its head."""
        super().data_received(data)
        # What arrives after the reply, such as the rest of a body that was refused, is thrown away.
        refused = self.conn.our_state is h11.DONE and self.conn.their_state is h11.SEND_BODY
        if self.conn.their_state is not h11.IDLE and not refused:
            self._stop_waiting()
        elif self._waiting is None:
            self._wait()

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget the connection."""
        self._stop_waiting()
        super().connection_lost(exc)

    def _wait(self) -> None:
        self._waiting = self.loop.call_later(HEAD_S, self.transport.abort)

    def _stop_waiting(self) -> None:
        if self._waiting is not None:
            self._waiting.cancel()
            self._waiting = None

    def _should_upgrade(self) -> bool:  # an upgrade is only an offer, which this server does not take
        return False


class PatientBody:
    """Receives the body of a request, as of ASGI. `HTTPException` ends a request whose body is too slow."""

    def __init__(self, receive: Receive) -> None:
        self._receive = receive
        self._more, self._n_bytes, self._waited_s = True, 0, 0.0

    async def __call__(self) -> Message:
        """The next message."""
        if not self._more:
            return await self._receive()
        began_s = time.monotonic()
        left_s = BODY_S + self._n_bytes / SLOWEST_BYTES_PER_S - self._waited_s
        try:
            message = await asyncio.wait_for(self._receive(), min(BODY_S, left_s))
        except TimeoutError:
            raise _failed(
                408, "expected the body of the request, got nothing or too little in time"
            ) from None
        self._waited_s += time.monotonic() - began_s
        if message["type"] == "http.disconnect":
            raise _failed(400, "expected the body of the request, got only a part of it")
        self._n_bytes += len(message.get("body", b""))
        self._more = message.get("more_body", False)
        return message


def _failed(status: int, detail: str) -> HTTPException:
    return HTTPException(status, detail, {"Connection": "close"})
