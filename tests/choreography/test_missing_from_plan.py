"""What is said of a requested genre and of takes without counts that a dance leaves out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic_repertoire import (
    synthetic_contents,
    synthetic_takes,
    with_counts,
    with_vocabulary,
    write_clicks,
)

import choreograph as cg
from choreograph.core.counts import NO_COUNTS
from choreograph.library.writing import write_repertoire

ENGINE_NAMES = ("graph", "mixer")


@pytest.fixture(scope="module")
def takes():
    """Of genres a, b and c; that of a has no counts."""
    first, *others = with_counts(synthetic_takes(duration_s=15.0))
    return [replace(first, take=replace(first.take, counts=NO_COUNTS, figures=())), *others]


@pytest.fixture(scope="module")
def dance(tmp_path_factory):
    """Dances to clicks with takes: the notes beside those of every dance, and the seconds of each take."""
    folder = tmp_path_factory.mktemp("left_out")
    song = write_clicks(folder / "clicks.wav", duration_s=10.0)
    made_of = {}

    def dance(takes, metre=4, **options):
        key = tuple(id(take) for take in takes)
        if key not in made_of:
            path = folder / f"{len(made_of)}.h5"
            write_repertoire(path, with_vocabulary(synthetic_contents(takes), takes))
            made_of[key] = cg.Repertoire.open(path), takes  # which are kept, so that no other has their id
        beats = folder / "clicks.beats"
        beats.write_text("".join(f"{0.5 * beat:.2f} {beat % metre + 1}\n" for beat in range(20)))
        made = cg.dance(song, made_of[key][0], beats=beats, **options)
        said = ("not danced", "requested", "bars of takes")
        notes = [note for note in made.notes if any(part in note for part in said)]
        return notes, made.plan.takes_s()

    return dance


@pytest.mark.parametrize("engine", ENGINE_NAMES)
def test_takes_without_counts_are_left_out_beside_counted_ones(takes, dance, engine):
    notes, danced_s = dance(takes, engine=engine)
    assert "take0" not in danced_s
    assert notes == ["1 take without counts is not danced, because other takes have counts (a)"]


def test_where_they_are_danced_nothing_is_said(takes, dance):
    without = [replace(m, take=replace(m.take, counts=NO_COUNTS, figures=())) for m in takes]
    assert dance(without)[0] == []
    notes, danced_s = dance(takes, pins=[cg.TakePin(0.0, 10.0, "take0")])
    assert notes == [] and set(danced_s) == {"take0"}
    assert dance(takes, bans=[cg.Ban(take="take0")])[0] == []
    assert dance(takes, warping="dtw")[0] == []


@pytest.mark.parametrize("engine", ENGINE_NAMES)
def test_a_requested_genre_is_danced_even_if_its_takes_have_no_counts(takes, dance, engine):
    for genre, take in (("a", "take0"), ("b", "take1")):
        notes, danced_s = dance(takes, engine=engine, genre=genre)
        assert notes == [] and set(danced_s) == {take}


@pytest.mark.parametrize("engine", ENGINE_NAMES)
def test_a_requested_genre_of_another_metre_is_danced(takes, dance, engine):
    counts = takes[1].take.counts
    three = replace(counts, numbers=(counts.numbers * 0) + [(k % 3) + 1 for k in range(len(counts))], metre=3)
    waltz = replace(takes[1], take=replace(takes[1].take, counts=three, figures=()))
    made_of = [takes[0], waltz, takes[2]]
    for metre, said in ((4, ["the bars of takes in 3 (b) are danced on bars in 4"]), (3, [])):
        notes, danced_s = dance(made_of, metre=metre, engine=engine, genre="b")
        assert notes == said and set(danced_s) == {"take1"}
    notes, danced_s = dance(made_of, engine=engine)
    assert not any("bars" in note for note in notes)


def test_a_requested_genre_that_is_banned_too_short_or_pinned_over_is_noted(takes, dance):
    said = "b was requested, but its takes are danced for {} of 10 s: "
    notes, _ = dance(takes, genre="b", bans=[cg.Ban(take="take1")])
    assert notes == [said.format(0) + "they are banned"]
    notes, _ = dance(takes, genre="b", pins=[cg.TakePin(4.0, 7.0, "take2")])
    assert len(notes) == 1 and notes[0].endswith(": others are pinned")
    measured = takes[1]
    brief = replace(measured.take, motion=measured.take.motion.sliced(0, 200), counts=NO_COUNTS, figures=())
    short = replace(
        measured, take=brief, body_pos_m=measured.body_pos_m[:133], motion_beats_s=np.arange(1, 6.0)
    )
    notes, _ = dance([takes[0], short, takes[2]], genre="b")
    assert notes == [said.format(0) + "they are shorter than 8 s"]
