"""Versions A and B of the dance, and ratings of them."""

from __future__ import annotations

from typing import Any, Literal

from fastapi import APIRouter

from choreograph.studio.project import Step
from choreograph.studio.ratings import SUFFIX, rate
from choreograph.studio.refusals import NotFoundError
from choreograph.studio.routes.bodies import Body, Slot
from choreograph.studio.service import Service


class VersionBody(Body):
    """The version that the dance shall be."""

    slot: Slot


class RatingBody(Body):
    """Which of the two versions is better."""

    better: Literal["A", "B", "same"]


def router(service: Service) -> APIRouter:
    """The addresses of versions."""
    made, desk = APIRouter(tags=["versions"]), service.desk

    @made.post("/api/versions")
    def keep(body: VersionBody) -> dict[str, Any]:
        """Keep the dance as it is as version A or B."""
        return service.change_now("version", lambda job: desk.keep_version(body.slot))

    @made.get("/api/versions/{slot}/facts")
    def facts(slot: Slot) -> dict[str, Any]:
        """The facts of a version, as those of the dance."""
        found: dict[str, Any] = service.jobs.do("version", lambda job: desk.facts(slot))
        return found

    @made.get("/api/versions/{slot}/motion")
    def motion(slot: Slot) -> dict[str, Any]:
        """The motion of a version, as that of the dance."""
        found: dict[str, Any] = service.jobs.do("version", lambda job: desk.motion_data(slot))
        return found

    @made.post("/api/rating")
    def rating(body: RatingBody) -> dict[str, Any]:
        """Note which version is better, in a folder that `python -m research.study show` reads."""
        project = desk.project
        if desk.file is None or set(project.versions) != {"A", "B"}:
            raise NotFoundError("expected versions A and B, got fewer: keep both first")
        names = _named(project.steps[project.versions["A"]]), _named(project.steps[project.versions["B"]])
        folder = desk.file.with_name(desk.file.name.removesuffix(".json") + SUFFIX)
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
