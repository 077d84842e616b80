"""The arrays and notes of a repertoire of which some takes are those of a file and others are new."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import PurePosixPath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.core.counts import FROM_MOTION
from choreograph.core.numerics import Indices
from choreograph.library.derived import ALWAYS_MADE
from choreograph.library.joined_rows import JoinedRows, Rows
from choreograph.library.notes import KINDS, Note
from choreograph.library.schema import DATASETS, POSES, UNCERTAINTY
from choreograph.library.store import RepertoireFile

# The takes of the result, in order, and the rows that each has in every array.


@dataclass(frozen=True)
class TakeOrigin:
    """Where a take of the result is: its index among the takes of the file, or among the new ones."""

    is_new: bool
    index: int


# By the first axis of an array with rows of takes: the column of `takes/` with their last rows, or the array
# with the take of each row, in order.
_ENDS = {"M": "takes/motion_stop", "B": "takes/body_stop", "Q": "takes/beat_stop", "U": "takes/count_stop"}
_TAKE_OF = {"N": "clips/take", "C": "sources/take", "F": "figures/take", "W": "motifs/word_take"}
_PER_TAKE = "X"


class TakeRows:
    """The rows of each take in the arrays of a file and in new arrays, and how they are joined."""

    def __init__(
        self,
        file: RepertoireFile,
        new: Mapping[str, Rows],
        n_new: int,
        order: Sequence[TakeOrigin],
    ) -> None:
        self._file, self._new, self._n_new, self.order = file, new, n_new, order
        self._n_old = file.shapes["takes/fps"][0]
        self._borders: dict[str, tuple[Indices, Indices]] = {}

    def borders(self, axis: str) -> tuple[Indices, Indices]:
        """First rows of the takes along an axis, and last the number of rows: of the file, and of the new."""
        if axis not in self._borders:
            none = np.zeros(1, np.int64)
            old = self._borders_in(axis, self._file.read, self._n_old)
            new = self._borders_in(axis, lambda name: np.asarray(self._new[name]), self._n_new)
            self._borders[axis] = old, new if self._n_new else none
        return self._borders[axis]

    def _borders_in(self, axis: str, read: Any, n_takes: int) -> Indices:
        if axis == _PER_TAKE or n_takes == 0:
            return np.arange(n_takes + 1)
        if axis in _ENDS:
            return np.append(0, read(_ENDS[axis])).astype(np.int64)
        return np.searchsorted(read(_TAKE_OF[axis]), np.arange(n_takes + 1))

    def counts(self, axis: str) -> Indices:
        """The number of rows of each take of the result."""
        old, new = (np.diff(borders) for borders in self.borders(axis))
        return np.array([(new if take.is_new else old)[take.index] for take in self.order], np.int64)

    def ranges(self, axis: str) -> list[tuple[bool, int, int]]:
        """Consecutive rows of the result: whether they are new, and the first and the one after the last."""
        found = []
        # In a run of takes that follow each other where they are, the difference is constant.
        runs = groupby(enumerate(self.order), lambda at: (at[1].is_new, at[1].index - at[0]))
        for (is_new, _), run in runs:
            takes = [take.index for _, take in run]
            borders = self.borders(axis)[is_new]
            found.append((is_new, int(borders[takes[0]]), int(borders[takes[-1] + 1])))
        return found

    def joined(self, name: str, kind: str, axis: str) -> Rows:
        """The rows of an array. Those of the file are read when they are needed, unless they are texts."""
        ranges = self.ranges(axis)
        if kind != "s":
            new = np.asarray(self._new[name]) if self._n_new else np.zeros(0)
            parts = [new[start:stop] if is_new else (start, stop) for is_new, start, stop in ranges]
            return JoinedRows(self._file, name, parts, kind)
        return self.joined_arrays(axis, self._file.read(name), self._new.get(name, np.zeros(0, np.str_)))

    def joined_arrays(self, axis: str, old: NDArray[Any], new: Rows) -> NDArray[Any]:
        """The rows of two arrays in memory, that of the takes of the file and that of the new ones."""
        both = old, np.asarray(new)
        return np.concatenate([both[is_new][start:stop] for is_new, start, stop in self.ranges(axis)])


def joined_arrays(rows: TakeRows, file: RepertoireFile, new: Mapping[str, Rows]) -> dict[str, Rows]:
    """The arrays of the result by path, without motifs, notes and those of `derived.ALWAYS_MADE`.

    `new` are those of the new takes, with what is derived from them.
    """
    layout = DATASETS | (POSES if "poses" in file.parts else {})
    made: dict[str, Rows] = {}
    for name, (kind, axes) in layout.items():
        axis = axes.split()[0]
        if name in ALWAYS_MADE or name == "provenance":
            continue
        if axis in ("J", "E"):
            made[name] = file.read(name)
        elif name in _TAKE_OF.values():
            made[name] = np.repeat(np.arange(len(rows.order)), rows.counts(axis))
        elif not name.endswith(("_start", "_stop")):
            made[name] = rows.joined(name, kind, axis)
    for axis, name in _ENDS.items():
        stops = np.cumsum(rows.counts(axis))
        made |= {name: stops, name.replace("_stop", "_start"): stops - rows.counts(axis)}
    if "roles" in file.parts:
        made["skeleton/roles"] = file.read("skeleton/roles")
    if (np.asarray(made["takes/counts_source"]) == FROM_MOTION).any():
        [name] = UNCERTAINTY
        old = file.read(name) if "uncertainty" in file.parts else np.zeros(file.shapes["counts/time_s"][0])
        n_counts = len(np.asarray(new["counts/time_s"])) if new else 0
        made[name] = rows.joined_arrays("U", old, new.get(name, np.zeros(n_counts)))
    return made


# Notes in the order in which a build of all takes makes them.


_STAGES = (
    ("import",), ("skipped file", "unreadable file"), ("unknown take",), ("jumps",), ("retargeted",),
    ("moved onto",), ("short",),
    ("counts from song", "counts from motion", "uncertain counts", "refused counts", "no counts"),
    ("uncounted left out", "uncounted danced"), ("style begins", "style kept"), ("counting networks",),
    ("networks unchanged", "no music networks"), ("song",), ("longer than song", "counts beside beats"),
    ("no density networks",), ("no music beats",), ("few words",),
)  # fmt: skip
_STAGE_OF = {kind: stage for stage, kinds in enumerate(_STAGES) for kind in kinds}


def joined_notes(
    old: Iterable[Note],
    new: Iterable[Note],
    names: Sequence[str],
    *,
    gone: Collection[str],
    files: Iterable[str],
    is_counted: NDArray[np.bool_],
) -> list[Note]:
    """The notes of the file on what is left, and those on new takes.

    Parameters
    ----------
    names : the takes of the result, in order
    gone : takes of the file that were removed or replaced, whose notes are left out
    files : paths of the sources of the result. Notes on other songs are left out
    is_counted : bool array (takes,)   whether each take of the result has counts
    """
    place = {name: index for index, name in enumerate(names)}
    songs = {PurePosixPath(path).name for path in files}

    def is_valid(note: Note) -> bool:
        subject = KINDS[note.kind].subject
        if subject == "take":
            return note.subject not in gone
        if subject == "song":
            return note.subject in songs
        return PurePosixPath(note.subject).stem not in place if subject else "uncounted" not in note.kind

    kept = [*filter(is_valid, old), *(note for note in new if "uncounted" not in note.kind)]
    if not is_counted.all():
        kept.append(Note("uncounted left out" if is_counted.any() else "uncounted danced"))
    seen: list[Note] = []
    for note in kept:
        if KINDS[note.kind].subject == "take" or note not in seen:
            seen.append(note)
    return sorted(seen, key=lambda note: (_STAGE_OF.get(note.kind, 0), place.get(note.subject, 0)))
