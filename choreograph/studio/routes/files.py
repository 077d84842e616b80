"""Characters, exports, builds and repertoires."""

from __future__ import annotations

import re
import secrets
from pathlib import Path
from shutil import rmtree
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Request
from fastapi.responses import FileResponse, Response
from pydantic import Field

from choreograph.characters.gltf_character import read_character
from choreograph.core.errors import ParameterError
from choreograph.studio import builds
from choreograph.studio.exports import export, export_scene, suffix_of
from choreograph.studio.jobs import Job
from choreograph.studio.project_file import checked_name, placed
from choreograph.studio.refusals import NotFoundError, TooLargeError
from choreograph.studio.routes.bodies import Body, Revised, Seconds, Text, received, uploaded
from choreograph.studio.service import Service
from choreograph.studio.shelf import SUFFIX as REPERTOIRE_SUFFIX

CHARACTER_SUFFIXES = (".glb", ".vrm")
MOST_CHARACTER_BYTES = 100_000_000
TAKE_SUFFIXES = (
    ".bvh", ".c3d", ".glb", ".npz", ".fbx", ".wav", ".mp3", ".flac", ".ogg", ".m4a", ".csv", ".json", ".txt",
)  # fmt: skip
MOST_TAKE_BYTES = 1 << 28  # of one file
_MOST_TAKES_BYTES = 1 << 32  # of all files of a build
_EXPORTS = 8  # that are kept until others are made


class ExportBody(Body):
    """The format of a file, and the part of the dance in it."""

    format: Text
    from_s: Seconds | None = Field(default=None, alias="from")
    to_s: Seconds | None = Field(default=None, alias="to")
    character: bool = False
    click: bool = False


class BonesBody(Body):
    """Names of bones by canonical joint."""

    bones: Annotated[dict[Text, Text], Field(max_length=100)]


class BuildBody(Body):
    """The name of a new repertoire."""

    name: Text
    preset: Literal["tiny", "small"] = "small"


class RepertoireBody(Revised):
    """The name of a repertoire to dance with."""

    name: Text


def router(service: Service) -> APIRouter:
    """The addresses of files."""
    made = APIRouter(tags=["files"])
    _add_characters(made, service)
    _add_exports(made, service)
    _add_builds(made, service)
    return made


def _add_characters(made: APIRouter, service: Service) -> None:
    desk = service.desk

    @made.post("/api/character")
    async def send_character(request: Request) -> dict[str, Any]:
        """Dance with a character that is sent as bytes, its name in the header X-Filename."""
        sent = await uploaded(request, service.scratch, CHARACTER_SUFFIXES, MOST_CHARACTER_BYTES)

        def use(job: Job) -> None:
            with received(sent):
                read_character(sent)
                path = placed(sent, desk.folder)
            service.use_character(read_character(path))

        return await service.soon("character", use)

    @made.put("/api/character/bones")
    def bones(body: BonesBody) -> dict[str, Any]:
        """Use other bones of the character."""
        character = service.character
        if character is None:
            raise NotFoundError("expected a character, got none yet: send one first")
        path = Path(character.document.name)
        return service.change_now(
            "bones", lambda job: service.use_character(read_character(path, body.bones))
        )

    @made.get("/api/character/glb")
    def glb() -> Response:
        """The character with the dance as its only animation."""
        character = service.character
        if character is None:
            raise NotFoundError("expected a character, got none yet: send one first")
        _, dance = desk.current()
        content = service.jobs.do("character", lambda job: character.dancing(dance.motion).to_glb())
        return Response(content, media_type="model/gltf-binary")


