"""Synthesised songs that the graph engine dances to beside those of the takes, for rollouts to learn from.

`train_rollout_ablations.py --networks graph-dances-too synthesised-songs-too` uses them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from choreograph.synthesis.songs import STYLES, render_song, write_song

SONG_S = 60.0
SONGS_PER_GENRE = 8  # synthesised, spread over the tempi of the genre
_SEEDS_FROM = 70_000  # beyond all other songs'


def synthesised_songs(genres: Sequence[str], folder: Path) -> Iterator[tuple[Path, str]]:
    """Songs of those genres that the synthesiser knows, written to `folder`, and their genres."""
    folder.mkdir(parents=True, exist_ok=True)
    for genre in sorted(set(genres) & set(STYLES)):
        for i, bpm in enumerate(np.linspace(*STYLES[genre].bpm, SONGS_PER_GENRE)):
            path = folder / f"{genre}-{i}.flac"
            if not path.exists():
                write_song(path, render_song(genre, bpm=bpm, duration_s=SONG_S, seed=_SEEDS_FROM + i))
            yield path, genre
