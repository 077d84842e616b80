"""Songs with known counts for tests and benchmarks, some with a soft middle, some spliced from two genres."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from choreograph.core.counts import Counts, numbers_in_bar
from choreograph.core.numerics import Floats
from content.songs.metre_styles import METRE_STYLES
from content.songs.synthesis.composition import Section
from content.songs.synthesis.song import STYLES, SyntheticSong, render_song
from content.songs.synthesis.sounds import RATE_HZ
from content.songs.synthesis.style import SongStyle

# Songs with ground truth for tests and benchmarks. None of them is a song of the built-in takes.
#
# Their seeds start at `FIRST_SEED` and those of the takes' songs are below, so neither the networks nor the
# settings of the engine were trained or tuned on them. They are rendered on demand, in half a second each.


FIRST_SEED = 1000
_DURATION_S = 50.0


@dataclass(frozen=True)
class BenchmarkSong:
    """Parameters of one benchmark song."""

    name: str
    group: str  # steady, ramp, swung, level (too fast to count every beat), metre (five, six, seven)
    genre: str  # of `STYLES` or `METRE_STYLES`
    bpm: float
    seed: int
    ramp_to_bpm: float | None = None
    swing: float = 0.0

    def render(self) -> SyntheticSong:
        """Render about 50 s."""
        return render_song(
            METRE_STYLES.get(self.genre, self.genre),
            bpm=self.bpm,
            duration_s=_DURATION_S,
            seed=self.seed,
            swing=self.swing,
            ramp_to_bpm=self.ramp_to_bpm,
        )


BENCHMARK_SONGS = (
    BenchmarkSong("steady hip-hop 85", "steady", "hip-hop", 85.0, 1000),
    BenchmarkSong("steady contemporary 90", "steady", "contemporary", 90.0, 1001),
    BenchmarkSong("steady rumba 100", "steady", "rumba", 100.0, 1002),
    BenchmarkSong("steady funk 106", "steady", "funk", 106.0, 1003),
    BenchmarkSong("steady disco 114", "steady", "disco", 114.0, 1004),
    BenchmarkSong("steady cha-cha 120", "steady", "cha-cha", 120.0, 1005),
    BenchmarkSong("steady house 125", "steady", "house", 125.0, 1006),
    BenchmarkSong("steady tango 131", "steady", "tango", 131.0, 1007),
    BenchmarkSong("steady waltz 152", "steady", "waltz", 152.0, 1008),
    BenchmarkSong("steady salsa 168", "steady", "salsa", 168.0, 1009),
    BenchmarkSong("ramp house 90-140", "ramp", "house", 90.0, 1010, ramp_to_bpm=140.0),
    BenchmarkSong("ramp disco 90-140", "ramp", "disco", 90.0, 1011, ramp_to_bpm=140.0),
    BenchmarkSong("ramp cha-cha 90-140", "ramp", "cha-cha", 90.0, 1012, ramp_to_bpm=140.0),
    BenchmarkSong("ramp tango 90-140", "ramp", "tango", 90.0, 1013, ramp_to_bpm=140.0),
    BenchmarkSong("swung hip-hop 94", "swung", "hip-hop", 94.0, 1014, swing=0.8),
    BenchmarkSong("swung house 121", "swung", "house", 121.0, 1015, swing=0.7),
    BenchmarkSong("swung swing 132", "swung", "swing", 132.0, 1016, swing=1.0),
    BenchmarkSong("swung swing 148", "swung", "swing", 148.0, 1017, swing=0.9),
    BenchmarkSong("house 164", "level", "house", 164.0, 1018),
    BenchmarkSong("disco 164", "level", "disco", 164.0, 1019),
    BenchmarkSong("hip-hop 164", "level", "hip-hop", 164.0, 1020),
    BenchmarkSong("waltz 172", "level", "waltz", 172.0, 1021),
    BenchmarkSong("waltz 180", "level", "waltz", 180.0, 1022),
    BenchmarkSong("jazz in five 166", "metre", "jazz in 3+2", 166.0, 1023, swing=0.8),
    BenchmarkSong("rock in five 124", "metre", "rock in 2+3", 124.0, 1024),
    BenchmarkSong("ballad in six 174", "metre", "ballad in 3+3", 174.0, 1025),
    BenchmarkSong("jig in six 216", "metre", "jig in 3+3", 216.0, 1026),
    BenchmarkSong("aksak in seven 214", "metre", "aksak in 2+2+3", 214.0, 1027),
    BenchmarkSong("rock in seven 142", "metre", "rock in 4+3", 142.0, 1028),
)


# Songs whose middle third is soft, to measure whether a dance gets smaller there.
#
# The middle third is played by the instruments of a break, and `SOFT_DB` softer. The outer ones are choruses.
# Their seeds start at `FIRST_SEED`, so no network was trained on them.


FIRST_SOFTENED_SEED = 9500
SOFT_DB = -12.0
_ENERGIES = {"chorus": 0.9, "break": 0.3}
_FADE_S = 0.05  # of the gain, around the bar lines


def softened_song(genre: str, *, seed: int, duration_s: float = 60.0) -> SyntheticSong:
    """A song of about this length in three equal sections, of which the middle one is soft.

    Raises `ParameterError` as `render_song` does.
    """
    style = STYLES[genre]
    bars = _bars_of_third(style, duration_s)
    names = ("chorus", "break", "chorus")
    sections = [Section(name, i * bars, bars, _ENERGIES[name]) for i, name in enumerate(names)]
    song = render_song(style, n_bars=3 * bars, seed=seed, sections=sections)
    start_s, stop_s = song.bar_times_s[[bars, 2 * bars]]
    times_s = np.arange(len(song.samples)) / RATE_HZ
    corners_s = [start_s - _FADE_S, start_s, stop_s - _FADE_S, stop_s]
    gain_db = np.interp(times_s, corners_s, [0.0, SOFT_DB, SOFT_DB, 0.0])
    gain = (10.0 ** (gain_db / 20.0)).astype(np.float32)
    return replace(song, samples=song.samples * gain[:, None])


def _bars_of_third(style: SongStyle, duration_s: float) -> int:
    bar_s = style.beats_per_bar * 60.0 / float(np.mean(style.bpm))
    return max(1, round(duration_s / bar_s / 3.0))


# Songs spliced from two genres, to measure whether a dance changes where its music does.
#
# They consist of two songs of about `HALF_S`, each cut on a bar line. The first downbeat of the second song
# is at the place of the next bar of the first one. Every genre of the built-in takes is first once and second
# once. Their seeds start at `FIRST_SEED`, so no network was trained and no setting tuned on them.


FIRST_SPLICED_SEED = 6000
HALF_S = 18.0
SOURCE = "synthesis"
_SPARE_S = 12.0  # rendered beyond the cut, so that no half fades out
_SPLICE_FADE_S = 0.02  # at both cuts, against clicks


@dataclass(frozen=True, eq=False)
class SplicedAudio:
    """A rendered song of two halves, with its ground truth."""

    samples: NDArray[np.float32]  # (S, 2) at 44.1 kHz
    counts: Counts  # its beats, with their numbers in the bar
    splice_s: float  # the first downbeat of the second half
    genres: tuple[str, str]

    @property
    def duration_s(self) -> float:
        """Length of the samples, in seconds."""
        return len(self.samples) / RATE_HZ

    @property
    def wanted(self) -> list[str]:
        """The genre of every whole second, at its middle."""
        middles_s = np.arange(int(self.duration_s)) + 0.5
        return [self.genres[int(middle >= self.splice_s)] for middle in middles_s]


@dataclass(frozen=True)
class SplicedSong:
    """Parameters of one spliced song."""

    genres: tuple[str, str]
    seed: int

    @property
    def name(self) -> str:
        """Its genres, as a name of files."""
        return "-then-".join(self.genres)

    def render(self) -> SplicedAudio:
        """Render both halves and join them."""
        first, second = (_half(genre, self.seed + i) for i, genre in enumerate(self.genres))
        splice_s = len(first[0]) / RATE_HZ
        times_s = np.concatenate([first[1], splice_s + second[1]])
        numbers = np.concatenate(
            [numbers_in_bar(len(beats_s), per_bar) for _, beats_s, per_bar in (first, second)]
        )
        counts = Counts(times_s, numbers, max(first[2], second[2]), SOURCE, 1.0)
        return SplicedAudio(np.concatenate([first[0], second[0]]), counts, splice_s, self.genres)


def _half(genre: str, seed: int) -> tuple[NDArray[np.float32], Floats, int]:
    """Samples (S, 2) of whole bars, their beats from the first one on (Q,), and the beats in a bar."""
    song = render_song(genre, duration_s=HALF_S + _SPARE_S, seed=seed, lead_in_s=0.0)
    bars_s = song.bar_times_s
    stop_s = float(bars_s[np.abs(bars_s - HALF_S).argmin()])
    samples = song.samples[: round(stop_s * RATE_HZ)].copy()
    ramp = np.linspace(1.0, 0.0, round(_SPLICE_FADE_S * RATE_HZ), dtype=np.float32)
    samples[-len(ramp) :] *= ramp[:, None]
    return samples, song.beat_times_s[song.beat_times_s < stop_s - 1e-6], song.beats_per_bar


SPLICED_SONGS = tuple(
    SplicedSong(genres, FIRST_SPLICED_SEED + 2 * index)
    for index, genres in enumerate(
        (
            ("house", "waltz"),
            ("waltz", "hip-hop"),
            ("hip-hop", "salsa"),
            ("salsa", "contemporary"),
            ("contemporary", "house"),
            ("disco", "swing"),
            ("swing", "cha-cha"),
            ("cha-cha", "disco"),
        )
    )
)
