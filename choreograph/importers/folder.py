"""A folder of BVH, C3D or glTF files, optionally with a song of the same name each, and a manifest.csv."""

from __future__ import annotations

import csv
import io
import os
import reprlib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from choreograph.audio.ffmpeg import has_sound
from choreograph.counts import ANNOTATED, make_counts
from choreograph.errors import FormatError, ParameterError
from choreograph.importers._bvh_text import read_text
from choreograph.importers._count_annotation import check_within, with_counts_of
from choreograph.importers._unread import unread_notes
from choreograph.importers.bvh import read_bvh
from choreograph.importers.c3d import is_c3d, read_c3d_files
from choreograph.importers.gltf import SUFFIXES, is_gltf, read_gltf_motions
from choreograph.motion.motion import LONGEST_S, Motion
from choreograph.takes import Credits, Take

LAYOUT = (
    "a folder of NAME.bvh, .c3d or .glb with NAME.wav|mp3|flac|ogg|m4a, or a video of that name, and an "
    "optional manifest.csv"
)
READS_BONE_MAP = True
SONG_SUFFIXES = (".wav", ".mp3", ".flac", ".ogg", ".m4a")
VIDEO_SUFFIXES = (".mp4", ".mov", ".mkv", ".webm", ".avi")  # whose sound is taken where there is no song
_LARGEST_OFFSET_S = 4 * LONGEST_S
_CREDITS = ("genre", "performer", "licence", "source")
_COLUMNS = ("name", *_CREDITS, "audio_offset_s", "song", "counts", "beats")


def detect(path: Path) -> bool:
    """Whether `path` is a folder with a BVH, C3D or glTF file in it."""
    return path.is_dir() and bool(_motion_files(path))


def read(path: Path, bone_map: Mapping[str, str] | None = None) -> Iterator[Take]:
    """The folder's takes by name; those of C3D files on one skeleton.

    The manifest's columns, all but `name` optional: genre, performer, licence, source; audio_offset_s, the
    time in the song of the motion's first frame; song, a file in the folder that takes may share; counts, a
    file in the folder as NAME.counts.csv is (see `count_files`), or beats, the instants that are counted, in
    seconds from the motion's first frame, separated by spaces. `FormatError` for any other column, a name
    without a motion file, or a missing song.
    """
    files = _motion_files(path)
    rows = _manifest(path / "manifest.csv", set(files))
    captured = [file for file in files.values() if is_c3d(file)]
    fitted = dict(zip(captured, read_c3d_files(captured), strict=True)) if captured else {}
    for name, file in files.items():
        row = rows.get(name, {})
        song = _song(path, name, row.get("song", ""))
        motion, notes = fitted[file] if file in fitted else _read_motion(file, bone_map)
        take = Take(
            name=name,
            motion=motion,
            credits=Credits(**{key: row.get(key, "") for key in _CREDITS}),
            song_path=song,
            song_start_s=float(row.get("audio_offset_s") or 0.0),
            song_name=song.stem if song else "",
            source_paths=(file, song) if song else (file,),
            notes=notes,
        )
        yield _counted(take, path, row)


def notes(path: Path) -> tuple[str, ...]:
    """A line for each reason for which files in the folder that look like motion or music are not read."""
    files = _motion_files(path)
    rows = _manifest(path / "manifest.csv", set(files))
    songs = {_song(path, name, rows.get(name, {}).get("song", "")) for name in files}
    read = {*files.values(), *(song for song in songs if song is not None)}
    return unread_notes(path, read, (".bvh", ".c3d", ".fbx", *SUFFIXES), _why_unread)


def _why_unread(file: Path) -> str:
    suffix = file.suffix.lower()
    if suffix == ".fbx":
        return "FBX is read by itself, not from a folder: give the files one by one"
    if file.name.startswith("."):
        return ""  # of other programs, such as macOS's "._NAME.bvh"
    if suffix in VIDEO_SUFFIXES:
        return "video without sound, or beside a song or no motion of its name"
    return "music without motion of its name" if suffix in SONG_SUFFIXES else ""


def _read_motion(file: Path, bone_map: Mapping[str, str] | None) -> tuple[Motion, tuple[str, ...]]:
    """The motion of a BVH file, or the only animation of a glTF file."""
    if not is_gltf(file):
        return read_bvh(file, bone_map)
    motions = read_gltf_motions(file, bone_map)
    if len(motions) > 1:
        raise FormatError(
            f"{file}: expected one animation of each file in a folder, got {', '.join(motions)}: "
            "give the file by itself, or export them one by one"
        )
    return next(iter(motions.values()))


