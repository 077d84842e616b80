"""Jobs and the stream of news."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter
from fastapi.responses import StreamingResponse

from choreograph.studio.service import Service


def router(service: Service) -> APIRouter:
    """The addresses of jobs."""
    made = APIRouter(tags=["jobs"])

    @made.get("/api/jobs/{id}")
    def job(id: str) -> dict[str, Any]:
        """The progress of a job, and its result once it is done."""
        return service.jobs.get(id).facts

    @made.delete("/api/jobs/{id}")
    def cancel(id: str) -> dict[str, Any]:
        """Cancel a job. It ends when it next reports progress."""
        return service.jobs.cancel(id).facts

    @made.get("/api/events", include_in_schema=False)
    async def events() -> StreamingResponse:
        """News as they happen: jobs, and revisions of the state."""
        return StreamingResponse(service.news.stream(), media_type="text/event-stream")

    return made
