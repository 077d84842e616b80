"""The songs of an evaluation, their beats and sections, and expert dances from files."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from choreograph.core.counts import Counts
from choreograph.core.errors import ParameterError
from choreograph.core.files import sha256_of
from choreograph.core.numerics import Floats
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.evaluation.metrics.energy_response import section_loudness_db
from choreograph.evaluation.plan_scores import CountedDance
from choreograph.evaluation.results import EXPERT
from choreograph.formats.register import import_takes
from choreograph.library.repertoire import Repertoire
from choreograph.library.songs import names_a_tracker, song_counts
from choreograph.motion.motion import Take
from choreograph.music.bars import choose_level, metrical_levels, tempo_bpm
from choreograph.music.beats import DEFAULT_TRACKER, get_beat_tracker
from choreograph.music.form import Sections, song_sections
from choreograph.music.mel import log_mel
from choreograph.music.song import Song, load_song
from choreograph.music.spectral import spectral_features

# The songs of an evaluation are the audio files in a folder, with the real takes to them if there are any.


SONG_SUFFIXES = (".wav", ".mp3", ".flac", ".ogg", ".m4a", ".opus", ".aac", ".aif", ".aiff")


@dataclass(frozen=True, eq=False)
class EvaluatedSong:
    """A song, or the part of it that a real take dances to."""

    name: str  # of the song
    path: Path  # of the audio file
    start_s: float = 0.0  # of the part in the file
    duration_s: float | None = None  # None for the rest of the song
    take: Take | None = None  # the real dance

    @property
    def song_name(self) -> str:
        """The song's name in the provenance of a repertoire."""
        return self.take.song_name if self.take is not None else self.path.stem

    @property
    def genre(self) -> str:
        """The genre of the real dance. Empty if there is none."""
        return self.take.credits.genre if self.take is not None else ""

    def load(self) -> Song:
        """Load the samples. Raises as `load_song` does."""
        return load_song(self.path, start_s=self.start_s, duration_s=self.duration_s)


