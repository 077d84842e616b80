"""The songs of a build: their counts, a cache of analyses, and notes on damage and wrong offsets."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from choreograph.core.cache import each_cached, key_of
from choreograph.core.counts import ANNOTATED, Counts, count_phase, index_at, time_at
from choreograph.core.errors import ParameterError
from choreograph.core.files import sha256_of
from choreograph.core.numerics import Floats
from choreograph.core.progress import StepReport
from choreograph.core.timebase import frame_times_s, times_to_frames
from choreograph.library.notes import Note
from choreograph.motion.motion import Take
from choreograph.music.bars import level_at_tempo, tempo_bpm, track_bars, with_eighths
from choreograph.music.beats import TRACKERS, BeatTracker, get_beat_tracker, read_beats
from choreograph.music.count_grids import steady_times_s
from choreograph.music.mel import log_mel
from choreograph.music.rhythm import (
    FRAME_RHYTHM_FPS,
    FRAME_RHYTHM_NAMES,
    frame_rhythm,
    rhythm_from,
    word_spectra,
)
from choreograph.music.song import Song, load_song
from choreograph.nets.music_counts import NetworkBeats

# The counts of a song: its beats by a tracker, by the network or from a file, numbered in their bars.


NETWORK = "network"  # `nets.music_counts`
TRACKER_NAMES = (*TRACKERS, NETWORK)
DEFAULT_BEATS = NETWORK
_BEAT_DECIMALS = 4  # of seconds: rounding removes differences between CPUs


def song_counts(song: Song, log_mel: NDArray[np.floating], beats: str | Path) -> Counts:
    """A song's beats and bars. Bars are tracked if the file has none.

    `beats` is one of `TRACKER_NAMES` or a file (see `music.beats`) of times in the song file.
    `log_mel` (T, 96) is that of the song. The source of the counts is "annotation" if the file has bars.
    Raises `ParameterError` for an unknown name, and `FormatError` for a file that cannot be read.
    """
    given = song_beats(song, log_mel, beats)
    if given.has_bars:
        return given
    counts = track_bars(song.samples, log_mel, given.times_s)
    return with_eighths(song.samples, log_mel, counts) if names_a_tracker(beats) else counts


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
    """A song's beats, with bars only if a file has them. Arguments and errors are those of `song_counts`."""
    check_beats(beats)
    if names_a_tracker(beats):
        tracker: BeatTracker = get_beat_tracker(str(beats)) if str(beats) in TRACKERS else NetworkBeats()
        times_s = np.round(tracker.beats(song, log_mel), _BEAT_DECIMALS)
        return Counts(times_s, np.zeros(len(times_s), np.int64), 0)
    return read_beats(beats, start_s=song.start_s, duration_s=song.duration_s)


# The songs of a build, each decoded and analysed once.


@dataclass(frozen=True, eq=False)
class AnalysedSong:
    """A song as a build uses it."""

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
    """Decodes and analyses a song when it is first needed. Several takes may share one song.

    `beats` names the tracker. Samples take 5 MB a minute and are dropped after the analysis
    unless `keep_samples`.
    """

    def __init__(self, beats: str = DEFAULT_BEATS, *, keep_samples: bool = False) -> None:
        self._beats = beats
        self._keep_samples = keep_samples
        self._analysed: dict[Path, AnalysedSong] = {}

    def known(self, path: Path) -> AnalysedSong | None:
        """The song of a file if it has been analysed already."""
        return self._analysed.get(path)

    def analysed(self, path: Path) -> AnalysedSong:
        """The song of a file. Raises as `load_song`."""
        if path not in self._analysed:
            self._analysed[path] = _analysed(path, beats=self._beats, keep_samples=self._keep_samples)
        return self._analysed[path]

    def analyse(self, paths: Iterable[Path], report: StepReport | None = None) -> None:
        """Analyse songs in the processes of `core.workers`, or read what is kept. Raises as `load_song`."""
        new = [path for path in dict.fromkeys(paths) if path not in self._analysed]
        analyse = partial(_analysed, beats=self._beats, keep_samples=self._keep_samples)
        key = partial(_analysis_key, analyse) if not self._keep_samples else lambda path: None
        each_song = each_cached(analyse, new, key=key, files=lambda path: [path])
        for done, (path, song) in enumerate(zip(new, each_song, strict=True)):
            self._analysed[path] = song
            if report is not None:
                report(done + 1, len(new))


def _analysis_key(analyse: Callable[[Path], AnalysedSong], path: Path) -> bytes | None:
    return key_of(analyse, path.name, sha256_of(path)) if path.is_file() else None


def _analysed(path: Path, *, beats: str, keep_samples: bool) -> AnalysedSong:
    song = load_song(path)
    mel = log_mel(song.samples)
    counts = song_counts(song, mel, beats)
    return AnalysedSong(song.duration_s, mel, counts, song if keep_samples else None, song.notes)


# Notes on songs: damage, motion without music, offsets that counts contradict.


_LONGER_S = 0.5  # by which a take is longer than its song if it gets a note
_FEWEST_COUNTS = 8
_APART_BEATS = 0.15  # least distance of counts from beats for a note
_AGREEMENT = 0.9  # least resultant length of the phases of the counts in the beat, for one offset


