"""`manifest.csv`, which describes the takes of a folder, and files that are skipped."""

from __future__ import annotations

import os
import reprlib
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np

from choreograph.core.cache import each_cached, key_of
from choreograph.core.counts import ANNOTATED, make_counts
from choreograph.core.errors import ChoreographError, FormatError, ParameterError, UnreadableFilesError
from choreograph.core.files import sha256_of
from choreograph.formats import motion_suffixes
from choreograph.formats.gltf_files import referenced_files
from choreograph.formats.tables import SUFFIX as COUNTS_SUFFIX
from choreograph.formats.tables import Row, as_number, check_within, read_table, with_counts_of
from choreograph.motion.motion import LONGEST_S, Take

# Known formats that are not read, and what to export instead.


class ForeignFormat(NamedTuple):
    """A known format that is not read."""

    what: str
    motion: str  # how to convert its motion to a format that is read


_BLENDER = "export BVH from Blender: File > Export > Motion Capture (.bvh)"
_ACCLAIM = ForeignFormat(
    "Acclaim motion capture", "take the .bvh or .c3d that most archives offer too, or import it in Blender"
)
_MAYA = ForeignFormat("a Maya scene", "export FBX from Maya: File > Export Selection > FBX")
_USD = ForeignFormat("USD", "import it in Blender (File > Import > Universal Scene Description), export .glb")
_FORMATS = {
    ".blend": ForeignFormat("a Blender scene", _BLENDER),
    ".ma": _MAYA,
    ".mb": _MAYA,
    ".max": ForeignFormat("a 3ds Max scene", "export FBX from 3ds Max: File > Export > FBX"),
    ".trc": ForeignFormat("marker tracks as text", "export C3D, or BVH of a solved skeleton"),
    ".mvnx": ForeignFormat("Xsens MVN motion", "export BVH or FBX from MVN: File > Export"),
    ".anim": ForeignFormat("an animation of Unity or Maya", "export FBX there, with the skeleton it moves"),
    ".abc": ForeignFormat("Alembic, meshes without a skeleton", "export its skeleton as BVH or FBX"),
    ".asf": _ACCLAIM,
    ".amc": _ACCLAIM,
    ".dae": ForeignFormat("COLLADA", "import it in the program it is from, and export FBX or glTF (.glb)"),
    ".obj": ForeignFormat("a mesh without skeleton or motion", "export the character that moves as .glb"),
    **dict.fromkeys((".usd", ".usda", ".usdc", ".usdz"), _USD),
    ".x": ForeignFormat("DirectX animation", _BLENDER),
}  # fmt: skip


def foreign_format(path: Path) -> ForeignFormat | None:
    """The known format of a file that is not read, by its suffix. None for other files."""
    return _FORMATS.get(path.suffix.lower())


# Skipped files.


SONG_SUFFIXES = (".wav", ".mp3", ".flac", ".ogg", ".m4a")
VIDEO_SUFFIXES = (".mp4", ".mov", ".mkv", ".webm", ".avi")  # their sound is used if there is no song
_LARGEST_KEPT_BYTES = 1 << 30  # of a file that is read once more for its checksum
_MANIFESTS = (".tsv", ".txt", ".xls", ".xlsx", ".ods", ".json")  # in which a manifest may be kept by mistake

File = TypeVar("File")
Content = TypeVar("Content")


@dataclass(frozen=True, eq=False)
class SkippedFile:
    """A file, or a folder of one take, that gave no take."""

    path: Path
    why: str
    error: ChoreographError | None = None  # set if it should have given one

    @classmethod
    def damaged(cls, path: Path, error: ChoreographError) -> SkippedFile:
        """A file that should have given a take. The reason is the error without the name of the file."""
        return cls(path, str(error).removeprefix(str(path)).lstrip(":, "), error)


def named_source(source: str | Path) -> Path:
    """The path of a source that ends in its name, as "." and links do not. Some layouts read the name."""
    path = Path(source)
    real = path.resolve()
    return real if path.is_dir() and path.name != real.name else path


def attempted(read: Callable[[Path], Content], path: Path) -> Content | SkippedFile:
    """The result of `read`, or a skipped file if it raises a `ChoreographError`."""
    try:
        return read(path)
    except ChoreographError as error:
        return SkippedFile.damaged(path, error)


def each_attempted(
    jobs: Iterable[tuple[Callable[[Path], Content], Path]],
) -> Iterator[Content | SkippedFile]:
    """`attempted` for each pair of a function and a path, in the processes of `core.workers`.

    Inside of `core.cache.caching`, what was read from files of the same names and contents is not read again.
    """
    return each_cached(
        _attempted_job,
        jobs,
        key=_job_key,
        is_kept=_is_read,
        killed=_killed,
        files=lambda job: files_of(job[1]),
    )


