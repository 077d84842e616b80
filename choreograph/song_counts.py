"""The counts of a song: its beats by a tracker, by the network or from a file, numbered in their bars."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from choreograph.audio.song import Song
from choreograph.counts import Counts
from choreograph.errors import ParameterError
from choreograph.features.bars import track_bars
from choreograph.features.beat_files import read_beats
from choreograph.features.music_beats import TRACKERS, BeatTracker, get_beat_tracker

NETWORK = "network"  # `nets.counts.music_tracker`
TRACKER_NAMES = (*TRACKERS, NETWORK)
DEFAULT_BEATS = NETWORK
_BEAT_DECIMALS = 4  # of seconds: what sums of other CPUs change is rounded off, and no ear would tell


def song_counts(song: Song, log_mel: NDArray[np.floating], beats: str | Path) -> Counts:
    """A song's beats and bars; bars are tracked where the file has none.

    `beats` is one of `TRACKER_NAMES` or a file (see `features.beat_files`) of times in the song file.
    `log_mel` (T, 96) is that of the song. The source of the counts is "annotation" where the file has bars.
    Raises `ParameterError` for an unknown name, `FormatError` for a file that cannot be read.
    """
    given = song_beats(song, log_mel, beats)
    return given if given.has_bars else track_bars(song.samples, log_mel, given.times_s)


def names_a_tracker(beats: object) -> bool:
    """Whether `beats` names a tracker or the network, rather than a file."""
    return str(beats) in TRACKER_NAMES


def check_beats(beats: object) -> None:
    """Raise `ParameterError` unless `beats` is one of `TRACKER_NAMES` or an existing file."""
    if names_a_tracker(beats) or (isinstance(beats, str | Path) and Path(beats).is_file()):
        return
    raise ParameterError(
        f"expected beats among {', '.join(TRACKER_NAMES)}, or a file of beats, got {str(beats)!r}"
    )


def song_beats(song: Song, log_mel: NDArray[np.floating], beats: str | Path) -> Counts:
    """A song's beats, with bars only if a file gives them; arguments and errors as of `song_counts`."""
    check_beats(beats)
    if names_a_tracker(beats):
        times_s = np.round(_tracker(str(beats)).beats(song, log_mel), _BEAT_DECIMALS)
        return Counts(times_s, np.zeros(len(times_s), np.int64), 0)
    return read_beats(beats, start_s=song.start_s, duration_s=song.duration_s)


def _tracker(name: str) -> BeatTracker:
    if name in TRACKERS:
        return get_beat_tracker(name)
    from choreograph.nets.counts.music_tracker import NetworkBeats  # imports torch

    return NetworkBeats()
