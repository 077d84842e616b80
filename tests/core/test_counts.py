"""Parts of counts."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from choreograph.core.counts import Counts


@given(start_s=st.floats(0, 30), length_s=st.floats(0, 30), is_read=st.booleans())
def test_a_part_has_its_counts_and_their_doubt(start_s, length_s, is_read):
    times_s = np.arange(0.0, 40.0, 0.5)
    uncertainty = np.linspace(0, 1, len(times_s)) if is_read else np.zeros(0)
    counts = Counts(times_s, np.arange(len(times_s)) % 3 + 1, 3, "motion", 0.7, uncertainty)
    part = counts.within(start_s, start_s + length_s)
    index = np.round((part.times_s + start_s) / 0.5).astype(int)
    assert np.array_equal(part.numbers, counts.numbers[index])
    assert np.array_equal(part.uncertainty, uncertainty[index] if is_read else uncertainty)
    assert (part.metre, part.source, part.confidence) == (3, "motion", 0.7)
