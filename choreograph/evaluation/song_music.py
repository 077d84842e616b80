"""What dances to a song are measured against: its beats in bars, a second tracker's beats, its sections."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from choreograph.audio.song import Song
from choreograph.counts import Counts
from choreograph.evaluation.songs import beats_of
from choreograph.features.mel import log_mel
from choreograph.features.metrical_level import choose_level, metrical_levels, tempo_bpm
from choreograph.features.music_beats import DEFAULT_TRACKER, get_beat_tracker
from choreograph.features.sections import Sections, song_sections
from choreograph.metrics.energy_response import section_loudness_db
from choreograph.song_counts import names_a_tracker
from choreograph.timebase import SAMPLE_RATE_HZ

Floats = NDArray[np.float64]

SECOND_TRACKER = "librosa"


@dataclass(frozen=True, eq=False)
class SongMusic:
    """The music of a song as dances are measured against it."""

    levels: tuple[Counts, ...]  # its beats in bars: as tracked, then at half and double tempo where that fits
    second_beats_s: Floats  # (Q',) by another tracker
    sections: Sections
    section_loudness_db: Floats  # (S,)
    duration_s: float

    @property
    def beats_s(self) -> Floats:
        """The beats as tracked, in seconds, (Q,)."""
        return self.levels[0].times_s

    def counted_as(self, danced: Counts) -> Counts:
        """The beats at the level that a dance counts at; as tracked if its counts are not known.

        Both levels are in the music, and dancing at the other one is no error.
        """
        if len(danced) < 2 or len(self.levels) == 1:
            return self.levels[0]
        bpm = {level.metre: np.array([tempo_bpm(danced)]) for level in self.levels}
        return choose_level(self.levels, bpm, {metre: np.ones(1) for metre in bpm})


def second_tracker(beats: str | Path) -> str:
    """The tracker of the second opinion: librosa, or the default one if librosa gives the first."""
    return DEFAULT_TRACKER if str(beats) == SECOND_TRACKER else SECOND_TRACKER


def song_music(song: Song, beats: str | Path) -> SongMusic:
    """Beats by a tracker's name or from a file, as `beats_of` takes them, and the rest. Raises as it does.

    The beats of a file are danced to at their own level.
    """
    counts = beats_of(song, beats)
    mel = log_mel(song.samples)  # (T, 96)
    sections = song_sections(song.samples, counts.times_s)
    return SongMusic(
        metrical_levels(song.samples, mel, counts) if names_a_tracker(beats) else (counts,),
        get_beat_tracker(second_tracker(beats)).beats(song, mel),
        sections,
        section_loudness_db(song.samples, SAMPLE_RATE_HZ, sections.bounds_s),
        song.duration_s,
    )
