"""Composition of a song: its form, and the notes of all its tracks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from content.songs.synthesis.style import (
    Chord,
    Lane,
    Motif,
    Part,
    SongStyle,
    best_scale,
    progression,
    realise_motif,
    scale_notes,
    shared_tones,
    voice_chords,
)

# A song's form: the order, length and energy of its sections.


_ENERGY = {"intro": 0.35, "verse": 0.6, "chorus": 1.0, "break": 0.3, "outro": 0.5}
_FORMS: dict[int, tuple[str, ...]] = {  # by number of phrases
    1: ("chorus",),
    2: ("verse", "chorus"),
    3: ("intro", "verse", "chorus"),
    4: ("verse", "chorus", "break", "chorus"),
    5: ("intro", "verse", "chorus", "break", "chorus"),
    6: ("intro", "verse", "chorus", "break", "chorus", "outro"),
    7: ("intro", "verse", "verse", "chorus", "break", "chorus", "outro"),
    8: ("intro", "verse", "verse", "chorus", "break", "chorus", "chorus", "outro"),
}
_CYCLE = (
    "verse",
    "verse",
    "chorus",
    "chorus",
    "break",
    "chorus",
)  # repeated in longer songs, between intro and outro


@dataclass(frozen=True)
class Section:
    """Consecutive bars with one character."""

    name: str  # intro, verse, chorus, break, outro
    first_bar: int
    bars: int
    energy: float  # 0 (bare) ... 1 (everything plays)


def form(n_bars: int, phrase_bars: int) -> tuple[Section, ...]:
    """Sections that fill `n_bars`: whole phrases, except for one that takes the remainder.

    Extra bars go to the first verse. Missing bars are taken from the break or the intro. Consecutive
    phrases with the same name are one section. The first chorus has less energy than later ones.
    """
    names = _names(max(1, round(n_bars / phrase_bars)))
    lengths = [phrase_bars] * len(names)
    left = n_bars - sum(lengths)
    bends = ("verse", "chorus") if left > 0 else ("break", "intro", "verse", "chorus")
    lengths[names.index(next(name for name in bends if name in names))] += left
    sections: list[Section] = []
    bar = 0
    for name, length in zip(names, lengths, strict=True):
        if sections and sections[-1].name == name:
            last = sections.pop()
            sections.append(Section(name, last.first_bar, last.bars + length, last.energy))
        else:
            choruses = sum(section.name == "chorus" for section in sections)
            energy = _ENERGY[name] - (0.1 if name == "chorus" and choruses == 0 else 0.0)
            sections.append(Section(name, bar, length, round(energy, 2)))
        bar += length
    return tuple(sections)


def _names(phrases: int) -> tuple[str, ...]:
    if phrases in _FORMS:
        return _FORMS[phrases]
    return ("intro", *(_CYCLE[i % len(_CYCLE)] for i in range(phrases - 2)), "outro")


# Composition of the notes of all tracks from a style, a form and a seed.


_VELOCITIES = {"X": 1.0, "x": 0.8, "o": 0.45}
_END_BARS = 1.0  # length of the last chord


@dataclass(frozen=True)
class Note:
    """A note or drum hit. Steps are quarters of a beat from the song's start, before swing."""

    step: int
    steps: int  # 0 for drums
    midi: int  # 0 for drums
    velocity: float  # 0 … 1


@dataclass(frozen=True)
class Track:
    """All notes of one drum or instrument."""

    sound: str  # of `sounds.DRUMS` or `voices.VOICES`
    source: Lane | Part
    notes: tuple[Note, ...]


