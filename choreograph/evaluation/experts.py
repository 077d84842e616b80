"""Expert dances from files: a folder of dances with their counts beside them, named as their songs."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path

from choreograph.errors import FormatError, ParameterError
from choreograph.evaluation.counted_dance import CountedDance
from choreograph.evaluation.results import EXPERT
from choreograph.evaluation.songs import EvaluatedSong
from choreograph.importers import import_takes
from choreograph.takes import Take

GENRES_FILE = "genres.csv"  # name,genre of dances whose files do not say


def read_experts(folder: str | Path, songs: Sequence[EvaluatedSong]) -> list[CountedDance]:
    """The dances in a folder, each from the first second of its song's danced part on.

    `folder` holds SONG.npz, with SONG.counts.csv and a genres.csv (name, genre), or any layout of takes.
    Dances to evaluated songs are cut to their length; those to other songs, whose genre is given, serve as
    references of their genre. Raises `ParameterError` if none is to an evaluated song, `FormatError` if a
    file is damaged.
    """
    by_name = {song.name: song for song in songs}
    genres = _genres(Path(folder) / GENRES_FILE)
    dances = []
    for take in _takes(Path(folder)):
        song = by_name.get(take.name)
        motion = take.motion
        if song is not None and song.duration_s is not None:
            motion = motion.sliced(0, min(motion.n_frames, max(1, round(song.duration_s * motion.fps))))
        genre = genres.get(take.name) or take.credits.genre or (song.genre if song else "")
        counts = take.counts.within(0.0, motion.duration_s)
        dances.append(CountedDance(EXPERT, take.name, motion, counts, genre=genre))
    if not any(dance.song in by_name for dance in dances):
        raise ParameterError(
            f"{folder}: expected dances named as the songs ({', '.join(sorted(by_name))}), got none"
        )
    return dances


def _takes(folder: Path) -> Iterator[Take]:
    """The folder's NPZ files one by one, which are no layout of their own, or the takes of its layout."""
    files = sorted(folder.glob("*.npz")) if folder.is_dir() else []
    for source in files or [folder]:
        yield from import_takes(source)


def _genres(path: Path) -> dict[str, str]:
    """Genre by name from a CSV file; none if there is no such file."""
    if not path.is_file():
        return {}
    with open(path, newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    if any(set(row) != {"name", "genre"} for row in rows):
        raise FormatError(f"{path}: expected columns name and genre, got others")
    return {row["name"]: row["genre"] for row in rows}