def song_notes(takes: Sequence[Take], songs: SongCache) -> list[Note]:
    """Notes on damaged songs, on motion that continues after its song, and on offsets that counts contradict.

    Songs that have not been analysed have no notes.
    """
    of_songs: dict[tuple[str, str], Note] = {}  # one for each song
    of_takes: list[Note] = []
    for take in takes:
        song = songs.known(take.song_path) if take.song_path else None
        if song is None or take.song_path is None:
            continue
        name = take.song_path.name
        of_songs |= {(name, text): Note("song", name, {"text": text}) for text in song.notes}
        over_s = take.song_start_s + take.motion.duration_s - song.duration_s
        if over_s > _LONGER_S:
            of_takes.append(Note("longer than song", take.name, {"over_s": over_s}))
        offset_s = better_offset_s(take, song)
        if offset_s is not None:
            of_takes.append(Note("counts beside beats", take.name, {"offset_s": offset_s}))
    return [*of_songs.values(), *of_takes]


def better_offset_s(take: Take, song: AnalysedSong) -> float | None:
    """Seconds by which a take would have to start later in its song for its counts to lie on beats.

    None if they lie on beats, if the offset varies, or if the counts are not annotated.
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


# The music of a take, warped so that its beats lie on the counts of the take and its bars on their bars.
#
# Music and motion of a recorded pair may not be aligned. A network that is conditioned on the phase of the
# music needs aligned pairs. So the features of the music are warped, and the motion is not changed.


@dataclass(frozen=True, eq=False)
class TakeMusic:
    """Features of the music of a take for the rollout network, from its first frame, at 30 fps."""

    rhythm: NDArray[np.float32]  # (T, 4) of `music.rhythm`
    count_phase: NDArray[np.float32]  # (T, 4) of `core.counts`
    spectral: NDArray[np.float32]  # (N, 87) of each word


def music_of_take(take: Take, analysed: AnalysedSong, bounds_s: Floats) -> TakeMusic:
    """The music of a take whose words begin and end at `bounds_s` (N + 1,), aligned with its counts.

    `analysed` has samples. If take or song have too few counts, the music is not warped, and phases are 0.
    """
    song, counts = analysed.song, take.counts
    assert song is not None
    n_frames = 1 + int(np.ceil(times_to_frames(take.motion.duration_s, FRAME_RHYTHM_FPS)))
    times_s = frame_times_s(n_frames + FRAME_RHYTHM_FPS, FRAME_RHYTHM_FPS)
    if min(len(counts), len(analysed.counts)) < _FEWEST_COUNTS:
        return TakeMusic(
            rhythm_from(song, analysed.beat_times_s, take.song_start_s),
            np.zeros((len(times_s), 4), np.float32),
            word_spectra(song, take.song_start_s + bounds_s),
        )
    beats = analysed.counts
    if counts.has_bars:
        beats = level_at_tempo(song.samples, analysed.log_mel, beats, counts.metre, tempo_bpm(counts))
    of_take = steady_times_s(counts.times_s)
    shift = beats_ahead(of_take, counts, beats, take.song_start_s)
    beats_s = steady_times_s(beats.times_s)
    return TakeMusic(
        _rhythm_at(song, beats_s, time_at(beats_s, index_at(of_take, times_s) + shift), of_take),
        count_phase(counts, times_s),
        word_spectra(song, np.sort(time_at(beats_s, index_at(of_take, bounds_s) + shift))),
    )


def beats_ahead(count_times_s: Floats, counts: Counts, beats: Counts, song_start_s: float) -> int:
    """Number of beats of the song before the first count of a take, if the two are aligned.

    If both have bars of one metre, only numbers that place count 1 on a downbeat are considered. Of these,
    the number is nearest to the recorded offset.
    """
    recorded = float(
        np.median(index_at(beats.times_s, count_times_s + song_start_s) - np.arange(len(counts)))
    )
    shifts = round(recorded) + np.arange(-counts.metre, counts.metre + 1)
    if counts.has_bars and beats.metre == counts.metre:
        of_take = int(counts.numbers[0])
        in_bar = [_number_at(beats, int(shift)) == of_take for shift in shifts]
        shifts = shifts[in_bar] if any(in_bar) else shifts
    return int(shifts[np.argmin(np.abs(shifts - recorded))])


def _number_at(beats: Counts, index: int) -> int:
    """The number of a beat in the bar, also before the first and after the last beat."""
    nearest = min(max(index, 0), len(beats) - 1)
    return (int(beats.numbers[nearest]) - 1 + index - nearest) % beats.metre + 1


def _rhythm_at(
    song: Song, beats_s: Floats, song_times_s: Floats, count_times_s: Floats
) -> NDArray[np.float32]:
    """The rhythm of a song (T, 4) at the time of each frame of a take, with beats on counts."""
    inside = beats_s[(beats_s >= 0) & (beats_s <= song.duration_s)]
    rows = frame_rhythm(song.samples, inside)
    # The nearest rows without interpolation, since onsets are short.
    frames = np.rint(times_to_frames(song_times_s, FRAME_RHYTHM_FPS)).astype(np.int64)
    rhythm: NDArray[np.float32] = rows[frames.clip(0, len(rows) - 1)].copy()
    counted = np.rint(times_to_frames(count_times_s, FRAME_RHYTHM_FPS)).astype(np.int64)
    rhythm[:, FRAME_RHYTHM_NAMES.index("beat")] = np.isin(np.arange(len(rhythm)), counted)
    return rhythm
