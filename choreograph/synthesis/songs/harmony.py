"""Keys, chord symbols and voice leading."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np

from choreograph.errors import ParameterError

SCALES: dict[str, tuple[int, ...]] = {  # semitones above the tonic
    "major": (0, 2, 4, 5, 7, 9, 11),
    "minor": (0, 2, 3, 5, 7, 8, 10),
    "harmonic minor": (0, 2, 3, 5, 7, 8, 11),
    "dorian": (0, 2, 3, 5, 7, 9, 10),
    "mixolydian": (0, 2, 4, 5, 7, 9, 10),
    "minor pentatonic": (0, 3, 5, 7, 10),
    "major pentatonic": (0, 2, 4, 7, 9),
    "blues": (0, 3, 5, 6, 7, 10),
}
_QUALITIES: dict[str, tuple[int, ...]] = {
    "": (0, 4, 7),
    "m": (0, 3, 7),
    "6": (0, 4, 7, 9),
    "m6": (0, 3, 7, 9),
    "7": (0, 4, 7, 10),
    "9": (0, 4, 7, 10, 14),
    "maj7": (0, 4, 7, 11),
    "maj9": (0, 4, 7, 11, 14),
    "m7": (0, 3, 7, 10),
    "m9": (0, 3, 7, 10, 14),
    "m7b5": (0, 3, 6, 10),
    "dim7": (0, 3, 6, 9),
    "sus2": (0, 2, 7),
    "sus4": (0, 5, 7),
    "add9": (0, 4, 7, 14),
    "7sus4": (0, 5, 7, 10),
}
_SYMBOL = re.compile(r"([A-G])([b#]?)(.*)")
_LETTERS = dict(zip("CDEFGAB", (0, 2, 4, 5, 7, 9, 11), strict=True))


@dataclass(frozen=True)
class Chord:
    """A root (pitch class) and the intervals above it."""

    root: int
    intervals: tuple[int, ...]

    @property
    def pitch_classes(self) -> tuple[int, ...]:
        """Root first."""
        return tuple((self.root + interval) % 12 for interval in self.intervals)

    def tone(self, number: int) -> int:
        """Semitones above the root of the chord's 1, 3, 5 or 7 (sixth or octave if it has no seventh)."""
        return (*self.intervals, 12, 12)[(number - 1) // 2]


def chord(symbol: str, tonic: int = 0) -> Chord:
    """ "Am7", "Bbmaj7" ... as written in C, transposed to the key of `tonic` (a pitch class)."""
    match = _SYMBOL.fullmatch(symbol)
    if match is None or match[3] not in _QUALITIES:
        raise ParameterError(f"expected a chord symbol like Am7, got {symbol!r}")
    root = _LETTERS[match[1]] + {"": 0, "b": -1, "#": 1}[match[2]]
    return Chord((root + tonic) % 12, _QUALITIES[match[3]])


def progression(text: str, tonic: int) -> tuple[tuple[Chord, ...], ...]:
    """Chords of each bar from "Am7 Dm7/G7 Cmaj7 E7": bars separated by spaces, half bars by slashes."""
    return tuple(tuple(chord(symbol, tonic) for symbol in bar.split("/")) for bar in text.split())


def voice_chords(
    chords: list[Chord], *, low: int = 52, high: int = 76, voices: int = 4
) -> list[tuple[int, ...]]:
    """Voice leading: ascending MIDI notes of each chord, with the voicing nearest to the previous one.

    Every pitch class sounds once (if there are too many, the fifth is dropped); the first chord lies
    around the middle of `low` ... `high`.
    """
    out: list[tuple[int, ...]] = []
    before: tuple[int, ...] | None = None
    for current in chords:
        before = _nearest_voicing(current, before, low, high, voices)
        out.append(before)
    return out


@lru_cache(maxsize=4096)
def _nearest_voicing(
    current: Chord, before: tuple[int, ...] | None, low: int, high: int, voices: int
) -> tuple[int, ...]:
    places = _note_options(current, low, high, voices)
    options = np.sort(np.array(list(product(*places))), axis=1)  # (M, V)
    cost = 0.3 * np.abs(options.mean(axis=1) - 0.5 * (low + high))
    cost += 8.0 * (np.diff(options, axis=1).min(axis=1) < 2)  # semitones within a chord clash
    cost += 2.0 * np.maximum(0, options[:, -1] - options[:, 0] - 17)  # wide chords sound thin
    if before is not None:
        steps = np.abs(options[:, :, None] - np.array(before))  # (M, V, V')
        cost += steps.min(axis=2).sum(axis=1) + steps.min(axis=1).sum(axis=1)
    return tuple(int(note) for note in options[np.argmin(cost)])


def _note_options(current: Chord, low: int, high: int, voices: int) -> list[list[int]]:
    classes = list(dict.fromkeys(current.pitch_classes))
    if len(classes) > voices:
        classes.pop(2)  # the fifth matters least
    return [[note for note in range(low, high + 1) if note % 12 == c] for c in classes[:voices]]


def scale_notes(scale: str, tonic: int, low: int, high: int) -> list[int]:
    """MIDI notes of a scale from `low` to `high`."""
    return [note for note in range(low, high + 1) if (note - tonic) % 12 in SCALES[scale]]


def best_scale(chords: Sequence[Chord], names: Sequence[str]) -> tuple[str, int]:
    """The scale, by name and tonic, that fits the chords best.

    Its notes should sound in the chords (others clash) and it should contain the chords' notes; a tonic on
    the first chord's root gets a bonus.
    """
    sounding = {c for chord in chords for c in chord.pitch_classes}

    def score(name: str, tonic: int) -> float:
        notes = {(tonic + step) % 12 for step in SCALES[name]}
        common = len(notes & sounding)
        return common / len(notes) + 0.5 * common / len(sounding) + 0.2 * (tonic == chords[0].root)

    return max(product(names, range(12)), key=lambda option: score(*option))


def shared_tones(first: Sequence[Chord], second: Sequence[Chord]) -> float:
    """Share of pitch classes that two progressions have in common (Jaccard index), 0 … 1."""
    one, other = ({c for chord in row for c in chord.pitch_classes} for row in (first, second))
    return len(one & other) / len(one | other)
