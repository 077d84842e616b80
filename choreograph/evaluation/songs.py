"""The songs of an evaluation: files of a folder, with the real takes to them if it holds any."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from choreograph.audio.song import Song, load_song
from choreograph.errors import FormatError, ParameterError
from choreograph.features.mel import log_mel
from choreograph.features.music_beats import TRACKERS, checked_beat_times_s, get_beat_tracker
from choreograph.files import sha256_of
from choreograph.importers import import_takes
from choreograph.repertoire import Repertoire
from choreograph.takes import Take

SONG_SUFFIXES = (".wav", ".mp3", ".flac", ".ogg", ".m4a", ".opus", ".aac", ".aif", ".aiff")


@dataclass(frozen=True, eq=False)
class EvaluatedSong:
    """A song, or the part of it that a real take dances to."""

    name: str
    path: Path
    start_s: float = 0.0
    duration_s: float | None = None  # None: to its end
    take: Take | None = None  # the real dance

    @property
    def song_name(self) -> str:
        """What provenance calls it."""
        return self.take.song_name if self.take is not None else self.path.stem

    @property
    def genre(self) -> str:
        """That of the real dance; empty if there is none."""
        return self.take.credits.genre if self.take is not None else ""

    def load(self) -> Song:
        """Its samples; raises as `load_song` does."""
        return load_song(self.path, start_s=self.start_s, duration_s=self.duration_s)


def find_songs(
    folder: str | Path, *, only: Collection[str] = (), duration_s: float | None = None
) -> tuple[EvaluatedSong, ...]:
    """The songs in a folder: of its takes in any layout that importers know, and every other audio file.

    `only` names takes and songs (files without suffix) to keep, all if empty; `duration_s` cuts songs,
    and real takes with them. Raises `ParameterError` if there is no song or a name of `only` is missing,
    `FormatError` if a take is damaged.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise ParameterError(f"expected a folder of songs at {folder}, got no such folder")
    files = sorted(p for p in folder.iterdir() if p.suffix.lower() in SONG_SUFFIXES and p.name[0] != ".")
    songs, danced = [], set()
    for take in _takes(folder, may_lack=bool(files)):
        if take.song_path is None:
            continue
        danced.add(take.song_path)
        if not only or take.name in only:
            songs.append(_of_take(take, duration_s))
    plain = [path for path in files if path not in danced and (not only or path.stem in only)]
    songs += [EvaluatedSong(path.stem, path, duration_s=duration_s) for path in plain]
    missing = sorted(set(only) - {song.name for song in songs})
    if missing:
        raise ParameterError(f"{folder}: expected a song {missing[0]!r}, got none of that name")
    if not songs:
        raise ParameterError(f"{folder}: expected songs ({', '.join(SONG_SUFFIXES)}), got none")
    return tuple(songs)


def _takes(folder: Path, *, may_lack: bool) -> Iterator[Take]:
    takes = import_takes(folder)
    try:
        first = next(takes)
    except ParameterError:
        if not may_lack:
            raise
        return
    except StopIteration:
        return
    yield first
    yield from takes


def _of_take(take: Take, duration_s: float | None) -> EvaluatedSong:
    assert take.song_path is not None
    length_s = min(take.motion.duration_s, duration_s or np.inf)
    return EvaluatedSong(take.name, take.song_path, take.song_start_s, length_s, take)


def check_unseen(songs: Sequence[EvaluatedSong], repertoire: Repertoire) -> None:
    """Raise `ParameterError` if the repertoire holds or was trained on a song, by name or by its bytes."""
    known = set(repertoire.provenance.get("trained_on", ())) | {t.song_name for t in repertoire.takes}
    known |= {take.name for take in repertoire.takes}
    checksums = repertoire.source_checksums
    seen = [s.name for s in songs if s.song_name in known or sha256_of(s.path) in checksums]
    if seen:
        more = f" and {len(seen) - 1} more" if len(seen) > 1 else ""
        raise ParameterError(
            f"{repertoire.path.name} was made with {seen[0]}{more}: expected songs held out of it "
            "(build-db --leave-out); --seen measures all the same, --only picks songs"
        )


def beats_of(song: Song, beats: str | Path, *, start_s: float = 0.0) -> NDArray[np.float64]:
    """Beats (Q,) in seconds by a tracker's name, or from a text file of the song's instants, one a line.

    `song` begins at `start_s` of its file. A folder holds such a file, SONG.txt, for every song. Raises
    `ParameterError` if it is neither, or beats do not increase; `FormatError` for a file of another kind.
    """
    if str(beats) in TRACKERS:
        return get_beat_tracker(str(beats)).beats(song, log_mel(song.samples))
    path = Path(beats)
    if path.is_dir():
        path = path / f"{(song.path or Path(song.name)).stem}.txt"
    if not path.is_file():
        raise ParameterError(f"expected beats by {', '.join(TRACKERS)}, or a file of them, got {path}")
    try:
        lines = path.read_text(encoding="utf-8").split("\n")
        instants = [float(line.split()[0]) for line in lines if line.strip() and line.strip()[0] != "#"]
    except (OSError, UnicodeDecodeError, ValueError) as error:
        raise FormatError(f"{path}: expected an instant in seconds on every line: {error}") from error
    inside = np.array(instants) - start_s
    return checked_beat_times_s(inside[(inside >= 0) & (inside <= song.duration_s)], song.duration_s)
