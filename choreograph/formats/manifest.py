"""Tables beside motions: counts of a take, `manifest.csv` of a folder, and files that are skipped.

`read_table` reads a table as spreadsheets write them. `NAME.counts.csv` has the counts and figures of a take.
`manifest.csv` has credits, songs, offsets and counts by the name of a take. `SkippedFile` says why a file
gave no take, and `each_attempted` reads files of which some may be damaged.
"""

from __future__ import annotations

import csv
import io
import os
import re
import reprlib
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple, TypeVar

import numpy as np

from choreograph.core.cache import each_cached, key_of
from choreograph.core.counts import ANNOTATED, MAX_METRE, Counts, Figure, make_counts
from choreograph.core.errors import ChoreographError, FormatError, ParameterError, UnreadableFilesError
from choreograph.core.files import MAX_TABLE_BYTES, atomic_path, read_text, sha256_of
from choreograph.formats import motion_suffixes
from choreograph.formats.gltf_document import referenced_files
from choreograph.motion.motion import LONGEST_S, Take

# Tables of text.
#
# Cells are separated by commas, semicolons or tabs, whichever is most frequent in the header. Column names
# may be in capitals. Blank rows, blank columns without a name and a first line `sep=;` are ignored. The text
# is in UTF-8 or UTF-16, or else in Windows-1252, which spreadsheets write. Numbers may have a decimal comma.


_SEPARATORS = ",;\t"
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+")
_SHOWN = 80  # characters of a header in an error


@dataclass(frozen=True)
class Row:
    """A row of a table."""

    where: str  # file and line, for errors
    cells: dict[str, str]  # by column, without spaces around them
    error: FormatError | None = None  # if there are more or fewer cells than columns


def read_table(
    path: Path,
    what: str,
    *,
    required: Collection[str],
    optional: Collection[str] | None = None,
    other_names: Mapping[str, str] = MappingProxyType({}),
    keep_wrong: bool = False,
) -> list[Row]:
    """The rows of a table that are not blank, each with a cell for every named column.

    If `optional` is None, further columns may have any name. `other_names` are synonyms of columns. Rows with
    more or fewer cells than the header raise an error, or have it as `error` if `keep_wrong` is true.

    Raises `FormatError` as `read_text` does, and if a required column is missing, or a column occurs twice or
    is not among `optional`.
    """
    text = read_text(path, what, fallback="cp1252", max_bytes=MAX_TABLE_BYTES)
    text = text.replace("\0", "").replace("\r\n", "\n").replace("\r", "\n")  # the csv module fails on NUL
    first = next((line for line in text.split("\n") if line.strip()), "")
    states_separator = len(first) == len("sep=;") and first.lower().startswith("sep=")
    separator = first[-1] if states_separator else max(_SEPARATORS, key=first.count)
    lines = _lines(path, what, text, separator)[int(states_separator) :]
    columns = ["_".join(re.split(r"[\s_-]+", name.lower())) for name in lines[0][1]] if lines else []
    columns = [other_names.get(name, name) for name in columns]
    while columns and not columns[-1]:
        columns.pop()
    _check_columns(path, what, [name for name in columns if name], required, optional)
    rows = [_row(f"{path}, line {line}", columns, cells) for line, cells in lines[1:]]
    for row in rows:
        if row.error is not None and not keep_wrong:
            raise row.error
    return rows


def as_number(cell: str) -> float:
    """The number in a cell, NaN if it is not a number."""
    try:
        return float(cell.replace(",", ".") if _DECIMAL_COMMA.fullmatch(cell) else cell)
    except ValueError:
        return np.nan


def _lines(path: Path, what: str, text: str, separator: str) -> list[tuple[int, list[str]]]:
    """Line numbers and cells of rows that are not blank."""
    reader = csv.reader(io.StringIO(text), delimiter=separator, skipinitialspace=True)
    try:
        lines = [(reader.line_num, [cell.strip() for cell in cells]) for cells in reader]
    except csv.Error as error:  # such as a cell without an end
        raise FormatError(f"{path}, line {reader.line_num}: expected {what}, got {error}") from None
    return [(line, cells) for line, cells in lines if any(cells)]


def _check_columns(
    path: Path, what: str, columns: list[str], required: Collection[str], optional: Collection[str] | None
) -> None:
    known = ", ".join(required) + (f" and any of {', '.join(optional)}" if optional else "")
    wrong = [f"no {name}" for name in required if name not in columns]
    wrong += [f"{name!r} twice" for name, n_times in Counter(columns).items() if n_times > 1]
    if optional is not None:
        wrong += [repr(name[:_SHOWN]) for name in columns if name not in (*required, *optional)]
    if wrong:
        raise FormatError(f"{path}: expected {what} with the header {known}, got {wrong[0]}")


def _row(where: str, columns: list[str], cells: list[str]) -> Row:
    named = {column: cell for column, cell in zip(columns, cells, strict=False) if column}
    nameless = [cell for column, cell in zip(columns, cells, strict=False) if cell and not column]
    error = None
    if nameless:
        error = FormatError(f"{where}: expected a name for the column of {nameless[0][:_SHOWN]!r}, got ''")
    elif len(cells) < len(columns) or any(cells[len(columns) :]):
        error = FormatError(
            f"{where}: expected {len(columns)} cells, got {len(cells)}: a cell with a separator needs quotes"
        )
    return Row(where, named, error)


