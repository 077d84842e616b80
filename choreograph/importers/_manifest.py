"""`manifest.csv` beside takes, as spreadsheets write it: credits, songs, offsets and counts by a take's name.

The columns, all but `name` optional: genre, performer, licence (or license), source; audio_offset_s, the time
in the song of the motion's first frame; song, a file in the folder that takes may share; counts, a file in
the folder as NAME.counts.csv is (see `count_files`), or beats, the instants that are counted, in seconds from
the motion's first frame, separated by spaces.

Cells are separated by commas, semicolons or tabs; where not by commas, decimal commas are read. Blank rows
and cells beyond the columns are nothing, capitals in the names of columns do not matter.
"""

from __future__ import annotations

import csv
import io
import os
import re
import reprlib
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from choreograph.counts import ANNOTATED, make_counts
from choreograph.errors import ChoreographError, FormatError, ParameterError
from choreograph.importers._bvh_text import read_text
from choreograph.importers._count_annotation import check_within, with_counts_of
from choreograph.importers._unread import MOTION_SUFFIXES, Unread
from choreograph.motion.motion import LONGEST_S
from choreograph.takes import Take

NAME = "manifest.csv"
_LARGEST_OFFSET_S = 4 * LONGEST_S
_CREDITS = ("genre", "performer", "licence", "source")
_COLUMNS = ("name", *_CREDITS, "audio_offset_s", "song", "counts", "beats")
_NUMBERS = ("audio_offset_s", "beats")
_SEPARATORS = ",;\t"
_SEPARATOR_LINE = re.compile(r'\s*"?sep=(.)"?[;,\t]*\s*', re.IGNORECASE)  # by which Excel is told


@dataclass(frozen=True)
class Manifest:
    """What a manifest says of takes, by their names, and what is wrong with it."""

    path: Path
    rows: Mapping[str, Mapping[str, str]] = field(default_factory=dict)  # cells by column
    lines: Mapping[str, int] = field(default_factory=dict)  # of the rows
    errors: Mapping[str, FormatError] = field(default_factory=dict)  # of rows that name a take
    nameless: tuple[ChoreographError, ...] = ()  # of rows that name none, or of the whole table

    def applied(self, take: Take) -> Take:
        """The take with what its row says; `FormatError` if the row or a file that it names is damaged."""
        if take.name in self.errors:
            raise self.errors[take.name]
        row = self.rows.get(take.name)
        if row is None:
            return take
        given = {column: row[column] for column in _CREDITS if row.get(column)}
        take = replace(take, credits=replace(take.credits, **given))
        if row.get("audio_offset_s"):
            take = replace(take, song_start_s=float(row["audio_offset_s"]))
        if row.get("song"):
            song = self._song(take.name, row["song"])
            others = tuple(path for path in take.source_paths if path != take.song_path)
            take = replace(take, song_path=song, song_name=song.stem, source_paths=(*others, song))
        return self._counted(take, row.get("counts", ""), row.get("beats", ""))

    def unused(self, names: Collection[str]) -> Iterator[Unread]:
        """The rows of no take in `names`, and those that cannot be read and are of none."""
        wrong = [*self.nameless, *(error for name, error in self.errors.items() if name not in names)]
        for name in self.rows:
            if name not in names:
                where, short = f"{self.path}, line {self.lines[name]}", name[:80]
                wrong.append(
                    FormatError(
                        f"{where}: there is no {short}.bvh, {short}.c3d, {short}.glb or other take {short}"
                    )
                )
        return (Unread.damaged(self.path, error) for error in wrong)

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
            times_s = [float(cell) for cell in beats.split()]
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
        return _rows(path, *_table(path))
    except (FormatError, ParameterError) as error:
        return Manifest(path, nameless=(error,))


def _table(path: Path) -> tuple[list[tuple[int, list[str]]], str]:
    """The rows that are not blank, each with its line, and what separates their cells."""
    text = read_text(path).replace("\0", "")  # NUL is no text, and what UTF-16 without a mark puts in
    head = text.lstrip().partition("\n")[0]
    named = _SEPARATOR_LINE.fullmatch(head)
    separator = named[1] if named else max(_SEPARATORS, key=head.count)
    reader = csv.reader(io.StringIO(text), delimiter=separator, skipinitialspace=True)
    try:
        rows = [(reader.line_num, [cell.strip() for cell in row]) for row in reader]
    except csv.Error as error:  # a quote that is not closed, for one
        raise FormatError(f"{path}, line {reader.line_num}: expected a table of takes, got {error}") from None
    rows = [(line, row) for line, row in rows if any(row)]
    return rows[1:] if named else rows, separator


def _columns(path: Path, header: list[str]) -> list[str]:
    """The columns by the names that we use; "" for those without a name."""
    columns = [re.sub(r"[\s-]+", "_", cell.lower()) for cell in header]
    columns = ["licence" if column == "license" else column for column in columns]
    named = [column for column in columns if column]
    if "name" not in named or not set(named) <= set(_COLUMNS) or len(set(named)) < len(named):
        raise FormatError(
            f"{path}: expected columns name and any of {', '.join(_COLUMNS[1:])}, each once, got "
            f"{reprlib.repr(', '.join(header))}"
        )
    return columns


def _rows(path: Path, table: list[tuple[int, list[str]]], separator: str) -> Manifest:
    columns = _columns(path, table[0][1] if table else [])
    n_cells = 1 + max(i for i, column in enumerate(columns) if column)
    rows: dict[str, dict[str, str]] = {}
    lines: dict[str, int] = {}
    errors: dict[str, FormatError] = {}
    nameless: list[ChoreographError] = []
    for line, cells in table[1:]:
        where = f"{path}, line {line}"
        row = {column: cell for column, cell in zip(columns, cells, strict=False) if column}
        name = _take_name(row.get("name", ""))
        try:
            beyond = [cell for i, cell in enumerate(cells) if cell and (i >= len(columns) or not columns[i])]
            if len(cells) < n_cells or beyond:
                raise FormatError(
                    f"{where}: expected {n_cells} cells, got {len(cells)}: a cell that holds "
                    f"{separator!r} needs quotes"
                )
            if not name:
                raise FormatError(f"{where}: expected the name of a take, got none")
            if name in rows:
                raise FormatError(f"{where}: {reprlib.repr(name)} is listed twice")
            if separator != ",":
                row |= {column: row[column].replace(",", ".") for column in _NUMBERS if column in row}
            _check_offset(where, row.get("audio_offset_s", ""))
        except FormatError as error:
            if name:
                errors.setdefault(name, error)
            else:
                nameless.append(error)
        else:
            rows[name], lines[name] = row, line
    return Manifest(path, rows, lines, errors, tuple(nameless))


def _take_name(cell: str) -> str:
    """The name of a take without the suffix of its file."""
    is_file = cell.lower().endswith(MOTION_SUFFIXES)
    return cell[: cell.rindex(".")] if is_file else cell


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
