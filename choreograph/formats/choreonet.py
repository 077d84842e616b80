"""ChoreoNet: C3D recordings with named and counted figures, and lists of the figures of whole dances.

Ye et al.: ChoreoNet (ACM Multimedia 2020), by the group of dance-with-melody. The folder has `c3d/`,
`figures.csv` (the figures in each recording) and `choreographies.json` (the figures of each dance of
dance-with-melody). It is a source of takes, and of counts for the takes of dance-with-melody. The figures of
a dance follow each other without a gap, at a constant tempo.
"""

from __future__ import annotations

import reprlib
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from choreograph.core.counts import DATA_SET, NO_COUNTS, Counts, Figure, make_counts, numbers_in_bar
from choreograph.core.errors import FormatError
from choreograph.core.files import read_json
from choreograph.formats import c3d
from choreograph.formats.manifest import Row, SkippedFile, as_number, read_table
from choreograph.motion.motion import Credits, Take

# The lists `choreographies.json` and `figures.csv`.


GENRES = {"C": "cha-cha", "R": "rumba", "T": "tango", "W": "waltz"}
METRES = {"cha-cha": 4, "rumba": 4, "tango": 4, "waltz": 3}
_LIST_FPS = 25.0  # of start_pos and end_pos
_NO_FIGURES = frozenset(("HOLD", "START", "NIL"))  # pauses between figures
_COLUMNS = ("c3d_file", "movement_tag", "start_frame", "end_frame", "beats")


@dataclass(frozen=True)
class Choreography:
    """The figures that are danced to a song, one after another, and their lengths in counts."""

    name: str  # as of the take in dance-with-melody
    genre: str
    start_s: float  # in the whole song
    end_s: float
    movements: tuple[str, ...]  # (M,) figures, and HOLD, START and NIL, which are pauses
    durations: tuple[int, ...]  # (M,) counts of each

    @property
    def n_counts(self) -> int:
        """Counts from the beginning of the first figure to the end of the last."""
        return sum(self.durations)

    @property
    def metre(self) -> int:
        """Counts in a bar."""
        return METRES[self.genre]


@dataclass(frozen=True)
class RecordedFigure:
    """A row of figures.csv: a figure of a recording, in frames from the first stored one."""

    recording: str  # name of the C3D file
    name: str  # genre's letter, figure, variant, such as C-10-2
    start_frame: float
    end_frame: float
    n_counts: int  # 0 if the row does not state it


def is_figure(name: str) -> bool:
    """Whether a movement is a figure and not a pause."""
    return name not in _NO_FIGURES


