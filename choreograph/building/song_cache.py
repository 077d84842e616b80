"""The songs of a build, each decoded and analysed once."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from choreograph.audio.song import Song, load_song
from choreograph.counts import Counts
from choreograph.features.mel import log_mel
from choreograph.song_counts import DEFAULT_BEATS, song_counts


@dataclass(frozen=True, eq=False)
class AnalysedSong:
    """What a build needs of a song."""

    duration_s: float
    log_mel: NDArray[np.float32]  # (T, 96) at 60 fps
    counts: Counts  # beats and bars
    song: Song | None  # with its samples, if the cache keeps them
    notes: tuple[str, ...] = ()  # on anything unusual in its file

    @property
    def beat_times_s(self) -> NDArray[np.float64]:
        """The beats, (Q,) seconds."""
        return self.counts.times_s


class SongCache:
    """Decodes and analyses a song when it is first needed; several takes may dance to one song.

    `beats` names the tracker. Samples are dropped after the analysis unless `keep_samples`: they take 5 MB a
    minute.
    """

    def __init__(self, beats: str = DEFAULT_BEATS, *, keep_samples: bool = False) -> None:
        self._beats = beats
        self._keep_samples = keep_samples
        self._analysed: dict[Path, AnalysedSong] = {}

    def known(self, path: Path) -> AnalysedSong | None:
        """The song of a file if it has been analysed already."""
        return self._analysed.get(path)

    def analysed(self, path: Path) -> AnalysedSong:
        """The song of a file; raises as `load_song`."""
        if path not in self._analysed:
            song = load_song(path)
            mel = log_mel(song.samples)
            counts = song_counts(song, mel, self._beats)
            kept = song if self._keep_samples else None
            self._analysed[path] = AnalysedSong(song.duration_s, mel, counts, kept, song.notes)
        return self._analysed[path]
