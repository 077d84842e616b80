"""The dance: its motion, settings, locks, undo and redo."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Query

from choreograph.core.errors import ParameterError
from choreograph.studio.refusals import ConflictError
from choreograph.studio.routes.bodies import LocksBody, Revised, SettingsBody
from choreograph.studio.service import Service


def router(service: Service) -> APIRouter:
    """The addresses of the dance."""
    made, desk = APIRouter(tags=["dance"]), service.desk

    @made.get("/api/state")
    def state() -> dict[str, Any]:
        """Everything that a page shows, apart from the motion, the mesh and the song."""
        return service.state()

    @made.get("/api/motion")
    def motion(revision: Annotated[int | None, Query(ge=0)] = None) -> dict[str, Any]:
        """The motion of the dance, compressed as in the page of `choreograph dance`."""
        shown = desk.state
        desk.current()
        if shown.dance is None or (revision is not None and revision != shown.project.revision):
            raise ConflictError(f"expected the newest revision {shown.project.revision}, got {revision}")
        return {"revision": shown.project.revision, **desk.motion_data()}

    @made.get("/api/mesh")
    def mesh() -> dict[str, Any]:
        """The mesh of the mannequin, and its facts."""
        text, facts = desk.mannequin()
        return {"mesh": text, "facts": facts}

    @made.post("/api/settings", status_code=202)
    def settings(body: SettingsBody) -> dict[str, Any]:
        """Change settings, and make the dance again, or a span of it."""
        desk.check(body.revision)
        desk.project.settings.changed(body.changes)
        if (body.from_s is None) != (body.to_s is None):
            raise ParameterError("expected both from and to, or none of them, got one")
        span = None if body.from_s is None or body.to_s is None else (body.from_s, body.to_s)
        job = service.change(
            "settings",
            lambda job: desk.change_settings(
                body.revision, body.changes, job.report, keep_locked=body.keep_locked, span=span
            ),
        )
        return {"job": job.id}

    @made.post("/api/locks")
    def locks(body: LocksBody) -> dict[str, Any]:
        """Lock these parts of the dance, and no others."""
        return service.change_now("lock", lambda job: desk.lock(body.revision, body.locks))

    @made.post("/api/undo")
    def undo(body: Revised) -> dict[str, Any]:
        """Go back to the dance before the last change."""
        return service.change_now("undo", lambda job: desk.move(body.revision, back=True))

    @made.post("/api/redo")
    def redo(body: Revised) -> dict[str, Any]:
        """Make a change again that was undone."""
        return service.change_now("redo", lambda job: desk.move(body.revision, back=False))

    return made
