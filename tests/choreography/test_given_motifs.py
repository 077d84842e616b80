"""A given sequence of motifs begins on the count on which its take dances it."""

from __future__ import annotations

import numpy as np
import pytest

import choreograph as cg
from choreograph.choreography.constraints import make_constraints
from choreograph.choreography.material import Material
from choreograph.choreography.mixer.engine import sequence_notes
from choreograph.choreography.slots import resolve
from choreograph.core.counts import NO_COUNTS, bar_positions, make_counts, numbers_in_bar

STARTER = cg.starter_repertoire()


def given(take: str, counts, n_motifs=None):
    """The constraints on a dance of 16 s with the motifs of a take."""
    motifs = cg.motifs_of(take, STARTER)[:n_motifs]
    return motifs, resolve(make_constraints(motifs=motifs), STARTER, Material((), counts), 16.0)


@pytest.mark.parametrize(
    ("take", "metre", "number"),
    [("house-03", 4, number) for number in (1, 2, 3, 4)] + [("waltz-04", 3, number) for number in (1, 2, 3)],
)
def test_it_begins_on_its_count_where_a_song_begins_within_a_bar(take, metre, number):
    counts = make_counts(0.3 + 0.5 * np.arange(31), numbers_in_bar(31, metre, first=number), metre)
    motifs, resolved = given(take, counts)
    slots = bar_positions(resolved.bounds_s[:-1], counts)
    words = STARTER.vocabulary.words_of_take(STARTER.take_index(take))
    of_take = STARTER.word_positions[words]
    first = resolved.first_given
    n_words = min(len(words), resolved.n_words - first)
    on_count = slots[first : first + n_words] == of_take[:n_words]
    assert on_count[slots[first : first + n_words] > 0].all()
    assert first <= metre
    assert [resolved.motifs[first + word] for word in range(n_words)] == list(motifs[:n_words])
    begins = [
        note for note in sequence_notes(resolved) if f"begin at {resolved.bounds_s[first]:.1f} s" in note
    ]
    assert bool(begins) == (first > 0)


@pytest.mark.parametrize(("metre", "wanted"), [(4, 3), (3, 2)])
def test_takes_begin_on_their_count(metre, wanted):
    """Count 3 is in slot 1, since the song begins before it."""
    counts = make_counts(0.3 + 0.5 * np.arange(31), numbers_in_bar(31, metre, first=3), metre)
    takes = [take.name for i, take in enumerate(STARTER.takes) if STARTER.counts(i).metre == metre]
    begins = np.array([given(take, counts)[1].first_given for take in takes])
    assert len(takes) > 30
    assert (begins % metre == wanted % metre).all()


@pytest.mark.parametrize(("metre", "wanted"), [(4, 3), (3, 2)])
def test_most_sequences_that_no_take_has_begin_on_the_count_of_their_words(metre, wanted):
    """Every motif but one is that of a take."""
    counts = make_counts(0.3 + 0.5 * np.arange(31), numbers_in_bar(31, metre, first=3), metre)
    begins = []
    for i, take in enumerate(STARTER.takes):
        if STARTER.counts(i).metre == metre:
            motifs = cg.motifs_of(take.name, STARTER)
            changed = (*motifs[:5], motifs[5] ^ 1, *motifs[6:])
            constraints = make_constraints(motifs=changed)
            begins.append(resolve(constraints, STARTER, Material((), counts), 16.0).first_given)
    assert np.mean(np.array(begins) % metre == wanted % metre) > 0.8


@pytest.mark.parametrize("n_motifs", [None, 3])
def test_without_bars_it_begins_with_the_dance(n_motifs):
    without_bars = make_counts(0.5 * np.arange(31), np.zeros(31), 0)
    for counts in (NO_COUNTS, without_bars):
        motifs, resolved = given("house-03", counts, n_motifs)
        assert resolved.first_given == 0 and resolved.motifs[0] == motifs[0]
        assert not any("begin at" in note for note in sequence_notes(resolved))


def test_a_few_motifs_begin_with_the_dance():
    counts = make_counts(0.3 + 0.5 * np.arange(31), numbers_in_bar(31, 4, first=3), 4)
    assert given("house-03", counts)[1].first_given > 0
    assert given("house-03", counts, 7)[1].first_given == 0
