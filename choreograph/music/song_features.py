"""`SongFeatures`, the features of a song per second: energy, stops, tempo-density, and `Places` by name."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from choreograph.core.arguments import as_index
from choreograph.core.counts import Counts
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import AnyFloats, Floats, frame_blocks
from choreograph.core.progress import one_line
from choreograph.core.timebase import MUSIC_FPS, NET_FPS, SAMPLE_RATE_HZ, SEGMENT_FRAMES, frame_times_s
from choreograph.music.form import Form, Phrase, Sections

# `SongFeatures`, the features of a song per second that the engines use for planning.


@dataclass(frozen=True, eq=False)
class SongFeatures:
    """Features of a song, which costs receive. S is its number of seconds, rounded up.

    Examples
    --------
    >>> class AsLoud(cg.Cost):
    ...     def node(self, layer, song_features):
    ...         return np.abs(layer.liveliness - song_features.energy[layer.second])
    >>> dance = cg.dance(cg.example_songs()["house"], duration_s=8, costs=[AsLoud()])
    >>> len(dance.plan.seconds)
    8
    """

    name: str
    """Name of the song."""

    duration_s: float
    """Length of the song in seconds."""

    counts: Counts
    """The beats, numbered in their bars."""

    style: NDArray[np.float32]
    """(S, 32) style vector of the music from each second on."""

    beat_count: NDArray[np.float32]
    """(S,) motion beats expected in the 4 s from each second on."""

    density: NDArray[np.float32]
    """(S, 80) target tempo-density of the 4 s from each second on, at 20 fps."""

    sections: Sections
    """The sections of the song, and which of them are the same music."""

    energy: NDArray[np.float32]
    """(S,) from 0 to 1, from the soft level of the song to its loud one (`energy_per_second`)."""

    opening_s: float
    """Time of the first count that is danced, in seconds. Before it, the first pose is held."""

    closing_s: float
    """Time of the last count that is danced, in seconds."""

    onset_density: NDArray[np.float32]
    """(S,) onsets in the 4 s from each second on, as a rank in the song from 0 to 1."""

    off_beat: float = 1.0
    """Share of the percussion that is between the beats (`off_beat_share`), from 0 to 1."""

    form: Form = field(default_factory=Form.empty)
    """The phrases of the song, and which of them repeat others."""

    stops_s: tuple[tuple[float, float], ...] = ()
    """From when a dance rests to when it moves again, in seconds, for each silence of whole bars."""

    __repr__ = one_line

    @property
    def beat_times_s(self) -> NDArray[np.float64]:
        """The beats in seconds, (Q,)."""
        return self.counts.times_s

    @property
    def n_seconds(self) -> int:
        """Number of seconds S. The last may be shorter."""
        return len(self.style)

    def section_at(self, second: int) -> str:
        """The name of the section in the middle of a second, A or another letter, or "" without sections.

        Sections with one name are the same music repeated. Raises `ParameterError` if the song has no such
        second.
        """
        middle_s = as_index("a second", second, self.n_seconds) + 0.5
        index = int(np.searchsorted(self.sections.bounds_s[1:-1], middle_s, side="right"))
        return self.sections.names[index] if len(self.sections) else ""

    def phrase_at(self, second: int) -> Phrase | None:
        """The phrase in the middle of a second, or None between phrases and without them.

        Raises `ParameterError` if the song has no such second.
        """
        middle_s = as_index("a second", second, self.n_seconds) + 0.5
        return next((p for p in self.form.phrases if p.start_s <= middle_s < p.end_s), None)


# Energy of a song, by which a dance is larger or smaller: its level, bass and brightness relative to its own.


_SPAN_S = 5  # of the moving median, which keeps phrases and removes beats, bangs and short pauses
_SILENT_DB = 60.0  # below the loudest second. Quieter seconds are silent
_BASS_HZ, _BRIGHT_HZ = 150.0, 2000.0  # below the first is the bass, and above the second the brightness
# The least range of level, bass, brightness and density of onsets, in dB. Smaller differences remain small.
# The break of a mastered song is 4 to 6 dB below its chorus.
_RANGES_DB = np.array([6.0, 12.0, 12.0, 3.0])
_WIDEST_DB = 24.0  # the greatest range. A song that fades in from silence still has soft parts
_SHARES = np.array([0.5, 0.2, 0.15, 0.15])  # of the energy, of the same four
_INAUDIBLE = 1e-4  # of the song's greatest power. Weaker bass or brightness does not count
_PERCENTILES = 5, 95  # of the seconds with sound, between which the energy rises from 0 to 1


def energy_per_second(
    samples: NDArray[np.floating], n_seconds: int, onsets: NDArray[np.floating] | None = None
) -> NDArray[np.float32]:
    """Energy (S,) of each second of a song, mono at 22.05 kHz, from 0 to 1.

    It is the weighted mean of the level, the level of the bass, that of the brightness, and the density of
    onsets, each relative to percentiles of the song: 1 at the 95th and 0 at the 5th, or at the least range
    below the 95th. One bang therefore does not lower the energy of all other seconds, and a song of one
    loudness has an energy near 1. Silent seconds have energy 0.

    `onsets` (T,) is the onset strength at 60 fps (`music.mel.onset_envelopes`). Without it, there are only
    the levels.
    """
    n_samples = min(len(samples), n_seconds * SAMPLE_RATE_HZ)
    hz = scipy.fft.rfftfreq(SAMPLE_RATE_HZ, 1 / SAMPLE_RATE_HZ)
    # Of power, in the bass and in the brightness, as by Butterworth filters of the second order.
    shares = np.stack([1 / (1 + (hz / _BASS_HZ) ** 4), 1 - 1 / (1 + (hz / _BRIGHT_HZ) ** 4)])  # (2, F)
    power = np.zeros((n_seconds, 4))
    for second in range(n_seconds):
        # Of a last second that is not full, the second that ends with the song.
        start = max(0, min(second * SAMPLE_RATE_HZ, n_samples - SAMPLE_RATE_HZ))
        part = samples[start : min(start + SAMPLE_RATE_HZ, n_samples)]
        padded = np.zeros(SAMPLE_RATE_HZ)
        padded[: len(part)] = part
        power[second, 0] = np.square(padded).mean()
        spectrum = np.abs(scipy.fft.rfft(padded)) / SAMPLE_RATE_HZ
        power[second, 1:3] = 2 * shares @ np.square(spectrum)
    if not power.any():
        return np.zeros(n_seconds, np.float32)
    power = scipy.ndimage.median_filter(power, (_SPAN_S, 1), mode="nearest")
    power[:, 1:3] += _INAUDIBLE * power[:, 0].max()
    level_db = 10.0 * np.log10(power + 1e-12)  # (S, 4)
    if onsets is not None:
        borders = np.minimum(np.arange(n_seconds) * MUSIC_FPS, len(onsets) - 1)
        sums = np.add.reduceat(np.asarray(onsets, np.float64), borders)
        level_db[:, 3] = 10.0 * np.log10(
            scipy.ndimage.median_filter(sums, _SPAN_S, mode="nearest") / MUSIC_FPS + 1e-3
        )
    sounding = level_db[:, 0] > level_db[:, 0].max() - _SILENT_DB
    soft_db, loud_db = np.percentile(level_db[sounding], _PERCENTILES, axis=0)
    parts = 1.0 + (level_db - loud_db) / np.clip(loud_db - soft_db, _RANGES_DB, _WIDEST_DB)
    weights = _SHARES[: 3 if onsets is None else 4]
    energy = np.clip(parts[:, : len(weights)], 0.0, 1.0) @ weights / weights.sum() * sounding
    per_second: NDArray[np.float32] = energy.astype(np.float32)
    return per_second


# Stops: silences within a song, for which a dance stands still.


_LEVEL_FPS = 20  # of the level by which silences are found
_AROUND_S = 4.0  # to each side, the loudest part of which a silence is relative to
_SILENCE_DB = 36.0  # below it
_SHORTEST_SILENCE_S = 0.8
_SHORTEST_STOP_S = 1.0  # and the least time between two stops
_ATTACK_S = 0.06  # within which a sound at a count begins
# From a count that sounds until the pose is reached, or before a silent one. After a stop, the dance is at
# full speed as long after, or before, count 1.
_AFTER_S, _BEFORE_S = 0.1, 0.05


def stops_s(samples: NDArray[np.floating], counts: Counts) -> tuple[tuple[float, float], ...]:
    """The stops of a song, mono at 22.05 kHz: from when a dance rests, and until when it moves again.

    A stop is a silence of 0.8 s or more between sounds. Its end is the next count 1 on which the music has
    returned, and it lasts whole bars, so that counts remain in order. The pose is reached just after a count
    that sounds, or just before a silent one. Without bars, there are no stops.
    """
    downbeats_s = counts.downbeat_times_s
    found: list[tuple[float, float]] = []
    for start_s, end_s in _silences_s(samples):
        returns = np.searchsorted(downbeats_s, end_s - _ATTACK_S)
        starts = np.abs(downbeats_s - (start_s - _ATTACK_S)).argmin() if len(downbeats_s) else 0
        if returns == len(downbeats_s) or starts >= returns:
            continue
        first_s, last_s = float(downbeats_s[starts]), float(downbeats_s[returns])
        sounds = first_s < start_s - _ATTACK_S
        shift_s = _AFTER_S if sounds else -_BEFORE_S
        stop_s = (round(first_s + shift_s, 3), round(last_s + shift_s, 3))
        before_s = found[-1][1] if found else 0.0
        if min(stop_s[1] - stop_s[0], stop_s[0] - before_s) >= _SHORTEST_STOP_S:
            found.append(stop_s)
    return tuple(found)


def _silences_s(samples: NDArray[np.floating]) -> list[tuple[float, float]]:
    """The silences between sounds, in seconds."""
    size = SAMPLE_RATE_HZ // _LEVEL_FPS
    n_frames = len(samples) // size
    power = np.empty(n_frames)
    for block in frame_blocks(n_frames):
        frames = samples[block.start * size : block.stop * size].reshape(-1, size)
        power[block] = np.square(frames, dtype=np.float64).mean(axis=1)
    if not power.any():
        return []
    loudest = scipy.ndimage.maximum_filter1d(power, 2 * round(_AROUND_S * _LEVEL_FPS) + 1, mode="nearest")
    silent = np.r_[False, power <= loudest * 10.0 ** (-_SILENCE_DB / 10.0), False]
    borders = np.flatnonzero(np.diff(silent.astype(np.int8))).reshape(-1, 2) / _LEVEL_FPS
    longest_s = n_frames / _LEVEL_FPS
    return [
        (float(start_s), float(end_s))
        for start_s, end_s in borders
        if end_s - start_s >= _SHORTEST_SILENCE_S and start_s > 0 and end_s < longest_s
    ]


# The analytic tempo-density, a Gaussian bump on every beat of the motion or of the music.
#
# It is the baseline and fallback for the learned one (`nets.density`). Both have the same two functions, one
# curve per take at 20 fps, and one per second of music for the 4 s from there.


BUMP_S = 0.08  # standard deviation of a bump


def bumps(times_s: NDArray[np.floating], beat_times_s: NDArray[np.floating]) -> NDArray[np.float32]:
    """The density at `times_s` (T,): 1 at every beat, falling towards 0 between beats."""
    if len(beat_times_s) == 0:
        return np.zeros(len(times_s), np.float32)
    after = np.searchsorted(beat_times_s, times_s)
    nearest = [beat_times_s[np.clip(after + side, 0, len(beat_times_s) - 1)] for side in (-1, 0)]
    near = np.minimum(*(np.abs(times_s - beat) for beat in nearest))  # (T,)
    return np.exp(-0.5 * (near / BUMP_S) ** 2).astype(np.float32)


def motion_density(n_frames: int, beat_times_s: NDArray[np.floating]) -> NDArray[np.float32]:
    """Tempo-density of a take, (T,) at 20 fps, from its motion beats in seconds."""
    return bumps(frame_times_s(n_frames, NET_FPS), beat_times_s)


def music_density(n_seconds: int, beat_times_s: NDArray[np.floating]) -> NDArray[np.float32]:
    """Target tempo-density of the 4 s from each second, (S, 80) at 20 fps, from the music's beats."""
    times = np.arange(n_seconds)[:, None] + frame_times_s(SEGMENT_FRAMES, NET_FPS)  # (S, 80)
    return bumps(times.ravel(), beat_times_s).reshape(times.shape)


