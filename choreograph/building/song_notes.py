"""What is wrong with takes' songs: damage, motion without music, offsets that counts contradict."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from choreograph.building.song_cache import AnalysedSong, SongCache
from choreograph.counts import ANNOTATED
from choreograph.features.count_phase import index_at
from choreograph.takes import Take

_LONGER_S = 0.5  # than its song: a note
_FEWEST_COUNTS = 8
_APART_BEATS = 0.15  # that counts lie beside beats by
_AGREEMENT = 0.9  # resultant length of the counts' phases in the beat: all lie beside the beats by the same
_NAMED = 3  # takes in a note


def song_notes(takes: Sequence[Take], songs: SongCache) -> tuple[str, ...]:
    """Notes on damaged songs, on takes that go on without theirs, and on offsets that counts contradict.

    Of songs that are not analysed yet nothing is said.
    """
    longer, beside = {}, {}
    notes: dict[str, None] = {}  # once for each song
    for take in takes:
        song = songs.known(take.song_path) if take.song_path else None
        if song is None:
            continue
        notes |= dict.fromkeys(f"{take.song_path}: {note}" for note in song.notes)
        over_s = take.song_start_s + take.motion.duration_s - song.duration_s
        if over_s > _LONGER_S:
            longer[take.name] = over_s
        offset_s = better_offset_s(take, song)
        if offset_s is not None:
            beside[take.name] = offset_s
    of_takes = []
    if longer:
        of_takes.append(f"motion goes on without music where it is longer than its song: {_listed(longer)}")
    if beside:
        of_takes.append(
            "counts lie beside the song's beats all along; the song would have to start at another time of "
            f"audio_offset_s by: {_listed(beside)}"
        )
    return (*notes, *of_takes)


def better_offset_s(take: Take, song: AnalysedSong) -> float | None:
    """How much later in its song a take would have to start for its counts to lie on beats, seconds.

    None if they do, if no one time would do, or if its counts are not annotated.
    """
    counts, beats = take.counts, song.counts
    if counts.source != ANNOTATED or min(len(counts), len(beats)) < _FEWEST_COUNTS:
        return None
    times_s = counts.times_s + take.song_start_s
    times_s = times_s[(times_s >= beats.times_s[0]) & (times_s <= beats.times_s[-1])]
    if len(times_s) < _FEWEST_COUNTS:
        return None
    mean = np.mean(np.exp(2j * np.pi * index_at(beats.times_s, times_s)))
    apart = float(np.angle(mean)) / (2 * np.pi)  # beats
    if np.abs(mean) < _AGREEMENT or abs(apart) < _APART_BEATS:
        return None
    return -apart * float(np.median(np.diff(beats.times_s)))


def _listed(seconds: dict[str, float]) -> str:
    named = [f"{name} ({value:+.2f} s)" for name, value in list(seconds.items())[:_NAMED]]
    more = f" and {len(seconds) - _NAMED} more" if len(seconds) > _NAMED else ""
    return ", ".join(named) + more