def files_of(path: Path) -> list[Path]:
    """The files that are read with a motion: all of a folder, or a file with its buffers."""
    if path.is_dir():
        return sorted(file for file in path.rglob("*") if file.is_file())
    return [path, *(referenced_files(path) if path.suffix.lower() == ".gltf" else [])]


def _job_key(job: tuple[Callable[[Path], Content], Path]) -> bytes | None:
    """The key of what a function reads, or None if it is not kept."""
    function, path = job
    if path.suffix.lower() == ".fbx":  # what is read depends on Blender
        return None
    contents = []
    try:
        for file in files_of(path):
            if not file.is_file() or file.stat().st_size > _LARGEST_KEPT_BYTES:
                return None
            contents.append((file, sha256_of(file)))
    except OSError:
        return None
    return key_of(function, path, path.resolve(), contents)


def _is_read(found: object) -> bool:
    return not isinstance(found, SkippedFile)


def _attempted_job(job: tuple[Callable[[Path], Content], Path]) -> Content | SkippedFile:
    return attempted(*job)


def _killed(job: tuple[Callable[[Path], Content], Path]) -> SkippedFile:
    error = ChoreographError("expected to read the file, but the process that did was killed twice: memory?")
    return SkippedFile.damaged(job[1], error)


def skipped_files(folder: Path, used: Collection[Path]) -> Iterator[SkippedFile]:
    """The files in a folder and its subfolders that look like motion or music and are not in `used`."""
    for parent, folders, names in os.walk(folder):
        # Hidden files and folders come from other programs, such as "._NAME.bvh" of macOS.
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        for name in sorted(names):
            path = Path(parent) / name
            if path in used or name.startswith("."):
                continue
            why = _why_skipped(path, is_below=path.parent != folder)
            if why:
                yield SkippedFile(path, why)


def raise_errors(skipped: Iterable[SkippedFile], cure: str = "") -> None:
    """Raise the error of the only damaged file, or an error that lists several.

    The summary of the list ends with `cure`.
    """
    errors = [file.error for file in skipped if file.error is not None]
    if len(errors) == 1:
        raise errors[0]
    if errors:
        summary = f"expected to read all files, got {len(errors)} that cannot be read{cure}:"
        raise UnreadableFilesError(summary, errors)


def _why_skipped(path: Path, *, is_below: bool) -> str:
    """Why a file is not read, "" if it looks like neither motion nor music."""
    suffix, foreign = path.suffix.lower(), foreign_format(path)
    if foreign is not None:
        return f"{foreign.what}: {foreign.motion}"
    if suffix == ".npz":
        return "NPZ without a motion of this program and without SMPL poses and their rate"
    if suffix in motion_suffixes():
        return "in subfolders, which are not read: pass them by themselves"
    if suffix in SONG_SUFFIXES:
        return "music that belongs to no take"
    if suffix in VIDEO_SUFFIXES:
        return "video without sound or without a motion of its name, or beside a song of its name"
    if path.name.lower().endswith(COUNTS_SUFFIX):
        return "counts without a motion of that name"
    if suffix == ".pkl" and not is_below:
        return "pickles of AIST++ are read from a folder motions/, or passed by themselves"
    if path.stem.lower() == "manifest" and suffix in _MANIFESTS and not is_below:
        return "expected manifest.csv: save the table as CSV under that name"
    return ""


# `manifest.csv`: credits, songs, offsets and counts by the name of a take, in a table as `tables` reads it.
#
# All columns but `name` are optional:
#
# - genre, performer, licence (or license), source
# - audio_offset_s, the time in the song at the first frame of the motion
# - song, a file in the folder, which several takes may share
# - counts, a file in the folder like NAME.counts.csv, or
# - beats, times of counts in seconds from the first frame of the motion, separated by spaces
#
# An error in a row is the error of the take that it names.


NAME = "manifest.csv"
_LARGEST_OFFSET_S = 4 * LONGEST_S
_CREDITS = ("genre", "performer", "licence", "source")
_OPTIONAL = (*_CREDITS, "audio_offset_s", "song", "counts", "beats")


