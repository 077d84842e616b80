"""ChoreoNet's lists: `choreographies.json`, the figures of whole dances, and `figures.csv`, of recordings."""

from __future__ import annotations

import reprlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from choreograph.errors import FormatError
from choreograph.files import read_json
from choreograph.tables import Row, as_number, read_table

GENRES = {"C": "cha-cha", "R": "rumba", "T": "tango", "W": "waltz"}
METRES = {"cha-cha": 4, "rumba": 4, "tango": 4, "waltz": 3}
_LIST_FPS = 25.0  # of start_pos and end_pos
_NO_FIGURES = frozenset(("HOLD", "START", "NIL"))  # time that passes between figures
_COLUMNS = ("c3d_file", "movement_tag", "start_frame", "end_frame", "beats")


@dataclass(frozen=True)
class Choreography:
    """What is danced to a song: figures end to end, and how many counts each lasts."""

    name: str  # as of the take in dance-with-melody
    genre: str
    start_s: float  # in the whole song
    end_s: float
    movements: tuple[str, ...]  # (M,) also HOLD, START and NIL, which are no figures
    durations: tuple[int, ...]  # (M,) counts of each

    @property
    def n_counts(self) -> int:
        """Counts from the first figure's beginning to the last one's end."""
        return sum(self.durations)

    @property
    def metre(self) -> int:
        """Counts in a bar."""
        return METRES[self.genre]


@dataclass(frozen=True)
class RecordedFigure:
    """A row of figures.csv: a figure in a recording, in frames from the file's first stored one."""

    recording: str  # name of the C3D file
    name: str  # genre's letter, figure, variant, such as C-10-2
    start_frame: float
    end_frame: float
    n_counts: int  # 0 where the row does not say


def is_figure(name: str) -> bool:
    """Whether a movement is a figure, not time that passes."""
    return name not in _NO_FIGURES


def read_choreographies(path: str | Path) -> list[Choreography]:
    """The dances of a choreographies.json, in its order.

    Raises `FormatError` if it is no such list, or an entry lacks a name, a known genre, a span or a positive
    whole number of counts for each figure.
    """
    path = Path(path)
    entries = read_json(path, "a list of dances (JSON)")
    if not isinstance(entries, list):
        raise FormatError(f"{path}: expected a list of dances, got {type(entries).__name__}")
    return [_choreography(f"{path}, dance {i + 1}", entry) for i, entry in enumerate(entries)]


def _choreography(where: str, entry: Any) -> Choreography:
    try:
        name, genre = str(entry["name"]), GENRES[entry["dance_type"]]
        start, end = float(entry["start_pos"]), float(entry["end_pos"])
        movements, durations = tuple(map(str, entry["movements"])), tuple(entry["durations"])
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise FormatError(
            f"{where}: expected name, dance_type ({', '.join(GENRES)}), start_pos, end_pos, movements and "
            f"durations, got no valid {error}"
        ) from None
    whole = all(isinstance(count, int) and not isinstance(count, bool) and count > 0 for count in durations)
    if not whole or len(movements) != len(durations) or not movements or not 0 <= start < end:
        raise FormatError(
            f"{where}: expected figures with a whole number of counts each and a span, got {len(movements)} "
            f"movements, {len(durations)} durations, {start:g} to {end:g}"
        )
    return Choreography(name, genre, start / _LIST_FPS, end / _LIST_FPS, movements, durations)


def read_recorded_figures(path: Path) -> list[RecordedFigure]:
    """The rows of a figures.csv, in its order; `FormatError` names the line of a damaged one."""
    return [_recorded_figure(row) for row in read_table(path, "a table of figures", required=_COLUMNS)]


def _recorded_figure(row: Row) -> RecordedFigure:
    start, end, beats = (
        as_number(row.cells[column] or "0") for column in ("start_frame", "end_frame", "beats")
    )
    if not (0 <= start < end < float("inf") and 0 <= beats < float("inf") and beats.is_integer()):
        got = ", ".join(reprlib.repr(row.cells[column]) for column in ("start_frame", "end_frame", "beats"))
        raise FormatError(
            f"{row.where}: expected frames from start to end and a whole number of beats, got {got}"
        )
    return RecordedFigure(row.cells["c3d_file"], row.cells["movement_tag"], start, end, int(beats))
