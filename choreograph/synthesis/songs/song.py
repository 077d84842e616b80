"""`render_song`: a song whose beats, bars and sections are known exactly; `write_song` writes it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import ChoreographError, ParameterError
from choreograph.files import atomic_path
from choreograph.synthesis.songs.arrangement import Section, form
from choreograph.synthesis.songs.composition import compose
from choreograph.synthesis.songs.genres import STYLES
from choreograph.synthesis.songs.mixing import mix_tracks
from choreograph.synthesis.songs.style import STEPS_PER_BEAT, SongStyle
from choreograph.synthesis.songs.tempo import (
    TempoMap,
    apply_swing,
    beats_within,
    checked_swing,
    tempo_map_from,
)
from choreograph.synthesis.songs.voices import RATE_HZ

_FASTEST_LONG_BAR_S = 1.7  # shorter bars are grouped in phrases of 8, longer ones of 4
_FORMATS = {".flac": ("FLAC", "PCM_16"), ".wav": ("WAV", "PCM_16"), ".ogg": ("OGG", "VORBIS")}


@dataclass(frozen=True, eq=False)
class SyntheticSong:
    """A rendered song with its ground truth.

    The last beat is the downbeat after the last bar: the closing chord, which rings out. So bar i is
    between `bar_times_s[i]` and `bar_times_s[i + 1]`.
    """

    samples: NDArray[np.float32]  # (S, 2) at 44.1 kHz
    genre: str
    beat_times_s: NDArray[np.float64]  # (Q,), each on a sample
    beats_per_bar: int
    sections: tuple[Section, ...]
    tempo: TempoMap  # in beats from the first beat
    swing: float
    seed: int

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
    bpm : beats per minute; None: the middle of the genre's range
    n_bars, duration_s : length; give one of them. A duration is rounded to an even number of bars. The
        closing chord rings for another bar and 1.5 s
    seed : determines key, chords, motifs, sounds and velocities; the same seed gives the same samples
    swing : 0 (straight) to 1 (triplets); None: the genre's swing
    ramp_to_bpm : tempo at the end of a ramp that is linear in time
    tempo_map : (beat, BPM) points instead of `bpm` and `ramp_to_bpm`; see `TempoMap`
    lead_in_s : silence before the first beat
    sections : the form, from bar 0 to `n_bars` without a gap; None: by the number of bars

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

    `compression_level`, 0 (large) to 1 (small), is the codec's scale; None: its default. The bytes of an .ogg
    differ from write to write by the stream's random serial number; its sound does not. Raises
    `ParameterError` for another suffix or a missing folder; `ChoreographError` if it cannot be written.
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
