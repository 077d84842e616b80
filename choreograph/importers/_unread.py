"""Files of a source that give no take, each with the reason: damaged ones, and those that are not read."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from choreograph.count_files import SUFFIX as COUNTS_SUFFIX
from choreograph.errors import ChoreographError, UnreadFilesError
from choreograph.foreign_formats import foreign_format

MOTION_SUFFIXES = (".bvh", ".c3d", ".glb", ".gltf", ".vrma", ".npz", ".fbx")
SONG_SUFFIXES = (".wav", ".mp3", ".flac", ".ogg", ".m4a")
VIDEO_SUFFIXES = (".mp4", ".mov", ".mkv", ".webm", ".avi")  # whose sound is taken where there is no song
_MANIFESTS = (".tsv", ".txt", ".xls", ".xlsx", ".ods", ".json")  # in which a manifest may be kept by mistake
_NAMED = 6  # files in a note; the others are counted

File = TypeVar("File")
Content = TypeVar("Content")


@dataclass(frozen=True, eq=False)
class Unread:
    """A file, or a folder that holds one take, that gave no take."""

    path: Path
    why: str
    error: ChoreographError | None = None  # set where it should have given one

    @classmethod
    def damaged(cls, path: Path, error: ChoreographError) -> Unread:
        """Of a file that should have given a take; the reason is the error without the file's name."""
        return cls(path, str(error).removeprefix(str(path)).lstrip(":, "), error)


def named_source(source: str | Path) -> Path:
    """The source by a path that ends in its own name, which some layouts read; "." and links do not."""
    path = Path(source)
    real = path.resolve()
    return real if path.is_dir() and path.name != real.name else path


def attempted(read: Callable[[Path], Content], path: Path) -> Content | Unread:
    """What `read` makes of a file; if it raises a `ChoreographError`, the file as unread."""
    try:
        return read(path)
    except ChoreographError as error:
        return Unread.damaged(path, error)


def unread_files(folder: Path, used: Collection[Path]) -> Iterator[Unread]:
    """The files in a folder, and in those below it, that look like motion or music and are not in `used`."""
    for parent, folders, names in os.walk(folder):
        # Hidden files and folders come from other programs, such as macOS's "._NAME.bvh".
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        for name in sorted(names):
            path = Path(parent) / name
            if path in used or name.startswith("."):
                continue
            why = _why_unread(path, is_below=path.parent != folder)
            if why:
                yield Unread(path, why)


def unread_notes(folder: str | Path, unread: Iterable[Unread]) -> tuple[str, ...]:
    """A note for each reason for which files were skipped, and one for each that should have been read."""
    by_reason: dict[str, list[str]] = {}
    folder = named_source(folder)
    damaged = []
    for file in unread:
        if file.error is not None:
            damaged.append(f"left out, since it cannot be read: {file.error}")
        else:
            name = file.path.relative_to(folder).as_posix() if file.path != folder else folder.name
            by_reason.setdefault(file.why, []).append(name)
    return (*(_note(reason, names) for reason, names in by_reason.items()), *damaged)


def raise_errors(unread: Iterable[Unread], cure: str = "") -> None:
    """Raise the error of the only file that should have been read, or one that lists those of several.

    The list begins with a line that ends in the `cure`.
    """
    errors = [file.error for file in unread if file.error is not None]
    if len(errors) == 1:
        raise errors[0]
    if errors:
        summary = f"expected to read all files, got {len(errors)} that cannot be read{cure}:"
        raise UnreadFilesError(summary, errors)


def _why_unread(path: Path, *, is_below: bool) -> str:
    """Why a file of its kind is not read; "" if it looks like neither motion nor music."""
    suffix, foreign = path.suffix.lower(), foreign_format(path)
    if foreign is not None:
        return f"{foreign.what}: {foreign.motion}"
    if suffix == ".npz":
        return "NPZ with neither a motion of this program nor SMPL poses and their rate"
    if suffix in MOTION_SUFFIXES:
        return "in folders below, which are not looked into: give them by themselves"
    if suffix in SONG_SUFFIXES:
        return "music that no take is danced to"
    if suffix in VIDEO_SUFFIXES:
        return "video without sound, or beside a song or no motion of its name"
    if path.name.lower().endswith(COUNTS_SUFFIX):
        return "counts without a motion of their name"
    if suffix == ".pkl" and not is_below:
        return "pickles of AIST++ are read from its folder motions/, or given by themselves"
    if path.stem.lower() == "manifest" and suffix in _MANIFESTS and not is_below:
        return "expected manifest.csv: save the table as CSV under that name"
    return ""


def _note(reason: str, names: list[str]) -> str:
    number = "1 file" if len(names) == 1 else f"{len(names)} files"
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return f"skipped {number}: {', '.join(names[:_NAMED])}{more} ({reason})"
