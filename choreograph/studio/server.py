"""The server of the studio: who may use it, how long it waits, and its addresses and errors.

A page of another site can send requests to this machine, and by a name of its own that leads here it can
even read the replies. So `Host` must be a name of this machine, and `Origin` the studio itself. If the studio
is open to other machines, requests need a random token, which is in the address that the command prints.
All this is checked before the body of a request is read (`Guard`).

Without limits, requests that never end would keep connections open, also those of others without the token.
So heads and bodies of requests must arrive in time (`PatientProtocol`, `PatientBody`).
"""

from __future__ import annotations

import asyncio
import ipaddress
import json
import os
import secrets
import socket
import threading
import time
import webbrowser
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs

import h11
import uvicorn
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import FileResponse, JSONResponse
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol

from choreograph.characters.character import read_character
from choreograph.core.errors import ChoreographError, FormatError, ParameterError
from choreograph.core.files import check_regular
from choreograph.library.repertoire import Repertoire
from choreograph.studio.dance_routes import dance_routes, edit_routes, take_routes, version_routes
from choreograph.studio.file_routes import (
    MOST_CHARACTER_BYTES,
    MOST_SONG_BYTES,
    MOST_TAKE_BYTES,
    file_routes,
    song_routes,
)
from choreograph.studio.jobs import Job
from choreograph.studio.project import ProjectFile
from choreograph.studio.refusals import ConflictError, ForbiddenError, NotFoundError, Refusal, TooLargeError
from choreograph.studio.service import Service

# A studio with what the command line names, served until it is stopped.


_GRACE_S = 2  # for requests in progress, when it is stopped
_BEFORE_BROWSER_S = 0.3  # in which the server begins to answer


def start(
    song: Path | None, repertoire: Repertoire, *, project: Path | None = None, character: Path | None = None
) -> Service:
    """A studio in the folder of the song or the project, else in the working folder.

    The song is read, and its first dance made, while the page is shown. Raises `FormatError` if a file is
    missing or damaged, and `ChoreographError` if another process works with the project.
    """
    if song is None and project is not None:
        song = _song_of(project)
    folder = Path.cwd() if song is None else song.parent
    service = Service(folder, repertoire)

    def load(job: Job) -> None:
        service.restore_character()
        service.studio.load(None, job.report)

    with ExitStack() as failed:
        failed.callback(service.close)
        if character is not None:
            service.character = read_character(character)
        if song is not None:
            check_regular(song, "a song")
            service.studio.open(song, project)
            service.change("song", load)
        failed.pop_all()
    return service


def serve(
    service: Service,
    host: str,
    port: int,
    *,
    opened: bool,
    ready: Callable[[str], None] = lambda address: None,
) -> None:
    """Serve a studio until the process is interrupted. `ready` is called with the address of the page.

    With port 0, a free one is taken. Raises `ChoreographError` if the port is in use, and `ParameterError`
    for a host that this machine does not have.
    """
    try:
        listening = _listening(host, port)
        access = Access.of(host, listening.getsockname()[1])
        server = make_server(service, access)
        ready(access.address)
        if opened:
            threading.Timer(_BEFORE_BROWSER_S, webbrowser.open, [access.address]).start()
        server.run(sockets=[listening])
    finally:
        service.close()


def make_server(service: Service, access: Access) -> uvicorn.Server:
    """The server of a studio, for those who have access."""
    return uvicorn.Server(
        uvicorn.Config(
            make_app(service, access), http=PatientProtocol, ws="none", lifespan="off", log_level="warning",
            access_log=False, server_header=False, proxy_headers=False, timeout_graceful_shutdown=_GRACE_S,
        )
    )  # fmt: skip


def _listening(host: str, port: int) -> socket.socket:
    if not 0 <= port <= 65_535:  # getaddrinfo would take another port without a word
        raise ParameterError(f"expected a port of 0 to 65535, got {port}")
    try:
        [(family, kind, protocol, _, address), *_] = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
        made = socket.socket(family, kind, protocol)
        made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        made.bind(address)
        made.listen(128)
    except (socket.gaierror, UnicodeError) as error:
        reason = getattr(error, "strerror", None) or "it is no name of a machine"
        raise ParameterError(f"expected a host of this machine, got {host[:80]!r}: {reason}") from error
    except OSError as error:
        raise ChoreographError(
            f"expected port {port} of {host} to be free, got {error.strerror}: choose another with --port"
        ) from error
    return made


