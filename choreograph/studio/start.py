"""Starts a studio with what the command line names."""

from __future__ import annotations

from pathlib import Path

from choreograph.characters.gltf_character import read_character
from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.files import check_regular
from choreograph.library.repertoire import Repertoire
from choreograph.studio.jobs import Job
from choreograph.studio.project_file import ProjectFile
from choreograph.studio.service import Service


def start(
    song: Path | None, repertoire: Repertoire, *, project: Path | None = None, character: Path | None = None
) -> Service:
    """A studio in the folder of the song or the project, else in the working folder.

    The song is read, and its first dance made, while the page is shown. Raises `FormatError` if a file is
    missing or damaged, and `ChoreographError` if another process works with the project.
    """
    if song is None and project is not None:
        song = _song_of(project)
    folder = Path.cwd() if song is None else song.parent
    service = Service(folder, repertoire)
    if character is not None:
        service.character = read_character(character)
    if song is not None:
        check_regular(song, "a song")
        service.desk.open(song, project)
        service.change("song", lambda job: _load(service, job))
    return service


def _load(service: Service, job: Job) -> None:
    service.restore_character()
    service.desk.load(None, job.report)


def _song_of(project: Path) -> Path:
    if not project.is_file():
        raise FormatError(
            f"{project}: expected a project of the studio, or a SONG for a new one, got no file"
        )
    file = ProjectFile(project)
    try:
        found = file.read()
    finally:
        file.close()
    if found is None or Path(found.song).name != found.song or not found.song:
        raise ParameterError(f"{project}: expected a project with a song in its folder, got none")
    return project.parent / found.song
