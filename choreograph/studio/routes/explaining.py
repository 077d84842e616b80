"""Why something is danced, and the palette of takes and motifs."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Query

from choreograph.studio.explain import explained
from choreograph.studio.palette import part_motion
from choreograph.studio.routes.bodies import Seconds
from choreograph.studio.service import Service

_Text = Annotated[str, Query(max_length=200)]


def router(service: Service) -> APIRouter:
    """The addresses of explanations and of the palette."""
    made, desk = APIRouter(tags=["takes"]), service.desk

    @made.get("/api/explain")
    def explain(at: Annotated[Seconds, Query()]) -> dict[str, Any]:
        """What is danced at a time, why, and what would be the next best."""
        _, dance = desk.current()
        repertoire = desk.state.repertoire
        found: dict[str, Any] = service.jobs.do("explain", lambda job: explained(dance, repertoire, at))
        return found

    @made.get("/api/palette")
    def palette(
        text: _Text = "",
        genre: _Text = "",
        energy: _Text = "",
        level: _Text = "",
        travel: _Text = "",
        offset: Annotated[int, Query(ge=0, le=1_000_000)] = 0,
        limit: Annotated[int, Query(ge=1, le=200)] = 24,
    ) -> dict[str, Any]:
        """Parts of takes, and motifs."""
        return service.palette().found(
            text=text, genre=genre, energy=energy, level=level, travel=travel, offset=offset, limit=limit
        )

    @made.get("/api/palette/motion")
    def motion(
        take: _Text,
        from_s: Annotated[Seconds, Query(alias="from")],
        to_s: Annotated[Seconds, Query(alias="to")],
    ) -> dict[str, Any]:
        """The motion of a part of a take for a small figure, at 20 frames a second."""
        return part_motion(desk.state.repertoire, take, from_s, to_s)

    return made
