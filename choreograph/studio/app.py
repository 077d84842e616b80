"""The application: all addresses, the files of the page, and errors as one line of JSON."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import FileResponse, JSONResponse
from starlette.exceptions import HTTPException

from choreograph.core.errors import ChoreographError
from choreograph.studio.refusals import ConflictError, NotFoundError, Refusal
from choreograph.studio.routes import comparing, dances, edits, explaining, files, songs
from choreograph.studio.safety import Access, Guard
from choreograph.studio.service import Service

_MOST_BYTES = {
    "/api/song": songs.MOST_BYTES,
    "/api/character": files.MOST_CHARACTER_BYTES,
    "/api/build": files.MOST_TAKE_BYTES,
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
    for part in (dances, edits, explaining, comparing, songs, files):
        app.include_router(part.router(service))
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
