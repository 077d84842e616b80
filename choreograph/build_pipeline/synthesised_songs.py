"""Synthesised songs that the graph engine dances to beside those of the takes, for rollouts to learn from.

A library may have three songs of a genre: a network that has heard no others keeps the count of these.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from choreograph.progress import ProgressReport
from choreograph.synthesis.songs import STYLES, render_song, write_song

SONG_S = 60.0
SONGS_PER_GENRE = 8  # spread over the tempi of the genre
_SEEDS_FROM = 70_000  # beyond those of songs that anything is measured on


def synthesised_songs(
    genres: Iterable[str], folder: Path, report: ProgressReport | None = None
) -> dict[Path, str]:
    """Songs of those `genres` that the synthesiser knows, written to `folder`, and the genre of each.

    Those that `folder` has are not rendered again.
    """
    folder.mkdir(parents=True, exist_ok=True)
    wanted = [
        (folder / f"{genre}-{i}.flac", genre, bpm, _SEEDS_FROM + i)
        for genre in sorted(set(genres) & set(STYLES))
        for i, bpm in enumerate(np.linspace(*STYLES[genre].bpm, SONGS_PER_GENRE))
    ]
    for index, (path, genre, bpm, seed) in enumerate(wanted):
        if not path.exists():
            write_song(path, render_song(genre, bpm=bpm, duration_s=SONG_S, seed=seed))
        if report is not None:
            report("synthesising songs for the rollout network to learn from", index + 1, len(wanted))
    return {path: genre for path, genre, _, _ in wanted}
