"""Recipe of the shipped style networks: built-in takes, rendered songs, and in `research` recorded takes.

Songs without dances are training data for the sound of eleven genres. The network is trained on the tempo,
bars and patterns of a rumba with them before it is trained on the first recorded rumba.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import soxr

from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.library.building.networks import checksum_of, style_take
from choreograph.library.building.options import BuildOptions
from choreograph.library.building.takes import measured_takes
from choreograph.library.songs import DEFAULT_BEATS, SongCache, song_counts
from choreograph.music.mel import log_mel
from choreograph.music.rhythm import rhythm_features
from choreograph.music.song import Song
from choreograph.nets.configs import StyleConfig, style_config
from choreograph.nets.style import StyleNets
from choreograph.nets.style_training import StyleSong, StyleTake, train_style
from choreograph.nets.training import TrainingContext
from content.songs.synthesis.song import STYLES
from content.songs.synthesis.sounds import RATE_HZ
from content.songs.training_songs import counted_song
from content.starter_takes import take_specs, write_takes

SONGS_PER_GENRE = 24
FIRST_SONG_SEED = 80_000  # beyond the seeds of every other song
STEPS = 1800
_SONG_S = 30.0


def style_songs(per_genre: int = SONGS_PER_GENRE) -> list[StyleSong]:
    """Songs of every genre of the synthesiser, of any tempo that suits it, with the beats tracked in them."""
    songs = []
    for number, genre in enumerate(sorted(STYLES)):
        for i in range(per_genre):
            seed = FIRST_SONG_SEED + 1000 * number + i
            made = counted_song(genre, "steady", seed=seed, duration_s=_SONG_S, others=())
            mono = soxr.resample(made.samples.mean(axis=1), RATE_HZ, SAMPLE_RATE_HZ).astype(np.float32)
            mel = log_mel(mono)
            counts = song_counts(Song(mono, str(seed)), mel, DEFAULT_BEATS)
            songs.append(StyleSong(str(seed), genre, mel, rhythm_features(mel, counts)))
    return songs


def style_takes(sources: Iterable[str | Path], *, leave_out: Iterable[str] = ()) -> list[StyleTake]:
    """Takes with music, as training data of style. Raises as a build does."""
    measured, _ = measured_takes(sources, BuildOptions(leave_out=tuple(leave_out)), None)
    songs = SongCache()
    return [style_take(m, songs) for m in measured if m.take.song_path is not None]


def built_in_style_takes(folder: Path) -> list[StyleTake]:
    """The takes of the built-in repertoire, rendered into `folder` unless they are there."""
    if not (folder / "manifest.csv").exists():
        write_takes(folder, take_specs())
    return style_takes([folder])


def shipped_style_config(**changes: Any) -> StyleConfig:
    """The configuration of the shipped networks, from which those of preset small start."""
    return style_config("small", **({"steps": STEPS} | changes))


def train_shipped_style(takes: Sequence[StyleTake], work: Path, *, seed: int = 0) -> StyleNets:
    """Train on takes, with built-in ones, and rendered songs. Continues from a checkpoint in `work`."""
    songs = style_songs()
    content = {"takes": checksum_of(takes), "songs": checksum_of(songs)}
    context = TrainingContext(work, resume=True, content=content)
    return train_style(takes, shipped_style_config(), seed=seed, songs=songs, context=context)
