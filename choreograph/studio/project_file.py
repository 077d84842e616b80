"""The file of a project: written as a whole after each change, and locked while a studio works with it."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from pathlib import Path
from shutil import copyfile

from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.files import (
    atomic_path,
    check_target,
    free_names,
    locked_folder,
    read_bytes,
    sha256_of,
)
from choreograph.studio.project import MOST_BYTES, Project, project_from_json
from choreograph.studio.refusals import UnknownTypeError

SUFFIX = ".studio.json"
_LONGEST_NAME_BYTES = 160
_NOT_IN_NAMES = re.compile(
    r'[\x00-\x1f\x7f-\x9f\u2028\u2029/\\:*?"<>|]|^\.|\.$|^\s|\s$'
    r"|^(con|prn|aux|nul|com\d|lpt\d)(\.|$)",  # devices on Windows
    re.IGNORECASE,
)


class ProjectFile:
    """The file of one project, which no other process can use until `close`.

    If its path is a link, the file is the one that the link leads to, and the link stays as it is.
    """

    def __init__(self, path: Path) -> None:
        """Lock the file. Raises `ChoreographError` if another process works with it."""
        self.path = path
        self.real = check_target(os.path.realpath(path))
        self._open = ExitStack()
        lock = self.real.with_name(f".{self.real.name}.lock")
        self._open.enter_context(locked_folder(lock, doing=f"works on {path.name} in the studio"))

    def read(self) -> Project | None:
        """The project in the file, or None if there is no file. Raises `FormatError` if it is damaged."""
        if not os.path.lexists(self.real):
            return None
        data = read_bytes(self.real, "a project of the studio", max_bytes=MOST_BYTES)
        return project_from_json(data, self.path.name)

    def write(self, project: Project) -> None:
        """Replace the file. Raises `ChoreographError` if it cannot be written. The old one is then kept."""
        with (
            atomic_path(self.real) as temporary,
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
    is_open = already is not None and already.real == Path(os.path.realpath(path))
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


def placed(sent: Path, folder: Path, is_taken: Callable[[Path], bool] = lambda path: False) -> Path:
    """Move a file into a folder, under a free name beside other files of its name. Returns its path.

    A file of the same content is used instead, and a free name must not be taken for another reason.
    Raises `ChoreographError` if it cannot be written.
    """
    checksum = sha256_of(sent)

    def is_other(path: Path) -> bool:
        if not os.path.lexists(path):
            return is_taken(path)
        return not (path.is_file() and sha256_of(path) == checksum)

    [target] = free_names([folder / sent.name], is_other)
    if not target.exists():
        with atomic_path(target) as temporary:
            copyfile(sent, temporary)
    sent.unlink()
    return target
