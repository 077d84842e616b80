"""Notes on what was unusual in a build: kinds, sentences, and a summary that fits one screen.

A note is data. Its kind is a key of `KINDS`, which has all sentences. A repertoire stores the notes of its
build, and a build prints their `summary`.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from string import Formatter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import ParameterError, RepertoireError
from choreograph.core.progress import counted

Value = float | str

MAX_LINES = 25  # of a summary
_NAMED = 3  # subjects and texts in a line of the summary. The others are counted
_NAME_CHARACTERS = 40
_LINE_CHARACTERS = 280
_LARGEST = 1e12  # number in a note
_PUNCTUATION = ".,;:()%"


@dataclass(frozen=True)
class NoteKind:
    """The sentence of a kind of notes, which is valid for one subject and for several."""

    sentence: str  # with the values as format fields. `text` is a sentence of another part of the program
    subject: str = "take"  # what its notes are about: a take, a file or a song, or "" for the whole build
    is_stored: bool = True  # False if it is about the run: a resumed build makes the same file


# In the order in which a summary has them.
KINDS: dict[str, NoteKind] = {
    "unreadable file": NoteKind("the file cannot be read and is left out: {text}", "file"),
    "skipped file": NoteKind("the file is skipped: {text}", "file"),
    "unknown take": NoteKind("there is no take of this name to leave out", "name"),
    "import": NoteKind("{text}"),
    "jumps": NoteKind("one-frame jumps of markers were smoothed ({jumps:.0f} in {limbs})"),
    "short": NoteKind("the motion is shorter than a clip of {clip_s:g} s and gives none"),
    "kept takes": NoteKind(
        "{kept:.0f} of {takes:.0f} takes are as in an earlier build, whose measurements were read", "",
        is_stored=False,
    ),
    "retargeted": NoteKind(
        "the takes have different skeletons, so all are retargeted to the canonical body", ""
    ),
    "moved onto": NoteKind("the skeleton is another one, so it is retargeted to that of the repertoire"),
    "counts from song": NoteKind(
        "counts are the beats of the song, which the motion follows, confidence {confidence:.2f}"
    ),
    "counts from motion": NoteKind("counts are estimated from the motion, confidence {confidence:.2f}"),
    "uncertain counts": NoteKind(
        "counts are estimated from the motion and are uncertain, confidence {confidence:.2f}"
    ),
    "refused counts": NoteKind(
        "there are no counts, since those estimated from the motion are too uncertain, confidence "
        "{confidence:.2f}, uncertainty {uncertainty:.2f}"
    ),
    "no counts": NoteKind("there are no counts"),
    "uncounted left out": NoteKind("takes without counts are not danced beside takes with counts", ""),
    "uncounted danced": NoteKind("no take has counts, so motion beats are danced on the beats", ""),
    "counting networks": NoteKind("counts are estimated from motion by {networks}", ""),
    "song": NoteKind("{text}", "song"),
    "longer than song": NoteKind("the motion continues without music for {over_s:.2f} s after its song"),
    "counts beside beats": NoteKind(
        "counts are not on the beats of the song, audio_offset_s would have to change by {offset_s:+.2f} s"
    ),
    "no music beats": NoteKind("no beats were found in the music, so motion words follow motion beats"),
    "style begins": NoteKind("training of style begins with {networks}", ""),
    "style kept": NoteKind("style is that of {networks}", ""),
    "training": NoteKind("{text}", "", is_stored=False),
    "networks unchanged": NoteKind(
        "there are fewer than two songs to train on, so the given networks are used unchanged", ""
    ),
    "no music networks": NoteKind(
        "there are fewer than two songs to train on, so there are no music networks and clips are not chosen "
        "by style", "",
    ),
    "no density networks": NoteKind(
        "there are no tempo-density networks, so clips have the analytic tempo-density", ""
    ),
    "farther words": NoteKind(
        "of the motion words of the new takes, {share:.0%} are farther from every motif than 95% of those "
        "that the networks were trained on, medians {new:.3f} m and {known:.3f} m", "", is_stored=False,
    ),
    "farther clips": NoteKind(
        "of the clips of the new takes, {share:.0%} are farther in style from other takes than 95% of those "
        "that the networks were trained on, medians {new:.3f} and {known:.3f}", "", is_stored=False,
    ),
    "new genres": NoteKind(
        "the networks were trained without {genres}: to train them again, build from all takes with "
        "--init-from {name}", "", is_stored=False,
    ),
    "lost motifs": NoteKind(
        "{motifs:.0f} motifs are not danced any more and were left out, so later motifs have lower numbers",
        "", is_stored=False,
    ),
    "few words": NoteKind(
        "there are {words:.0f} motion words, fewer than {fewest:.0f}, so there are no motifs and no genre "
        "can be followed", "",
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Note:
    """One thing that was unusual in a build.

    Raises
    ------
    ParameterError   if the kind is unknown or has other values
    """

    kind: str
    """A key of `choreograph.library.notes.KINDS`."""

    subject: str = ""
    """Name of the take, song or file that the note is about, or "" for the whole build."""

    values: Mapping[str, Value] = field(default_factory=dict)
    """Numbers and texts of its sentence, by name."""

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ParameterError(f"expected a kind of notes, got {self.kind[:40]!r}")
        expected = {name for _, name, _, _ in Formatter().parse(KINDS[self.kind].sentence) if name}
        is_valid = all(
            isinstance(value, str)
            or (isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= _LARGEST)
            for value in self.values.values()
        )
        if set(self.values) != expected or not is_valid:
            raise ParameterError(
                f"expected {', '.join(sorted(expected)) or 'no values'} of a note of kind {self.kind!r}, "
                f"got {str(dict(self.values))[:80]}"
            )

    @property
    def text(self) -> str:
        """The note's sentence without its subject."""
        return _sentence([self])

    def __str__(self) -> str:
        return f"{self.subject}: {self.text}" if self.subject else self.text


