"""The song: what a page drops is read, and its project is opened or begun."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request
from fastapi.responses import FileResponse

from choreograph.music.song import load_song
from choreograph.studio.facts import waveform
from choreograph.studio.jobs import Job
from choreograph.studio.project_file import placed, project_path
from choreograph.studio.routes.bodies import received, uploaded
from choreograph.studio.service import Service

SUFFIXES = (".wav", ".mp3", ".flac", ".ogg", ".oga", ".opus", ".m4a", ".mp4", ".aac", ".aif", ".aiff")
MOST_BYTES = 1 << 28


def router(service: Service) -> APIRouter:
    """The addresses of the song."""
    made, desk = APIRouter(tags=["song"]), service.desk

    @made.post("/api/song", status_code=202)
    async def send_song(request: Request, dance: bool = True) -> dict[str, Any]:
        """Open a song that is sent as bytes, its name in the header X-Filename. The job makes a dance."""
        sent = await uploaded(request, service.scratch, SUFFIXES, MOST_BYTES)
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
        shown = waveform(desk.song(), points)
        return {"peaks": shown, "levels": sound.levels, "levels_per_s": sound.levels_per_s}

    return made


def _open(service: Service, sent: Path, job: Job, dance: bool) -> None:
    desk = service.desk
    with received(sent):
        job.report("reading the song", 0, 0)
        song = load_song(sent)
        # The project beside a free name would be that of another song, such as one with another suffix.
        path = placed(sent, desk.folder, lambda path: os.path.lexists(project_path(path)))
    desk.open(path)
    service.restore_character()
    desk.load(replace(song, path=path, name=path.stem), job.report, with_dance=dance)
