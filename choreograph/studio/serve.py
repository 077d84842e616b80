"""Starts a studio with what the command line names, and serves it on this machine until it is stopped."""

from __future__ import annotations

import os
import socket
import threading
import webbrowser
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import uvicorn

from choreograph.characters.gltf_character import read_character
from choreograph.core.errors import ChoreographError, FormatError, ParameterError
from choreograph.core.files import check_regular
from choreograph.library.repertoire import Repertoire
from choreograph.studio.app import make_app
from choreograph.studio.jobs import Job
from choreograph.studio.patience import PatientProtocol
from choreograph.studio.project_file import ProjectFile
from choreograph.studio.safety import Access
from choreograph.studio.service import Service

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
    with ExitStack() as failed:
        failed.callback(service.close)
        if character is not None:
            service.character = read_character(character)
        if song is not None:
            check_regular(song, "a song")
            service.desk.open(song, project)
            service.change("song", lambda job: _load(service, job))
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


def _load(service: Service, job: Job) -> None:
    service.restore_character()
    service.desk.load(None, job.report)


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
