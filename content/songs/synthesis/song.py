"""`render_song` makes a song with known beats, bars and sections, and `write_song` writes it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from choreograph.core.errors import ChoreographError, ParameterError
from choreograph.core.files import atomic_path
from content.songs.synthesis.ballroom import SWING, TANGO, WALTZ
from content.songs.synthesis.club import DISCO, FUNK, HOUSE
from content.songs.synthesis.composition import Section, compose, form
from content.songs.synthesis.latin import CHA_CHA, RUMBA, SALSA
from content.songs.synthesis.mixing import mix_tracks
from content.songs.synthesis.slow import CONTEMPORARY, HIP_HOP
from content.songs.synthesis.sounds import RATE_HZ
from content.songs.synthesis.style import STEPS_PER_BEAT, SongStyle

# Beat times: tempo maps with steady parts and ramps, and swing, in closed form.


_SLOWEST_BPM, _FASTEST_BPM = 20.0, 400.0


@dataclass(frozen=True)
class TempoMap:
    """Tempo at given beats. Between two of them it changes linearly in time.

    Beat 0 is at 0 s. Before the first and after the last point the tempo is constant.
    """

    points: tuple[tuple[float, float], ...]  # (beat, BPM), beats increasing

    def __post_init__(self) -> None:
        beats = [beat for beat, _ in self.points]
        if not beats or any(b <= a for a, b in pairwise(beats)):
            raise ParameterError(f"expected a tempo map with increasing beats, got {beats}")
        for _, bpm in self.points:
            if not _SLOWEST_BPM <= bpm <= _FASTEST_BPM:
                raise ParameterError(
                    f"expected a tempo of {_SLOWEST_BPM:.0f} to {_FASTEST_BPM:.0f} BPM, got {bpm:g}"
                )

    @classmethod
    def steady(cls, bpm: float) -> TempoMap:
        """One tempo throughout."""
        return cls(((0.0, bpm),))

    @classmethod
    def ramp(cls, from_bpm: float, to_bpm: float, n_beats: float) -> TempoMap:
        """From one tempo to another over `n_beats`, linearly in time."""
        return cls(((0.0, from_bpm), (float(n_beats), to_bpm)))

    def seconds(self, beats: ArrayLike) -> NDArray[np.float64]:
        """Times of (fractional) beats in seconds, negative for beats before 0."""
        beats = np.asarray(beats, np.float64)
        times_s: NDArray[np.float64] = self._from_first_point(beats) - self._from_first_point(np.zeros(1))[0]
        return times_s

    def bpm_at(self, beats: ArrayLike) -> NDArray[np.float64]:
        """Tempo at (fractional) beats."""
        knots, bpm = self._arrays()
        # The square of the tempo is linear in beats when the tempo is linear in time.
        return np.sqrt(np.interp(np.asarray(beats, np.float64), knots, bpm**2))

    def _from_first_point(self, beats: NDArray[np.float64]) -> NDArray[np.float64]:
        knots, bpm = self._arrays()
        spans_s = 120.0 * np.diff(knots) / (bpm[1:] + bpm[:-1])
        starts_s = np.concatenate([[0.0], np.cumsum(spans_s)])
        piece = np.clip(np.searchsorted(knots, beats, side="right") - 1, 0, len(knots) - 1)
        here = self.bpm_at(np.maximum(beats, knots[0]))
        return starts_s[piece] + 120.0 * (beats - knots[piece]) / (bpm[piece] + here)

    def _arrays(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        points = np.asarray(self.points, np.float64)
        return points[:, 0], points[:, 1]


def apply_swing(beats: ArrayLike, swing: float, unit_beats: float = 0.5) -> NDArray[np.float64]:
    """Beats with every second unit delayed: 0 straight, 1 triplets (two thirds of the way).

    Each pair of units is warped piecewise linearly, so beats stay in place and times between two units
    move along.
    """
    beats = np.asarray(beats, np.float64)
    pair = 2.0 * unit_beats
    whole = np.floor(beats / pair + 1e-9)
    inside = beats / pair - whole  # 0 … 1 within the pair
    late = 0.5 + swing / 6.0
    return pair * (whole + np.interp(inside, [0.0, 0.5, 1.0], [0.0, late, 1.0]))


def beats_within(tempo: TempoMap, duration_s: float) -> float:
    """Number of beats in the first `duration_s` of the map."""
    low, high = 0.0, duration_s * _FASTEST_BPM / 60.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if tempo.seconds([middle])[0] < duration_s else (low, middle)
    return low


def checked_swing(swing: float) -> float:
    """The swing, if it is from 0 to 1. Raises `ParameterError` otherwise."""
    if not 0.0 <= swing <= 1.0:
        raise ParameterError(f"expected a swing from 0 (straight) to 1 (triplets), got {swing:g}")
    return float(swing)


def tempo_map_from(
    bpm: float, ramp_to_bpm: float | None, tempo_map: Sequence[tuple[float, float]] | None, n_beats: float
) -> TempoMap:
    """The tempo map of a song's arguments. `tempo_map` takes precedence over `bpm`."""
    if tempo_map is not None:
        return TempoMap(tuple((float(beat), float(value)) for beat, value in tempo_map))
    return TempoMap.steady(bpm) if ramp_to_bpm is None else TempoMap.ramp(bpm, ramp_to_bpm, n_beats)