@dataclass(frozen=True)
class Harmony:
    """Chords of a song by bar, and the scales of its melodies."""

    bars: tuple[tuple[Chord, ...], ...]  # one more than the song has: the last chord
    scales: dict[str, list[int]]  # MIDI notes, of the chorus and of the verse (all other sections)
    steps_per_bar: int

    def at(self, step: int) -> Chord:
        """The chord at a step. The last one is sustained."""
        bar, inside = divmod(step, self.steps_per_bar)
        chords = self.bars[min(bar, len(self.bars) - 1)]
        return chords[inside * len(chords) // self.steps_per_bar]

    def after(self, step: int) -> Chord:
        """The next chord, at the next half bar or bar line."""
        half = self.steps_per_bar // len(self.bars[min(step // self.steps_per_bar, len(self.bars) - 1)])
        return self.at((step // half + 1) * half)


def compose(style: SongStyle, sections: Sequence[Section], rng: np.random.Generator) -> list[Track]:
    """All tracks of a song, including the closing chord on the downbeat after the last bar."""
    tonic = int(rng.integers(12))
    harmony = _harmony(style, sections, tonic, rng)
    tracks = [_drum_track(style, lane, sections, rng) for lane in style.lanes]
    tracks += _fills(style, sections, rng)
    for part in style.parts:
        voice = str(rng.choice(part.voices))
        if part.role == "bass":
            notes = _bass(style, part, sections, harmony, rng)
        elif part.role == "chords":
            notes = _chords(style, part, sections, harmony, rng)
        else:
            notes = _melody(style, part, sections, harmony, rng)
        tracks.append(Track(voice, part, tuple(notes)))
    return [track for track in tracks if track.notes]


def _harmony(style: SongStyle, sections: Sequence[Section], tonic: int, rng: np.random.Generator) -> Harmony:
    progressions = [progression(text, tonic) for text in style.progressions]
    flat = [[chord for bar in bars for chord in bar] for bars in progressions]
    verse = int(rng.integers(len(flat)))
    others = sorted(set(range(len(flat))) - {verse}, key=lambda i: -shared_tones(flat[verse], flat[i]))
    chosen = {
        "verse": verse,
        "chorus": int(rng.choice(others[:2] or [verse])),
    }  # one that shares tones with the verse
    bars: list[tuple[Chord, ...]] = []
    for section in sections:
        chords = progressions[chosen[_material(section)]]
        bars += [chords[i % len(chords)] for i in range(section.bars)]
    last = flat[chosen[_material(sections[-1])]]
    home = next((chord for chord in last if chord.root == tonic), last[0])
    scales = {book: best_scale(flat[i], style.scales) for book, i in chosen.items()}
    notes = {book: scale_notes(name, root, 0, 127) for book, (name, root) in scales.items()}
    return Harmony((*bars, (home,)), notes, style.steps_per_bar)


def _material(section: Section) -> str:
    """The musical material of a section, that of the chorus or of the verse."""
    return "chorus" if section.name == "chorus" else "verse"


def _plays(source: Lane | Part, section: Section) -> bool:
    return source.enters <= section.energy < source.leaves


def _spans(pattern: str, section: Section, steps_per_bar: int) -> Iterator[tuple[int, int, str]]:
    """(step, steps, letter) of each note of a pattern repeated through a section."""
    length = section.bars * steps_per_bar
    text = (pattern * (length // len(pattern) + 1))[:length]
    first = section.first_bar * steps_per_bar
    i = 0
    while i < length:
        end = i + 1
        if text[i] not in ".-":
            while end < length and text[end] == "-":
                end += 1
            yield first + i, end - i, text[i]
        i = end


def _velocity(letter: str, section: Section, rng: np.random.Generator) -> float:
    """Velocity of a pattern letter: louder in sections with high energy, randomised."""
    plain = _VELOCITIES.get(letter, 0.8)
    return float(np.clip(plain * (0.8 + 0.2 * section.energy) * rng.uniform(0.9, 1.06), 0.1, 1.0))


def _drum_track(style: SongStyle, lane: Lane, sections: Sequence[Section], rng: np.random.Generator) -> Track:
    pattern = str(rng.choice(lane.patterns))
    notes = [
        Note(step, 0, 0, _velocity(letter, section, rng))
        for section in sections
        if _plays(lane, section)
        for step, _, letter in _spans(pattern, section, style.steps_per_bar)
    ]
    return Track(lane.drum, lane, tuple(notes))


def _fills(style: SongStyle, sections: Sequence[Section], rng: np.random.Generator) -> list[Track]:
    """A fill in the last bar of each section, a crash at the start of full ones, and the final hit."""
    drum, pattern = style.fills[int(rng.integers(len(style.fills)))]
    fill: list[Note] = []
    for section in sections[:-1]:
        last = Section(section.name, section.first_bar + section.bars - 1, 1, 1.0)
        spans = list(_spans(pattern, last, style.steps_per_bar))
        for i, (step, _, letter) in enumerate(spans):
            rise = 0.6 + 0.4 * (i + 1) / len(spans)
            fill.append(Note(step, 0, 0, rise * _velocity(letter, last, rng)))
    end = (sections[-1].first_bar + sections[-1].bars) * style.steps_per_bar
    heads = [s.first_bar * style.steps_per_bar for s in sections[1:] if s.energy >= 0.6]
    tracks = [Track(drum, Lane(drum, (pattern,), db=-9.0, pan=0.15), tuple(fill))]
    if style.crash is not None:
        notes = tuple(Note(step, 0, 0, 0.8) for step in heads)
        tracks.append(Track(style.crash, Lane(style.crash, (), db=-15.0, pan=-0.25, send=0.2), notes))
    tracks += [Track(d, Lane(d, (), db=-8.0, send=0.2), (Note(end, 0, 0, 0.9),)) for d in style.ending]
    return tracks


def _bass(
    style: SongStyle,
    part: Part,
    sections: Sequence[Section],
    harmony: Harmony,
    rng: np.random.Generator,
) -> list[Note]:
    pattern = str(rng.choice(part.patterns))
    notes: list[Note] = []
    for section in sections:
        if not _plays(part, section):
            continue
        for step, steps, letter in _spans(pattern, section, style.steps_per_bar):
            before = notes[-1].midi if notes else part.low + 5
            midi = _bass_note(letter, harmony.at(step), harmony.after(step), before, part.low, rng)
            notes.append(Note(step, steps, midi, _velocity("x", section, rng)))
    end = (sections[-1].first_bar + sections[-1].bars) * style.steps_per_bar
    last = _note_from(harmony.at(end).root, part.low)
    return [*notes, Note(end, round(_END_BARS * style.steps_per_bar), last, 0.8)]


def _note_from(pitch_class: int, low: int) -> int:
    """The lowest note of a pitch class from `low` up."""
    return low + (pitch_class - low) % 12


def _bass_note(
    letter: str, now: Chord, following: Chord, before: int, low: int, rng: np.random.Generator
) -> int:
    root, target = _note_from(now.root, low), _note_from(following.root, low)
    if letter == "n":
        return target
    if letter == "a":
        return target + (1 if rng.random() < 0.4 else -1)
    if letter == "8":
        return root + 12
    if letter == "w":  # a chord tone near the last note, but another one, towards the next root
        tones = [
            root + i + octave for i in now.intervals for octave in (0, 12) if root + i + octave < low + 19
        ]
        tones = [tone for tone in tones if 0 < abs(tone - before) <= 7] or [root]
        cost = [abs(tone - before) + 0.6 * abs(tone - target) + rng.uniform(0.0, 4.0) for tone in tones]
        return tones[int(np.argmin(cost))]
    return root + now.tone(int(letter))


def _chords(
    style: SongStyle,
    part: Part,
    sections: Sequence[Section],
    harmony: Harmony,
    rng: np.random.Generator,
) -> list[Note]:
    pattern = str(rng.choice(part.patterns))
    flat = [chord for bar in harmony.bars for chord in bar]
    voicings = dict(zip(_chord_steps(harmony), voice_chords(flat, low=part.low, high=part.high), strict=True))
    heads = np.array(sorted(voicings))
    notes: list[Note] = []
    for section in sections:
        if not _plays(part, section):
            continue
        for step, steps, letter in _spans(pattern, section, style.steps_per_bar):
            chord = voicings[heads[np.searchsorted(heads, step, side="right") - 1]]
            velocity = _velocity(letter, section, rng)
            for midi in _voices_of(letter, chord, part.doubled):
                notes.append(Note(step, steps, midi, velocity))
    end = (sections[-1].first_bar + sections[-1].bars) * style.steps_per_bar
    if _plays(part, sections[-1]) or part.enters <= 0.6 < part.leaves:
        notes += [Note(end, round(_END_BARS * style.steps_per_bar), midi, 0.7) for midi in voicings[end]]
    return notes


def _chord_steps(harmony: Harmony) -> list[int]:
    size = harmony.steps_per_bar
    return [
        bar * size + i * size // len(row) for bar, row in enumerate(harmony.bars) for i in range(len(row))
    ]


def _voices_of(letter: str, chord: tuple[int, ...], doubled: bool) -> tuple[int, ...]:
    if letter in _VELOCITIES:
        return chord
    number = int(letter)
    midi = chord[0] + 12 if number > len(chord) else chord[number - 1]
    return (midi, midi + 12) if doubled else (midi,)


def _melody(
    style: SongStyle,
    part: Part,
    sections: Sequence[Section],
    harmony: Harmony,
    rng: np.random.Generator,
) -> list[Note]:
    """Motifs in the order A A' B A'' in each section. Verse and chorus have different ones."""
    material = {
        name: (Motif.drawn(part.patterns, rng), Motif.drawn(part.patterns, rng)) for name in harmony.scales
    }
    notes: list[Note] = []
    for section in sections:
        if not _plays(part, section):
            continue
        first, second = material[_material(section)]
        scale = harmony.scales[_material(section)]
        bar = section.first_bar
        for slot in range(section.bars):
            motif = second if slot % 4 == 2 else first
            bars = min(len(motif.rhythm) // style.steps_per_bar, section.first_bar + section.bars - bar)
            if bars < 1:
                break
            span = Section(section.name, bar, bars, section.energy)
            rows = list(_spans(motif.rhythm, span, style.steps_per_bar))
            centre = part.low + (part.high - part.low) * (0.35 + 0.25 * section.energy)
            cadence = slot % 4 == 3 or bar + bars == section.first_bar + section.bars
            chords = [harmony.at(step) for step, _, _ in rows]
            pitches = realise_motif(motif, rows, chords, scale, centre, varied=slot % 4 == 1, cadence=cadence)
            for (step, steps, letter), midi in zip(rows, pitches, strict=True):
                notes.append(Note(step, steps, midi, _velocity(letter, section, rng)))
            bar += bars
    return notes
