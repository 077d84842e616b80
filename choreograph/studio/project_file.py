"""The file of a project: written as a whole after each change, and locked while a studio works with it."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path

from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.files import atomic_path, free_names, locked_folder, read_text, sha256_of
from choreograph.studio.project import Project, project_from_json
from choreograph.studio.refusals import UnknownTypeError

SUFFIX = ".studio.json"
MOST_BYTES = 1 << 29  # of a project file
_LONGEST_NAME_BYTES = 160
_NOT_IN_NAMES = re.compile(r'[\x00-\x1f\x7f/\\:*?"<>|]|^\.|\.$|^\s|\s$')


class ProjectFile:
    """The file of one project, which no other process can use until `close`."""

    def __init__(self, path: Path) -> None:
        """Lock the file. Raises `ChoreographError` if another process works with it."""
        self.path = path
        self._open = ExitStack()
        lock = path.with_name(f".{path.name}.lock")
        self._open.enter_context(locked_folder(lock, doing=f"works on {path.name} in the studio"))

    def read(self) -> Project | None:
        """The project in the file, or None if there is no file. Raises `FormatError` if it is damaged."""
        if not self.path.exists():
            return None
        text = read_text(self.path, "a project of the studio", max_bytes=MOST_BYTES)
        return project_from_json(text, self.path.name)

    def write(self, project: Project) -> None:
        """Replace the file. Raises `ChoreographError` if it cannot be written. The old one is then kept."""
        with (
            atomic_path(self.path) as temporary,
            open(temporary, "w", encoding="utf-8", newline="\n") as file,
        ):
            file.write(project.to_json())
            file.flush()
            os.fsync(file.fileno())

    def close(self) -> None:
        """Let other processes work with the file."""
        self._open.close()


def opened(path: Path, song: str, already: ProjectFile | None) -> tuple[ProjectFile, Project | None]:
    """The locked file of a project, and the project of this song in it, or None if there is no file yet.

    `already` is the file that is open. Raises as `ProjectFile`, and `FormatError` if the file is damaged or
    of another song.
    """
    is_open = already is not None and already.path.resolve() == path.resolve()
    file = already if is_open and already is not None else ProjectFile(path)
    try:
        project = file.read()
        if project is not None and project.song != song:
            raise FormatError(f"{path}: expected a project of {song}, got one of {project.song!r}")
    except FormatError:
        if not is_open:
            file.close()
        raise
    return file, project


def project_path(song: Path) -> Path:
    """The project file of a song, beside it."""
    return song.with_name(f"{song.stem}{SUFFIX}")


# Files that pages send. Their names are names in the folder of the project, and never paths.


def checked_name(name: str, suffixes: Iterable[str]) -> str:
    """The name of a file that a page has sent.

    Raises `ParameterError` for a path or a name that is not usable on all systems, and `UnknownTypeError` for
    another suffix.
    """
    if not name or _NOT_IN_NAMES.search(name) or len(name.encode(errors="replace")) > _LONGEST_NAME_BYTES:
        raise ParameterError(f"expected a plain name of a file, got {name[:80]!r}")
    known = tuple(suffixes)
    if not name.lower().endswith(known):
        raise UnknownTypeError(f"expected a file among {', '.join(known)}, got {name[:80]!r}")
    return name


def placed(temporary: Path, folder: Path) -> Path:
    """Move a file into a folder. A file of the same name and content is used, another is kept beside it."""
    target = folder / temporary.name
    if target.is_file() and sha256_of(target) == sha256_of(temporary):
        temporary.unlink()
        return target
    [free] = free_names([target], lambda path: os.path.lexists(path))
    temporary.rename(free)
    return free
