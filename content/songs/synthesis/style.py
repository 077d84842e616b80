"""The elements of the songs of a genre: drum lanes, parts, patterns, keys, chords and melodies."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np

from choreograph.core.errors import ParameterError

# The elements of a genre: drum lanes, pitched parts, progressions, and their step patterns.
#
# A pattern is a string with four steps per beat, one or more bars long: `.` is a rest, `-` sustains the
# previous note. Drums and chords: `X` accented, `x` plain, `o` soft. Chords also `1` to `5`, one voice of
# the voicing (5 is the lowest an octave up). Bass: `1 3 5 7 8` tones of the chord, `n` the next chord's
# root, `a` a semitone from it, `w` a step of a walking bass. Melody: `X x o` start notes. The pitch is
# composed.


STEPS_PER_BEAT = 4


@dataclass(frozen=True)
class Lane:
    """A drum, its patterns, and when it plays."""

    drum: str
    patterns: tuple[str, ...]  # one is drawn per song
    enters: float = 0.0  # plays in sections whose energy is at least this
    leaves: float = 2.0  # and below this
    db: float = -10.0
    pan: float = 0.0  # -1 left ... 1 right
    send: float = 0.08  # to the reverb


@dataclass(frozen=True)
class Part:
    """A pitched instrument, its patterns, and when it plays."""

    role: str  # bass, chords, melody
    voices: tuple[str, ...]  # one is drawn per song
    patterns: tuple[str, ...]  # one is drawn per song. A melody draws two
    enters: float = 0.0  # plays in sections whose energy is at least this
    leaves: float = 2.0  # and below this
    db: float = -14.0  # level in the mix
    pan: float = 0.0  # -1 left to 1 right
    send: float = 0.2  # to the reverb
    width: float = 0.0  # stereo width, 0 ... 1
    low: int = 52  # lowest MIDI note
    high: int = 76  # highest MIDI note
    doubled: bool = False  # chord voices doubled an octave up, as in a montuno


@dataclass(frozen=True)
class SongStyle:
    """A genre of the song synthesiser."""

    name: str  # of the genre
    bpm: tuple[float, float]  # usual range
    lanes: tuple[Lane, ...]  # drums
    parts: tuple[Part, ...]  # pitched instruments
    progressions: tuple[str, ...]  # one bar per word, in C. Verse and chorus take one each
    scales: tuple[str, ...]  # for melodies. The best match to the chords is used
    fills: tuple[tuple[str, str], ...]  # (drum, one bar) of which one is drawn per song
    ending: tuple[str, ...] = ("kick", "crash")  # drums on the last downbeat
    crash: str | None = "crash"  # at the start of sections with high energy
    beats_per_bar: int = 4  # metre
    swing: float = 0.0  # usual swing
    swing_unit_beats: float = 0.5  # length of the swung unit
    duck: float = 0.0  # depth of the ducking of pitched parts by the kick
    room_s: float = 1.2  # reverb time

    @property
    def steps_per_bar(self) -> int:
        """Sequencer steps in a bar."""
        return STEPS_PER_BEAT * self.beats_per_bar


# Keys, chord symbols and voice leading.


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

    Every pitch class sounds once (if there are too many, the fifth is dropped). The first chord lies
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

    Its notes should sound in the chords (others clash) and it should contain the chords' notes. A tonic on
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


# Melodic motifs: a rhythm with a contour, fitted to the scale and the chords.


_STEPS = (-3, -2, -1, -1, -1, 0, 1, 1, 1, 2, 3)  # scale steps between neighbours: mostly small
_STRONG = 8  # a note on every eighth step, or as long as a beat, is a chord tone


@dataclass(frozen=True)
class Motif:
    """A rhythm pattern, and the offset of each note from its centre, in scale steps."""

    rhythm: str
    contour: tuple[int, ...]
    tail: tuple[int, ...]  # replaces the last notes in a variation

    @classmethod
    def drawn(cls, rhythms: Sequence[str], rng: np.random.Generator) -> Motif:
        """A random motif on one of the rhythms. Its contour is a random walk that stays near its centre."""
        rhythm = str(rng.choice(list(rhythms)))
        count = sum(letter not in ".-" for letter in rhythm)
        contour = [int(rng.integers(-2, 3))]
        for _ in range(count - 1):
            step = int(rng.choice(_STEPS))
            if abs(contour[-1] + step) > 4:
                step = -step
            contour.append(contour[-1] + step)
        tail = tuple(int(step) for step in rng.integers(-3, 4, size=max(1, count // 3)))
        return cls(rhythm, tuple(contour), tail)


def realise_motif(
    motif: Motif,
    rows: Sequence[tuple[int, int, str]],
    chords: Sequence[Chord],
    scale: Sequence[int],
    centre: float,
    *,
    varied: bool,
    cadence: bool,
) -> list[int]:
    """MIDI notes of a motif's rows (step, steps, letter) over their chords.

    A varied motif keeps its head and gets another ending. A cadence ends on the chord's root or third. A
    motif truncated by its section keeps the notes that fit.
    """
    contour = list(motif.contour[: len(rows)])
    if varied:
        tail = motif.tail[: len(contour)]
        contour[len(contour) - len(tail) :] = tail
    middle = int(np.argmin(np.abs(np.asarray(scale) - centre)))
    pitches: list[int] = []
    for i, ((step, steps, _), chord, offset) in enumerate(zip(rows, chords, contour, strict=True)):
        note = scale[middle + offset]
        last = i == len(rows) - 1
        if cadence and last:
            note = _nearest(note, chord.pitch_classes[:2])
        elif step % _STRONG == 0 or steps >= 4 or (steps >= 2 and _clashes(note, chord)):
            note = _nearest(note, chord.pitch_classes)
        pitches.append(note)
    return pitches


def _clashes(note: int, chord: Chord) -> bool:
    """A semitone above a chord tone: acceptable only as a passing note."""
    return note % 12 not in chord.pitch_classes and (note - 1) % 12 in chord.pitch_classes


def _nearest(note: int, pitch_classes: Sequence[int]) -> int:
    """The nearest note with one of the pitch classes. The lower one in a tie."""
    return min(range(note - 6, note + 7), key=lambda n: (n % 12 not in pitch_classes, abs(n - note), n))
