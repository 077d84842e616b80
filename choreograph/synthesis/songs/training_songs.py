"""Songs without end whose counts are known: what trackers of beats and bars are trained on and measured by.

Each has a kind, so that a table can say what a tracker is good at. The seeds of training songs start at
`FIRST_SEED`, those to measure by at `FIRST_UNSEEN_SEED`.

Six in a bar is counted as two threes, as dancers do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.counts import Counts, numbers_in_bar
from choreograph.errors import ParameterError
from choreograph.synthesis.songs.genres import STYLES
from choreograph.synthesis.songs.restyling import (
    double_time_drums,
    drums_of,
    half_time_drums,
    in_six,
    in_three,
    reorchestrated,
)
from choreograph.synthesis.songs.song import SyntheticSong, render_song
from choreograph.synthesis.songs.style import SongStyle
from choreograph.synthesis.songs.voices import RATE_HZ

FIRST_SEED = 20_000
FIRST_UNSEEN_SEED = 60_000
KINDS = (
    "steady", "ramp", "swing", "wandering", "rubato introduction", "three", "six", "pick-up", "half time",
    "double time", "break",
)  # fmt: skip
SOURCE = "synthesis"
_COUNTED = {3: 3, 4: 4, 6: 3}  # beats in a bar: counts in a bar
_TEMPO_MARGIN = 1.1  # beyond a genre's usual tempi
_P_HYBRID, _P_REORCHESTRATED = 0.3, 0.7
_BREAK_DB = -30.0


@dataclass(frozen=True, eq=False)
class CountedSong:
    """A rendered song with its true counts."""

    samples: NDArray[np.float32]  # (S, 2) at 44.1 kHz
    counts: Counts
    genre: str  # of its parts
    kind: str  # of `KINDS`


def counted_song(
    genre: str, kind: str, *, seed: int, duration_s: float = 50.0, others: Sequence[str] = tuple(STYLES)
) -> CountedSong:
    """A song of a kind of about this length; all that the kind leaves open is drawn from the seed.

    It may have the drums of one of the genres `others`. A kind that needs another metre than the genre's
    changes it ("three", "six").
    Raises `ParameterError` for an unknown genre or kind.
    """
    if genre not in STYLES or kind not in KINDS:
        raise ParameterError(
            f"expected a genre among {', '.join(STYLES)} and a kind among {', '.join(KINDS)}, got {genre!r} "
            f"and {kind!r}"
        )
    rng = np.random.default_rng([seed, 1])
    style = _drawn_style(genre, kind, others, rng)
    bpm = float(rng.uniform(style.bpm[0] / _TEMPO_MARGIN, style.bpm[1] * _TEMPO_MARGIN))
    options: dict[str, object] = {"bpm": bpm, "swing": style.swing}
    if kind == "ramp":
        options["ramp_to_bpm"] = bpm * float(rng.choice([rng.uniform(0.7, 0.9), rng.uniform(1.1, 1.45)]))
    elif kind == "swing":
        options["swing"] = float(rng.uniform(0.5, 1.0))
    elif kind in ("wandering", "rubato introduction"):
        options["tempo_map"] = _free_tempo(bpm, duration_s, kind, rng)
    song = render_song(
        style,
        seed=seed,
        duration_s=duration_s,
        lead_in_s=float(rng.uniform(0.0, 2.0)),
        **options,  # type: ignore[arg-type]
    )
    metre = _COUNTED[song.beats_per_bar]
    numbers = numbers_in_bar(len(song.beat_times_s), metre)
    samples, times_s = song.samples, song.beat_times_s
    if kind == "pick-up":
        samples, times_s, numbers = _begun_within_a_bar(song, numbers, rng)
    elif kind == "break":
        samples = _with_breaks(song, rng)
    return CountedSong(samples, Counts(times_s, numbers, metre, SOURCE, 1.0), genre, kind)


def style_of(genre: str, kind: str, *, seed: int, others: Sequence[str] = tuple(STYLES)) -> SongStyle:
    """The style in which `counted_song` renders; its name has the genres of its parts and of its drums."""
    return _drawn_style(genre, kind, others, np.random.default_rng([seed, 1]))


def _drawn_style(genre: str, kind: str, others: Sequence[str], rng: np.random.Generator) -> SongStyle:
    style = STYLES[genre]
    same_metre = [name for name in others if STYLES[name].beats_per_bar == style.beats_per_bar]
    if same_metre and rng.random() < _P_HYBRID:
        style = drums_of(STYLES[str(rng.choice(same_metre))], style)
    if rng.random() < _P_REORCHESTRATED:
        style = reorchestrated(style, _voices_by_role(), rng)
    if kind in ("three", "six") and style.beats_per_bar == 4:
        style = in_three(style, dropped=int(rng.integers(1, 4)))
    if kind == "six":
        style = in_six(style)
    elif kind == "half time":
        style = half_time_drums(style)
    elif kind == "double time":
        style = double_time_drums(style)
    return style


def _voices_by_role() -> dict[str, Sequence[str]]:
    voices: dict[str, set[str]] = {}
    for style in STYLES.values():
        for part in style.parts:
            voices.setdefault(part.role, set()).update(part.voices)
    return {role: sorted(names) for role, names in voices.items()}


def _free_tempo(
    bpm: float, duration_s: float, kind: str, rng: np.random.Generator
) -> list[tuple[float, float]]:
    """A tempo that wanders by a few per cent throughout, or by more in the first bars alone."""
    n_beats = bpm * duration_s / 60.0
    if kind == "wandering":
        beats = np.arange(0.0, n_beats, 6.0)
        drift = np.cumsum(rng.normal(0.0, 0.02, len(beats)))
        return [
            (float(b), float(bpm * np.exp(np.clip(d, -0.2, 0.2)))) for b, d in zip(beats, drift, strict=True)
        ]
    free = [(float(b), float(bpm * rng.uniform(0.75, 1.15))) for b in range(0, 12, 2)]
    return [*free, (14.0, bpm)]


def _begun_within_a_bar(
    song: SyntheticSong, numbers: NDArray[np.int64], rng: np.random.Generator
) -> tuple[NDArray[np.float32], NDArray[np.float64], NDArray[np.int64]]:
    """The song from a beat of its first bar other than the first, with a little silence before it."""
    first = int(rng.integers(1, song.beats_per_bar))
    silence_s = float(rng.uniform(0.02, 0.5))
    start = round((song.beat_times_s[first] - 0.01) * RATE_HZ)
    silence = np.zeros((round(silence_s * RATE_HZ), 2), np.float32)
    moved_s = song.beat_times_s[first:] - start / RATE_HZ + len(silence) / RATE_HZ
    return np.concatenate([silence, song.samples[start:]]), moved_s, numbers[first:]


def _with_breaks(song: SyntheticSong, rng: np.random.Generator) -> NDArray[np.float32]:
    """The song nearly silent for one or two bars, three times."""
    gain = np.ones(len(song.samples), np.float32)
    bars = np.rint(song.bar_times_s * RATE_HZ).astype(np.int64)
    for first in rng.choice(np.arange(2, len(bars) - 3), size=3):
        gain[bars[first] : bars[first + int(rng.integers(1, 3))]] = 10.0 ** (_BREAK_DB / 20.0)
    return song.samples * gain[:, None]


def drawn_song(seed: int, genres: Sequence[str] = tuple(STYLES), *, duration_s: float = 50.0) -> CountedSong:
    """A song of any genre and kind, drawn from the seed: threes are a third of all."""
    rng = np.random.default_rng([seed, 0])
    genre, kind = str(rng.choice(genres)), str(rng.choice(KINDS, p=_KIND_SHARES))
    return counted_song(genre, kind, seed=seed, duration_s=duration_s, others=genres)


_SHARES = {"steady": 3, "ramp": 2, "swing": 2, "wandering": 1.5, "three": 4, "six": 1.5, "pick-up": 1.5}
_KIND_SHARES = np.array([_SHARES.get(kind, 0.7) for kind in KINDS])
_KIND_SHARES /= _KIND_SHARES.sum()