def _add_exports(made: APIRouter, service: Service) -> None:
    desk = service.desk

    @made.post("/api/export", status_code=202)
    def start(body: ExportBody) -> dict[str, Any]:
        """Write the dance, or a part of it, to a file. The result of the job has its id.

        Formats of one dancer are a .zip with a file for each, if there are several.
        """
        suffix = suffix_of(body.format)
        _, dance = desk.current()
        scene = desk.state.scene
        if (body.from_s is None) != (body.to_s is None):
            raise ParameterError("expected both from and to, or none of them, got one")
        span = None if body.from_s is None or body.to_s is None else (body.from_s, body.to_s)
        character = service.character if body.character else None
        id = secrets.token_hex(8)
        path = service.scratch / id / f"{Path(desk.project.song).stem}.{suffix}"

        def work(job: Job) -> dict[str, Any]:
            path.parent.mkdir()
            if scene is None:
                made = export(path, dance, span, character, job.report, click=body.click)
            else:
                made = export_scene(
                    path, scene, dance.song_path, span, character, job.report, click=body.click
                )
            service.exports[id] = made
            for old in list(service.exports)[:-_EXPORTS]:
                rmtree(service.exports.pop(old).parent, ignore_errors=True)
            return {"id": id, "file": made.name, "bytes": made.stat().st_size}

        return {"job": service.jobs.start("export", work, lane="files").id}

    @made.get("/api/export/{id}")
    def exported(id: str) -> FileResponse:
        """A file that was written."""
        path = service.exports.get(id)
        if path is None:
            raise NotFoundError(f"expected the id of a file that was written, got {id[:40]!r}")
        return FileResponse(path, filename=path.name, content_disposition_type="attachment")


def _add_builds(made: APIRouter, service: Service) -> None:
    desk, takes = service.desk, service.scratch / "takes"

    def files() -> list[dict[str, Any]]:
        found = sorted(takes.iterdir()) if takes.is_dir() else []
        return [{"name": path.name, "bytes": path.stat().st_size} for path in found if path.is_file()]

    @made.get("/api/build")
    def sent() -> dict[str, Any]:
        """The files that were sent for the next build."""
        return {"files": files()}

    @made.post("/api/build")
    async def send_take(request: Request) -> dict[str, Any]:
        """A take, its music or a table of takes, as bytes, for the next build."""
        if sum(file["bytes"] for file in files()) > _MOST_TAKES_BYTES:
            raise TooLargeError(f"expected at most {_MOST_TAKES_BYTES >> 30} GiB of takes, got more")
        file = await uploaded(request, service.scratch, TAKE_SUFFIXES, MOST_TAKE_BYTES)
        takes.mkdir(exist_ok=True)
        file.replace(takes / file.name)
        rmtree(file.parent, ignore_errors=True)
        return {"files": files()}

    @made.delete("/api/build")
    def clear() -> dict[str, Any]:
        """Forget the files that were sent."""
        rmtree(takes, ignore_errors=True)
        return {"files": []}

    @made.post("/api/build/check", status_code=202)
    def check() -> dict[str, Any]:
        """Check the files that were sent. The log of the job has a row for each."""
        _expect(files())
        return {"job": service.jobs.start("check", lambda job: builds.check(takes, job), lane="builds").id}

    @made.post("/api/build/start", status_code=202)
    def start(body: BuildBody) -> dict[str, Any]:
        """Build a repertoire from the files that were sent, in the folder of the project."""
        _expect(files())
        stem = re.sub(rf"{re.escape(REPERTOIRE_SUFFIX)}$", "", body.name)
        name = checked_name(f"{stem}{REPERTOIRE_SUFFIX}", [REPERTOIRE_SUFFIX])
        output = desk.folder / name
        if output.exists() or name in desk.shelf.names(desk.folder):
            raise ParameterError(f"expected a new name, got that of a repertoire: {name}")

        def work(job: Job) -> dict[str, Any]:
            builds.build(takes, output, body.preset, job)
            return {"name": name}

        return {"job": service.jobs.start("build", work, lane="builds").id}

    @made.post("/api/repertoire", status_code=202)
    def use(body: RepertoireBody) -> dict[str, Any]:
        """Make the dance again with another repertoire."""
        desk.check(body.revision)
        desk.shelf.open(body.name, desk.folder)
        changes = {"repertoire": body.name}
        job = service.change(
            "repertoire", lambda job: desk.change_settings(body.revision, changes, job.report)
        )
        return {"job": job.id}


def _expect(files: list[dict[str, Any]]) -> None:
    if not files:
        raise NotFoundError("expected takes for a build, got none yet: send them first")
