"""What the studio refuses before any work: other sites and hosts, requests without the token, large ones.

A page of another site can send requests to this machine, and by a name of its own that leads here it can
even read the replies. So `Host` must be a name of this machine, and `Origin` the studio itself. If the studio
is open to other machines, requests need a random token, which is in the address that the command prints.
All this is checked before the body of a request is read.
"""

from __future__ import annotations

import ipaddress
import json
import secrets
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from urllib.parse import parse_qs

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from choreograph.studio.patience import PatientBody
from choreograph.studio.refusals import ForbiddenError, TooLargeError

COOKIE = "choreograph-studio"
MOST_JSON_BYTES = 1 << 20  # of a request whose body is not a file
_LONGEST_LENGTH = 16  # digits of the length of a body
_UNSAFE = {"POST", "PUT", "DELETE", "PATCH"}
_POLICY = "; ".join(
    [
        "default-src 'self'", "media-src 'self' blob:", "img-src 'self' blob: data:",
        "connect-src 'self' blob:", "object-src 'none'", "base-uri 'none'", "form-action 'self'",
        "frame-ancestors 'none'",
    ]
)  # fmt: skip
HEADERS = {
    "Content-Security-Policy": _POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-store",
}


@dataclass(frozen=True)
class Access:
    """Who may use the studio."""

    port: int
    host: str = "127.0.0.1"  # the address on which it waits for requests
    token: str = ""  # that requests need, or empty on the loopback address alone

    @classmethod
    def of(cls, host: str, port: int) -> Access:
        """The access to a host: with a new token unless it is this machine alone."""
        return cls(port, host, "" if is_loopback(host) else secrets.token_urlsafe(24))

    @property
    def address(self) -> str:
        """The address of the page, with the token."""
        name = f"[{self.host}]" if ":" in self.host else self.host
        shown = "127.0.0.1" if self.host in ("0.0.0.0", "::") else name
        return f"http://{shown}:{self.port}/" + (f"?token={self.token}" if self.token else "")

    def check_host(self, host: str) -> None:
        """Raise `ForbiddenError` unless a `Host` header names this machine and this port."""
        name, _, port = host.rpartition(":") if ":" in host.rpartition("]")[2] else (host, "", "80")
        name = name.removeprefix("[").removesuffix("]").lower()
        is_served = bool(self.token) and (name == self.host.lower() or _address(name) is not None)
        if not (is_loopback(name) or is_served) or port != str(self.port):
            raise ForbiddenError(f"expected a request to this machine, got one to {host[:80]!r}")

    def check_origin(self, origin: str | None, host: str) -> None:
        """Raise `ForbiddenError` if a request comes from the page of another site."""
        if origin is not None and origin != f"http://{host}":
            raise ForbiddenError(f"expected a request of the studio's own page, got one of {origin[:80]!r}")

    def check_token(self, given: str | None) -> None:
        """Raise `ForbiddenError` if a token is needed and another is given."""
        if self.token and not secrets.compare_digest((given or "").encode(), self.token.encode()):
            raise ForbiddenError(
                "expected the token of this studio, got another or none: open the address that the command "
                "prints"
            )


def is_loopback(host: str) -> bool:
    """Whether an address is only reached from this machine."""
    address = _address(host)
    return host == "localhost" or (address is not None and address.is_loopback)


def _address(name: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    try:
        return ipaddress.ip_address(name)
    except ValueError:
        return None


class Guard:
    """Checks each request before it reaches the application, and adds headers to each reply."""

    def __init__(self, app: ASGIApp, access: Access, most_bytes: Mapping[str, int]) -> None:
        """`most_bytes` are the limits of the bodies of requests by their path."""
        self.app, self.access, self.most_bytes = app, access, most_bytes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request, as of ASGI."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        if scope["type"] != "http":  # there are no web sockets here
            await send({"type": "websocket.close", "code": 1008})
            return
        headers = {name.decode("latin-1"): value.decode("latin-1") for name, value in scope["headers"]}
        try:
            token = self._check(scope, headers)
        except ForbiddenError as error:
            await _reply(send, error.status, {"error": str(error)})
            return
        most = self.most_bytes.get(scope["path"], MOST_JSON_BYTES) if scope["method"] in _UNSAFE else 0
        length = headers.get("content-length", "0")
        is_short = length.isdecimal() and len(length) < _LONGEST_LENGTH and int(length) <= most
        if "transfer-encoding" in headers or not is_short:
            await _reply(send, TooLargeError.status, {"error": too_large(most)})
            return
        cookie = None
        if token is not None and scope["path"] == "/":
            cookie = "; ".join([f"{COOKIE}={token}", "HttpOnly", "SameSite=Strict", "Path=/"])
        await self.app(scope, PatientBody(receive), _with_headers(send, cookie))

    def _check(self, scope: Scope, headers: Mapping[str, str]) -> str | None:
        """Raise `ForbiddenError` for a request that is refused. Returns the token, if its address has it."""
        host = headers.get("host", "")
        self.access.check_host(host)
        self.access.check_origin(headers.get("origin"), host)
        if headers.get("upgrade", "").lower() == "websocket":
            raise ForbiddenError("expected a request of HTTP, got one of a web socket, which has no use here")
        site = headers.get("sec-fetch-site", "none")
        if site not in ("same-origin", "none") and (scope["method"] in _UNSAFE or scope["path"] != "/"):
            raise ForbiddenError(f"expected a request of the studio's own page, got one from {site[:20]!r}")
        query: bytes = scope.get("query_string", b"")
        given = parse_qs(query.decode("latin-1")).get("token", [""])[0] or None
        self.access.check_token(given or _cookie(headers))
        return given if self.access.token else None


def too_large(most: int) -> str:
    """The message for a body of more than `most` bytes."""
    size = f"{most >> 20} MiB" if most >= 1 << 20 else f"{most} bytes"
    return f"expected at most {size} in this request, got more or an unknown length"


def _cookie(headers: Mapping[str, str]) -> str | None:
    """The token in a cookie. Other programs on this machine may have set cookies of any form beside it."""
    pairs = (one.strip().partition("=") for one in headers.get("cookie", "").split(";"))
    return next((value for name, _, value in pairs if name == COOKIE), None)


def _with_headers(send: Send, cookie: str | None) -> Send:
    added = dict(HEADERS) | ({"Set-Cookie": cookie} if cookie else {})

    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            known = {name.lower() for name, _ in message["headers"]}
            new = [
                (name.encode(), value.encode())
                for name, value in added.items()
                if name.lower().encode() not in known
            ]
            message = {**message, "headers": [*message["headers"], *new]}
        await send(message)

    return sending


async def _reply(send: Send, status: int, content: dict[str, Any]) -> None:
    body = json.dumps(content).encode()
    headers = [(b"content-type", b"application/json"), (b"content-length", str(len(body)).encode())]
    headers += [(name.encode(), value.encode()) for name, value in HEADERS.items()]
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": body})
