"""Songs spliced from two genres: does a dance change where its music does?

Two songs of about `HALF_S`, each cut on a bar line: the second begins on its first downbeat where the
first one's next bar would. Every genre of the built-in takes comes first once and second once. Their seeds
start at `FIRST_SEED`, so no network was trained and no setting tuned on them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.counts import Counts, numbers_in_bar
from choreograph.synthesis.songs.song import render_song
from choreograph.synthesis.songs.voices import RATE_HZ

Floats = NDArray[np.float64]

FIRST_SEED = 6000
HALF_S = 18.0
SOURCE = "synthesis"
_SPARE_S = 12.0  # rendered beyond the cut, so that no half fades out
_FADE_S = 0.02  # at both cuts, against clicks


@dataclass(frozen=True, eq=False)
class SplicedAudio:
    """A rendered song of two halves, with what is true of it."""

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
    ramp = np.linspace(1.0, 0.0, round(_FADE_S * RATE_HZ), dtype=np.float32)
    samples[-len(ramp) :] *= ramp[:, None]
    return samples, song.beat_times_s[song.beat_times_s < stop_s - 1e-6], song.beats_per_bar


SPLICED_SONGS = tuple(
    SplicedSong(genres, FIRST_SEED + 2 * index)
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