# Places of a song by name: bars, phrases, sections, choruses and verses, as times or spans in seconds.

_NAMES = ("bar", "phrase", "section", "chorus", "verse")
PLACE = re.compile(rf"\b({'|'.join(_NAMES)})\s*(\d+)\b", re.IGNORECASE)
Span = tuple[float, float]


def names_place(text: str) -> bool:
    """Whether a text names a place of a song, such as `bar 9` or `chorus 2`."""
    return PLACE.search(text.partition("=")[0]) is not None


@dataclass(frozen=True)
class Places:
    """The spans of a song that have names, each numbered from 1."""

    spans_s: dict[str, tuple[Span, ...]]  # by "bar", "phrase", "section", "chorus" and "verse"

    @classmethod
    def of_song(cls, features: SongFeatures) -> Places:
        """Those of a song. The chorus is the music that returns with the most energy, the verse the next."""
        sections = tuple(pairwise(features.sections.bounds_s.tolist()))
        chorus, verse = chorus_and_verse(features.sections, features.energy)
        labels = features.sections.labels.tolist()
        return cls(
            {
                "bar": bar_spans_s(features.counts.downbeat_times_s, features.duration_s),
                "phrase": tuple((phrase.start_s, phrase.end_s) for phrase in features.form.phrases),
                "section": sections,
                "chorus": tuple(s for s, label in zip(sections, labels, strict=True) if label == chorus),
                "verse": tuple(s for s, label in zip(sections, labels, strict=True) if label == verse),
            }
        )

    def span_s(self, name: str, number: int) -> Span:
        """The span of a place. Raises `ParameterError` if the song has none of this number."""
        spans = self.spans_s.get(name, ())
        if not 1 <= number <= len(spans):
            known = f"{name} 1 to {len(spans)}" if spans else f"a song in which a {name} was found"
            cure = "" if spans else ": write the time in seconds"
            raise ParameterError(f"expected {known}, got {name} {number}{cure}")
        return spans[number - 1]

    def in_seconds(self, text: str, *, is_span: bool = False) -> str:
        """A text with the starts of places in seconds instead of their names.

        What follows an equals sign remains as it is. If a span is expected and one place is named, the result
        is its start and its end, as `12.000000-20.000000`. Raises as `span_s`.
        """
        times, equals, rest = text.partition("=")
        whole = PLACE.fullmatch(times.strip())
        if whole and is_span:
            start_s, end_s = self.span_s(whole[1].lower(), int(whole[2]))
            return f"{start_s:.6f}-{end_s:.6f}{equals}{rest}"

        def start(found: re.Match[str]) -> str:
            return f"{self.span_s(found[1].lower(), int(found[2]))[0]:.6f}"

        return PLACE.sub(start, times) + equals + rest


def bar_spans_s(downbeats_s: Floats | Sequence[float], duration_s: float) -> tuple[Span, ...]:
    """The spans of the bars of a song from its downbeats (D,). The last one ends with the song."""
    return tuple(pairwise([*(float(s) for s in downbeats_s), float(duration_s)])) if len(downbeats_s) else ()


def chorus_and_verse(sections: Sections, energy: AnyFloats) -> tuple[int, int]:
    """The labels of the chorus and the verse of a song with the energy (S,) of its seconds, -1 for none.

    They are the two of greatest mean energy among the labels that occur more than once.
    """
    labels, seconds = sections.labels, np.arange(len(energy)) + 0.5
    loud: dict[int, float] = {}
    for label in dict.fromkeys(labels.tolist()):
        own = np.zeros(len(energy), bool)
        for index in np.flatnonzero(labels == label):
            own |= (seconds >= sections.bounds_s[index]) & (seconds < sections.bounds_s[index + 1])
        if (labels == label).sum() > 1 and own.any():
            loud[label] = float(np.asarray(energy, np.float64)[own].mean())
    ranked = [*sorted(loud, key=lambda label: -loud[label]), -1, -1]
    return ranked[0], ranked[1]
