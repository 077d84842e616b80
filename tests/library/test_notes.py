"""Notes of a build: one screen for any build, ranges of values, and what a file may hold."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from string import Formatter

import h5py
import numpy as np
import pytest
from command_line import assert_one_line, run
from hypothesis import given
from hypothesis import strategies as st
from synthetic_repertoire import put_texts, synthetic_contents, synthetic_takes

from choreograph.core.errors import ParameterError, RepertoireError
from choreograph.library.notes import KINDS, MAX_LINES, Note, note_arrays, notes_from, summary
from choreograph.library.repertoire import Repertoire
from choreograph.library.writing import write_repertoire

LAYOUT = json.loads(
    (Path(__file__).resolve().parents[2] / "data_schema" / "repertoire.json").read_text(encoding="utf-8")
)
NOTES = (
    Note("import", "take0", {"text": "marker RTHI is missing for 0.39 s, which was interpolated"}),
    Note("counts from motion", "take0", {"confidence": 0.61}),
    Note("counts from motion", "take1", {"confidence": 0.97}),
    Note("retargeted"),
)


def fields_of(kind: str) -> set[str]:
    return {name for _, name, _, _ in Formatter().parse(KINDS[kind].sentence) if name}


def test_a_build_of_seventy_takes_has_a_line_for_each_kind():
    """64 takes counted by their motion, 6 refused, and three notes of the reader on each take."""
    names = [f"take{i:02d}" for i in range(70)]
    confidences = np.linspace(0.61, 0.97, 64).tolist()
    counted = zip(names[:64], confidences, strict=True)
    notes = [Note("counts from motion", name, {"confidence": share}) for name, share in counted]
    notes += [Note("refused counts", n, {"confidence": 0.4, "uncertainty": 0.35}) for n in names[64:]]
    for i, name in enumerate(names):
        texts = f"the floor drifted by {i} cm, which was removed", f"marker M{i} is missing", "no toes"
        notes += [Note("import", name, {"text": text}) for text in texts]
    assert summary(notes, 70, "rep.h5") == (
        "all takes: the floor drifted by 0 to 69 cm, which was removed",
        "all takes: marker M0, M1, M2 and 67 more is missing",
        "all takes: no toes",
        "64 of 70 takes: counts are estimated from the motion, confidence 0.61 to 0.97 "
        "(take00, take01, take02 and 61 more)",
        "6 of 70 takes: there are no counts, since those estimated from the motion are too uncertain, "
        "confidence 0.40, uncertainty 0.35 (take64, take65, take66 and 3 more)",
        "`choreograph inspect rep.h5 --notes` prints all 280 notes",
    )


# No name of a take or a file has a NUL, at which NumPy's texts end.
WORDS = st.text(st.characters(exclude_categories=("Cs",), exclude_characters="\0"), max_size=400)


@given(st.lists(st.tuples(st.sampled_from(sorted(KINDS)), WORDS, WORDS), max_size=80))
def test_any_notes_fit_one_screen_and_are_stored(notes):
    made = [Note(kind, about, dict.fromkeys(fields_of(kind), value)) for kind, about, value in notes]
    lines = summary(made, 70, "rep.h5")
    assert len(lines) <= MAX_LINES and all(len(line) <= 300 for line in lines)
    assert bool(lines) == bool(made)
    stored = [note for note in made if KINDS[note.kind].is_stored]
    arrays = note_arrays(stored)
    assert not stored or [*notes_from(arrays.__getitem__)] == stored


def test_notes_on_the_whole_build_are_never_left_out():
    texts = [f"{'x' * n} is missing" for n in range(1, 60)]
    notes = [Note("import", "take0", {"text": text}) for text in texts] + [Note("no music networks")]
    lines = summary(notes, 1, "rep.h5")
    assert len(lines) == MAX_LINES and Note("no music networks").text in lines
    assert lines[-1] == "`choreograph inspect rep.h5 --notes` prints all 60 notes"


@pytest.mark.parametrize(
    ("kind", "values"),
    [
        ("tempo", {}), ("retargeted", {"text": "a"}), ("import", {}), ("jumps", {"jumps": 1}),
        ("short", {"clip_s": float("nan")}), ("short", {"clip_s": True}), ("short", {"clip_s": [8]}),
        ("short", {"clip_s": 10**400}),
    ],
)  # fmt: skip
def test_a_note_has_the_values_of_its_kind(kind, values):
    with pytest.raises(ParameterError):
        Note(kind, "take0", values)


def test_the_published_kinds_are_those_in_the_code():
    published = LAYOUT["notes"]["kinds"]
    assert list(published) == [name for name, kind in KINDS.items() if kind.is_stored]
    for name, kind in published.items():
        assert set(kind["values"]) == fields_of(name)
        assert kind["subject"] == (KINDS[name].subject or "build")


@pytest.fixture
def path(tmp_path):
    contents = synthetic_contents(synthetic_takes(duration_s=12.0))
    write_repertoire(tmp_path / "rep.h5", replace(contents, arrays={**contents.arrays, **note_arrays(NOTES)}))
    return tmp_path / "rep.h5"


def test_a_repertoire_has_the_notes_of_its_build_or_none(path, tmp_path):
    assert Repertoire.open(path).notes == NOTES
    write_repertoire(tmp_path / "b.h5", synthetic_contents(synthetic_takes(duration_s=12.0)))
    assert Repertoire.open(tmp_path / "b.h5").notes == ()


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("notes/kind", "tempo"), ("notes/values", "{"), ("notes/values", "[]"), ("notes/values", "{}"),
        ("notes/values", '{"text": NaN}'), ("notes/values", "[" * 50_000), ("notes/values", "9" * 5000),
    ],
)  # fmt: skip
def test_a_note_that_is_not_valid_is_refused_when_it_is_read(path, name, text):
    with h5py.File(path, "r+") as file:
        put_texts(file, name, [text, *(["{}"] * 9)][: len(NOTES)])
    repertoire = Repertoire.open(path)
    assert repertoire.takes
    with pytest.raises(RepertoireError, match="note 0"):
        _ = repertoire.notes
    assert_one_line(run("inspect", path, "--notes"), says="damaged")


def test_a_part_of_the_notes_is_refused(path):
    with h5py.File(path, "r+") as file:
        del file["notes/values"]
    with pytest.raises(RepertoireError, match="notes/values"):
        Repertoire.open(path)


def test_inspect_prints_the_notes_and_those_on_one_take(path):
    assert run("inspect", path, "--notes").output.splitlines() == [str(note) for note in NOTES]
    shown = run("inspect", path, "--notes", "--take", "take1").output
    assert shown == "take1: counts are estimated from the motion, confidence 0.97\n"
    (row,) = json.loads(run("inspect", path, "--notes", "--take", "take1", "--json").output)
    assert Note(row["kind"], row["subject"], row["values"]) == NOTES[2] and row["text"] == NOTES[2].text
    assert_one_line(run("inspect", path, "--notes", "--take", "take9"), says="take9")
    for options in (("--take", "a"), ("--notes", "--plots", "x"), ("--notes", "--counts", "a", "-o", "x")):
        assert_one_line(run("inspect", path, *options), says="--notes")


def test_without_notes_inspect_says_so(tmp_path):
    write_repertoire(tmp_path / "b.h5", synthetic_contents(synthetic_takes(duration_s=12.0)))
    assert run("inspect", tmp_path / "b.h5", "--notes").output == "no notes\n"
