"""What a repertoire lacks for given songs: genres, metres, tempi, and calm or lively motion.

A second of a song is covered if enough motion of its genre and metre can be danced there at nearly its own
tempo, and if some of that motion is as calm or as lively as the music. Other seconds are poor: they are
danced with the same motion again and again, with motion played much faster or slower than it was recorded, or
with motion of another metre.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.constraints import Constraints
from choreograph.choreography.genres import LikelyGenre, likely_genres, tempo_at
from choreograph.choreography.song_analysis import analyse_song
from choreograph.core.arguments import as_list, check_function, check_kind
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats, default_numerics
from choreograph.core.progress import ProgressReport, counted
from choreograph.core.timebase import NET_FPS, SEGMENT_FRAMES
from choreograph.library.repertoire import Repertoire
from choreograph.library.vocabulary import ALL_GENRES
from choreograph.motion.motion_beats import mean_joint_speed_m_s
from choreograph.music.bars import tempo_bpm
from choreograph.music.count_grids import FEWEST_COUNTS
from choreograph.music.song import Song, as_song

# Motion looks as it was recorded between these speeds. Faster or slower, its weight is wrong.
SPEEDS = (0.8, 1.25)
ENOUGH_S = 24.0  # of motion for a second of a song. A phrase of 32 counts lasts 12 to 20 s
ENOUGH_OF_ENERGY_S = 8.0  # of calm or lively motion for a soft or loud second
_OTHER_ENERGY = 0.25  # difference of a second from the median of its song that calls for other motion
_CALM, _LIVELY = 0.85, 1.15  # speed of joints in 4 s, relative to the median of the genre
_TEMPO_STEP_BPM = 10

GOOD, METRE, TEMPO, ENERGY = "", "metre", "tempo", "energy"
REASONS = (METRE, TEMPO, ENERGY)  # why a second is poor, the first that applies


@dataclass(frozen=True, eq=False)
class SongCoverage:
    """How a repertoire covers a song of S seconds."""

    song: str
    """Name of the song."""

    duration_s: float
    """Length of the song in seconds."""

    metre: int
    """Counts in a bar, or 0 if there are no bars."""

    tempo_bpm: NDArray[np.float64]
    """(S,) tempo at which each second is counted, in beats per minute, nan without counts."""

    genres: tuple[str, ...]
    """(S,) genre that is danced in each second."""

    energy: NDArray[np.float32]
    """(S,) from 0 to 1, from soft to loud."""

    motion_s: NDArray[np.float64]
    """(S,) seconds of motion of the genre and metre that fit the tempo."""

    reasons: tuple[str, ...]
    """(S,) one of `REASONS`, or empty where the second is covered."""

    probability: float
    """Probability of the least certain genre, 0 to 1."""

    notes: tuple[str, ...]
    """What was unusual in the analysis, such as a tempo that was halved."""

    @property
    def poor_s(self) -> int:
        """Number of seconds that are not covered."""
        return sum(reason != GOOD for reason in self.reasons)


@dataclass(frozen=True)
class Lack:
    """Motion that a repertoire lacks for some seconds of songs."""

    reason: str
    """One of `REASONS`."""

    genre: str
    """The genre that the motion must have."""

    metre: int
    """Counts in a bar, or 0 for any."""

    tempo_bpm: int
    """The lowest tempo of a range of 10 beats per minute."""

    energy: str
    """"calm", "lively" or empty."""

    seconds: int
    """Number of seconds of the songs that lack it."""

    songs: tuple[str, ...]
    """Names of these songs."""

    def __str__(self) -> str:
        metre = f" in {self.metre}" if self.metre else ""
        kind = f"{self.energy} {self.genre}" if self.energy else self.genre
        return f"{kind}{metre} at {self.tempo_bpm} to {self.tempo_bpm + _TEMPO_STEP_BPM} BPM"


@dataclass(frozen=True, eq=False)
class Coverage:
    """How a repertoire covers songs, and what it lacks for them."""

    songs: tuple[SongCoverage, ...]
    """What is covered of each song."""

    lacks: tuple[Lack, ...]
    """What is lacking, the most seconds first."""

    unused: tuple[str, ...]
    """Names of takes that no second of the songs can use."""

    motion: TakeMotion
    """The motion of the takes."""


@default_numerics()
def coverage(
    repertoire: Repertoire,
    songs: Iterable[str | Path | Song],
    *,
    report: ProgressReport | None = None,
) -> Coverage:
    """Say what a repertoire lacks for these songs.

    Parameters
    ----------
    repertoire : the takes to dance with
    songs : paths of audio files, or loaded songs, 1 or more
    report : called with the name of the stage, the work done so far, and all the work

    Raises `FormatError` if a song cannot be read, `RepertoireError` if the repertoire is damaged, and
    `ParameterError` without songs.

    Examples
    --------
    >>> found = cg.coverage(cg.starter_repertoire(), [cg.example_songs()["house"]])
    >>> found.songs[0].poor_s, found.lacks
    (0, ())
    """
    check_kind("a repertoire", repertoire, Repertoire)
    check_function("report", report)
    songs = as_list("songs", songs, "path or Song", str | Path | Song)
    if not songs:
        raise ParameterError("expected songs to dance to, got none")
    motion = TakeMotion(repertoire)
    found, used = [], np.zeros(len(repertoire.takes), bool)
    for done, (name, song) in enumerate(zip(_names(songs), songs, strict=True)):
        if report is not None:
            report("analysing songs", done, len(songs))
        covered, takes = _covered(name, as_song("a song", song), repertoire, motion)
        found.append(covered)
        used |= takes
    if report is not None:
        report("analysing songs", len(songs), len(songs))
    unused = tuple(take.name for take, is_used in zip(repertoire.takes, used, strict=True) if not is_used)
    return Coverage(tuple(found), _lacks(found), unused, motion)


class TakeMotion:
    """Tempo, metre, genre and seconds of each take of a repertoire, and of its calm and lively motion."""

    def __init__(self, repertoire: Repertoire) -> None:
        takes = range(len(repertoire.takes))
        counts = [repertoire.counts(take) for take in takes]
        self.genre = np.array([take.credits.genre for take in repertoire.takes])
        self.metre = np.array([own.metre for own in counts])
        self.bpm = np.array([tempo_bpm(own) if len(own) >= FEWEST_COUNTS else np.nan for own in counts])
        self.clips = np.bincount(repertoire.clip_take, minlength=len(counts))
        self.calm, self.lively = np.zeros(len(counts)), np.zeros(len(counts))
        speeds = [_speeds_m_s(repertoire.body_pos_m(take)) for take in takes]  # every second
        for genre in np.unique(self.genre):
            of_genre = np.flatnonzero(self.genre == genre)
            usual = np.median(np.concatenate([speeds[take] for take in of_genre]))
            for take in of_genre:
                self.calm[take] = np.sum(speeds[take] <= _CALM * usual)
                self.lively[take] = np.sum(speeds[take] >= _LIVELY * usual)
        self.seconds = np.where(self.clips > 0, [take.duration_s for take in repertoire.takes], 0.0)

    def seconds_of(self, wanted: NDArray[np.bool_], energy: str = "") -> float:
        """Seconds of motion of some of the takes (takes,), or of what is "calm" or "lively" of it."""
        of_takes = {"": self.seconds, "calm": self.calm, "lively": self.lively}[energy]
        return float(of_takes[wanted].sum())


def _speeds_m_s(body_pos_m: NDArray[np.float32]) -> Floats:
    """Mean speed of the joints in the 4 s from each second of a take, at least one value."""
    sums = np.append(0.0, np.cumsum(mean_joint_speed_m_s(body_pos_m, NET_FPS)))
    starts = np.arange(0, max(1, len(body_pos_m) - SEGMENT_FRAMES + 1), NET_FPS)
    stops = np.minimum(starts + SEGMENT_FRAMES, len(body_pos_m))
    speeds: Floats = (sums[stops] - sums[starts]) / (stops - starts)
    return speeds


def _names(songs: Sequence[str | Path | Song]) -> list[str]:
    """The names of songs, of files of one name with their folders."""
    names = [song.name if isinstance(song, Song) else Path(song).stem for song in songs]
    return [
        f"{Path(song).parent.name}/{name}" if names.count(name) > 1 and not isinstance(song, Song) else name
        for name, song in zip(names, songs, strict=True)
    ]


def _covered(
    name: str, song: Song, repertoire: Repertoire, motion: TakeMotion
) -> tuple[SongCoverage, NDArray[np.bool_]]:
    """How a song is covered, and which takes (takes,) one of its seconds can use."""
    features, notes = analyse_song(song, repertoire, keep=True)
    parts = likely_genres(features, repertoire, Constraints())
    counts = features.counts
    bpm = tempo_at(counts, features.n_seconds) if len(counts) > 1 else np.full(features.n_seconds, np.nan)
    genres = _genres(parts, features.n_seconds)
    metre = counts.metre
    motion_s, reasons = np.zeros(features.n_seconds), []
    used = np.zeros(len(motion.genre), bool)
    for second, (genre, energy) in enumerate(zip(genres, energy_names(features.energy), strict=True)):
        of_genre = (motion.genre == genre) if genre != ALL_GENRES else np.ones(len(used), bool)
        in_metre = of_genre & (motion.metre == metre) if metre else of_genre
        speed = bpm[second] / motion.bpm
        fits = (
            in_metre & (speed >= SPEEDS[0]) & (speed <= SPEEDS[1]) if np.isfinite(bpm[second]) else in_metre
        )
        motion_s[second] = motion.seconds_of(fits)
        used |= fits & (motion.clips > 0)
        reasons.append(_reason(motion, in_metre, fits, energy))
    return (
        SongCoverage(
            name, features.duration_s, metre, bpm, tuple(genres), features.energy, motion_s,
            tuple(reasons), min(part.probability for part in parts), notes,
        ),
        used,
    )  # fmt: skip


def _reason(motion: TakeMotion, in_metre: NDArray[np.bool_], fits: NDArray[np.bool_], energy: str) -> str:
    if motion.seconds_of(in_metre) < ENOUGH_S:
        return METRE
    if motion.seconds_of(fits) < ENOUGH_S:
        return TEMPO
    if energy and motion.seconds_of(fits, energy) < ENOUGH_OF_ENERGY_S:
        return ENERGY
    return GOOD


def energy_names(energy: NDArray[np.floating]) -> list[str]:
    """The motion that each second calls for by its energy (S,): "calm", "lively", or "" for any."""
    away = energy - np.median(energy)
    return ["calm" if a < -_OTHER_ENERGY else "lively" if a > _OTHER_ENERGY else "" for a in away]


def _genres(parts: Sequence[LikelyGenre], n_seconds: int) -> list[str]:
    """The genre of each second, (S,)."""
    genres = [ALL_GENRES] * n_seconds
    for part in parts:
        genres[part.first_second :] = [part.genre] * (n_seconds - part.first_second)
    return genres


def _lacks(songs: Sequence[SongCoverage]) -> tuple[Lack, ...]:
    """The poor seconds of all songs, grouped by what motion they lack."""
    seconds: dict[tuple[str, str, int, int, str], list[str]] = defaultdict(list)
    for song in songs:
        for second, (reason, name) in enumerate(zip(song.reasons, energy_names(song.energy), strict=True)):
            if reason == GOOD:
                continue
            bpm = song.tempo_bpm[second]
            step = round(bpm) // _TEMPO_STEP_BPM * _TEMPO_STEP_BPM if np.isfinite(bpm) else 0
            energy = name if reason == ENERGY else ""
            seconds[reason, song.genres[second], song.metre, step, energy].append(song.song)
    lacks = [Lack(*kind, len(of), tuple(dict.fromkeys(of))) for kind, of in seconds.items()]
    return tuple(sorted(lacks, key=lambda lack: -lack.seconds))


# As a table, as JSON and as a picture.


def coverage_table(found: Coverage) -> list[str]:
    """A line for each song, then what to capture, and how many takes no song uses."""
    width = max(len("song"), *(len(song.song) for song in found.songs))
    lines = [f"{'song':<{width}}  length  metre  tempo     poor  genre"]
    for song in found.songs:
        tempi = song.tempo_bpm[np.isfinite(song.tempo_bpm)]
        tempo = (
            "-".join(dict.fromkeys(f"{bpm:.0f}" for bpm in np.percentile(tempi, [5, 95])))
            if len(tempi)
            else "none"
        )
        danced = ", ".join(dict.fromkeys(song.genres))
        lines.append(
            f"{song.song:<{width}}  {song.duration_s:4.0f} s  {song.metre or '-':>5}  {tempo:<8}  "
            f"{song.poor_s:4d}  {danced} ({100 * song.probability:.0f} % sure)"
        )
    lines.append("What is lacking:" if found.lacks else "Every second of these songs is covered.")
    why = {
        METRE: f"there are less than {ENOUGH_S:.0f} s in this metre",
        TEMPO: "there are less than {:.0f} s within {:g} to {:g} of the tempo".format(ENOUGH_S, *SPEEDS),
        ENERGY: f"there are less than {ENOUGH_OF_ENERGY_S:.0f} s of such energy",
    }
    for lack in found.lacks:
        of = ", ".join(lack.songs[:3]) + (f" and {len(lack.songs) - 3} more" if len(lack.songs) > 3 else "")
        lines.append(f"  {lack}, for {lack.seconds} s of {of}: {why[lack.reason]}")
    if found.unused:
        lines.append(f"{counted(len(found.unused), 'take')} cannot be used by any of these songs")
    return lines
