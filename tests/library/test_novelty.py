"""How far new takes are from those before: planted takes that are the same, and ones that are far."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_repertoire import synthetic_contents, synthetic_repertoire, synthetic_takes, with_vocabulary

import choreograph as cg
from choreograph.library.building.kept_motifs import WordTable
from choreograph.library.building.novelty import novelty_notes
from choreograph.library.schema import NetArrays
from choreograph.library.writing import write_repertoire


@pytest.fixture(scope="module")
def with_motifs(tmp_path_factory):
    return synthetic_repertoire(tmp_path_factory.mktemp("novelty") / "rep.h5", vocabulary=True)


def of_words(repertoire, *, scale=1.0, genres=("a",)):
    """The notes on a take with the words of the first one, or on larger ones."""
    v = repertoire.vocabulary
    own = v.words_of_take(0)
    words = WordTable(v.word_take[own], v.word_start_s[own], v.word_end_s[own], ["new"], list(genres))
    return novelty_notes(repertoire, genres, np.zeros((0, 32)), words, [scale * repertoire.body_pos_m(0)])


def test_words_of_a_take_that_is_there_are_as_near_as_those_before(with_motifs):
    [note] = of_words(with_motifs)
    assert note.kind == "farther words" and note.values["share"] < 0.2
    assert note.values["new"] < 2 * note.values["known"]


def test_words_of_a_giant_are_far(with_motifs):
    [note] = of_words(with_motifs, scale=3.0)
    assert note.values["share"] == 1.0 and note.values["new"] > 5 * note.values["known"]
    assert "100% are farther from every motif than 95%" in str(note)


def test_genres_are_new_if_no_take_has_them(with_motifs):
    _, note = of_words(with_motifs, genres=("a", "polka", "", "jig"))
    assert "without jig, polka" in str(note) and "rep.h5" in str(note)


def test_only_takes_that_the_networks_were_trained_on_are_known(tmp_path):
    takes = synthetic_takes()
    contents = with_vocabulary(synthetic_contents(takes), takes)
    write_repertoire(
        tmp_path / "rep.h5", replace(contents, provenance={**contents.provenance, "trained_on": ["song1"]})
    )
    _, note = of_words(cg.Repertoire.open(tmp_path / "rep.h5"), genres=("a", "b"))
    assert "without a:" in str(note)  # the genre of another take, which was added later


def test_without_motifs_clips_are_compared_by_their_style(tmp_path):
    contents = synthetic_contents(synthetic_takes(duration_s=14.0))
    nets = {"style": NetArrays({}, {"w": np.zeros(3, np.float32)})}
    write_repertoire(tmp_path / "rep.h5", replace(contents, nets=nets))
    repertoire = cg.Repertoire.open(tmp_path / "rep.h5")
    style = repertoire.clip_style

    def share(new):
        [note] = novelty_notes(repertoire, ["a"], new, WordTable.none(), [])
        assert note.kind == "farther clips"
        return note.values["share"]

    assert share(style) == 0.0 and share(style + 100.0) == 1.0
    assert novelty_notes(repertoire, ["a"], style[:0], WordTable.none(), []) == []
