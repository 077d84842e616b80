"""Edits of parts of the dance, and alternatives to choose from."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter

from choreograph.choreography.constraints import MotifPin, TakePin, parse_ban
from choreograph.choreography.edits import EditRequest, Hold, MoveJoin, Repeat, Swap, Vary
from choreograph.core.errors import ParameterError
from choreograph.music.song_features import SongFeatures
from choreograph.studio.routes.bodies import AlternativesBody, ChooseBody, EditBody, SeamBody
from choreograph.studio.service import Service

_SAME_S = 0.1  # between the start of a part and that of a section, which are then the same


def router(service: Service) -> APIRouter:
    """The addresses of edits."""
    made, desk = APIRouter(tags=["edits"]), service.desk

    @made.post("/api/edit", status_code=202)
    def edit(body: EditBody) -> dict[str, Any]:
        """Change one part of the dance. All else stays as it is."""
        desk.check(body.revision)
        request = edit_request(body, desk.state.features)
        bans = [str(request)] if body.kind == "ban" else []
        if isinstance(request, TakePin) and body.source_s is not None:
            span, take, source_s = (request.start_s, request.end_s), request.take, body.source_s
            job = service.change(body.kind, lambda job: desk.pin_part(body.revision, span, take, source_s))
            return {"job": job.id}
        job = service.change(
            body.kind, lambda job: desk.edit(body.revision, [request], body.seed, job.report, bans=bans)
        )
        return {"job": job.id}

    @made.post("/api/seam", status_code=202)
    def seam(body: SeamBody) -> dict[str, Any]:
        """Let one take give way to the next some counts later, or earlier."""
        desk.check(body.revision)
        request = MoveJoin(body.at, body.counts)
        job = service.change("seam", lambda job: desk.edit(body.revision, [request], 0, job.report))
        return {"job": job.id}

    @made.post("/api/alternatives", status_code=202)
    def alternatives(body: AlternativesBody) -> dict[str, Any]:
        """Find what else could be danced in a span."""
        desk.check(body.revision)
        span = body.from_s, body.to_s
        job = service.jobs.start(
            "alternatives", lambda job: desk.alternatives(body.revision, span, body.n, job.report)
        )
        return {"job": job.id}

    @made.post("/api/choose")
    def choose(body: ChooseBody) -> dict[str, Any]:
        """Dance an alternative."""
        return service.change_now("choose", lambda job: desk.choose(body.revision, body.id))

    return made


def edit_request(body: EditBody, features: SongFeatures | None) -> EditRequest:
    """The edit of a body. Raises `ParameterError` if it lacks a value that its kind needs.

    `features` are those of the song, once there is a dance.
    """

    def needed(name: str, value: Any) -> Any:
        if value is None:
            raise ParameterError(f"expected {name} beside the kind {body.kind}, got none")
        return value

    if body.kind == "ban":
        if body.ban is not None:
            return parse_ban(body.ban)
        return parse_ban(f"take:{body.take}" if body.motif is None else f"motif:{body.motif}")
    if body.kind == "pin_motif":
        at_s = body.from_s if body.at is None else body.at
        return MotifPin(needed("at", at_s), needed("motif", body.motif))
    start_s, end_s = needed("from", body.from_s), needed("to", body.to_s)
    if body.kind == "swap":
        return Swap(start_s, end_s)
    if body.kind == "vary":
        return Vary(start_s, end_s)
    if body.kind == "hold":
        return Hold(start_s, end_s)
    if body.kind == "cut":
        return _cut(start_s, end_s, needed("section", body.section), features)
    if body.kind == "repeat":
        return Repeat(start_s, end_s, needed("at", body.at), body.mirrored)
    return TakePin(start_s, end_s, needed("take", body.take))


def _cut(start_s: float, end_s: float, section: int, features: SongFeatures | None) -> Repeat:
    """The edit that dances a part as the start of a section is danced, at most to the end of the section."""
    bounds_s = [] if features is None else features.sections.bounds_s.tolist()
    if not section < len(bounds_s) - 1:
        raise ParameterError(f"expected one of {max(0, len(bounds_s) - 1)} sections, from 0, got {section}")
    from_s, to_s = bounds_s[section], bounds_s[section + 1]
    if abs(from_s - start_s) < _SAME_S:
        raise ParameterError("expected another section than the one that begins here, got this one")
    return Repeat(from_s, min(to_s, from_s + end_s - start_s), start_s)
