"""Expert dances from files: a folder of dances with their counts beside them, named as their songs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from choreograph.errors import ParameterError
from choreograph.evaluation.counted_dance import CountedDance
from choreograph.evaluation.results import EXPERT
from choreograph.evaluation.songs import EvaluatedSong
from choreograph.importers import import_takes


def read_experts(folder: str | Path, songs: Sequence[EvaluatedSong]) -> list[CountedDance]:
    """The dances in a folder, each from the first second of its song's danced part on.

    `folder` is in any layout of takes: SONG.bvh with SONG.counts.csv, and genres in manifest.csv, say. Dances
    to evaluated songs are cut to their length; those to other songs serve as references of their genre.
    Raises `ParameterError` if none is to an evaluated song, `FormatError` if a file is damaged.
    """
    by_name = {song.name: song for song in songs}
    dances = []
    for take in import_takes(folder):
        song = by_name.get(take.name)
        motion = take.motion
        if song is not None and song.duration_s is not None:
            motion = motion.sliced(0, min(motion.n_frames, max(1, round(song.duration_s * motion.fps))))
        genre = take.credits.genre or (song.genre if song else "")
        counts = take.counts.within(0.0, motion.duration_s)
        dances.append(CountedDance(EXPERT, take.name, motion, counts, genre=genre))
    if not any(dance.song in by_name for dance in dances):
        raise ParameterError(
            f"{folder}: expected dances named as the songs ({', '.join(sorted(by_name))}), got none"
        )
    return dances