def song_beside(folder: Path, name: str) -> Path | None:
    """The file NAME with an audio suffix (in any case) in `folder`, else a video; None if there is none."""
    if not folder.is_dir():
        return None
    named = [p for p in sorted(folder.iterdir()) if p.stem == name]
    songs = [p for p in named if p.suffix.lower() in SONG_SUFFIXES]
    songs = songs or [p for p in named if p.suffix.lower() in VIDEO_SUFFIXES and has_sound(p)]
    return songs[0] if songs else None


def _motion_files(path: Path) -> dict[str, Path]:
    """The folder's BVH, C3D and glTF files by name; `FormatError` if two have the same."""
    # Hidden files come from other programs, such as macOS's "._NAME.bvh".
    files = sorted(
        p
        for p in path.iterdir()
        if is_c3d(p) or is_gltf(p) or (p.suffix.lower() == ".bvh" and p.name[0] != ".")
    )
    by_name: dict[str, Path] = {}
    for file in files:
        if file.stem in by_name:
            raise FormatError(
                f"{file}: expected one motion of each name, got {by_name[file.stem].name} as well"
            )
        by_name[file.stem] = file
    return by_name


def _counted(take: Take, folder: Path, row: dict[str, str]) -> Take:
    """The take with the counts that its row of the manifest names or lists."""
    where = f"{folder / 'manifest.csv'}: {take.name!r}"
    file, beats = row.get("counts", ""), row.get("beats", "")
    if file and beats:
        raise FormatError(f"{where}: expected counts or beats, got both")
    if file:
        is_inside = Path(os.path.abspath(folder / file)).is_relative_to(os.path.abspath(folder))
        if not is_inside or not os.path.isfile(folder / file):
            raise FormatError(f"{where} names the counts {file!r}, which are not in the folder")
        return with_counts_of(take, folder / file)
    if not beats:
        return take
    try:
        times_s = [float(cell) for cell in beats.split()]
        counts = make_counts(times_s, np.zeros(len(times_s)), 0, source=ANNOTATED)
    except (ValueError, ParameterError):
        raise FormatError(
            f"{where}: expected increasing seconds in beats, between spaces, got {beats!r}"
        ) from None
    check_within(take, counts, where)
    return replace(take, counts=counts)


def _song(folder: Path, name: str, given: str) -> Path | None:
    if not given:
        return song_beside(folder, name)
    if not os.path.isfile(folder / given):  # False, too, for what can be no name of a file
        raise FormatError(
            f"{folder / 'manifest.csv'}: {name!r} names the song {given[:80]!r}, which is not in the folder"
        )
    return folder / given


def _manifest(path: Path, names: set[str]) -> dict[str, dict[str, str]]:
    if not path.exists():
        return {}
    # The csv module fails on NUL, which no text contains.
    reader = csv.DictReader(io.StringIO(read_text(path).replace("\0", "")), skipinitialspace=True)
    try:
        columns = reader.fieldnames or []
        lines = [(reader.line_num, row) for row in reader]
    except csv.Error as error:  # a quote that is not closed, for one
        raise FormatError(f"{path}, line {reader.line_num}: expected a table of takes, got {error}") from None
    unknown = [column for column in columns if column not in _COLUMNS]
    if unknown or "name" not in columns:
        raise FormatError(
            f"{path}: expected columns name and any of {', '.join(_COLUMNS[1:])}, got {list(columns)}"
        )
    rows: dict[str, dict[str, str]] = {}
    for line, row in lines:
        where = f"{path}, line {line}"
        if None in row or None in row.values():
            raise FormatError(f"{where}: expected {len(columns)} cells: a cell with a comma needs quotes")
        name = row["name"]
        if Path(name).suffix.lower() in (".bvh", ".c3d", *SUFFIXES):
            name = Path(name).stem
        if name not in names:
            raise FormatError(f"{where}: there is no {name}.bvh, {name}.c3d or {name}.glb in the folder")
        if name in rows:
            raise FormatError(f"{where}: {name!r} is listed twice")
        _check_offset(where, row.get("audio_offset_s", ""))
        rows[name] = {column: cell.strip() for column, cell in row.items()}
    return rows


def _check_offset(where: str, cell: str) -> None:
    try:
        offset_s = float(cell or 0.0)
    except ValueError:
        offset_s = np.nan
    if not abs(offset_s) <= _LARGEST_OFFSET_S:
        raise FormatError(
            f"{where}: expected seconds in audio_offset_s, up to {_LARGEST_OFFSET_S:.0f} either way, got "
            f"{reprlib.repr(cell)}"
        )
