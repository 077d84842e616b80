"""Words know on which count of the bar they begin."""

from types import SimpleNamespace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from choreograph.choreography.motif_sequences import possible_motifs
from choreograph.core.counts import NO_COUNTS, UNKNOWN, bar_positions, make_counts, numbers_in_bar


@given(st.integers(2, 6), st.integers(1, 40), st.floats(0.3, 1.2), st.data())
def test_times_on_counts_have_their_number(metre, n_bars, period_s, data):
    first = data.draw(st.integers(1, metre))
    counts = make_counts(
        np.arange(n_bars * metre + 1) * period_s,
        numbers_in_bar(n_bars * metre + 1, metre, first=first),
        metre,
    )
    shift_s = data.draw(st.floats(-0.1, 0.1)) * period_s
    found = bar_positions(counts.times_s + shift_s, counts)
    np.testing.assert_array_equal(found % 100, counts.numbers)
    assert (found // 100 == metre).all()


def test_times_between_counts_and_beyond_them_are_unknown():
    counts = make_counts(np.arange(8) * 0.5, numbers_in_bar(8, 4), 4)
    found = bar_positions(np.array([-0.5, 0.25, 1.6, 4.0, 9.0]), counts)
    assert (found == UNKNOWN).all()
    assert (bar_positions(np.array([0.0, 1.0]), NO_COUNTS) == UNKNOWN).all()
    without_bars = make_counts(np.arange(4) * 0.5, np.zeros(4), 0)
    assert (bar_positions(np.array([0.0, 1.0]), without_bars) == UNKNOWN).all()


def test_a_bar_of_three_within_bars_of_four_is_no_bar_of_four():
    numbers = np.array([3, 4, 1, 2, 3, 4, 1, 2, 3, 1, 2, 3, 4, 1, 2])
    counts = make_counts(np.arange(15) * 0.5, numbers, 4)
    found = bar_positions(counts.times_s, counts)
    assert (found // 100).tolist() == [4, 4, 4, 4, 4, 4, 3, 3, 3, 4, 4, 4, 4, 4, 4]
    np.testing.assert_array_equal(found % 100, numbers)


@given(
    st.lists(st.tuples(st.integers(0, 4), st.integers(0, 3), st.integers(0, 1)), min_size=1, max_size=20),
    st.integers(0, 4),
)
def test_a_motif_is_possible_where_a_word_of_the_takes_begins(words, wanted):
    position, motif, take = (np.array(column) for column in zip(*words, strict=True))
    vocabulary = SimpleNamespace(word_motif=motif, n_motifs=4)
    vocabulary.word_take = take
    possible = possible_motifs(np.array([wanted]), position, np.array([[True, False]]), vocabulary)[0]
    known = wanted != UNKNOWN and (position != UNKNOWN).any()
    of_take = motif[take == 0]
    fitting = motif[(take == 0) & (position == wanted)] if known else of_take
    fitting = fitting if len(fitting) else of_take  # on no count: all motifs of the takes
    assert set(np.flatnonzero(possible)) == set(fitting)
