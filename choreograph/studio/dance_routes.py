"""The addresses of the dance: its motion, settings, edits, versions and explanations, and jobs.

The bodies of requests are models, whose fields are checked before anything is done.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query
from fastapi.responses import JSONResponse, StreamingResponse
from pydantic import BaseModel, ConfigDict, Field

from choreograph.choreography.constraints import MotifPin, TakePin, parse_ban
from choreograph.choreography.edits import EditRequest, Hold, MoveJoin, Repeat, Swap, Vary
from choreograph.core.errors import ParameterError
from choreograph.motion.motion import Motion
from choreograph.music.song_features import SongFeatures
from choreograph.pipeline.planning import FirstPart
from choreograph.studio.dance_json import explained, motion_data, part_motion
from choreograph.studio.jobs import Job
from choreograph.studio.project import EditKind, Step
from choreograph.studio.ratings import SUFFIX, rate
from choreograph.studio.refusals import ConflictError, NotFoundError
from choreograph.studio.service import Service

# The bodies of requests.


Seconds = Annotated[float, Field(ge=0, le=86_400, allow_inf_nan=False)]
Span = tuple[Seconds, Seconds]
Slot = Literal["A", "B"]
Text = Annotated[str, Field(max_length=300)]


class Body(BaseModel):
    """A body without unknown fields."""

    model_config = ConfigDict(extra="forbid")


class Revised(Body):
    """A change of the newest state."""

    revision: Annotated[int, Field(ge=0, le=1 << 53)]


class PartBody(Body):
    """A part of the dance, or all of it."""

    from_s: Seconds | None = Field(default=None, alias="from")
    to_s: Seconds | None = Field(default=None, alias="to")

    def span(self) -> Span | None:
        """The part, or None for all. Raises `ParameterError` if only one end is given."""
        if self.from_s is not None and self.to_s is not None:
            return self.from_s, self.to_s
        if self.from_s is not None or self.to_s is not None:
            raise ParameterError("expected both from and to, or none of them, got one")
        return None


class SettingsBody(Revised, PartBody):
    """Changes of settings, for the whole dance or a span. The motion from `at` on is sent first."""

    changes: dict[str, Any]
    keep_locked: bool = True
    at: Seconds | None = None


class LocksBody(Revised):
    """All parts that are locked."""

    locks: Annotated[list[Span], Field(max_length=500)]


class AlternativesBody(Revised):
    """The span to dance otherwise, and how many ways to show."""

    from_s: Seconds = Field(alias="from")
    to_s: Seconds = Field(alias="to")
    n: Annotated[int, Field(ge=1, le=24)] = 8


class ChooseBody(Revised):
    """The alternative to dance."""

    id: Text


class EditBody(Revised, PartBody):
    """One edit of the dance."""

    kind: EditKind
    at: Seconds | None = None
    mirrored: bool = False
    take: Text | None = None
    source_s: Seconds | None = None
    motif: Annotated[int, Field(ge=0, le=100_000)] | None = None
    section: Annotated[int, Field(ge=0, le=10_000)] | None = None  # of the song, that a part is cut to
    ban: Text | None = None  # such as genre:tango
    seed: Annotated[int, Field(ge=0, le=1 << 32)] = 0


class SeamBody(Revised):
    """The join of two takes that is nearest to a time, and by how many counts it is moved."""

    at: Seconds
    counts: Annotated[int, Field(ge=-256, le=256)]


# The dance, the jobs that change it, and the stream of news.


_LONGEST_WAIT_S = 1.0  # of a request, so that no thread of the server is long without other work
_FIRST_S = 5.0  # of the dance that is sent first: longer than a page waits for the rest


def dance_routes(service: Service) -> APIRouter:
    """The addresses of the dance."""
    made, studio = APIRouter(tags=["dance"]), service.studio

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
        shown = studio.state
        studio.current()
        if shown.dance is None or (revision is not None and revision != shown.project.revision):
            raise ConflictError(f"expected the newest revision {shown.project.revision}, got {revision}")
        of = {"revision": shown.project.revision, "repertoire": shown.repertoire.path.name}
        return JSONResponse(of | studio.motion_data())

    @made.get("/api/mesh")
    def mesh() -> dict[str, Any]:
        """The mesh of the mannequin, and its facts."""
        text, facts = studio.mannequin()
        return {"mesh": text, "facts": facts}

    @made.post("/api/settings", status_code=202)
    def settings(body: SettingsBody) -> dict[str, Any]:
        """Change settings, and make the dance again, or a span of it.

        Dancers, formation and relation leave the dance of the leader as it is. Each formation and relation is
        VALUE or WHEN=VALUE, as of `choreograph scene`.
        """
        studio.check(body.revision)
        dancers = studio.project.settings.changed(body.changes).dancers
        span = body.span()

        def work(job: Job) -> None:
            # Several dancers come together, so that none is near another one meanwhile.
            first = None if body.at is None or dancers > 1 else first_part(job, body.at, body.revision + 1)
            studio.change_settings(
                body.revision, body.changes, job.report, keep_locked=body.keep_locked, span=span, first=first
            )

        return {"job": service.change("settings", work).id}

    @made.post("/api/locks")
    def locks(body: LocksBody) -> dict[str, Any]:
        """Lock these parts of the dance, and no others."""
        return service.change_now("lock", lambda job: studio.lock(body.revision, body.locks))

    @made.post("/api/undo")
    def undo(body: Revised) -> dict[str, Any]:
        """Go back to the dance before the last change."""
        return service.change_now("undo", lambda job: studio.move(body.revision, back=True))

    @made.post("/api/redo")
    def redo(body: Revised) -> dict[str, Any]:
        """Make a change again that was undone."""
        return service.change_now("redo", lambda job: studio.move(body.revision, back=False))

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


# Edits of parts of the dance, and alternatives to choose from.


_OF_A_PART: dict[str, type[Swap | Vary | Hold]] = {"swap": Swap, "vary": Vary, "hold": Hold}
_SAME_S = 0.1  # between the start of a part and that of a section, which are then the same


def edit_routes(service: Service) -> APIRouter:
    """The addresses of edits."""
    made, studio = APIRouter(tags=["edits"]), service.studio

    @made.post("/api/edit", status_code=202)
    def edit(body: EditBody) -> dict[str, Any]:
        """Change one part of the dance. All else stays as it is."""
        studio.check(body.revision)
        request = edit_request(body, studio.state.features)
        bans = [str(request)] if body.kind == "ban" else []

        def work(job: Job) -> None:
            if isinstance(request, TakePin) and body.source_s is not None:
                span = request.start_s, request.end_s
                studio.pin_part(body.revision, span, request.take, body.source_s)
            else:
                studio.edit(body.revision, [request], body.seed, job.report, bans=bans)

        return {"job": service.change(body.kind, work).id}

    @made.post("/api/seam", status_code=202)
    def seam(body: SeamBody) -> dict[str, Any]:
        """Let one take give way to the next some counts later, or earlier."""
        studio.check(body.revision)
        request = MoveJoin(body.at, body.counts)
        job = service.change("seam", lambda job: studio.edit(body.revision, [request], 0, job.report))
        return {"job": job.id}

    @made.post("/api/alternatives", status_code=202)
    def alternatives(body: AlternativesBody) -> dict[str, Any]:
        """Find what else could be danced in a span."""
        studio.check(body.revision)
        span = body.from_s, body.to_s
        job = service.jobs.start(
            "alternatives", lambda job: studio.alternatives(body.revision, span, body.n, job.report)
        )
        return {"job": job.id}

    @made.post("/api/choose")
    def choose(body: ChooseBody) -> dict[str, Any]:
        """Dance an alternative."""
        return service.change_now("choose", lambda job: studio.choose(body.revision, body.id))

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
    if body.kind in _OF_A_PART:
        return _OF_A_PART[body.kind](start_s, end_s)
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


# Versions A and B of the dance, and ratings of them.


class VersionBody(Body):
    """The version that the dance shall be."""

    slot: Slot


class RatingBody(Body):
    """Which of the two versions is better."""

    better: Literal["A", "B", "same"]


def version_routes(service: Service) -> APIRouter:
    """The addresses of versions."""
    made, studio = APIRouter(tags=["versions"]), service.studio

    @made.post("/api/versions")
    def keep(body: VersionBody) -> dict[str, Any]:
        """Keep the dance as it is as version A or B."""
        return service.change_now("version", lambda job: studio.keep_version(body.slot))

    @made.get("/api/versions/{slot}/facts")
    def facts(slot: Slot) -> dict[str, Any]:
        """The facts of a version, as those of the dance."""
        return service.jobs.do("version", lambda job: studio.facts(slot))

    @made.get("/api/versions/{slot}/motion")
    def motion(slot: Slot) -> dict[str, Any]:
        """The motion of a version, as that of the dance."""
        return service.jobs.do("version", lambda job: studio.motion_data(slot))

    @made.post("/api/rating")
    def rating(body: RatingBody) -> dict[str, Any]:
        """Note which version is better, in a folder that `python -m research.study show` reads."""
        project = studio.project
        if studio.file is None or set(project.versions) != {"A", "B"}:
            raise NotFoundError("expected versions A and B, got fewer: keep both first")
        names = _named(project.steps[project.versions["A"]]), _named(project.steps[project.versions["B"]])
        folder = studio.file.with_name(studio.file.name.removesuffix(".json") + SUFFIX)
        better = {"A": 0, "B": 1}.get(body.better)
        path = service.jobs.do("rating", lambda job: rate(folder, project.song, names, better))
        return {"file": f"{path.parent.name}/{path.name}"}

    return made


def _named(step: Step) -> str:
    """What a version is called in a study."""
    edits = f", {len(step.edits)} edits" if step.edits else ""
    weights = "".join(f", {name}={weight:g}" for name, weight in step.settings.weights.items())
    genre = f", {step.settings.genre}" if step.settings.genre else ""
    n = step.settings.dancers
    dancers = (
        f", {n} dancers, {' '.join((*step.settings.formation, *step.settings.relation))}" if n > 1 else ""
    )
    return f"{step.settings.engine}, seed {step.settings.seed}{genre}{weights}{edits}{dancers}"


# Why something is danced, and the palette of takes and motifs.


_Query = Annotated[str, Query(max_length=200)]


def take_routes(service: Service) -> APIRouter:
    """The addresses of explanations and of the palette."""
    made, studio = APIRouter(tags=["takes"]), service.studio

    @made.get("/api/explain")
    def explain(at: Annotated[Seconds, Query()]) -> dict[str, Any]:
        """What is danced at a time, why, and what would be the next best."""
        _, dance = studio.current()
        repertoire = studio.state.repertoire
        return service.jobs.do("explain", lambda job: explained(dance, repertoire, at))

    @made.get("/api/palette")
    def palette(
        text: _Query = "",
        genre: _Query = "",
        energy: _Query = "",
        level: _Query = "",
        travel: _Query = "",
        offset: Annotated[int, Query(ge=0, le=1_000_000)] = 0,
        limit: Annotated[int, Query(ge=1, le=200)] = 24,
    ) -> dict[str, Any]:
        """Parts of takes, and motifs."""
        return service.palette().found(
            text=text, genre=genre, energy=energy, level=level, travel=travel, offset=offset, limit=limit
        )

    @made.get("/api/palette/motion")
    def motion(
        take: _Query,
        from_s: Annotated[Seconds, Query(alias="from")],
        to_s: Annotated[Seconds, Query(alias="to")],
    ) -> dict[str, Any]:
        """The motion of a part of a take for a small figure, at 20 frames a second."""
        return part_motion(studio.state.repertoire, take, from_s, to_s)

    return made
