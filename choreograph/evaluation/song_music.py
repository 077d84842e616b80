"""What dances to a song are measured against: its beats in bars, a second tracker's beats, its sections."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from choreograph.audio.song import Song
from choreograph.counts import Counts
from choreograph.evaluation.songs import beats_of
from choreograph.features.bars import track_bars
from choreograph.features.mel import log_mel
from choreograph.features.music_beats import DEFAULT_TRACKER, get_beat_tracker
from choreograph.features.sections import Sections, song_sections

Floats = NDArray[np.float64]

SECOND_TRACKER = "librosa"


@dataclass(frozen=True, eq=False)
class SongMusic:
    """The music of a song as dances are measured against it."""

    counts: Counts  # its beats, numbered where bars are known
    second_beats_s: Floats  # (Q',) by another tracker
    sections: Sections
    duration_s: float

    @property
    def beats_s(self) -> Floats:
        """The beats in seconds, (Q,)."""
        return self.counts.times_s


def second_tracker(beats: str | Path) -> str:
    """The tracker of the second opinion: librosa, or the default one if librosa gives the first."""
    return DEFAULT_TRACKER if str(beats) == SECOND_TRACKER else SECOND_TRACKER


def song_music(song: Song, beats: str | Path, *, start_s: float = 0.0) -> SongMusic:
    """Beats by a tracker's name or from a file, as `beats_of` takes them, and the rest. Raises as it does."""
    beats_s = beats_of(song, beats, start_s=start_s)
    mel = log_mel(song.samples)  # (T, 96)
    return SongMusic(
        track_bars(song.samples, mel, beats_s),
        get_beat_tracker(second_tracker(beats)).beats(song, mel),
        song_sections(song.samples, beats_s),
        song.duration_s,
    )