# Song styles of the genres, by name.


_ALL = (HOUSE, HIP_HOP, DISCO, FUNK, CONTEMPORARY, CHA_CHA, SALSA, RUMBA, TANGO, WALTZ, SWING)
STYLES: dict[str, SongStyle] = {style.name: style for style in _ALL}


# `render_song` makes a song whose beats, bars and sections are known exactly. `write_song` writes it.


_FASTEST_LONG_BAR_S = 1.7  # shorter bars are grouped in phrases of 8, longer ones of 4
_FORMATS = {".flac": ("FLAC", "PCM_16"), ".wav": ("WAV", "PCM_16"), ".ogg": ("OGG", "VORBIS")}


@dataclass(frozen=True, eq=False)
class SyntheticSong:
    """A rendered song with its ground truth.

    The last beat is the downbeat after the last bar: the closing chord, which rings out. So bar i is
    between `bar_times_s[i]` and `bar_times_s[i + 1]`.
    """

    samples: NDArray[np.float32]  # (S, 2) at 44.1 kHz
    genre: str  # of its style
    beat_times_s: NDArray[np.float64]  # (Q,), each on a sample
    beats_per_bar: int  # its metre
    sections: tuple[Section, ...]  # in order, without gaps
    tempo: TempoMap  # in beats from the first beat
    swing: float  # 0 (straight) to 1 (triplets)
    seed: int  # of everything that is drawn at random

    @property
    def duration_s(self) -> float:
        """Length of the samples, in seconds."""
        return len(self.samples) / RATE_HZ

    @property
    def n_bars(self) -> int:
        """Number of bars, without the closing downbeat."""
        return (len(self.beat_times_s) - 1) // self.beats_per_bar

    @property
    def bar_times_s(self) -> NDArray[np.float64]:
        """Downbeats in seconds, (n_bars + 1,)."""
        return self.beat_times_s[:: self.beats_per_bar]

    def truth(self) -> dict[str, Any]:
        """The ground truth of the song, JSON-serialisable."""
        bpm = self.tempo.bpm_at(np.arange(len(self.beat_times_s)))
        bars = self.bar_times_s
        return {
            "genre": self.genre,
            "seed": self.seed,
            "swing": self.swing,
            "beats_per_bar": self.beats_per_bar,
            "duration_s": self.duration_s,
            "beat_times_s": self.beat_times_s.tolist(),
            "bar_times_s": bars.tolist(),
            "bpm_at_beats": np.round(bpm, 4).tolist(),
            "sections": [
                {
                    "name": section.name,
                    "first_bar": section.first_bar,
                    "bars": section.bars,
                    "energy": section.energy,
                    "start_s": float(bars[section.first_bar]),
                    "end_s": float(bars[section.first_bar + section.bars]),
                }
                for section in self.sections
            ],
        }


def render_song(
    style: SongStyle | str,
    *,
    bpm: float | None = None,
    n_bars: int | None = None,
    duration_s: float | None = None,
    seed: int = 0,
    swing: float | None = None,
    ramp_to_bpm: float | None = None,
    tempo_map: Sequence[tuple[float, float]] | None = None,
    lead_in_s: float = 0.25,
    sections: Sequence[Section] | None = None,
) -> SyntheticSong:
    """Compose and render a song.

    Parameters
    ----------
    style : a `SongStyle`, or a genre's name in `STYLES`
    bpm : beats per minute, by default the middle of the genre's range
    n_bars, duration_s : length. Give one of them. A duration is rounded to an even number of bars. The
        closing chord rings for another bar and 1.5 s
    seed : determines key, chords, motifs, sounds and velocities. The same seed gives the same samples
    swing : 0 (straight) to 1 (triplets), by default the genre's swing
    ramp_to_bpm : tempo at the end of a ramp that is linear in time
    tempo_map : (beat, BPM) points instead of `bpm` and `ramp_to_bpm`. See `TempoMap`
    lead_in_s : silence before the first beat
    sections : the form, from bar 0 to `n_bars` without a gap. By default, it follows from the number of bars

    Returns
    -------
    SyntheticSong   stereo, about -14 LUFS, with beats, bars, sections and tempo

    Raises
    ------
    ParameterError   an unknown genre, a negative seed, a tempo outside 20 to 400 BPM, a swing outside
                     0 to 1, not exactly one length, a length below two bars, or sections that do not
                     fill it
    """
    style = _checked_style(style)
    if seed < 0:
        raise ParameterError(f"expected a seed of 0 or more, got {seed}")
    swing = checked_swing(style.swing if swing is None else swing)
    bpm = float(np.mean(style.bpm)) if bpm is None else float(bpm)
    n_bars, tempo = _length(style, bpm, n_bars, duration_s, ramp_to_bpm, tempo_map)
    if not (np.isfinite(lead_in_s) and lead_in_s >= 0.0):
        raise ParameterError(f"expected a lead-in of 0 s or more, got {lead_in_s:g}")
    n_beats = n_bars * style.beats_per_bar
    bar_s = float(tempo.seconds([n_beats])[0]) / n_bars
    if sections is None:
        sections = form(n_bars, 8 if bar_s < _FASTEST_LONG_BAR_S and n_bars >= 16 else 4)
    sections = _checked_sections(sections, n_bars)
    tracks = compose(style, sections, np.random.default_rng([seed, *style.name.encode()]))
    steps = np.arange(STEPS_PER_BEAT * (n_beats + style.beats_per_bar) + 1) / STEPS_PER_BEAT
    step_s = lead_in_s + tempo.seconds(apply_swing(steps, swing, style.swing_unit_beats))
    beats = np.rint(step_s[: STEPS_PER_BEAT * n_beats + 1 : STEPS_PER_BEAT] * RATE_HZ) / RATE_HZ
    samples = mix_tracks(style, tracks, step_s)
    return SyntheticSong(samples, style.name, beats, style.beats_per_bar, sections, tempo, swing, seed)


