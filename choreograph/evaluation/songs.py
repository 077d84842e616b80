"""The songs of an evaluation: the audio files in a folder, with the real takes to them if there are any."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from choreograph.audio.song import Song, load_song
from choreograph.counts import Counts
from choreograph.errors import ParameterError
from choreograph.features.mel import log_mel
from choreograph.files import sha256_of
from choreograph.importers import annotate_takes, import_takes
from choreograph.repertoire import Repertoire
from choreograph.song_counts import names_a_tracker, song_counts
from choreograph.takes import Take

SONG_SUFFIXES = (".wav", ".mp3", ".flac", ".ogg", ".m4a", ".opus", ".aac", ".aif", ".aiff")


@dataclass(frozen=True, eq=False)
class EvaluatedSong:
    """A song, or the part of it that a real take dances to."""

    name: str
    path: Path
    start_s: float = 0.0
    duration_s: float | None = None  # None: to the end
    take: Take | None = None  # the real dance

    @property
    def song_name(self) -> str:
        """The song's name in the provenance of a repertoire."""
        return self.take.song_name if self.take is not None else self.path.stem

    @property
    def genre(self) -> str:
        """The genre of the real dance; empty if there is none."""
        return self.take.credits.genre if self.take is not None else ""

    def load(self) -> Song:
        """Load the samples; raises as `load_song` does."""
        return load_song(self.path, start_s=self.start_s, duration_s=self.duration_s)


def find_songs(
    folder: str | Path,
    *,
    only: Collection[str] = (),
    duration_s: float | None = None,
    counted_by: Sequence[str | Path] = (),
) -> tuple[EvaluatedSong, ...]:
    """Find the songs in a folder: those of importable takes in any layout, and all other audio files.

    `only` names the takes and songs (files without suffix) to keep, all if empty. `duration_s` cuts songs and
    their real takes. `counted_by` are other sources that know the counts of the takes, such as ChoreoNet's
    lists of dance-with-melody's figures. Raises `ParameterError` if there is no song or a name in `only` is
    missing, `FormatError` if a take is damaged.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise ParameterError(f"expected a folder of songs at {folder}, got no such folder")
    files = sorted(p for p in folder.iterdir() if p.suffix.lower() in SONG_SUFFIXES and p.name[0] != ".")
    songs, with_take = [], set()
    takes = list(_takes(folder, optional=bool(files)))
    for source in counted_by:
        takes = annotate_takes(takes, source)
    for take in takes:
        if take.song_path is None:
            continue
        with_take.add(take.song_path)
        if not only or take.name in only:
            songs.append(_song_of_take(take, duration_s))
    others = [path for path in files if path not in with_take and (not only or path.stem in only)]
    songs += [EvaluatedSong(path.stem, path, duration_s=duration_s) for path in others]
    missing = sorted(set(only) - {song.name for song in songs})
    if missing:
        raise ParameterError(f"{folder}: expected a song {missing[0]!r}, got none with that name")
    if not songs:
        raise ParameterError(f"{folder}: expected songs ({', '.join(SONG_SUFFIXES)}), got none")
    return tuple(songs)


def _takes(folder: Path, *, optional: bool) -> Iterator[Take]:
    takes = import_takes(folder)
    try:
        first = next(takes)
    except ParameterError:
        if not optional:
            raise
        return
    except StopIteration:
        return
    yield first
    yield from takes


def _song_of_take(take: Take, duration_s: float | None) -> EvaluatedSong:
    assert take.song_path is not None
    length_s = min(take.motion.duration_s, duration_s or np.inf)
    return EvaluatedSong(take.name, take.song_path, take.song_start_s, length_s, take)


def check_unseen(songs: Sequence[EvaluatedSong], repertoire: Repertoire) -> None:
    """Raise `ParameterError` if the repertoire holds or was trained on a song, by name or by checksum."""
    known = set(repertoire.provenance.get("trained_on", ())) | {t.song_name for t in repertoire.takes}
    known |= {take.name for take in repertoire.takes}
    checksums = repertoire.source_checksums
    seen = [s.name for s in songs if s.song_name in known or sha256_of(s.path) in checksums]
    if seen:
        more = f" and {len(seen) - 1} more" if len(seen) > 1 else ""
        raise ParameterError(
            f"{repertoire.path.name}: expected held-out songs, got {seen[0]}{more} that it was built from: "
            "build with --leave-out, choose songs with --only, or measure anyway with --seen"
        )


def beats_of(song: Song, beats: str | Path) -> Counts:
    """Beats and bars by the name of a tracker, from a file of beats, or from SONG.txt in a folder.

    Bars are tracked where a file has none. Raises `ParameterError` if `beats` is none of these, `FormatError`
    for a file that cannot be read.
    """
    if not names_a_tracker(beats) and Path(beats).is_dir():
        beats = Path(beats) / f"{(song.path or Path(song.name)).stem}.txt"
    return song_counts(song, log_mel(song.samples), beats)
