"""What a genre is made of: drum lanes, pitched parts, progressions, and their step patterns.

A pattern is a string with four steps per beat, one or more bars long: `.` is a rest, `-` sustains the
previous note. Drums and chords: `X` accented, `x` plain, `o` soft; chords also `1` ... `5`, one voice of
the voicing (5 is the lowest an octave up). Bass: `1 3 5 7 8` tones of the chord, `n` the next chord's
root, `a` a semitone from it, `w` a step of a walking bass. Melody: `X x o` start notes; the pitch is
composed.
"""

from __future__ import annotations

from dataclasses import dataclass

STEPS_PER_BEAT = 4


@dataclass(frozen=True)
class Lane:
    """A drum, its patterns, and when it plays."""

    drum: str
    patterns: tuple[str, ...]  # one is drawn per song
    enters: float = 0.0  # plays in sections whose energy is at least this
    leaves: float = 2.0  # ... and below this
    db: float = -10.0
    pan: float = 0.0  # -1 left ... 1 right
    send: float = 0.08  # to the reverb


@dataclass(frozen=True)
class Part:
    """A pitched instrument, its patterns, and when it plays."""

    role: str  # bass, chords, melody
    voices: tuple[str, ...]  # one is drawn per song
    patterns: tuple[str, ...]  # one is drawn per song; a melody draws two
    enters: float = 0.0
    leaves: float = 2.0
    db: float = -14.0
    pan: float = 0.0
    send: float = 0.2
    width: float = 0.0  # stereo width, 0 ... 1
    low: int = 52  # lowest MIDI note
    high: int = 76
    doubled: bool = False  # chord voices doubled an octave up, as in a montuno


@dataclass(frozen=True)
class SongStyle:
    """A genre of the song synthesiser."""

    name: str
    bpm: tuple[float, float]  # usual range
    lanes: tuple[Lane, ...]
    parts: tuple[Part, ...]
    progressions: tuple[str, ...]  # one bar per word, in C; verse and chorus take one each
    scales: tuple[str, ...]  # for melodies; the best match to the chords is used
    fills: tuple[tuple[str, str], ...]  # (drum, one bar) of which one is drawn per song
    ending: tuple[str, ...] = ("kick", "crash")  # drums on the last downbeat
    crash: str | None = "crash"  # at the start of sections with high energy
    beats_per_bar: int = 4
    swing: float = 0.0  # usual swing
    swing_unit_beats: float = 0.5
    duck: float = 0.0  # depth of the ducking of pitched parts by the kick
    room_s: float = 1.2  # reverb time

    @property
    def steps_per_bar(self) -> int:
        return STEPS_PER_BEAT * self.beats_per_bar
