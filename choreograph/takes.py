"""`Take`: one recorded performance with its music, the unit of import and of train/test splits."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from choreograph.motion.motion import Motion


@dataclass(frozen=True)
class Credits:
    """Whose motion a take is and under what terms; empty where the source does not say."""

    genre: str = ""
    performer: str = ""
    licence: str = ""
    source: str = ""


@dataclass(frozen=True, eq=False)
class Take:
    """One performance: its motion, where its music is, and whose it is."""

    name: str  # unique in a repertoire
    motion: Motion
    credits: Credits
    song_path: Path | None = None  # None: motion only
    song_start_s: float = 0.0  # instant of the song file at the motion's first frame
    song_name: str = ""  # takes of one song share it: splits never cut between them
    source_paths: tuple[Path, ...] = ()  # every file the take was read from, for checksums
    notes: tuple[str, ...] = ()  # what was odd and how it was read, one line each
