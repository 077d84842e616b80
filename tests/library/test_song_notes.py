"""Takes that do not fit their songs are noted, and those that do are not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from synthetic_motions import swaying

from choreograph.core.counts import ANNOTATED, FROM_MOTION, make_counts, numbers_in_bar
from choreograph.library.notes import summary
from choreograph.library.songs import AnalysedSong, SongCache, better_offset_s, song_notes
from choreograph.motion.motion import Credits, Take

BEAT_S = 0.5
SONG = Path("song.wav")


def song(duration_s: float = 20.0) -> AnalysedSong:
    times_s = np.arange(0.2, duration_s, BEAT_S)
    counts = make_counts(times_s, numbers_in_bar(len(times_s), 4), 4, source="tracked")
    return AnalysedSong(duration_s, np.zeros((0, 96), np.float32), counts, None)


def take(
    name: str = "a", *, late_s: float = 0.0, jitter_s: float = 0.0, seconds: float = 15.0, source=ANNOTATED
):
    """A take whose counts lie `late_s` after the beats of `song`."""
    times_s = np.arange(0.2, seconds - 1.0, BEAT_S) + late_s
    times_s += jitter_s * np.random.default_rng(0).uniform(-1, 1, len(times_s))
    counts = make_counts(times_s, numbers_in_bar(len(times_s), 4), 4, source=source)
    motion = swaying(round(30 * seconds), fps=30.0)
    return Take(name, motion, Credits(), song_path=SONG, counts=counts)


def songs(analysed: AnalysedSong) -> SongCache:
    cache = SongCache()
    cache._analysed[SONG] = analysed
    return cache


@pytest.mark.parametrize("late_s", [0.12, -0.15, 0.2])
def test_the_offset_that_would_fit_is_found(late_s):
    assert better_offset_s(take(late_s=late_s), song()) == pytest.approx(-late_s, abs=0.01)
    (note,) = song_notes([take(late_s=late_s)], songs(song()))
    assert f"{-late_s:+.2f} s" in note.text and "audio_offset_s" in note.text


@pytest.mark.parametrize(
    "fitting",
    [
        take(), take(late_s=0.05), take(jitter_s=0.24), take(late_s=0.2, source=FROM_MOTION),
        take(late_s=0.2, seconds=4.0),
    ],
    ids=["on the beat", "nearly", "not alike all along", "read from motion", "too few"],
)  # fmt: skip
def test_what_fits_or_is_not_known_is_not_noted(fitting):
    assert song_notes([fitting], songs(song())) == []


def test_motion_that_is_longer_than_its_song_is_noted_and_many_are_counted():
    takes = [take(name, seconds=22.0) for name in "abcde"]
    notes = song_notes(takes, songs(song(20.0)))
    assert [(note.subject, note.values) for note in notes] == [(name, {"over_s": 2.0}) for name in "abcde"]
    line, _ = summary(notes, 6, "a.h5")
    assert (
        line
        == "5 of 6 takes: the motion continues without music for 2.00 s after its song (a, b, c and 2 more)"
    )


def test_of_songs_that_are_not_analysed_nothing_is_said():
    assert song_notes([take(seconds=30.0)], SongCache()) == []