def _song_of(project: Path) -> Path:
    if not project.is_file():
        raise FormatError(
            f"{project}: expected a project of the studio, or a SONG for a new one, got no file"
        )
    file = ProjectFile(project)
    try:
        found = file.read()
    finally:
        file.close()
    if found is None or Path(found.song).name != found.song or not found.song:
        raise ParameterError(f"{project}: expected a project with a song in its folder, got none")
    beside = project.parent / found.song
    return beside if beside.exists() else Path(os.path.realpath(project)).parent / found.song


# The application.


_MOST_BYTES = {
    "/api/song": MOST_SONG_BYTES,
    "/api/character": MOST_CHARACTER_BYTES,
    "/api/build": MOST_TAKE_BYTES,
}
_TYPES = {
    ".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml",
    ".json": "application/json", ".txt": "text/plain", "": "text/plain",
}  # fmt: skip


def make_app(service: Service, access: Access) -> FastAPI:
    """The application of a studio, for those who have access."""
    app = FastAPI(
        title="choreograph studio", version="1", docs_url=None, redoc_url=None,
        openapi_url="/api/openapi.json", description="Makes dances for a song, and changes parts of them.",
    )  # fmt: skip
    for routes in (dance_routes, edit_routes, take_routes, version_routes, song_routes, file_routes):
        app.include_router(routes(service))
    _add_page(app)
    app.add_middleware(Guard, access=access, most_bytes=_MOST_BYTES)

    @app.exception_handler(ChoreographError)
    def refused(request: Request, error: Exception) -> JSONResponse:
        status = error.status if isinstance(error, Refusal) else 400
        content: dict[str, Any] = {"error": service.said(error)}
        if isinstance(error, ConflictError):
            content["state"] = service.state()
        return JSONResponse(content, status)

    @app.exception_handler(RequestValidationError)
    def not_valid(request: Request, error: Exception) -> JSONResponse:
        return JSONResponse({"error": _said(error)}, 422)

    @app.exception_handler(HTTPException)
    def unknown(request: Request, error: Exception) -> JSONResponse:
        assert isinstance(error, HTTPException)
        content = {"error": f"{error.detail}: {request.url.path[:80]}"}
        return JSONResponse(content, error.status_code, error.headers)

    return app


def _said(error: Exception) -> str:
    """The first fault of a request in one line."""
    first = error.errors()[0] if isinstance(error, RequestValidationError) else {}
    where = ".".join(str(part) for part in first.get("loc", ())[1:]) or "the body"
    return f"{where}: {first.get('msg', 'not valid')}"


def _add_page(app: FastAPI) -> None:
    """Add the page of the studio, and the modules that it shares with the page of a dance."""
    own = Path(str(resources.files("choreograph.studio") / "page"))
    shared = Path(str(resources.files("choreograph.view") / "page"))
    known = {"/": own / "index.html"}
    for prefix, folder in (("/studio", own), ("/page", shared)):
        for path in folder.rglob("*"):
            if path.is_file() and path.suffix in _TYPES:
                known[f"{prefix}/{path.relative_to(folder).as_posix()}"] = path

    def file(request: Request) -> FileResponse:
        path = known.get(request.url.path)
        if path is None:
            raise NotFoundError(f"expected a file of the page, got {request.url.path[:80]!r}")
        return FileResponse(path, media_type=_TYPES[path.suffix])

    app.add_api_route("/", file, include_in_schema=False)
    app.add_api_route("/studio/{name:path}", file, include_in_schema=False)
    app.add_api_route("/page/{name:path}", file, include_in_schema=False)


# What is refused before any work.


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
            await _reply(send, TooLargeError.status, {"error": str(TooLargeError(most))})
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


# How long requests may take.


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
