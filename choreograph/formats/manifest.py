"""What lies beside takes in a folder: `manifest.csv`, and files that were not read."""

from __future__ import annotations

import os
import reprlib
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np

from choreograph.core.counts import ANNOTATED, make_counts
from choreograph.core.errors import ChoreographError, FormatError, ParameterError, UnreadableFilesError
from choreograph.formats import motion_suffixes
from choreograph.formats.tables import SUFFIX as COUNTS_SUFFIX
from choreograph.formats.tables import Row, as_number, check_within, read_table, with_counts_of
from choreograph.motion.motion import LONGEST_S, Take

# Formats of motion, scenes and bodies that are not read: what they are, and what to export instead.


class ForeignFormat(NamedTuple):
    """A format that is known, but not read."""

    what: str
    motion: str  # how its motion comes into a format that is read


_BLENDER = "export BVH from Blender: File > Export > Motion Capture (.bvh)"
_ACCLAIM = ForeignFormat(
    "Acclaim motion capture", "take the .bvh or .c3d that most archives offer too, or import it in Blender"
)
_MAYA = ForeignFormat("a Maya scene", "export FBX from Maya: File > Export Selection > FBX")
_USD = ForeignFormat("USD", "import it in Blender (File > Import > Universal Scene Description), export .glb")
_FORMATS = {
    ".vmd": ForeignFormat("MikuMikuDance motion", _BLENDER),
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
    """The known format of a file that is not read, by its suffix; None for any other file."""
    return _FORMATS.get(path.suffix.lower())


# Files of a source that give no take, each with the reason: damaged ones, and those that are not read.


SONG_SUFFIXES = (".wav", ".mp3", ".flac", ".ogg", ".m4a")
VIDEO_SUFFIXES = (".mp4", ".mov", ".mkv", ".webm", ".avi")  # whose sound is taken where there is no song
_MANIFESTS = (".tsv", ".txt", ".xls", ".xlsx", ".ods", ".json")  # in which a manifest may be kept by mistake

File = TypeVar("File")
Content = TypeVar("Content")


@dataclass(frozen=True, eq=False)
class SkippedFile:
    """A file, or a folder that holds one take, that gave no take."""

    path: Path
    why: str
    error: ChoreographError | None = None  # set where it should have given one

    @classmethod
    def damaged(cls, path: Path, error: ChoreographError) -> SkippedFile:
        """Of a file that should have given a take; the reason is the error without the file's name."""
        return cls(path, str(error).removeprefix(str(path)).lstrip(":, "), error)


def named_source(source: str | Path) -> Path:
    """The source by a path that ends in its own name, which some layouts read; "." and links do not."""
    path = Path(source)
    real = path.resolve()
    return real if path.is_dir() and path.name != real.name else path


def attempted(read: Callable[[Path], Content], path: Path) -> Content | SkippedFile:
    """What `read` makes of a file; if it raises a `ChoreographError`, the file as skipped."""
    try:
        return read(path)
    except ChoreographError as error:
        return SkippedFile.damaged(path, error)


def skipped_files(folder: Path, used: Collection[Path]) -> Iterator[SkippedFile]:
    """The files in a folder, and in those below it, that look like motion or music and are not in `used`."""
    for parent, folders, names in os.walk(folder):
        # Hidden files and folders come from other programs, such as macOS's "._NAME.bvh".
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        for name in sorted(names):
            path = Path(parent) / name
            if path in used or name.startswith("."):
                continue
            why = _why_skipped(path, is_below=path.parent != folder)
            if why:
                yield SkippedFile(path, why)


def raise_errors(skipped: Iterable[SkippedFile], cure: str = "") -> None:
    """Raise the error of the only file that should have been read, or one that lists those of several.

    The list begins with a line that ends in the `cure`.
    """
    errors = [file.error for file in skipped if file.error is not None]
    if len(errors) == 1:
        raise errors[0]
    if errors:
        summary = f"expected to read all files, got {len(errors)} that cannot be read{cure}:"
        raise UnreadableFilesError(summary, errors)


def _why_skipped(path: Path, *, is_below: bool) -> str:
    """Why a file of its kind is not read; "" if it looks like neither motion nor music."""
    suffix, foreign = path.suffix.lower(), foreign_format(path)
    if foreign is not None:
        return f"{foreign.what}: {foreign.motion}"
    if suffix == ".npz":
        return "NPZ with neither a motion of this program nor SMPL poses and their rate"
    if suffix in motion_suffixes():
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


# `manifest.csv` beside takes, as spreadsheets write it: credits, songs, offsets and counts by a take's name.
#
# The columns, all but `name` optional: genre, performer, licence (or license), source; audio_offset_s, the
# time in the song of the motion's first frame; song, a file in the folder that takes may share; counts, a
# file in the folder as NAME.counts.csv is (see `count_files`), or beats, the instants that are counted, in
# seconds from the motion's first frame, separated by spaces.
#
# It is a table as `tables` reads them. A row that cannot be read is the error of the take that it names.


NAME = "manifest.csv"
_LARGEST_OFFSET_S = 4 * LONGEST_S
_CREDITS = ("genre", "performer", "licence", "source")
_OPTIONAL = (*_CREDITS, "audio_offset_s", "song", "counts", "beats")


@dataclass(frozen=True)
class Manifest:
    """What a manifest says of takes, by their names, and what is wrong with it."""

    path: Path
    rows: Mapping[str, Row] = field(default_factory=dict)
    errors: Mapping[str, FormatError] = field(default_factory=dict)  # of rows that name a take
    nameless: tuple[ChoreographError, ...] = ()  # of rows that name none, or of the whole table

    def applied(self, take: Take) -> Take:
        """The take with what its row says; `FormatError` if the row or a file that it names is damaged."""
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
        """The rows of no take in `names`, and those that cannot be read and are of none."""
        wrong = [*self.nameless, *(error for name, error in self.errors.items() if name not in names)]
        for name in (name for name in self.rows if name not in names):
            short = name[:80]
            what = f"there is no {short}.bvh, {short}.c3d, {short}.glb or other take {short}"
            wrong.append(FormatError(f"{self.rows[name].where}: {what}"))
        return (SkippedFile.damaged(self.path, error) for error in wrong)

    def _song(self, name: str, given: str) -> Path:
        song = self.path.parent / given
        if not os.path.isfile(song):  # False, too, for what can be no name of a file
            raise FormatError(
                f"{self.path}: {name!r} names the song {given[:80]!r}, which is not in the folder"
            )
        return song

    def _counted(self, take: Take, file: str, beats: str) -> Take:
        """The take with the counts that its row names or lists."""
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
                f"{where}: expected increasing seconds in beats, between spaces, got {reprlib.repr(beats)}"
            ) from None
        check_within(take, counts, where)
        return replace(take, counts=counts)


def read_manifest(folder: Path) -> Manifest:
    """The manifest of a folder, its name in any case; one without rows if there is none.

    What is wrong with it is in its `errors` and `nameless`.
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
    """What is wrong with a row; None if nothing is. `is_listed`: another names the same take."""
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
