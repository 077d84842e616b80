"""The addresses of files: songs, characters, exports, builds and repertoires."""

from __future__ import annotations

import os
import re
import secrets
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from shutil import rmtree
from typing import Annotated, Any, Literal
from urllib.parse import unquote

from fastapi import APIRouter, Query, Request
from fastapi.responses import FileResponse, Response
from pydantic import Field

from choreograph.characters.character import read_character
from choreograph.core.errors import ChoreographError, ParameterError
from choreograph.core.files import writing
from choreograph.music.song import load_song
from choreograph.studio.dance_json import waveform
from choreograph.studio.dance_routes import Body, PartBody, Revised, Text
from choreograph.studio.exports import build, check_takes, export, export_scene, suffix_of
from choreograph.studio.jobs import Job
from choreograph.studio.project import checked_name, placed, project_path
from choreograph.studio.refusals import NotFoundError, TooLargeError
from choreograph.studio.service import Service
from choreograph.studio.studio_session import SUFFIX as REPERTOIRE_SUFFIX

# Uploaded files. Each has a folder of its own, so that messages show its own name.


async def uploaded(request: Request, folder: Path, suffixes: Iterable[str], most_bytes: int) -> Path:
    """A file that a page sends, its name in the header X-Filename, in a new folder below `folder`.

    Raises `ParameterError` for a name that is none, `UnknownTypeError` for another suffix, `TooLargeError`
    for more bytes, and `ChoreographError` if the disk is full. Nothing is then left.
    """
    name = checked_name(unquote(request.headers.get("x-filename", "")), suffixes)
    sent = folder / f"sent-{secrets.token_hex(8)}" / name
    n_bytes, done = 0, False
    try:
        with writing(Path(name)):
            sent.parent.mkdir()
            with open(sent, "xb") as file:
                async for chunk in request.stream():
                    n_bytes += len(chunk)
                    if n_bytes > most_bytes:
                        raise TooLargeError(most_bytes)
                    file.write(chunk)
        done = True
        return sent
    finally:
        if not done:
            rmtree(sent.parent, ignore_errors=True)


@contextmanager
def received(sent: Path) -> Iterator[None]:
    """Use an uploaded file in the block. Its folder is removed at the end, and errors name it without it."""
    try:
        yield
    except ChoreographError as error:
        raise type(error)(str(error).replace(f"{sent.parent}{os.sep}", "")) from None
    finally:
        rmtree(sent.parent, ignore_errors=True)


# The song: what a page drops is read, and its project is opened or begun.


SONG_SUFFIXES = (".wav", ".mp3", ".flac", ".ogg", ".oga", ".opus", ".m4a", ".mp4", ".aac", ".aif", ".aiff")
MOST_SONG_BYTES = 1 << 28


def song_routes(service: Service) -> APIRouter:
    """The addresses of the song."""
    made, studio = APIRouter(tags=["song"]), service.studio

    @made.post("/api/song", status_code=202)
    async def send_song(request: Request, dance: bool = True) -> dict[str, Any]:
        """Open a song that is sent as bytes, its name in the header X-Filename. The job makes a dance."""
        sent = await uploaded(request, service.scratch, SONG_SUFFIXES, MOST_SONG_BYTES)
        job = service.change("song", lambda job: _open(service, sent, job, dance))
        return {"job": job.id}

    @made.get("/api/song/audio")
    def audio() -> FileResponse:
        """The song as AAC in MP4."""
        return FileResponse(service.sound().path, media_type="audio/mp4")

    @made.get("/api/song/waveform")
    def peaks(points: Annotated[int, Query(ge=1, le=20_000)] = 1000) -> dict[str, Any]:
        """The peaks of the song, and its levels as in the page of `choreograph dance`."""
        sound = service.sound()
        shown = waveform(studio.song(), points)
        return {"peaks": shown, "levels": sound.levels, "levels_per_s": sound.levels_per_s}

    return made


def _open(service: Service, sent: Path, job: Job, dance: bool) -> None:
    studio = service.studio
    with received(sent):
        job.report("reading the song", 0, 0)
        song = load_song(sent)
        # The project beside a free name would be that of another song, such as one with another suffix.
        path = placed(sent, studio.folder, lambda path: os.path.lexists(project_path(path)))
    studio.open(path)
    service.restore_character()
    studio.load(replace(song, path=path, name=path.stem), job.report, with_dance=dance)


