"""Edits as text, and the counts from which and to which they change a dance."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from choreograph.choreography.edits import (
    MOST_COUNTS,
    Repeat,
    Swap,
    Vary,
    edit_slots,
    parse_repeat,
    parse_swap,
    parse_vary,
    parts_of,
)
from choreograph.core.errors import ParameterError

BOUNDS_S = np.array([0.0, *np.arange(0.3, 30.0, 0.5), 30.0])


@pytest.mark.parametrize("edit", [Swap(1.0, 2.5), Vary(61.5, 70.0), Repeat(1.0, 2.0, 8.0, mirrored=True)])
def test_edits_as_text_are_read_again(edit):
    parse = {Swap: parse_swap, Vary: parse_vary, Repeat: parse_repeat}[type(edit)]
    assert parse(str(edit).partition(" ")[2]) == edit


def test_clock_times_are_read():
    assert parse_swap("1:02-1:04.5") == Swap(62.0, 64.5)
    assert parse_repeat("0:02-4@1:00") == Repeat(2.0, 4.0, 60.0)


@pytest.mark.parametrize("text", ["", "1-2", "1-2@", "1@2", "1-2@3=up", "1-2@3-4", "a-b@c"])
def test_text_that_is_no_repetition(text):
    with pytest.raises(ParameterError, match="expected --repeat FROM-TO"):
        parse_repeat(text)


@pytest.mark.parametrize(("parse", "option"), [(parse_swap, "--swap"), (parse_vary, "--vary")])
def test_text_that_is_no_span(parse, option):
    with pytest.raises(ParameterError, match=f"expected {option} FROM-TO"):
        parse("4")


@pytest.mark.parametrize("count_s", [0.3, 0.42, 0.5, 0.9])
def test_edits_begin_and_end_within_a_count_and_change_two_more_at_most(count_s):
    rng = np.random.default_rng(0)
    bounds_s = np.arange(0.0, 40.0 + count_s, count_s)
    for _ in range(200):
        start_s = rng.uniform(0.0, 35.0)
        end_s = start_s + rng.uniform(0.05, 5.0)
        slots = edit_slots(start_s, end_s, bounds_s)
        assert slots.begin <= slots.first < slots.stop <= slots.end
        assert (
            abs(bounds_s[slots.first] - start_s) <= count_s and abs(bounds_s[slots.stop] - end_s) <= count_s
        )
        assert bounds_s[slots.begin] >= start_s - 2 * count_s - 1e-9 or slots.before == 1
        assert bounds_s[slots.begin] >= bounds_s[slots.first] - 2 * count_s - 1e-9
        assert bounds_s[slots.end] <= bounds_s[slots.stop] + 2 * count_s + 1e-9
        outer = edit_slots(start_s, end_s, bounds_s, outwards=True)
        assert bounds_s[outer.first] <= start_s + 1e-3 and bounds_s[outer.stop] >= end_s - 1e-3


def test_nothing_leads_from_or_to_an_edit_at_the_ends_of_the_dance():
    assert (edit_slots(0.0, 30.0, BOUNDS_S).begin, edit_slots(0.0, 30.0, BOUNDS_S).end) == (0, 61)
    slots = edit_slots(0.0, 0.1, BOUNDS_S)
    assert (slots.first, slots.stop, slots.before, slots.after) == (0, 1, 0, 1)
    assert edit_slots(29.99, 30.0, BOUNDS_S).stop == 61


@pytest.mark.parametrize("span_s", [(3.0, 3.0), (4.0, 3.0), (-1.0, 3.0), (28.0, 30.5)])
def test_spans_outside_of_the_dance_are_refused(span_s):
    with pytest.raises(ParameterError, match="expected an edit with a start before its end"):
        edit_slots(*span_s, BOUNDS_S)


def test_a_long_edit_has_parts_that_follow_one_another_on_downbeats():
    slots = edit_slots(2.3, 26.3, BOUNDS_S)
    downbeats_s = np.arange(0.3, 30.0, 2.0).tolist()
    parts = parts_of(slots, BOUNDS_S, downbeats_s)
    assert parts[0].first == slots.first and parts[-1].stop == slots.stop
    for before, after in pairwise(parts):
        assert before.stop == after.first and np.isclose(downbeats_s, BOUNDS_S[after.first]).any()
    assert all(part.stop - part.first <= MOST_COUNTS for part in parts) and len(parts) > 2
    assert parts_of(edit_slots(2.3, 4.3, BOUNDS_S), BOUNDS_S, downbeats_s) == [edit_slots(2.3, 4.3, BOUNDS_S)]
