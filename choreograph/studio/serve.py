"""Serves a studio on this machine until it is stopped."""

from __future__ import annotations

import socket
import threading
import webbrowser
from collections.abc import Callable

import uvicorn

from choreograph.core.errors import ChoreographError, ParameterError
from choreograph.studio.app import make_app
from choreograph.studio.safety import Access
from choreograph.studio.service import Service

_GRACE_S = 2  # for requests in progress, when it is stopped
_BEFORE_BROWSER_S = 0.3  # in which the server begins to answer


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
        config = uvicorn.Config(
            make_app(service, access), log_level="warning", access_log=False, server_header=False,
            timeout_graceful_shutdown=_GRACE_S, lifespan="off", proxy_headers=False,
        )  # fmt: skip
        ready(access.address)
        if opened:
            threading.Timer(_BEFORE_BROWSER_S, webbrowser.open, [access.address]).start()
        uvicorn.Server(config).run(sockets=[listening])
    finally:
        service.close()


def _listening(host: str, port: int) -> socket.socket:
    try:
        [(family, kind, protocol, _, address), *_] = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
        made = socket.socket(family, kind, protocol)
        made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        made.bind(address)
        made.listen(128)
    except socket.gaierror as error:
        raise ParameterError(f"expected a host of this machine, got {host!r}: {error.strerror}") from error
    except OverflowError as error:
        raise ParameterError(f"expected a port of 0 to 65535, got {port}") from error
    except OSError as error:
        raise ChoreographError(
            f"expected port {port} of {host} to be free, got {error.strerror}: choose another with --port"
        ) from error
    return made