def summary(
    notes: Iterable[Note], n_takes: int, name: str, *, n_stored: int | None = None
) -> tuple[str, ...]:
    """At most `MAX_LINES` lines: one for each kind of notes, with counts and ranges of their values.

    `n_takes` are those of the repertoire, and `name` is that of its file, which stores `n_stored` notes, by
    default those that are given. Notes that quote another part of the program share a line if only numbers
    and names differ.
    """
    notes = tuple(notes)
    groups: dict[tuple[str, str], list[Note]] = {}
    for note in notes:
        groups.setdefault((note.kind, _template(str(note.values.get("text", "")))[0]), []).append(note)
    # Notes on the whole build first, then those on most takes.
    largest = sorted(groups.values(), key=lambda group: (group[0].subject != "", -len(group)))
    kinds = list(KINDS)
    shown = sorted(largest[: MAX_LINES - 1], key=lambda group: (kinds.index(group[0].kind), -len(group)))
    lines = [_line(group, n_takes) for group in shown]
    if len(lines) < len(notes):
        if n_stored is None:
            n_stored = sum(KINDS[note.kind].is_stored for note in notes)
        lines.append(f"`choreograph inspect {name} --notes` prints all {counted(n_stored, 'note')}")
    return tuple(lines)


def _line(notes: Sequence[Note], n_takes: int) -> str:
    """The line of notes of one kind."""
    subjects = list(dict.fromkeys(note.subject for note in notes))
    kind = KINDS[notes[0].kind].subject
    names = ""
    if len(subjects) == 1:
        start = f"{_cut(subjects[0], _NAME_CHARACTERS)}: " if subjects[0] else ""
    elif kind == "take" and len(subjects) == n_takes:
        start = "all takes: "
    else:
        of_takes = f" of {counted(n_takes, kind)}" if kind == "take" else ""
        start = f"{len(subjects)}{of_takes}: " if of_takes else f"{counted(len(subjects), kind)}: "
        names = f" ({_listed(subjects)})"
    sentence = _sentence(notes)
    return f"{start}{_cut(sentence, _LINE_CHARACTERS - len(start) - len(names))}{names}"


