"""The dance: its motion, settings, locks, undo and redo, the jobs that change it, and the stream of news."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Query
from fastapi.responses import JSONResponse, StreamingResponse

from choreograph.core.errors import ParameterError
from choreograph.motion.motion import Motion
from choreograph.render.rendering import FirstPart
from choreograph.studio.facts import motion_data
from choreograph.studio.jobs import Job
from choreograph.studio.refusals import ConflictError
from choreograph.studio.routes.bodies import LocksBody, Revised, SettingsBody
from choreograph.studio.service import Service

_LONGEST_WAIT_S = 1.0  # of a request, so that no thread of the server is long without other work
_FIRST_S = 5.0  # of the dance that is sent first: longer than a page waits for the rest


def router(service: Service) -> APIRouter:
    """The addresses of the dance."""
    made, desk = APIRouter(tags=["dance"]), service.desk

    @made.get("/api/state")
    def state() -> JSONResponse:
        """Everything that a page shows, apart from the motion, the mesh and the song."""
        return JSONResponse(service.state())

    @made.get("/api/motion")
    def motion(revision: Annotated[int | None, Query(ge=0)] = None) -> JSONResponse:
        """The motion of the dance, compressed as in the page of `choreograph dance`.

        With several dancers, it is that of the leader on the stage, and `others` has the facts and motions of
        the others.
        """
        shown = desk.state
        desk.current()
        if shown.dance is None or (revision is not None and revision != shown.project.revision):
            raise ConflictError(f"expected the newest revision {shown.project.revision}, got {revision}")
        of = {"revision": shown.project.revision, "repertoire": shown.repertoire.path.name}
        return JSONResponse(of | desk.motion_data())

    @made.get("/api/mesh")
    def mesh() -> dict[str, Any]:
        """The mesh of the mannequin, and its facts."""
        text, facts = desk.mannequin()
        return {"mesh": text, "facts": facts}

    @made.post("/api/settings", status_code=202)
    def settings(body: SettingsBody) -> dict[str, Any]:
        """Change settings, and make the dance again, or a span of it.

        Dancers, formation and relation leave the dance of the leader as it is. Each formation and relation is
        VALUE or WHEN=VALUE, as of `choreograph scene`.
        """
        desk.check(body.revision)
        dancers = desk.project.settings.changed(body.changes).dancers
        if (body.from_s is None) != (body.to_s is None):
            raise ParameterError("expected both from and to, or none of them, got one")
        span = None if body.from_s is None or body.to_s is None else (body.from_s, body.to_s)

        def work(job: Job) -> None:
            # Several dancers come together, so that none is near another one meanwhile.
            first = None if body.at is None or dancers > 1 else first_part(job, body.at, body.revision + 1)
            desk.change_settings(
                body.revision, body.changes, job.report, keep_locked=body.keep_locked, span=span, first=first
            )

        return {"job": service.change("settings", work).id}

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

    _add_jobs(made, service)
    return made


def first_part(job: Job, at_s: float, revision: int) -> FirstPart:
    """The part of a dance from a time on, which the job shows as the motion of a revision."""

    def tell(motion: Motion, from_s: float) -> None:
        job.show({"revision": revision, "from_s": from_s, **motion_data(motion)})

    return FirstPart(at_s, at_s + _FIRST_S, tell)


def _add_jobs(made: APIRouter, service: Service) -> None:
    @made.get("/api/jobs/{id}")
    def job(
        id: str, wait: Annotated[float, Query(ge=0, le=_LONGEST_WAIT_S)] = 0.0, first: bool = False
    ) -> JSONResponse:
        """The progress of a job, and its result once it is done, for which it waits at most `wait` s.

        With `first`, it waits for a first part of the result, and returns that part.
        """
        found = service.jobs.get(id)
        (found.begun if first else found.ended).wait(wait)
        return JSONResponse(found.facts | ({"first": found.first} if first and found.first else {}))

    @made.delete("/api/jobs/{id}")
    def cancel(id: str) -> dict[str, Any]:
        """Cancel a job. It ends when it next reports progress."""
        return service.jobs.cancel(id).facts

    @made.get("/api/events", include_in_schema=False)
    async def events() -> StreamingResponse:
        """News as they happen: jobs, and revisions of the state."""
        return StreamingResponse(service.news.stream(), media_type="text/event-stream")