# Characters, exports, builds and repertoires.


CHARACTER_SUFFIXES = (".glb", ".vrm")
MOST_CHARACTER_BYTES = 100_000_000
TAKE_SUFFIXES = (
    ".bvh", ".c3d", ".glb", ".npz", ".fbx", ".wav", ".mp3", ".flac", ".ogg", ".m4a", ".csv", ".json", ".txt",
)  # fmt: skip
MOST_TAKE_BYTES = 1 << 28  # of one file
_MOST_TAKES_BYTES = 1 << 32  # of all files of a build
_EXPORTS = 8  # that are kept until others are made


class ExportBody(PartBody):
    """The format of a file, and the part of the dance in it."""

    format: Text
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


def file_routes(service: Service) -> APIRouter:
    """The addresses of files."""
    made = APIRouter(tags=["files"])
    _add_characters(made, service)
    _add_exports(made, service)
    _add_builds(made, service)
    return made


def _add_characters(made: APIRouter, service: Service) -> None:
    studio = service.studio

    @made.post("/api/character")
    async def send_character(request: Request) -> dict[str, Any]:
        """Dance with a character that is sent as bytes, its name in the header X-Filename."""
        sent = await uploaded(request, service.scratch, CHARACTER_SUFFIXES, MOST_CHARACTER_BYTES)

        def use(job: Job) -> None:
            with received(sent):
                read_character(sent)
                path = placed(sent, studio.folder)
            service.use_character(read_character(path))

        return await service.soon("character", use)

    @made.put("/api/character/bones")
    def bones(body: BonesBody) -> dict[str, Any]:
        """Use other bones of the character."""
        path = Path(service.shown_character().document.name)
        return service.change_now(
            "bones", lambda job: service.use_character(read_character(path, body.bones))
        )

    @made.get("/api/character/glb")
    def glb() -> Response:
        """The character with the dance as its only animation."""
        character = service.shown_character()
        _, dance = studio.current()
        content = service.jobs.do("character", lambda job: character.dancing(dance.motion).to_glb())
        return Response(content, media_type="model/gltf-binary")


def _add_exports(made: APIRouter, service: Service) -> None:
    studio = service.studio

    @made.post("/api/export", status_code=202)
    def start(body: ExportBody) -> dict[str, Any]:
        """Write the dance, or a part of it, to a file. The result of the job has its id.

        Formats of one dancer are a .zip with a file for each, if there are several.
        """
        suffix = suffix_of(body.format)
        _, dance = studio.current()
        scene = studio.state.scene
        span, character = body.span(), service.character if body.character else None
        id = secrets.token_hex(8)
        path = service.scratch / id / f"{Path(studio.project.song).stem}.{suffix}"

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
    studio, takes = service.studio, service.scratch / "takes"

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
            raise TooLargeError(_MOST_TAKES_BYTES)
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
        return {"job": service.jobs.start("check", lambda job: check_takes(takes, job), lane="builds").id}

    @made.post("/api/build/start", status_code=202)
    def start(body: BuildBody) -> dict[str, Any]:
        """Build a repertoire from the files that were sent, in the folder of the project."""
        _expect(files())
        stem = re.sub(rf"{re.escape(REPERTOIRE_SUFFIX)}$", "", body.name)
        name = checked_name(f"{stem}{REPERTOIRE_SUFFIX}", [REPERTOIRE_SUFFIX])
        output = studio.folder / name
        if output.exists() or name in studio.repertoires.names(studio.folder):
            raise ParameterError(f"expected a new name, got that of a repertoire: {name}")

        def work(job: Job) -> dict[str, Any]:
            build(takes, output, body.preset, job)
            return {"name": name}

        return {"job": service.jobs.start("build", work, lane="builds").id}

    @made.post("/api/repertoire", status_code=202)
    def use(body: RepertoireBody) -> dict[str, Any]:
        """Make the dance again with another repertoire."""
        studio.check(body.revision)
        studio.repertoires.open(body.name, studio.folder)
        changes = {"repertoire": body.name}
        job = service.change(
            "repertoire", lambda job: studio.change_settings(body.revision, changes, job.report)
        )
        return {"job": job.id}


def _expect(files: list[dict[str, Any]]) -> None:
    if not files:
        raise NotFoundError("expected takes for a build, got none yet: send them first")