def _checked_style(style: SongStyle | str) -> SongStyle:
    if isinstance(style, SongStyle):
        return style
    if style not in STYLES:
        raise ParameterError(f"expected a genre among {', '.join(STYLES)}, got {style!r}")
    return STYLES[style]


def _checked_sections(sections: Sequence[Section], n_bars: int) -> tuple[Section, ...]:
    bar = 0
    for section in sections:
        if section.first_bar != bar or section.bars < 1:
            raise ParameterError(f"expected a section of 1 or more bars from bar {bar} on, got {section}")
        bar += section.bars
    if bar != n_bars:
        raise ParameterError(f"expected sections of {n_bars} bars in all, got {bar}")
    return tuple(sections)


def _length(
    style: SongStyle,
    bpm: float,
    n_bars: int | None,
    duration_s: float | None,
    ramp_to_bpm: float | None,
    tempo_map: Sequence[tuple[float, float]] | None,
) -> tuple[int, TempoMap]:
    """The number of bars and the tempo map."""
    if (n_bars is None) == (duration_s is None):
        raise ParameterError("expected either n_bars or duration_s, got both or neither")
    if duration_s is not None:
        if not (np.isfinite(duration_s) and duration_s > 0.0):
            raise ParameterError(f"expected a duration in seconds above 0, got {duration_s:g}")
        mean_bpm = bpm if ramp_to_bpm is None else 0.5 * (bpm + ramp_to_bpm)
        beats = duration_s * mean_bpm / 60.0  # a ramp linear in time has as many beats as its mean tempo
        if tempo_map is not None:
            beats = beats_within(tempo_map_from(bpm, None, tempo_map, 1.0), duration_s)
        n_bars = 2 * round(beats / style.beats_per_bar / 2.0)
    if n_bars is None or n_bars < 2:
        raise ParameterError(f"expected a song of two bars or more, got {n_bars} bars")
    return n_bars, tempo_map_from(bpm, ramp_to_bpm, tempo_map, n_bars * style.beats_per_bar)


def write_song(
    path: str | Path,
    song: SyntheticSong,
    *,
    truth_path: str | Path | None = None,
    compression_level: float | None = None,
) -> None:
    """Write the samples as .flac, .wav (16 bit) or .ogg (Vorbis), and optionally the ground truth as JSON.

    `compression_level` is the codec's, 0 (large) to 1 (small), by default the codec's own. The bytes of an
    .ogg differ from write to write by the stream's random serial number. Its sound does not. Raises
    `ParameterError` for another suffix or a missing folder, and `ChoreographError` if the file cannot be
    written.
    """
    import soundfile

    path = Path(path)
    if path.suffix.lower() not in _FORMATS:
        raise ParameterError(f"expected a song file of {', '.join(_FORMATS)}, got {path.name!r}")
    kind, subtype = _FORMATS[path.suffix.lower()]
    options = {} if compression_level is None else {"compression_level": compression_level}
    with atomic_path(path) as temporary:
        try:
            with soundfile.SoundFile(temporary, "w", RATE_HZ, 2, subtype, format=kind, **options) as file:
                for start in range(0, len(song.samples), RATE_HZ):  # libvorbis overflows on long blocks
                    file.write(song.samples[start : start + RATE_HZ])
        except soundfile.LibsndfileError as error:
            raise ChoreographError(f"cannot write {path}: {error}") from error
    if truth_path is not None:
        with atomic_path(truth_path) as temporary:
            temporary.write_text(json.dumps(song.truth(), indent=1) + "\n", encoding="utf-8")