def _sentence(notes: Sequence[Note]) -> str:
    """The sentence of notes of one kind, with the ranges of their values."""
    values: dict[str, Any] = {
        name: _Spread([note.values[name] for note in notes]) for name in notes[0].values
    }
    if "text" in values:
        texts = [_template(str(note.values["text"])) for note in notes]
        parts = zip(*(found for _, found in texts), strict=True)
        values["text"] = texts[0][0].format(*map(_Spread, parts))
    return KINDS[notes[0].kind].sentence.format(**values)


class _Spread:
    """Values of several notes, formatted as a range of numbers or a list of texts."""

    def __init__(self, values: Sequence[Value]) -> None:
        self._values = list(values)

    def __format__(self, spec: str) -> str:
        try:
            ends = [min(self._values, key=float), max(self._values, key=float)]
        except ValueError:
            texts = dict.fromkeys(self._values)
            if len(texts) > 1:  # lists of names have some in common
                texts = dict.fromkeys(text for value in texts for text in str(value).split(", "))
            return _listed([str(text) for text in texts])
        return " to ".join(dict.fromkeys(format(float(end), spec) if spec else str(end) for end in ends))


def _template(text: str) -> tuple[str, tuple[str, ...]]:
    """A text with a format field for each run of numbers and names in it, and these runs.

    A name is a word with a capital letter or a digit.
    """
    parts: list[str] = []
    values: list[str] = []
    for is_value, words in groupby(text.split(" "), _is_value):
        run = " ".join(words)
        if is_value:
            values.append(run.strip(_PUNCTUATION))
            before, after = run.split(values[-1], 1)
            parts.append(f"{_escaped(before)}{{}}{_escaped(after)}")
        else:
            parts.append(_escaped(run))
    return " ".join(parts), tuple(values)


def _is_value(word: str) -> bool:
    return any(letter.isdigit() or letter.isupper() for letter in word)


def _escaped(text: str) -> str:
    return text.replace("{", "{{").replace("}", "}}")


def _listed(texts: Sequence[str]) -> str:
    if len(texts) == 1:
        return texts[0]
    more = f" and {len(texts) - _NAMED} more" if len(texts) > _NAMED else ""
    return ", ".join(_cut(text, _NAME_CHARACTERS) for text in texts[:_NAMED]) + more


def _cut(text: str, length: int) -> str:
    return text if len(text) <= length else f"{text[: length - 3]}..."


# Notes in a repertoire file.


def note_arrays(notes: Sequence[Note]) -> dict[str, NDArray[np.str_]]:
    """The arrays of notes in a file, by path, or none if there are no notes to store."""
    notes = [note for note in notes if KINDS[note.kind].is_stored]
    if not notes:
        return {}
    return {
        "notes/kind": np.array([note.kind for note in notes]),
        "notes/subject": np.array([note.subject for note in notes]),
        "notes/values": np.array([json.dumps(dict(note.values), sort_keys=True) for note in notes]),
    }


def notes_from(read: Callable[[str], NDArray[np.str_]]) -> tuple[Note, ...]:
    """The notes of a file. `read` returns an array by path. Raises `RepertoireError` if one is not valid."""
    columns = (read(f"notes/{column}") for column in ("kind", "subject", "values"))
    notes = []
    for index, (kind, subject, values) in enumerate(zip(*columns, strict=True)):
        try:
            parsed = json.loads(str(values))
            if not isinstance(parsed, dict):
                raise ParameterError("expected a JSON object as values")
            notes.append(Note(str(kind), str(subject), parsed))
        except (ParameterError, ValueError, RecursionError) as error:
            raise RepertoireError(f"note {index}: {error}") from error
    return tuple(notes)
