"""`manifest.csv` beside takes, as spreadsheets write it: credits, songs, offsets and counts by a take's name.

The columns, all but `name` optional: genre, performer, licence (or license), source; audio_offset_s, the time
in the song of the motion's first frame; song, a file in the folder that takes may share; counts, a file in
the folder as NAME.counts.csv is (see `count_files`), or beats, the instants that are counted, in seconds from
the motion's first frame, separated by spaces.

It is a table as `tables` reads them. A row that cannot be read is the error of the take that it names.
"""

from __future__ import annotations

import os
import reprlib
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from choreograph.counts import ANNOTATED, make_counts
from choreograph.errors import ChoreographError, FormatError, ParameterError
from choreograph.importers._count_annotation import check_within, with_counts_of
from choreograph.importers._unread import MOTION_SUFFIXES, Unread
from choreograph.motion.motion import LONGEST_S
from choreograph.tables import Row, as_number, read_table
from choreograph.takes import Take

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

    def unused(self, names: Collection[str]) -> Iterator[Unread]:
        """The rows of no take in `names`, and those that cannot be read and are of none."""
        wrong = [*self.nameless, *(error for name, error in self.errors.items() if name not in names)]
        for name in (name for name in self.rows if name not in names):
            short = name[:80]
            what = f"there is no {short}.bvh, {short}.c3d, {short}.glb or other take {short}"
            wrong.append(FormatError(f"{self.rows[name].where}: {what}"))
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
    is_file = cell.lower().endswith(MOTION_SUFFIXES)
    return cell[: cell.rindex(".")] if is_file else cell