# `NAME.counts.csv`: the counts and figures of a take, written by hand or by `inspect --counts`.
#
# There is a row for each count, in order:
#
#     time_s,number,figure
#     0.480,1,basic
#     0.962,2,
#     1.445,3,
#     1.927,4,
#     2.410,1,-
#
# `time_s` is in seconds from the first frame of the take. `number` is the count in the bar, 1 on the
# downbeat, or 0 in every row if bars are not known. The metre is the largest number. The optional `figure`
# names the figure that begins there and lasts to the next name. "-" ends a figure that no other follows.


COUNTS_SUFFIX = ".counts.csv"
_COLUMNS = ("time_s", "number", "figure")
_END = "-"


def read_counts(path: str | Path) -> tuple[Counts, tuple[Figure, ...]]:
    """The counts of a file, with source "annotation" and confidence 1, and its figures.

    Raises `ParameterError` if the file does not exist. Raises `FormatError`, with the line, if a column is
    missing or unknown, a cell is not a number, times do not increase, or a number is not from 0 to 12.
    """
    path = Path(path)
    if not path.exists():
        raise ParameterError(f"no file {path}")
    times_s: list[float] = []
    numbers: list[int] = []
    names: list[str] = []
    for row in read_table(path, "a table of counts", required=_COLUMNS[:2], optional=_COLUMNS[2:]):
        time_s, number = _number_in(row, "time_s"), _number_in(row, "number")
        if not number.is_integer() or not 0 <= number <= MAX_METRE:
            got = reprlib.repr(row.cells["number"])
            raise FormatError(f"{row.where}: expected a number from 0 to {MAX_METRE}, got {got}")
        if time_s < 0 or (times_s and time_s <= times_s[-1]):
            raise FormatError(
                f"{row.where}: expected increasing seconds of 0 or more, got {time_s:g}: unsorted?"
            )
        times_s.append(time_s)
        numbers.append(int(number))
        names.append(row.cells.get("figure", ""))
    if not times_s:
        raise FormatError(f"{path}: expected a row for each count, got none")
    if min(numbers) == 0 < max(numbers):
        raise FormatError(f"{path}: expected a number in the bar in every row or 0 in every row, got both")
    return make_counts(times_s, numbers, max(numbers), source=ANNOTATED), _figures(times_s, names)


def write_counts(path: str | Path, counts: Counts, figures: Sequence[Figure] = ()) -> None:
    """Write counts and figures. A figure begins and ends at the nearest counts.

    Raises `ParameterError` if there are no counts, or the folder is missing.
    """
    if not len(counts):
        raise ParameterError(f"expected counts to write to {path}, got none: the take is not counted")
    names = [""] * len(counts)
    for figure in figures:
        names[_nearest(counts, figure.end_s)] = _END
    for figure in figures:
        names[_nearest(counts, figure.start_s)] = figure.name
    with atomic_path(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(_COLUMNS)
        rows = zip(counts.times_s, counts.numbers, names, strict=True)
        writer.writerows((f"{time_s:.6f}", number, name) for time_s, number, name in rows)


def _number_in(row: Row, column: str) -> float:
    value = as_number(row.cells[column])
    if not np.isfinite(value):
        raise FormatError(
            f"{row.where}: expected a number in {column}, got {reprlib.repr(row.cells[column])}"
        )
    return value


def _figures(times_s: Sequence[float], names: Sequence[str]) -> tuple[Figure, ...]:
    borders = [i for i, name in enumerate(names) if name]
    ends = [*borders[1:], len(times_s) - 1]
    return tuple(
        Figure(names[start], times_s[start], times_s[end], end - start)
        for start, end in zip(borders, ends, strict=False)
        if names[start] != _END and end > start
    )


def _nearest(counts: Counts, time_s: float) -> int:
    return int(np.argmin(np.abs(counts.times_s - time_s)))


_BEYOND_S = 0.1  # the last count may be annotated a little after the last frame


def with_counts_beside(take: Take) -> Take:
    """The take with the counts in NAME.counts.csv beside its motion, if there is such a file.

    They replace those of a data set, but not those of a manifest. Raises `FormatError` if the file is
    damaged.
    """
    if take.counts.source == ANNOTATED or not take.source_paths:
        return take
    beside = take.source_paths[0].with_suffix(COUNTS_SUFFIX)
    return with_counts_of(take, beside) if os.path.exists(beside) else take


def with_counts_of(take: Take, path: Path) -> Take:
    """The take with the counts of a file. Raises `FormatError` if it is damaged or of another take."""
    counts, figures = read_counts(path)
    check_within(take, counts, str(path))
    return replace(take, counts=counts, figures=figures, source_paths=(*take.source_paths, path))


def check_within(take: Take, counts: Counts, where: str) -> None:
    """Raise `FormatError` if a count is outside of the take."""
    if counts.times_s[0] < 0 or counts.times_s[-1] > take.motion.duration_s + _BEYOND_S:
        raise FormatError(
            f"{where}: expected counts within the {take.motion.duration_s:.2f} s of {take.name}, got "
            f"{counts.times_s[0]:.2f} to {counts.times_s[-1]:.2f} s: times are from the first frame of the "
            "take, not of the song"
        )


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
        is_kept=lambda found: not isinstance(found, SkippedFile),
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
        name = row.cells.get("name", "")
        if name.lower().endswith(motion_suffixes()):
            name = name[: name.rindex(".")]
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