def read_choreographies(path: str | Path) -> list[Choreography]:
    """The dances of a choreographies.json, in its order.

    Raises `FormatError` if it is not such a list, or an entry lacks a name, a known genre, a span or a
    positive whole number of counts for each figure.
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
    """The rows of a figures.csv, in its order. Raises `FormatError`, with the line, for a damaged row."""
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


# Takes, and counts of takes.


LAYOUT = "ChoreoNet: a folder with c3d/, figures.csv and choreographies.json"
_LISTS, _FIGURES = "choreographies.json", "figures.csv"
_SOURCE = "Ye et al. 2020, ChoreoNet"
_LICENCE = "none stated"
_GAP_COUNTS = 0.5  # after a longer gap between figures, counting begins again
_STEADY_RATIO = 1.25  # between the tempi of a figure and of the recording
_FASTEST_HZ = 4.0  # an entry with faster counts is wrong
# Errata of choreographies.json: tempi of songs, as librosa tracks them, whose lists state another tempo. They
# cannot be found without the songs: 139 and 78 counts a minute are usual tempi of a cha-cha and a rumba.
_SONG_BPM = {"DANCE_C_4": 125.0, "DANCE_C_8": 124.0, "DANCE_R_7": 130.0}
_SAME_TEMPO = 1.1  # ratio of two tempi, below which they are taken for one
_OTHER_TEMPO_CONFIDENCE = 0.5


def detect(path: Path) -> bool:
    """Whether `path` has a list of choreographies, or of figures beside recordings."""
    return path.is_dir() and (
        (path / _LISTS).is_file() or ((path / _FIGURES).is_file() and (path / "c3d").is_dir())
    )


def read(path: Path) -> Iterator[Take | SkippedFile]:
    """The recordings by name, on one skeleton. Recordings without figures are takes without counts.

    Raises `FormatError` if the list of figures is damaged.
    """
    folder = path / "c3d"
    files = sorted(file for file in folder.glob("[!.]*") if file.suffix.lower() in c3d.SUFFIXES)
    if not files:
        return
    rows: dict[str, list[RecordedFigure]] = defaultdict(list)
    if (path / _FIGURES).is_file():
        for row in read_recorded_figures(path / _FIGURES):
            if is_figure(row.name):
                rows[row.recording].append(row)
    for file, found in zip(files, c3d.read_c3d_files(files), strict=True):
        if isinstance(found, SkippedFile):
            yield found
            continue
        motion, notes = found
        named = sorted(rows[file.stem], key=lambda row: row.start_frame)
        genre = GENRES.get(named[0].name[:1], "") if named else ""
        counts, figures, wrong = _counted(named, motion.fps, genre, motion.duration_s)
        if wrong:
            notes += (f"not counted, since faster than {_FASTEST_HZ:g} counts a second: {', '.join(wrong)}",)
        yield Take(
            name=f"choreonet-{file.stem}",
            motion=motion,
            credits=Credits(genre=genre, licence=_LICENCE, source=_SOURCE),
            source_paths=(file, path / _FIGURES) if named else (file,),
            notes=notes,
            counts=counts,
            figures=figures,
        )


def annotate(takes: Sequence[Take], path: Path) -> list[Take]:
    """The takes, with counts and figures if `path` lists their choreography and they have no counts yet.

    Raises `FormatError` if the list is damaged.
    """
    lists = path / _LISTS
    if not lists.is_file():
        return list(takes)
    by_name = {choreography.name: choreography for choreography in read_choreographies(lists)}
    return [
        _annotated(take, by_name[take.name], lists) if take.name in by_name and not len(take.counts) else take
        for take in takes
    ]


def figure_counts(choreography: Choreography) -> list[tuple[str, int]]:
    """Names and counts of the figures in order, with the name "" for pauses."""
    pairs = zip(choreography.movements, choreography.durations, strict=True)
    return [(name if is_figure(name) else "", counts) for name, counts in pairs]


def _annotated(take: Take, choreography: Choreography, lists: Path) -> Take:
    """The take with counts. Count k of n is at k / n of the length of the take, for k from 0 to n."""
    n_counts, duration_s = choreography.n_counts, take.motion.duration_s
    if n_counts > _FASTEST_HZ * duration_s:
        note = (
            f"not counted: {n_counts} counts in {duration_s:.0f} s are too many for the length of the motion"
        )
        return replace(take, notes=(*take.notes, note))
    notes, confidence = take.notes, 1.0
    counts_bpm = 60.0 * n_counts / duration_s
    song_bpm = _SONG_BPM.get(take.name, counts_bpm)
    if max(song_bpm / counts_bpm, counts_bpm / song_bpm) > _SAME_TEMPO:
        confidence = _OTHER_TEMPO_CONFIDENCE
        notes += (
            f"its figures have {counts_bpm:.0f} counts a minute, its song {song_bpm:.0f} beats: "
            "it is danced at another tempo than its song's",
        )
    times_s = np.linspace(0.0, duration_s, n_counts + 1)
    starts = np.cumsum([0, *choreography.durations])
    return replace(
        take,
        counts=make_counts(
            times_s,
            numbers_in_bar(n_counts + 1, choreography.metre),
            choreography.metre,
            source=DATA_SET,
            confidence=confidence,
        ),
        figures=tuple(
            Figure(name, float(times_s[start]), float(times_s[start + n]), n)
            for (name, n), start in zip(figure_counts(choreography), starts[:-1], strict=True)
            if name
        ),
        source_paths=(*take.source_paths, lists),
        notes=notes,
    )


def _counted(
    rows: Sequence[RecordedFigure], fps: float, genre: str, duration_s: float
) -> tuple[Counts, tuple[Figure, ...], list[str]]:
    """Counts and figures of a recording, and the names of rows that cannot be counted.

    Counts are evenly spaced inside a figure, and continue through figures that follow each other.
    """
    named = [row for row in rows if row.n_counts > 0 and row.start_frame < duration_s * fps]
    counted = [row for row in named if row.n_counts / (row.end_frame - row.start_frame) * fps <= _FASTEST_HZ]
    if not counted or genre not in METRES:
        return NO_COUNTS, (), [row.name for row in named]
    times_s: list[float] = []
    numbers: list[int] = []
    figures: list[Figure] = []
    metre, next_number = METRES[genre], 1
    for i, row in enumerate(counted):
        start, end = row.start_frame, row.end_frame
        following = counted[i + 1].start_frame if i + 1 < len(counted) else np.inf
        runs_on = following - end <= _GAP_COUNTS * (end - start) / row.n_counts
        stop = following if runs_on else end  # a row ends up to two frames before or after the next begins
        n_times = row.n_counts + (0 if runs_on else 1)  # the end of the last figure is a count as well
        row_s = np.linspace(start, stop, row.n_counts + 1) / fps
        times_s += row_s[:n_times].tolist()
        numbers += numbers_in_bar(n_times, metre, first=next_number).tolist()
        figures.append(Figure(row.name, float(row_s[0]), float(row_s[-1]), row.n_counts))
        next_number = (next_number + row.n_counts - 1) % metre + 1 if runs_on else 1
    counts = make_counts(times_s, numbers, metre, source=DATA_SET, confidence=_steadiness(figures))
    return counts, tuple(figures), [row.name for row in named if row not in counted]


def _steadiness(figures: Sequence[Figure]) -> float:
    """The share of counts in figures at about the tempo of the recording. Others are probably miscounted."""
    n_counts = np.array([figure.n_counts for figure in figures])
    count_s = np.array([figure.end_s - figure.start_s for figure in figures]) / n_counts
    is_steady = np.abs(np.log(count_s / np.median(np.repeat(count_s, n_counts)))) < np.log(_STEADY_RATIO)
    return round(float(n_counts[is_steady].sum() / n_counts.sum()), 2)
