"""`Take`: one recorded performance with its music, the unit of import and of train/test splits."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from choreograph.arguments import as_list, as_number, as_texts, check_kind, check_text
from choreograph.counts import NO_COUNTS, Counts, Figure
from choreograph.files import as_path
from choreograph.motion.motion import Motion


@dataclass(frozen=True)
class Credits:
    """Performer, licence and source of a take; empty where the source does not state them.

    Raises `ParameterError` unless all are text.
    """

    genre: str = ""
    performer: str = ""
    licence: str = ""
    source: str = ""

    def __post_init__(self) -> None:
        check_text("credits", self.genre, self.performer, self.licence, self.source)


@dataclass(frozen=True, eq=False)
class Take:
    """One performance: its motion, its song file and its credits.

    Raises `ParameterError` if a field is of another type.
    """

    name: str  # unique in a repertoire
    motion: Motion
    credits: Credits
    song_path: Path | None = None  # None: motion only
    song_start_s: float = 0.0  # time in the song file of the motion's first frame
    song_name: str = ""  # the same for all takes of a song: splits keep them together
    source_paths: tuple[Path, ...] = ()  # all files the take was read from, for checksums
    notes: tuple[str, ...] = ()  # anything unusual in the files and how it was handled, one line each
    counts: Counts = NO_COUNTS
    figures: tuple[Figure, ...] = ()  # in order, where the data names them

    def __post_init__(self) -> None:
        check_text("the names of a take and its song", self.name, self.song_name)
        check_kind("the motion of a take", self.motion, Motion)
        check_kind("the credits of a take", self.credits, Credits)
        if self.song_path is not None:
            object.__setattr__(self, "song_path", as_path("the song of a take", self.song_path))
        as_number("song_start_s of a take in seconds", self.song_start_s)
        sources = as_list("the source_paths of a take", self.source_paths, "paths", str | Path)
        object.__setattr__(self, "source_paths", tuple(map(Path, sources)))
        object.__setattr__(self, "notes", as_texts("notes on a take", self.notes))
        check_kind("the counts of a take", self.counts, Counts)
        figures = as_list("the figures of a take", self.figures, "Figure", Figure)
        object.__setattr__(self, "figures", figures)