@dataclass(frozen=True)
class Manifest:
    """The rows of a manifest by the name of the take, and its errors."""

    path: Path
    rows: Mapping[str, Row] = field(default_factory=dict)
    errors: Mapping[str, FormatError] = field(default_factory=dict)  # of rows that name a take
    nameless: tuple[ChoreographError, ...] = ()  # of rows without a name, or of the whole table

    def applied(self, take: Take) -> Take:
        """The take with the data of its row. Raises `FormatError` if it or one of its files is damaged."""
        if take.name in self.errors:
            raise self.errors[take.name]
        if take.name not in self.rows:
            return take
        row = self.rows[take.name].cells
        given = {column: row[column] for column in _CREDITS if row.get(column)}
        take = replace(take, credits=replace(take.credits, **given))
        if row.get("audio_offset_s"):
            take = replace(take, song_start_s=as_number(row["audio_offset_s"]))
        if row.get("song"):
            song = self._song(take.name, row["song"])
            others = tuple(path for path in take.source_paths if path != take.song_path)
            take = replace(take, song_path=song, song_name=song.stem, source_paths=(*others, song))
        return self._counted(take, row.get("counts", ""), row.get("beats", ""))

    def unused(self, names: Collection[str]) -> Iterator[SkippedFile]:
        """The rows, valid or not, that belong to no take in `names`."""
        wrong = [*self.nameless, *(error for name, error in self.errors.items() if name not in names)]
        for name in (name for name in self.rows if name not in names):
            short = name[:80]
            what = f"there is no {short}.bvh, {short}.c3d, {short}.glb or other take {short}"
            wrong.append(FormatError(f"{self.rows[name].where}: {what}"))
        return (SkippedFile.damaged(self.path, error) for error in wrong)

    def _song(self, name: str, given: str) -> Path:
        song = self.path.parent / given
        if not os.path.isfile(song):  # also False for an invalid name
            raise FormatError(
                f"{self.path}: {name!r} names the song {given[:80]!r}, which is not in the folder"
            )
        return song

    def _counted(self, take: Take, file: str, beats: str) -> Take:
        """The take with the counts of its row."""
        where, folder = f"{self.path}: {take.name!r}", self.path.parent
        if file and beats:
            raise FormatError(f"{where}: expected counts or beats, got both")
        if file:
            is_inside = Path(os.path.abspath(folder / file)).is_relative_to(os.path.abspath(folder))
            if not is_inside or not os.path.isfile(folder / file):
                raise FormatError(f"{where} names the counts {file[:80]!r}, which are not in the folder")
            return with_counts_of(take, folder / file)
        if not beats:
            return take
        try:
            times_s = [as_number(cell) for cell in beats.split()]
            counts = make_counts(times_s, np.zeros(len(times_s)), 0, source=ANNOTATED)
        except (ValueError, ParameterError):
            raise FormatError(
                f"{where}: expected increasing seconds in beats, with spaces, got {reprlib.repr(beats)}"
            ) from None
        check_within(take, counts, where)
        return replace(take, counts=counts)


def read_manifest(folder: Path) -> Manifest:
    """The manifest of a folder, whose name may have capitals. It has no rows if there is no such file.

    Errors are not raised. They are in its `errors` and `nameless`.
    """
    named = [name for name in sorted(os.listdir(folder)) if name.lower() == NAME] if folder.is_dir() else []
    if not named:
        return Manifest(folder / NAME)
    path = folder / named[0]
    try:
        if len(named) > 1:
            raise FormatError(f"{path}: expected one manifest, got {named[1]} as well")
        return _rows(path)
    except (FormatError, ParameterError) as error:
        return Manifest(path, nameless=(error,))


def _rows(path: Path) -> Manifest:
    rows: dict[str, Row] = {}
    errors: dict[str, FormatError] = {}
    nameless: list[ChoreographError] = []
    table = read_table(
        path, "a table of takes", required=("name",), optional=_OPTIONAL, other_names={"license": "licence"},
        keep_wrong=True,
    )  # fmt: skip
    for row in table:
        name = _take_name(row.cells.get("name", ""))
        error = row.error or _error_in(row, is_listed=name in rows)
        if error is None:
            rows[name] = row
        elif name:
            errors.setdefault(name, error)
        else:
            nameless.append(error)
    return Manifest(path, rows, errors, tuple(nameless))


def _error_in(row: Row, *, is_listed: bool) -> FormatError | None:
    """The error in a row, or None. `is_listed` is whether another row names the same take."""
    if not row.cells["name"]:
        return FormatError(f"{row.where}: expected the name of a take, got none")
    if is_listed:
        return FormatError(f"{row.where}: {reprlib.repr(row.cells['name'])} is listed twice")
    offset = row.cells.get("audio_offset_s", "")
    if offset and not abs(as_number(offset)) <= _LARGEST_OFFSET_S:
        return FormatError(
            f"{row.where}: expected seconds in audio_offset_s, up to {_LARGEST_OFFSET_S:.0f} either way, got "
            f"{reprlib.repr(offset)}"
        )
    return None


def _take_name(cell: str) -> str:
    """The name of a take without the suffix of its file."""
    is_file = cell.lower().endswith(motion_suffixes())
    return cell[: cell.rindex(".")] if is_file else cell
