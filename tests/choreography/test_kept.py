"""Stretches of an existing dance, held against the song."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic_motions import swaying

from choreograph.choreography.constraints import Keep, MotifPin, TakePin, make_constraints, parse_keep
from choreograph.choreography.slots import check_pins_in_gaps, kept_dance
from choreograph.core.errors import ParameterError

MOTION = swaying(360, fps=30.0)  # 12 s
DURATION_S = MOTION.duration_s


def kept(*spans, duration_s=DURATION_S):
    return kept_dance(MOTION, [Keep(*span) for span in spans], duration_s, name="old.npz")


def test_spans_are_in_order_and_reach_the_ends():
    found = kept((8.0, 11.95), (0.04, 3.0))
    assert [str(k) for k in found.spans] == ["0-3", f"8-{DURATION_S:g}"]
    assert found.frames == [(0, 90), (240, 360)]
    assert found.keeps(2.0, 4.0) and not found.keeps(3.0, 8.0)


def test_what_is_left_at_an_end_is_kept_if_it_is_too_short():
    found = kept((6.0, 11.5))
    assert [str(k) for k in found.spans] == ["6-12"] and found.frames == [(180, 360)]
    assert found.notes == ("the last 0.50 s of the existing dance are kept: too short to be planned again",)
    assert [str(k) for k in kept((1.0, 10.9)).spans] == ["1-10.9"] and not kept((1.0, 10.9)).notes
    with pytest.raises(ParameterError, match="all of it is kept"):
        kept((0.9, 11.5))


@pytest.mark.parametrize(
    ("spans", "said"),
    [
        ([], "got none"),
        ([(3.0, 3.0)], "a start before its end"),
        ([(5.0, 14.0)], "within the dance of 12 s"),
        ([(-1.0, 4.0)], "a start before its end"),
        ([(0.0, 5.0), (4.0, 8.0)], "do not overlap, got 0-5, 4-8"),
        ([(0.0, 5.0), (6.0, 8.0)], "gaps of 2 s or more"),
        ([(0.0, DURATION_S)], "all of it is kept"),
        ([(np.nan, 5.0)], "start_s of a Keep in seconds, got nan"),
    ],
)
def test_spans_that_cannot_be_kept(spans, said):
    with pytest.raises(ParameterError, match=said):
        kept(*spans)


def test_a_dance_of_another_length_is_refused():
    with pytest.raises(ParameterError, match="is it to another song"):
        kept((0.0, 5.0), duration_s=20.0)


def test_pins_lie_in_gaps():
    found = kept((0.0, 4.0), (8.0, 12.0))
    check_pins_in_gaps(make_constraints(pins=[MotifPin(5.0, 1), TakePin(4.5, 7.5, "a")]), found)
    check_pins_in_gaps(make_constraints(pins=[MotifPin(4.0, 1), TakePin(4.0, 8.0, "a")]), found)
    for pin in (MotifPin(2.0, 1), TakePin(3.0, 6.0, "a"), TakePin(3.99, 6.0, "a")):
        with pytest.raises(ParameterError, match="move it into a gap"):
            check_pins_in_gaps(make_constraints(pins=[pin]), found)


@pytest.mark.parametrize("text", ["", "4", "a-b", "4-5-6", "-1-4", "1..2-3"])
def test_text_that_is_no_stretch(text):
    with pytest.raises(ParameterError, match="expected --keep FROM-TO"):
        parse_keep(text)


def test_spans_as_text():
    assert parse_keep("1.5-20") == Keep(1.5, 20.0)
    assert parse_keep("0:10-1:02:03.5") == Keep(10.0, 3723.5)
    assert parse_keep(str(Keep(0.25, 3.0))) == Keep(0.25, 3.0)
