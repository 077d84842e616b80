"""`Take`: one recorded performance with its music, the unit of import and of train/test splits."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from choreograph.counts import NO_COUNTS, Counts, Figure
from choreograph.motion.motion import Motion


@dataclass(frozen=True)
class Credits:
    """Performer, licence and source of a take; empty where the source does not state them."""

    genre: str = ""
    performer: str = ""
    licence: str = ""
    source: str = ""


@dataclass(frozen=True, eq=False)
class Take:
    """One performance: its motion, its song file and its credits."""

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
