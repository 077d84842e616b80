"""Jobs and the stream of news."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Query
from fastapi.responses import StreamingResponse

from choreograph.studio.service import Service

_LONGEST_WAIT_S = 1.0  # of a request, so that no thread of the server is long without other work


def router(service: Service) -> APIRouter:
    """The addresses of jobs."""
    made = APIRouter(tags=["jobs"])

    @made.get("/api/jobs/{id}")
    def job(id: str, wait: Annotated[float, Query(ge=0, le=_LONGEST_WAIT_S)] = 0.0) -> dict[str, Any]:
        """The progress of a job, and its result once it is done, for which it waits at most `wait` s."""
        found = service.jobs.get(id)
        found.ended.wait(wait)
        return found.facts

    @made.delete("/api/jobs/{id}")
    def cancel(id: str) -> dict[str, Any]:
        """Cancel a job. It ends when it next reports progress."""
        return service.jobs.cancel(id).facts

    @made.get("/api/events", include_in_schema=False)
    async def events() -> StreamingResponse:
        """News as they happen: jobs, and revisions of the state."""
        return StreamingResponse(service.news.stream(), media_type="text/event-stream")

    return made
