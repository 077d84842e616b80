"""Melodic motifs: a rhythm with a contour, fitted to the scale and the chords."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from choreograph.synthesis.songs.harmony import Chord

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
        """A random motif on one of the rhythms; its contour is a random walk that stays near its centre."""
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

    A varied motif keeps its head and gets another ending; a cadence ends on the chord's root or third. A
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
    """The nearest note with one of the pitch classes; the lower one in a tie."""
    return min(range(note - 6, note + 7), key=lambda n: (n % 12 not in pitch_classes, abs(n - note), n))