def find_songs(
    folder: str | Path,
    *,
    only: Collection[str] = (),
    duration_s: float | None = None,
) -> tuple[EvaluatedSong, ...]:
    """Find the songs in a folder: those of importable takes in any layout, and all other audio files.

    `only` names the takes and songs (files without suffix) to keep, all if empty. `duration_s` cuts songs and
    their real takes. Raises `ParameterError` if there is no song or a name in `only` is missing, and
    `FormatError` if a take is damaged.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise ParameterError(f"expected a folder of songs at {folder}, got no such folder")
    files = sorted(p for p in folder.iterdir() if p.suffix.lower() in SONG_SUFFIXES and p.name[0] != ".")
    songs, with_take = [], set()
    for take in _takes(folder, optional=bool(files)):
        if take.song_path is None:
            continue
        with_take.add(take.song_path)
        if not only or take.name in only:
            songs.append(_song_of_take(take, duration_s))
    others = [path for path in files if path not in with_take and (not only or path.stem in only)]
    songs += [EvaluatedSong(path.stem, path, duration_s=duration_s) for path in others]
    missing = sorted(set(only) - {song.name for song in songs})
    if missing:
        raise ParameterError(f"{folder}: expected a song {missing[0]!r}, got none with that name")
    if not songs:
        raise ParameterError(f"{folder}: expected songs ({', '.join(SONG_SUFFIXES)}), got none")
    return tuple(songs)


def _takes(folder: Path, *, optional: bool) -> Iterator[Take]:
    takes = import_takes(folder)
    try:
        first = next(takes)
    except ParameterError:
        if not optional:
            raise
        return
    except StopIteration:
        return
    yield first
    yield from takes


def _song_of_take(take: Take, duration_s: float | None) -> EvaluatedSong:
    assert take.song_path is not None
    length_s = min(take.motion.duration_s, duration_s or np.inf)
    return EvaluatedSong(take.name, take.song_path, take.song_start_s, length_s, take)


def check_unseen(songs: Sequence[EvaluatedSong], repertoire: Repertoire) -> None:
    """Raise `ParameterError` if the repertoire holds or was trained on a song, by name or by checksum."""
    known = set(repertoire.provenance.get("trained_on", ())) | {t.song_name for t in repertoire.takes}
    known |= {take.name for take in repertoire.takes}
    checksums = repertoire.source_checksums
    seen = [s.name for s in songs if s.song_name in known or sha256_of(s.path) in checksums]
    if seen:
        more = f" and {len(seen) - 1} more" if len(seen) > 1 else ""
        raise ParameterError(
            f"{repertoire.path.name}: expected held-out songs, got {seen[0]}{more} that it was built from: "
            "build with --leave-out, choose songs with --only, or measure anyway with --seen"
        )


def beats_of(song: Song, beats: str | Path) -> Counts:
    """Beats and bars by the name of a tracker, from a file of beats, or from SONG.txt in a folder.

    Bars are tracked where a file has none. Raises `ParameterError` if `beats` is none of these, `FormatError`
    for a file that cannot be read.
    """
    if not names_a_tracker(beats) and Path(beats).is_dir():
        beats = Path(beats) / f"{(song.path or Path(song.name)).stem}.txt"
    return song_counts(song, log_mel(song.samples), beats)


# Dances to a song are compared with its beats in bars, the beats of a second tracker, and its sections.


SECOND_TRACKER = "librosa"


@dataclass(frozen=True, eq=False)
class SongMusic:
    """The music of a song as dances are measured against it."""

    levels: tuple[Counts, ...]  # its beats in bars, as tracked, then at half and double tempo if that fits
    second_beats_s: Floats  # (Q',) by another tracker
    sections: Sections
    section_loudness_db: Floats  # (S,)
    duration_s: float

    @property
    def beats_s(self) -> Floats:
        """The beats as tracked, in seconds, (Q,)."""
        return self.levels[0].times_s

    def counted_as(self, danced: Counts) -> Counts:
        """The beats at the metrical level of the counts of a dance, or as tracked if those are not known.

        Both levels are in the music, so dancing at the other one is no error.
        """
        if len(danced) < 2 or len(self.levels) == 1:
            return self.levels[0]
        bpm = {level.metre: np.array([tempo_bpm(danced)]) for level in self.levels}
        return choose_level(self.levels, bpm, {metre: np.ones(1) for metre in bpm})


def second_tracker(beats: str | Path) -> str:
    """The second tracker: librosa, or the default one if librosa is the first."""
    return DEFAULT_TRACKER if str(beats) == SECOND_TRACKER else SECOND_TRACKER


def song_music(song: Song, beats: str | Path) -> SongMusic:
    """The music of a song, with beats from a tracker or a file as in `beats_of`. Raises as it does.

    The beats of a file are used at their own metrical level only.
    """
    counts = beats_of(song, beats)
    mel = log_mel(song.samples)  # (T, 96)
    sections = song_sections(spectral_features(song.samples, counts.times_s), counts.times_s)
    return SongMusic(
        metrical_levels(song.samples, mel, counts) if names_a_tracker(beats) else (counts,),
        get_beat_tracker(second_tracker(beats)).beats(song, mel),
        sections,
        section_loudness_db(song.samples, SAMPLE_RATE_HZ, sections.bounds_s),
        song.duration_s,
    )


# Expert dances from files: a folder of dances with their counts beside them, named as their songs.


def read_experts(folder: str | Path, songs: Sequence[EvaluatedSong]) -> list[CountedDance]:
    """The dances in a folder, each from the first danced second of its song.

    `folder` is in any layout of takes, for example SONG.bvh with SONG.counts.csv, and genres in manifest.csv.
    Dances to evaluated songs are cut to their length. Those to other songs serve as references of their
    genre. Raises `ParameterError` if none is to an evaluated song, `FormatError` if a file is damaged.
    """
    by_name = {song.name: song for song in songs}
    dances = []
    for take in import_takes(folder):
        song = by_name.get(take.name)
        motion = take.motion
        if song is not None and song.duration_s is not None:
            motion = motion.sliced(0, min(motion.n_frames, max(1, round(song.duration_s * motion.fps))))
        genre = take.credits.genre or (song.genre if song else "")
        counts = take.counts.within(0.0, motion.duration_s)
        dances.append(CountedDance(EXPERT, take.name, motion, counts, genre=genre))
    if not any(dance.song in by_name for dance in dances):
        raise ParameterError(
            f"{folder}: expected dances named as the songs ({', '.join(sorted(by_name))}), got none"
        )
    return dances
