"""Expert dances from files: a folder of dances to the evaluated songs, with their counts beside them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from choreograph.errors import ParameterError
from choreograph.evaluation.counted_dance import CountedDance
from choreograph.evaluation.results import EXPERT
from choreograph.evaluation.songs import EvaluatedSong
from choreograph.importers import import_takes


def read_experts(folder: str | Path, songs: Sequence[EvaluatedSong]) -> list[CountedDance]:
    """The dances in a folder that are named as one of the songs and begin with its evaluated part.

    `folder` is in any layout of takes: SONG.bvh or SONG.npz with SONG.counts.csv, say. Longer dances are cut.
    Raises `ParameterError` if none is to one of the songs, `FormatError` if one is damaged.
    """
    by_name = {song.name: song for song in songs}
    dances = []
    for take in import_takes(folder):
        song = by_name.get(take.name)
        if song is None:
            continue
        motion = take.motion
        if song.duration_s is not None:
            motion = motion.sliced(0, min(motion.n_frames, max(1, round(song.duration_s * motion.fps))))
        dances.append(CountedDance(EXPERT, song.name, motion, take.counts.within(0.0, motion.duration_s)))
    if not dances:
        raise ParameterError(
            f"{folder}: expected dances named as the songs ({', '.join(sorted(by_name))}), got none"
        )
    return dances
