"""Songs of known form, to measure whether repeats and borders of phrases are found."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from choreograph.core.counts import Counts, numbers_in_bar
from content.songs.metre_styles import METRE_STYLES
from content.songs.synthesis.composition import Note, Section, Track, compose
from content.songs.synthesis.mixing import mix_tracks
from content.songs.synthesis.song import STYLES
from content.songs.synthesis.style import STEPS_PER_BEAT, Lane, SongStyle

# The seeds of the songs on which the detection was developed start at `FIRST_FORM_SEED`, those of the
# held-out songs at `FIRST_HELD_OUT_SEED`. No network was trained on any of them.


FIRST_FORM_SEED = 7000
FIRST_HELD_OUT_SEED = 7500
UNIT_BARS = 4  # a phrase of eight bars consists of two different units
_LEAD_IN_S = 0.4
_TAIL_BEATS = 4
_VELOCITY = (0.93, 1.05)  # no two repeats are played equally
_ENERGIES = (0.7, 0.85, 1.0)  # of varied repeats, some without a drum or an instrument
_LIFT = 2  # semitones


@dataclass(frozen=True, eq=False)
class FormAudio:
    """A rendered song, and its true form."""

    samples: NDArray[np.float32]  # (S, 2) at 44.1 kHz
    counts: Counts  # its beats
    ids: NDArray[np.int64]  # (Q,) of counts. Equal ids are the same music at the same place of its phrase
    borders_s: NDArray[np.float64]  # first count of each unit of four bars, without the first unit


@dataclass(frozen=True)
class FormSong:
    """Parameters of a song of known form."""

    letters: str  # its phrases in order
    genre: str  # of `STYLES` or `METRE_STYLES`
    seed: int
    phrase_bars: int = 4  # 4 or 8
    varied: bool = False  # repeats differ in instruments, and end with other fills
    lifted: bool = False  # the last phrase is two semitones higher
    pickup_beats: int = 0  # before the first bar

    @property
    def style(self) -> SongStyle:
        """Style of the synthesiser."""
        return METRE_STYLES[self.genre] if self.genre in METRE_STYLES else STYLES[self.genre]

    @property
    def name(self) -> str:
        """Form, genre and variations."""
        marks = [
            f"of {self.phrase_bars} bars",
            *(["varied"] if self.varied else []),
            *(["lifted"] if self.lifted else []),
            *([f"{self.pickup_beats} beats before"] if self.pickup_beats else []),
        ]
        return f"{self.letters} {self.genre} {', '.join(marks)}"

    def render(self) -> FormAudio:
        """Compose each phrase once, and arrange the song."""
        metre = self.style.beats_per_bar
        rng = np.random.default_rng([self.seed, 1])
        units = [(letter, half) for letter in self.letters for half in range(self.phrase_bars // UNIT_BARS)]
        books = {unit: self._composed(index) for index, unit in enumerate(dict.fromkeys(units))}
        unit_steps = UNIT_BARS * metre * STEPS_PER_BEAT
        first_step = self.pickup_beats * STEPS_PER_BEAT
        notes: dict[tuple[str, object], list[Note]] = {}
        seen: set[tuple[str, int]] = set()
        for place, unit in enumerate(units):
            energy = float(rng.choice(_ENERGIES)) if self.varied and unit in seen else 1.0
            lift = _LIFT if self.lifted and place >= len(units) - self.phrase_bars // UNIT_BARS else 0
            seen.add(unit)
            at = first_step + place * unit_steps
            for key, score in books[unit].items():
                source = key[1]
                if source.enters <= energy < source.leaves:
                    notes.setdefault(key, []).extend(_moved(score, at, lift, rng))
            if self.varied or unit[1] == self.phrase_bars // UNIT_BARS - 1:
                key, fill = self._fill(rng, at + unit_steps)
                notes.setdefault(key, []).extend(fill)
        if self.pickup_beats:
            key, fill = self._fill(rng, first_step)
            notes.setdefault(key, []).extend(note for note in fill if note.step >= 0)
        tracks = [Track(sound, source, tuple(score)) for (sound, source), score in notes.items()]
        return self._rendered(tracks, units)

    def _rendered(self, tracks: list[Track], units: list[tuple[str, int]]) -> FormAudio:
        metre = self.style.beats_per_bar
        n_beats = self.pickup_beats + len(units) * UNIT_BARS * metre
        low, high = self.style.bpm
        bpm = np.random.default_rng([self.seed, 2]).uniform(low, high)
        steps = np.arange((n_beats + _TAIL_BEATS) * STEPS_PER_BEAT + 1) / STEPS_PER_BEAT
        samples = mix_tracks(self.style, tracks, _LEAD_IN_S + steps * 60.0 / bpm)
        times_s = _LEAD_IN_S + np.arange(n_beats) * 60.0 / bpm
        numbers = numbers_in_bar(n_beats + metre, metre)[metre - self.pickup_beats :][:n_beats]
        kinds = list(dict.fromkeys(units))
        unit_counts = UNIT_BARS * metre
        ids = [kinds.index(unit) * unit_counts + i for unit in units for i in range(unit_counts)]
        before = -1 - np.arange(self.pickup_beats)  # the pickup is not repeated
        starts = self.pickup_beats + unit_counts * np.arange(1, len(units))
        counts = Counts(times_s, numbers, metre, "synthesis", 1.0)
        return FormAudio(samples, counts, np.r_[before, ids].astype(np.int64), times_s[starts])

    def _composed(self, index: int) -> dict[tuple[str, Lane], list[Note]]:
        """The notes of a unit by sound and source, in the key and with the sounds of the first unit."""
        style = self.style
        rng = np.random.default_rng([self.seed, 3, index])
        words = sorted({word for text in style.progressions for word in text.split()})
        own = replace(style, progressions=(" ".join(rng.choice(words, UNIT_BARS)),))
        section = [Section("verse", 0, UNIT_BARS, 1.0)]
        sounds = {t.source: t.sound for t in compose(own, section, np.random.default_rng([self.seed, 4, 0]))}
        tonics = [int(np.random.default_rng([self.seed, 4, i]).integers(12)) for i in (0, index)]
        shift = (tonics[0] - tonics[1] + 5) % 12 - 5
        last = UNIT_BARS * style.steps_per_bar
        return {
            (sounds.get(track.source, track.sound), track.source): [
                replace(note, midi=note.midi + shift if note.midi else 0)
                for note in track.notes
                if note.step < last
            ]
            for track in compose(own, section, np.random.default_rng([self.seed, 4, index]))
        }

    def _fill(self, rng: np.random.Generator, end_step: int) -> tuple[tuple[str, Lane], list[Note]]:
        """A fill in the bar before a step."""
        drum, pattern = self.style.fills[int(rng.integers(len(self.style.fills)))]
        first = end_step - len(pattern)
        notes = [Note(first + i, 0, 0, 0.7) for i, letter in enumerate(pattern) if letter not in ".-"]
        return (drum, Lane(drum, (pattern,), db=-9.0, pan=0.15)), notes


def _moved(score: list[Note], at: int, lift: int, rng: np.random.Generator) -> list[Note]:
    """Notes later in the song, higher, and slightly louder or softer."""
    return [
        Note(
            note.step + at,
            note.steps,
            note.midi + lift if note.midi else 0,
            float(np.clip(note.velocity * rng.uniform(*_VELOCITY), 0.1, 1.0)),
        )
        for note in score
    ]


def _songs(first_seed: int) -> tuple[FormSong, ...]:
    """One song of each kind, in other genres for other seeds."""
    genres = sorted(STYLES)
    metres = sorted(METRE_STYLES)
    rng = np.random.default_rng(first_seed)
    order = [str(genre) for genre in rng.permutation(genres)]
    kinds = [
        dict(letters="ABAB", phrase_bars=8),
        dict(letters="AABA", phrase_bars=8),
        dict(letters="ABACA", phrase_bars=4),
        dict(letters="AAAA", phrase_bars=8),
        dict(letters="ABABCB", phrase_bars=4, varied=True),
        dict(letters="AABABA", phrase_bars=4, varied=True),
        dict(letters="ABABB", phrase_bars=8, lifted=True),
        dict(letters="ABCDEFGH", phrase_bars=4),
        dict(letters="ABCD", phrase_bars=8),
        dict(letters="AABBA", phrase_bars=4, pickup_beats=2),
        dict(letters="ABCABC", phrase_bars=4, varied=True, pickup_beats=1),
    ]
    songs = [
        FormSong(genre=order[i % len(order)], seed=first_seed + i, **kind) for i, kind in enumerate(kinds)
    ]
    songs.append(FormSong("AABA", "waltz", first_seed + 20, 8))
    songs.append(FormSong("ABCB", "waltz", first_seed + 21, 4))
    for i, metre in enumerate(rng.permutation(metres)[:3]):
        songs.append(FormSong("ABAB", str(metre), first_seed + 22 + i, 4))
    return tuple(songs)


DEVELOPED_ON = _songs(FIRST_FORM_SEED)
HELD_OUT_FORMS = _songs(FIRST_HELD_OUT_SEED)
