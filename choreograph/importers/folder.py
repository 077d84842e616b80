"""A folder of BVH files, optionally with a song of the same name each, and a manifest.csv."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from choreograph.errors import FormatError
from choreograph.importers._bvh_text import read_text
from choreograph.importers.bvh import read_bvh
from choreograph.takes import Credits, Take

LAYOUT = "a folder of NAME.bvh with NAME.wav|mp3|flac|ogg|m4a and an optional manifest.csv"
SONG_SUFFIXES = (".wav", ".mp3", ".flac", ".ogg", ".m4a")
_CREDITS = ("genre", "performer", "licence", "source")
_COLUMNS = ("name", *_CREDITS, "audio_offset_s", "song")


def detect(path: Path) -> bool:
    """Whether `path` is a folder with a BVH file in it."""
    return path.is_dir() and bool(_bvh_files(path))


def read(path: Path) -> Iterator[Take]:
    """The folder's takes by name.

    The manifest's columns, all but `name` optional: genre, performer, licence, source; audio_offset_s, the
    time in the song of the motion's first frame; song, a file in the folder that takes may share.
    `FormatError` for any other column, a name without a BVH file, or a missing song.
    """
    files = {file.stem: file for file in _bvh_files(path)}
    rows = _manifest(path / "manifest.csv", set(files))
    for name, file in files.items():
        row = rows.get(name, {})
        song = _song(path, name, row.get("song", ""))
        motion, notes = read_bvh(file)
        yield Take(
            name=name,
            motion=motion,
            credits=Credits(**{key: row.get(key, "") for key in _CREDITS}),
            song_path=song,
            song_start_s=float(row.get("audio_offset_s") or 0.0),
            song_name=song.stem if song else "",
            source_paths=(file, song) if song else (file,),
            notes=notes,
        )


def song_beside(folder: Path, name: str) -> Path | None:
    """The file NAME with an audio suffix (in any case) in `folder`; None if there is none."""
    if not folder.is_dir():
        return None
    found = (p for p in sorted(folder.iterdir()) if p.stem == name and p.suffix.lower() in SONG_SUFFIXES)
    return next(found, None)


def _bvh_files(path: Path) -> list[Path]:
    # Hidden files come from other programs, such as macOS's "._NAME.bvh".
    return sorted(p for p in path.iterdir() if p.suffix.lower() == ".bvh" and not p.name.startswith("."))


def _song(folder: Path, name: str, given: str) -> Path | None:
    if not given:
        return song_beside(folder, name)
    if not (folder / given).is_file():
        raise FormatError(
            f"{folder / 'manifest.csv'}: {name!r} names the song {given!r}, which is not in the folder"
        )
    return folder / given


def _manifest(path: Path, names: set[str]) -> dict[str, dict[str, str]]:
    if not path.exists():
        return {}
    # The csv module fails on NUL, which no text contains.
    reader = csv.DictReader(io.StringIO(read_text(path).replace("\0", "")), skipinitialspace=True)
    columns = reader.fieldnames or []
    unknown = [column for column in columns if column not in _COLUMNS]
    if unknown or "name" not in columns:
        raise FormatError(
            f"{path}: expected columns name and any of {', '.join(_COLUMNS[1:])}, got {list(columns)}"
        )
    rows: dict[str, dict[str, str]] = {}
    for row in reader:
        where = f"{path}, line {reader.line_num}"
        if None in row or None in row.values():
            raise FormatError(f"{where}: expected {len(columns)} cells: a cell with a comma needs quotes")
        name = row["name"].removesuffix(".bvh")
        if name not in names:
            raise FormatError(f"{where}: there is no {name}.bvh in the folder")
        if name in rows:
            raise FormatError(f"{where}: {name!r} is listed twice")
        _check_offset(where, row.get("audio_offset_s", ""))
        rows[name] = {column: cell.strip() for column, cell in row.items()}
    return rows


def _check_offset(where: str, cell: str) -> None:
    try:
        finite = np.isfinite(float(cell or 0.0))
    except ValueError:
        finite = False
    if not finite:
        raise FormatError(f"{where}: expected seconds in audio_offset_s, got {cell!r}")
